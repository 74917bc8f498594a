"""When a call is made again, and after which pause."""

import random
from collections.abc import Iterator
from time import monotonic

from .errors import DynhullError, OutcomeUnknownError, UnavailableError

FIRST_PAUSE = 0.1
LONGEST_PAUSE = 5.0

# What passes once the server can be reached, or can read its disk. A numbered batch that was applied is a duplicate.
PASSING = (OutcomeUnknownError, UnavailableError)


def pauses() -> Iterator[float]:
    """Seconds before each new attempt: doubled from one to the next, and a random part of that taken off.

    Clients that lost the same server do not all come back at the same moment (Brooker, "Exponential Backoff and
    Jitter", 2015).
    """
    pause = FIRST_PAUSE
    while True:
        yield pause * random.uniform(0.5, 1)  # noqa: S311  # no secret
        pause = min(2 * pause, LONGEST_PAUSE)


class Attempts:
    """The attempts at one call, which share its timeout."""

    def __init__(self, timeout: float | None, retries: int) -> None:
        self._deadline = None if timeout is None else monotonic() + timeout
        self._pauses = pauses()
        self._left = retries

    def timeout(self) -> float | None:
        """Seconds that are left."""
        return None if self._deadline is None else max(0.0, self._deadline - monotonic())

    def pause_after(self, error: DynhullError) -> float:
        """Seconds until the next attempt; raises the error where there is none."""
        self._left -= 1
        pause = next(self._pauses)
        left = self.timeout()
        if self._left < 0 or not isinstance(error, PASSING) or (left is not None and left <= pause):
            raise error from None
        return pause
