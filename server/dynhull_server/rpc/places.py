"""Places for calls, of which one caller may not take all."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from ..state.errors import LimitExceededError


class Places:
    """At most so many at a time, and at most so many of each owner.

    Args:
        limit: the name of the limit; that of each owner's is the same with "_per_caller".
        most: how many in all.
        most_each: how many of one owner.
    """

    def __init__(self, limit: str, most: int, most_each: int) -> None:
        self._limit = limit
        self._most = most
        self._most_each = most_each
        self._taken: Counter[str] = Counter()
        self._all = 0

    @contextmanager
    def take(self, owner: str) -> Iterator[None]:
        """Hold a place, or raise LimitExceededError where there is none."""
        if self._taken[owner] >= self._most_each:
            raise LimitExceededError(f"{self._limit}_per_caller", self._most_each)
        if self._all >= self._most:
            raise LimitExceededError(self._limit, self._most)
        self._taken[owner] += 1
        self._all += 1
        try:
            yield
        finally:
            self._all -= 1
            self._taken[owner] -= 1
            if not self._taken[owner]:
                del self._taken[owner]
