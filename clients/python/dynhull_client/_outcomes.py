"""The futures of batches and reads."""

from __future__ import annotations

import threading
from concurrent.futures import Future, InvalidStateError
from concurrent.futures._base import CANCELLED, FINISHED, PENDING
from contextlib import suppress
from typing import TYPE_CHECKING, Any, TypeVar

if TYPE_CHECKING:
    from collections.abc import Iterable

T = TypeVar("T")


class Outcome(Future[T]):
    """A future that has no condition until a thread waits for it, cancels it or adds a callback.

    To make the condition takes longer than all else that a future does, and of thousands under way nobody waits for
    most: they are done when somebody looks.
    """

    _making = threading.Lock()

    def __init__(self) -> None:
        # As the base class does, without the condition.
        self._state = PENDING
        self._result = None
        self._exception = None
        self._waiters = []
        self._done_callbacks: list[Any] = []

    def __getattr__(self, name: str) -> Any:
        """The condition, which the methods of the base class use before anything else."""
        if name != "_condition":
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        with self._making:
            return self.__dict__.setdefault(name, threading.Condition())

    def done(self) -> bool:
        """Whether it has a result or an error, or is cancelled."""
        return self._state == FINISHED or super().done()

    def cancel(self) -> bool:
        """Cancel it, and tell those who wait for several futures: no executor does so later."""
        cancelled = super().cancel()
        with self._condition:
            if self._state == CANCELLED:
                self.set_running_or_notify_cancel()
        return cancelled

    def result(self, timeout: float | None = None) -> T:
        """The result, or raise the error, at most `timeout` seconds later; TimeoutError after these."""
        if self._state == FINISHED and self._exception is None:
            return self._result  # type: ignore[return-value]  # it has one
        return super().result(timeout)

    def finish(self, result: T | Exception) -> bool:
        """Give it its result, or the exception that takes its place; returns False if a thread may wait for it."""
        with self._making:
            if "_condition" in self.__dict__:
                return False
            if isinstance(result, Exception):
                self._exception = result
            else:
                self._result = result
            self._state = FINISHED
        return True


def settle(settled: Iterable[tuple[Any, Any]]) -> None:
    """Give each future its result, or the exception that takes its place."""
    for outcome, result in settled:
        if type(outcome) is Outcome and outcome.finish(result):
            continue
        if outcome.done():  # cancelled by its caller
            continue
        with suppress(InvalidStateError):  # cancelled just now
            if isinstance(result, Exception):
                outcome.set_exception(result)
            else:
                outcome.set_result(result)
