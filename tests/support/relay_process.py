"""A real relay in a process of its own, and fences and alarms with events for it to deliver."""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from forked import COMMAND
from logged_process import Logged, logged_process

from dynhull_client import HullClient

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
INSIDE, OUTSIDE = [[1, 1]], [[9, 9]]
FAST = ("--first-pause", "10ms", "--longest-pause", "100ms")


@contextmanager
def relay_process(
    address: str, state: Path, *arguments: object, killed: bool = False, code: int = 0
) -> Iterator[Logged]:
    """`dynhull relay` with a log of JSON. It must end with `code`, unless it was `killed`."""
    options = ["--address", address, "--state", state / "relay", "--log-format", "json", "--consumer", "test"]
    with logged_process([COMMAND, "relay", *map(str, [*options, *arguments])], killed=killed, code=code) as relay:
        yield relay


def fence(client: HullClient, name: str, initial: str = "none") -> None:
    """A fence around a square, and a keyed hull of the same name as its subjects."""
    client.create_hull(name, keyed="str")
    client.create_fence(name, area=SQUARE, subjects=name, initial=initial)


def pass_through(client: HullClient, name: str, keys: Iterable[str]) -> None:
    """An enter and an exit of each key."""
    for key in keys:
        client.put(name, [key], INSIDE)
        client.put(name, [key], OUTSIDE)


def alarm(client: HullClient, name: str) -> None:
    """An alarm about the area of a keyed hull of the same name, whose third point decides."""
    client.create_hull(name, keyed="str")
    client.put(name, ["a", "b", "c"], [[0, 0], [4, 0], [0, 1]])
    client.create_alarm(name, hull=name, when="area > 10", clear="area < 9")


def grow_and_shrink(client: HullClient, name: str, times: int) -> None:
    """The alarm is raised and cleared so many times."""
    for _ in range(times):
        client.put(name, ["c"], [[0, 6]])
        client.put(name, ["c"], [[0, 1]])


def acknowledged(client: HullClient, name: str, kind: str = "fence") -> int:
    """The sequence that the relay has acknowledged."""
    found = client.get_alarm(name) if kind == "alarm" else client.get_fence(name)
    return max((each.acknowledged for each in found.consumers), default=0)
