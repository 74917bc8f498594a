"""A TCP proxy whose connections can be cut."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress


class Proxy:
    """Forwards connections on `address` to a server, which may change; `cut` severs all of them at once.

    While `flowing` is not set, it takes data and passes none on. After `silence`, its connections do so for ever, and
    new ones work. The next connections are ended at once, `refusals` of them.

    Args:
        server: host and port, or the path of a Unix socket; "" to end new connections at once.
    """

    def __init__(self, server: str) -> None:
        self.server = server
        self.refusals = 0
        self.flowing = threading.Event()
        self.flowing.set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self._silent: list[threading.Event] = []
        self._open: set[socket.socket] = set()
        self._closed = False
        self._threads: list[threading.Thread] = []
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self._start(self._accept)

    def cut(self) -> None:
        for each in list(self._open):
            shut(each)

    def silence(self) -> None:
        silent, self.flowing = self.flowing, threading.Event()
        self.flowing.set()
        silent.clear()
        self._silent.append(silent)

    def close(self) -> None:
        self._closed = True
        shut(self._listener)
        self.cut()
        for each in (self.flowing, *self._silent):
            each.set()
        for thread in self._threads:
            thread.join()
        self._listener.close()

    def _start(self, target: Callable[..., None], *arguments: object) -> threading.Thread:
        thread = threading.Thread(target=target, args=arguments)
        self._threads.append(thread)
        thread.start()
        return thread

    def _accept(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self._listener.accept()
                if self.refusals:
                    self.refusals -= 1
                    client.close()
                    continue
                self._start(self._connect, client)

    def _connect(self, client: socket.socket) -> None:
        flowing = self.flowing
        with client, suppress(OSError), connected(self.server) as server:
            self._open |= {client, server}
            if self._closed:  # too late to be cut
                shut(client)
                shut(server)
            back = self._start(self._forward, server, client, flowing)
            self._forward(client, server, flowing)
            back.join()
            self._open -= {client, server}

    def _forward(self, source: socket.socket, sink: socket.socket, flowing: threading.Event) -> None:
        with suppress(OSError):
            while data := source.recv(65536):
                flowing.wait()
                sink.sendall(self.passed(data))
        flowing.wait()  # such a network does not say either that the other end has gone
        shut(source)
        shut(sink)

    def passed(self, data: bytes) -> bytes:
        """What arrives of it."""
        return data


def connected(server: str) -> socket.socket:
    if not server.startswith("/"):
        host, _, port = server.rpartition(":")
        return socket.create_connection((host, int(port or 0)))
    connection = socket.socket(socket.AF_UNIX)
    connection.connect(server)
    return connection


def shut(end: socket.socket) -> None:
    with suppress(OSError):
        end.shutdown(socket.SHUT_RDWR)


@contextmanager
def proxy(server: str) -> Iterator[Proxy]:
    running = Proxy(server)
    try:
        yield running
    finally:
        running.close()
