"""A server that is tortured: it keeps its folder, or its database, and its port over its lives."""

import subprocess
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from forked import COMMAND, Process
from ports import free_port
from promises import require


class Server:
    """`dynhull serve` on a folder, or on a database, with these options; it keeps its port over its lives."""

    def __init__(self, folder: Path, options: Sequence[str] = (), journal: str = "") -> None:
        self.data = folder / "data"
        self._options = [*options, *(["--journal", journal] if journal else ["--data", str(self.data)])]
        self._port = free_port()
        self._log = folder / "server.log"

    def start(self, wrap: Sequence[str] = ()) -> None:
        require(self.starts(wrap), f"the server did not start: {self.said()}")

    def starts(self, wrap: Sequence[str] = ()) -> bool:
        command = [*wrap, COMMAND, "serve", "--port", str(self._port)]
        command += ["--create-on-write", "--snapshot-points", "300", "--log-level", "warning", "--scrub-cpu", "0"]
        command += self._options
        with self._log.open("ab") as log:
            self.process = Process(command, stdout=subprocess.PIPE, stderr=log, text=True)
        line = self.process.stdout.readline()
        if "serving on" not in line:
            self.process.wait()
            return False
        return True

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self._port}"

    def said(self) -> str:
        return self._log.read_text()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


@contextmanager
def killed_at_the_end(server: Server) -> Iterator[None]:
    try:
        yield
    finally:
        server.kill()
