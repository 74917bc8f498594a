"""A real relay in a process of its own, and fences with events for it to deliver."""

import json
import signal
import subprocess
import tempfile
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

from forked import COMMAND, Process
from patience import PATIENCE, wait_until

from dynhull_client import HullClient

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
INSIDE, OUTSIDE = [[1, 1]], [[9, 9]]
FAST = ("--first-pause", "10ms", "--longest-pause", "100ms")


class Relay:
    def __init__(self, process: subprocess.Popen[str], errors: IO[str]) -> None:
        self.process = process
        self._errors = errors

    def log(self) -> list[dict[str, Any]]:
        self._errors.seek(0)
        return [json.loads(line) for line in self._errors.read().splitlines(keepends=True) if line.endswith("}\n")]

    def said(self, event: str) -> list[dict[str, Any]]:
        return [line for line in self.log() if line["event"] == event]

    def wait_for(self, event: str) -> dict[str, Any]:
        wait_until(lambda: self.said(event))
        return self.said(event)[0]


@contextmanager
def relay_process(
    address: str, state: Path, *arguments: object, killed: bool = False, code: int = 0
) -> Iterator[Relay]:
    """`dynhull relay` with a log of JSON. It must end with `code`, unless it was `killed`."""
    options = ["--address", address, "--state", state / "relay", "--log-format", "json", "--consumer", "test"]
    command = [COMMAND, "relay", *map(str, [*options, *arguments])]
    with (
        tempfile.TemporaryFile("w+") as errors,
        Process(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        try:
            yield Relay(process, errors)
        finally:
            process.terminate()
            ended = process.wait(PATIENCE)
            errors.seek(0)
            assert ended == (-signal.SIGKILL if killed else code), errors.read()


def fence(client: HullClient, name: str, initial: str = "none") -> None:
    """A fence around a square, and a keyed hull of the same name as its subjects."""
    client.create_hull(name, keyed="str")
    client.create_fence(name, area=SQUARE, subjects=name, initial=initial)


def pass_through(client: HullClient, name: str, keys: Iterable[str]) -> None:
    """An enter and an exit of each key."""
    for key in keys:
        client.put(name, [key], INSIDE)
        client.put(name, [key], OUTSIDE)


def acknowledged(client: HullClient, name: str) -> int:
    """The sequence that the relay has acknowledged."""
    return max((each.acknowledged for each in client.get_fence(name).consumers), default=0)
