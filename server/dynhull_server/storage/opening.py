"""Preparing what has just been opened."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Closable(Protocol):
    """What can be closed."""

    def close(self) -> object:
        """Close it."""


@contextmanager
def closed_on_error(opened: Closable) -> Iterator[None]:
    """A block that prepares what has just been opened: it is closed if that fails."""
    try:
        yield
    except BaseException:
        opened.close()
        raise
