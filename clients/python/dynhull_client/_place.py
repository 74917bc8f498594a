"""The state of a watch between events and connections, as far as it is the same for all watches. No I/O."""

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from time import monotonic
from typing import Any, Generic, TypeVar

import grpc

from ._errors import DynhullError
from ._retry import LONGEST_PAUSE, pauses, seconds_until, with_cause

Happening = TypeVar("Happening", covariant=True)


class Place(ABC, Generic[Happening]):
    """What a watch has received, and what it requests next.

    Attributes:
        method: the name of the RPC.
        lost: why no events can arrive; None while they can.
        request: the request that begins the next connection.
        pause: seconds until then.
        ended: whether there is nothing more to come.
    """

    method: str
    request: Any

    def __init__(
        self, timeout: float | None, reconnect: bool, retries: int, longest_pause: float = LONGEST_PAUSE
    ) -> None:
        self.lost: DynhullError | None = None
        self.pause = 0.0
        self.ended = False
        self._deadline = None if timeout is None else monotonic() + timeout
        self._reconnect = reconnect
        self._longest_pause = longest_pause
        self._begun = False
        self._retries = retries
        self._cause: DynhullError | None = None  # why the last connection was lost, while there is no other
        self._pauses = self._new_pauses()

    @property
    def subject(self) -> str:
        """What is watched, for people."""
        return repr(self.request.name)

    def timeout(self) -> float | None:
        """Seconds left for the watch."""
        return seconds_until(self._deadline)

    @abstractmethod
    def take(self, message: Any) -> Sequence[Happening]:
        """The events to return for a message."""

    @abstractmethod
    def end(self, error: DynhullError) -> Sequence[Happening]:
        """Prepare the next connection after one has ended; raises the error if there is none."""

    def _connected(self) -> None:
        """A message has arrived."""
        if self.lost is not None or not self._begun:
            self.lost, self._begun, self._pauses = None, True, self._new_pauses()
            self._cause = None

    def _continue_later(self, error: DynhullError) -> None:
        """Prepare the next connection after this one was lost; raises any other error.

        Until the watch has begun it is a call like others, with as many retries; afterwards it goes on for ever, unless
        it is not to reconnect.
        """
        again = self._reconnect
        if not self._begun:
            self._retries -= 1
            again = self._retries >= 0
        if not again or error.code != grpc.StatusCode.UNAVAILABLE:
            raise with_cause(error, self._cause) from None
        self._cause = error
        self._report_connection()
        self.pause = next(self._pauses)

    def _report_connection(self) -> None:
        """Have the server say that the next connection is there, even if nothing changes."""
        if not self.request.HasField("progress_interval"):
            self.request.progress_interval.seconds = 1

    def _new_pauses(self) -> Iterator[float]:
        return pauses(self._longest_pause)
