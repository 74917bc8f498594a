"""Feeds that several viewers share."""

import asyncio
from collections import Counter
from collections.abc import Callable
from typing import Generic, Protocol, TypeVar


class Closable(Protocol):
    """Something that runs until it is closed."""

    async def close(self) -> None:
        """Stop."""
        ...


Feed = TypeVar("Feed", bound=Closable)


class Feeds(Generic[Feed]):
    """Feeds by name: begun for the first viewer, closed after the last.

    Args:
        begin: begins the feed of a name.
    """

    def __init__(self, begin: Callable[[str], Feed]) -> None:
        self._begin = begin
        self._feeds: dict[str, Feed] = {}
        self._viewers: Counter[str] = Counter()
        self._closing: set[asyncio.Task[None]] = set()

    def open(self, name: str) -> Feed:
        """The feed of this name, shared with its other viewers. Release it once for each call."""
        if name not in self._feeds:
            self._feeds[name] = self._begin(name)
        self._viewers[name] += 1
        return self._feeds[name]

    def release(self, name: str) -> None:
        """End one viewer's use of a feed; the last one closes it."""
        self._viewers[name] -= 1
        if not self._viewers[name]:
            task = asyncio.create_task(self._feeds.pop(name).close())
            self._closing.add(task)
            task.add_done_callback(self._closing.discard)

    async def close(self) -> None:
        """Close all feeds."""
        await asyncio.gather(*(feed.close() for feed in self._feeds.values()), *self._closing)
