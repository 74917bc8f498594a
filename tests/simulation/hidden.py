"""What the simulated processes of several machines can see of each other: see `dynhull_cluster.postgres.processes`.

The files of processes may be hidden from those of other users, whom a signal does not reach either; and processes of
another machine or namespace use the same numbers.
"""

import errno
from dataclasses import dataclass, field
from pathlib import Path


@dataclass(eq=False)
class Place:
    """A machine since its start, and a namespace of processes on it, which has these."""

    boot: str
    namespace: str
    processes: dict[int, "Entry"] = field(default_factory=dict)


@dataclass(eq=False)
class Entry:
    """A process.

    Attributes:
        place: where it runs.
        number: its number, which is used again when it has ended.
        begun: when it began.
        user: whose it is: files and signals of others are out of reach.
        hides: whether the files of others' processes are hidden from it.
        reaped: whether its number is free after its end.
        state: what its file says of it.
    """

    place: Place
    number: int
    begun: int
    user: str
    hides: bool
    reaped: bool = True
    state: str = "S"

    def end(self) -> None:
        self.state = "Z"
        if self.reaped:
            del self.place.processes[self.number]


class System:
    """What `os` is for a process."""

    def __init__(self, own: Entry) -> None:
        self._own = own

    def getpid(self) -> int:
        return self._own.number

    def kill(self, number: int, _: int) -> None:
        other = self._own.place.processes.get(number)
        if other is None:
            raise ProcessLookupError(errno.ESRCH, "there is no such process")
        if other.user != self._own.user:
            raise PermissionError(errno.EPERM, "it is another user's process")


class Proc:
    """What /proc is for a process."""

    def __init__(self, own: Entry, path: str = "") -> None:
        self._own, self._path = own, path

    def __truediv__(self, name: str) -> "Proc":
        return Proc(self._own, f"{self._path}/{name}")

    def read_text(self) -> str:
        if self._path == "/sys/kernel/random/boot_id":
            return f"{self._own.place.boot}\n"
        number = self._path.split("/")[1]
        shown = self._own if number == "self" else self._own.place.processes.get(int(number))
        if shown is None or (shown.user != self._own.user and self._own.hides):
            raise FileNotFoundError(errno.ENOENT, "it is not shown", self._path)
        return f"{shown.number} (a (process)) {shown.state} {'1 ' * 16}1 0 {shown.begun} 0"

    def readlink(self) -> Path:
        if self._path == "/self":
            return Path(str(self._own.number))
        kind = self._path.rpartition("/")[2]
        return Path(f"{kind}:[{self._own.place.namespace}]")
