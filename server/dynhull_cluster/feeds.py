"""What many calls at a gateway have in common, for as long as one of them uses it."""

from collections import Counter
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from typing import Generic, Protocol, TypeVar


class Feed(Protocol):
    """A watch of a worker, for several calls."""

    @property
    def over(self) -> bool:
        """Whether it has ended by itself."""

    def close(self) -> None:
        """End it."""


F = TypeVar("F", bound=Feed)


class Feeds(Generic[F]):
    """The feeds in use, by their keys."""

    def __init__(self) -> None:
        self._feeds: dict[Hashable, F] = {}
        self._users: Counter[F] = Counter()

    @contextmanager
    def use(self, key: Hashable, begin: Callable[[], F]) -> Iterator[F]:
        """The feed with this key: a new one if none goes on. It ends with the last block that uses it."""
        feed = self._feeds.get(key)
        if feed is None or feed.over:
            feed = self._feeds[key] = begin()
        self._users[feed] += 1
        try:
            yield feed
        finally:
            self._users[feed] -= 1
            if not self._users[feed]:
                del self._users[feed]
                feed.close()
                if self._feeds.get(key) is feed:
                    del self._feeds[key]
