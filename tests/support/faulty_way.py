"""A way to a server that fails as networks and servers do."""

import os
import signal
import socket
import struct
from collections.abc import Callable

from proxy import Proxy
from server_process import Server

RESET = struct.pack("ii", 1, 0)  # a socket that lingers for no time sends a reset when it is closed


class FaultyWay(Proxy):
    """A proxy whose connections end, or stay and carry nothing, in one of the ways of WAYS."""

    def __init__(self, server: Server) -> None:
        super().__init__(server.address)
        self._process = server.process

    def reset(self) -> None:
        """Connections are reset, new ones too."""
        self.server = ""
        for each in list(self._open):
            each.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, RESET)
        self.cut()

    def stop(self) -> None:
        """The server stands still: connections are accepted, and nothing is answered."""
        os.kill(self._process.pid, signal.SIGSTOP)

    def darken(self) -> None:
        """The network takes all bytes and passes none on."""
        self.flowing.clear()

    def shut(self) -> None:
        """Nobody listens."""
        self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.cut()

    def close(self) -> None:
        os.kill(self._process.pid, signal.SIGCONT)
        super().close()


WAYS: dict[str, Callable[[FaultyWay], None]] = {
    "reset": FaultyWay.reset,
    "stopped": FaultyWay.stop,
    "dark": FaultyWay.darken,
    "shut": FaultyWay.shut,
}
