"""A real HTTP endpoint that remembers what it received, and can be down for a while."""

import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

from ports import free_port


@dataclass(frozen=True)
class Received:
    path: str
    headers: dict[str, str]
    body: str

    @property
    def events(self) -> list[dict[str, Any]]:
        found = json.loads(self.body)
        return found if isinstance(found, list) else [found]


def accept(_: Received) -> tuple[int, dict[str, str]]:
    return 200, {}


class Receiver:
    """Receives on `url` until stopped; `answer` decides the status and the headers of each answer."""

    def __init__(self) -> None:
        self.received: list[Received] = []
        self.accepted: list[Received] = []
        self.answer: Callable[[Received], tuple[int, dict[str, str]]] = accept
        self._port = free_port()
        self.start()
        self.url = f"http://127.0.0.1:{self._port}/hook"

    def start(self) -> None:
        class Page(BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_POST(page) -> None:  # noqa: N805
                body = page.rfile.read(int(page.headers["Content-Length"])).decode()
                request = Received(page.path, {name.lower(): value for name, value in page.headers.items()}, body)
                self.received.append(request)
                status, headers = self.answer(request)
                if 200 <= status < 300:
                    self.accepted.append(request)
                page.send_response(status)
                for name, value in headers.items():
                    page.send_header(name, value)
                page.send_header("Content-Length", "0")
                page.send_header("Connection", "close")
                page.end_headers()

            def log_message(self, *_: object) -> None:
                """Tests print nothing."""

        class Server(ThreadingHTTPServer):
            def handle_error(self, *_: object) -> None:
                """The relay was killed: nobody reads the answer."""

        self._server = Server(("127.0.0.1", self._port), Page)
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))
        self._thread.start()

    def stop(self) -> None:
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()

    def events(self, name: str, kind: str = "fence") -> list[dict[str, Any]]:
        """The events of a fence or an alarm in the order in which they were accepted, repetitions too."""
        return [each for request in list(self.accepted) for each in request.events if each["data"].get(kind) == name]


@contextmanager
def receiver() -> Iterator[Receiver]:
    running = Receiver()
    try:
        yield running
    finally:
        running.stop()
