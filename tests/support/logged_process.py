"""A command in a process of its own that logs lines of JSON on standard error."""

import json
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import IO, Any

from forked import Process
from patience import PATIENCE, wait_until

from dynhull_client import HullClient


class Logged:
    def __init__(self, process: subprocess.Popen[str], errors: IO[str]) -> None:
        self.process = process
        self._errors = errors

    def lines(self) -> list[str]:
        self._errors.seek(0)
        return self._errors.read().splitlines(keepends=True)

    def log(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.lines() if line.endswith("}\n")]

    def said(self, event: str) -> list[dict[str, Any]]:
        return [line for line in self.log() if line["event"] == event]

    def wait_for(self, event: str) -> dict[str, Any]:
        wait_until(lambda: self.said(event))
        return self.said(event)[0]


@contextmanager
def logged_process(command: Sequence[str], *, killed: bool = False, code: int = 0) -> Iterator[Logged]:
    """The command; it is ended by SIGTERM, and must end with `code`, unless it was `killed`."""
    with (
        tempfile.TemporaryFile("a+") as errors,  # to read it moves the place at which it would write else
        Process(command, stdout=subprocess.PIPE, stderr=errors, text=True) as process,
    ):
        logged = Logged(process, errors)
        try:
            yield logged
        finally:
            process.terminate()
            ended = process.wait(PATIENCE)
            assert ended == (-signal.SIGKILL if killed else code), f"{ended}: {''.join(logged.lines())}"


def require_service(logged: Logged) -> None:
    """Wait until `dynhull serve` says that it serves, and have it take a hull."""
    assert logged.process.stdout is not None
    first = logged.process.stdout.readline()
    assert first.startswith("dynhull serving on "), logged.lines()
    with HullClient(first.split()[-1]) as client:
        client.create_hull("a")
