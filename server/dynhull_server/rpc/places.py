"""Limits on the calls in progress, in total and per caller, and on what callers do not read."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager

from ..state.errors import LimitExceededError


class Places:
    """A limited number of places, in total and per owner.

    Args:
        limit: the name of the limit; that per owner has the suffix "_per_caller".
        most: the limit in total.
        most_each: the limit per owner.
    """

    def __init__(self, limit: str, most: int, most_each: int) -> None:
        self._limit = limit
        self._most = most
        self._most_each = most_each
        self._taken: Counter[str] = Counter()
        self._all = 0

    @contextmanager
    def take(self, owner: str) -> Iterator[None]:
        """Hold a place during the block, or raise LimitExceededError if none is free."""
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


class Unread:
    """The bytes of messages that were sent to owners, and that they have not received yet.

    A message that is larger than the limit is sent to an owner who has received all others.

    Args:
        most_each: the limit per owner.

    Attributes:
        total: the bytes of all owners.
    """

    def __init__(self, most_each: int) -> None:
        self.total = 0
        self._most_each = most_each
        self._each: Counter[str] = Counter()

    @contextmanager
    def sending(self, owner: str, size: int) -> Iterator[None]:
        """Count a message during the block, or raise LimitExceededError if that would be too much."""
        unread = self._each[owner]
        if unread and unread + size > self._most_each:
            raise LimitExceededError("max_unread_bytes_per_caller", self._most_each)
        self._each[owner] += size
        self.total += size
        try:
            yield
        finally:
            self.total -= size
            self._each[owner] -= size
            if not self._each[owner]:
                del self._each[owner]
