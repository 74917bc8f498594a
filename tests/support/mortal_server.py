"""A real server that is killed and started again on what is left."""

import subprocess
import threading
from pathlib import Path

import wall_clock
from forked import COMMAND, Process
from ports import free_port


class MortalServer:
    """`dynhull serve` with these options on a folder or the database that they name; it keeps its port over its lives.

    Attributes:
        lives: how often it has started.
        up: set while it runs.
    """

    def __init__(self, folder: Path, *options: str) -> None:
        self._data = folder / "data"
        self._options = options
        self._log = folder / "server.log"
        self._port = free_port()
        self.lives = 0
        self.up = threading.Event()
        self.start()

    def start(self, *, stepped_back: bool = False) -> None:
        wrap = wall_clock.at("-1h") if stepped_back else []
        command = [*wrap, COMMAND, "serve", "--port", str(self._port), "--log-level", "warning", *self._options]
        if "--journal" not in self._options:
            command += ["--data", str(self._data)]
        with self._log.open("ab") as log:
            self._process = Process(command, stdout=subprocess.PIPE, stderr=log, text=True)
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        assert "serving on" in line, f"the server did not start: {self._log.read_text()[-2000:]}"
        self.lives += 1
        self.up.set()

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self._port}"

    def kill(self) -> None:
        self.up.clear()
        with self._process:
            self._process.kill()
