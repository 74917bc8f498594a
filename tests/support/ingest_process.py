"""A real ingest in a process of its own."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from forked import COMMAND
from logged_process import Logged, logged_process
from patience import PATIENCE


@contextmanager
def ingest_process(address: str, *arguments: object, killed: bool = False, code: int = 0) -> Iterator[Logged]:
    """`dynhull ingest` with a log of JSON. It must end with `code`, unless it was `killed`."""
    command = [COMMAND, "ingest", "--address", address, "--log-format", "json", *map(str, arguments)]
    with logged_process(command, killed=killed, code=code) as ingest:
        yield ingest


def ingested(address: str, *arguments: object, code: int = 0) -> list[dict[str, Any]]:
    """Run an ingest to the end of its log; returns what it said."""
    with ingest_process(address, *arguments, "--to-end", code=code) as ingest:
        ingest.process.wait(PATIENCE)
        return ingest.log()
