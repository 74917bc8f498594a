"""A real server whose time a test moves: what would take an hour is there at once, and nothing comes by being slow.

As a program it runs the command that follows, whose time is that many seconds ahead as the file given first says.
"""

import mmap
import os
import runpy
import struct
import sys
import time
from pathlib import Path

from dynhull_server.engine import driver
from dynhull_server.engine.server_time import MICROSECONDS, ServerTime
from dynhull_server.engine.threads import Clock

SECONDS = struct.Struct("d")
FILE = "DYNHULL_TEST_SET_TIME"


class SetTime:
    """What the servers started with `wrap` take for the time: the wall clock's, and `ahead` seconds.

    Args:
        folder: where a file for it may be.

    Attributes:
        wrap: the words before a command.
        ahead: the seconds that were passed.
    """

    def __init__(self, folder: Path) -> None:
        self._file = folder / "ahead"
        self.ahead = 0.0
        self._file.write_bytes(SECONDS.pack(self.ahead))
        self.wrap = sys.executable, __file__, str(self._file)

    def passes(self, seconds: float) -> None:
        """That many seconds pass, at once."""
        self.ahead += seconds
        with self._file.open("r+b") as file:
            file.write(SECONDS.pack(self.ahead))

    def now(self) -> int:
        """The time of the servers, in microseconds since 1970, as well as the wall clock of this process knows it."""
        return int((time.time() + self.ahead) * MICROSECONDS)


class _Ahead(Clock):
    """Its times are that many seconds ahead as the file says."""

    def __init__(self, file: str) -> None:
        with Path(file).open("rb") as opened:
            self._ahead = mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ)

    def wall(self) -> float:
        return super().wall() + SECONDS.unpack(self._ahead)[0]

    def monotonic(self) -> float:
        return super().monotonic() + SECONDS.unpack(self._ahead)[0]


def _install(file: str) -> None:
    ahead = _Ahead(file)
    driver.ServerTime = lambda _, latest: ServerTime(ahead, latest)


if __name__ == "__main__":
    from dynhull_cluster import child_process

    os.environ[FILE] = sys.argv[1]
    _install(sys.argv[1])
    # Workers are forked from a process that imports this file.
    os.environ["PYTHONPATH"] = str(Path(__file__).parent)
    child_process.IMPORTED.append("set_time")
    sys.argv = sys.argv[2:]
    runpy.run_path(sys.argv[0], run_name="__main__")
elif FILE in os.environ:
    _install(os.environ[FILE])
