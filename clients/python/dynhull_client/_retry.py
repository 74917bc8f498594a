"""When to repeat a call, and after which pause."""

import random
from collections.abc import Iterator
from time import monotonic
from typing import TypeVar

import grpc

from dynhull_surface.reasons import NOT_BEGUN, Repeat, repeat_of

from ._calls import Call
from ._errors import DeadlineError, DynhullError, HullNotFoundError, not_sent

FIRST_PAUSE = 0.1
LONGEST_PAUSE = 5.0
# A hull that is awaited is asked for this often: a missing hull costs the server little.
LONGEST_PAUSE_FOR_A_HULL = 1.0
# The refusal of a call whose connection has too many of them already. It passes as the others are answered.
CROWDED = "TOO_MANY_CALLS"

Answer = TypeVar("Answer")


def passes(error: DynhullError) -> bool:
    """Whether the call may succeed later, once the server can be reached or can read its disk.

    UNAVAILABLE means this in every gRPC service, also with a reason that this version does not know.
    """
    return repeat_of(error.reason, error.code.name) is not Repeat.NO


def pauses(longest: float = LONGEST_PAUSE) -> Iterator[float]:
    """Seconds before each new attempt: doubled each time up to `longest`, less a random part.

    The random part keeps clients that lost the same server from reconnecting at the same moment (Brooker,
    "Exponential Backoff and Jitter", 2015).
    """
    pause = FIRST_PAUSE
    while True:
        yield pause * random.uniform(0.5, 1)  # noqa: S311  # no secret
        pause = min(2 * pause, longest)


def seconds_until(deadline: float | None) -> float | None:
    """Seconds left until a time of the monotonic clock; None for no deadline."""
    return None if deadline is None else max(0.0, deadline - monotonic())


def with_cause(error: DynhullError, cause: DynhullError | None) -> DynhullError:
    """The error of the last attempt; with that of the one before, if there was no time for it."""
    if cause is None or not isinstance(error, DeadlineError):
        return error
    return DeadlineError(f"{error}; before: {cause}", error.code, error.reason, error.metadata)


class Attempts:
    """The attempts at one call, which share its timeout."""

    def __init__(self, call: Call[Answer], timeout: float | None, retries: int) -> None:
        self._timeout = timeout
        self._deadline = None if timeout is None else monotonic() + timeout
        self._pauses = pauses(LONGEST_PAUSE_FOR_A_HULL if call.awaits_hull else LONGEST_PAUSE)
        self._left = retries
        self._waits_in_a_crowd = retries > 0
        self._repeatable = call.repeatable
        self._cause: DynhullError | None = None

    def timeout(self) -> float | None:
        """Seconds left."""
        return seconds_until(self._deadline)

    def after(self, call: Call[Answer], error: DynhullError) -> tuple[Call[Answer], float]:
        """The next call to make after an error, and the seconds until then; raises the error if there is none."""
        instead = call.instead(error)
        if instead is not None:
            return instead, 0.0
        pause, left = next(self._pauses), self.timeout()
        late = left is not None and left <= pause
        if call.awaits_hull and (passes(error) or isinstance(error, HullNotFoundError)):
            if late:
                message = f"not within {self._timeout:g} s: {error}"
                raise DeadlineError(message, grpc.StatusCode.DEADLINE_EXCEEDED, "", {}) from error
            return call, pause
        if error.reason != CROWDED or not self._waits_in_a_crowd:
            self._left -= 1
        safe = self._repeatable or error.reason in NOT_BEGUN or not_sent(error)
        if self._left < 0 or late or not passes(error) or not safe:
            raise with_cause(self._explained(call, error), self._cause) from None
        self._cause = error
        return call, pause

    def _explained(self, call: Call[Answer], error: DynhullError) -> DynhullError:
        """The error; after the timeout with what the call waited for, which gRPC does not know."""
        if not isinstance(error, DeadlineError) or self._timeout is None:
            return error
        message = f"the call took longer than {self._timeout:g} s"
        revision, hull = getattr(call.request, "min_revision", 0), getattr(call.request, "name", "")
        if revision:
            message += f"; hull {hull!r} may not have reached revision {revision}"
        elif call.awaits_hull:
            message = f"not within {self._timeout:g} s: no server has said whether hull {hull!r} exists"
        return DeadlineError(message, error.code, error.reason, error.metadata)
