"""The state of a watch of numbered events, those of a fence or of an alarm, between connections. No I/O."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Any, Protocol

from ._arguments import text, whole
from ._place import Happening, Place
from ._times import encode_duration

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ._errors import DynhullError


class WatchingNumbered(Protocol):
    """A watch of numbered events to begin."""

    @property
    def request(self) -> Any:
        """The request that begins it."""

    @property
    def reconnect(self) -> bool:
        """Whether it continues after a lost connection."""

    @property
    def timeout(self) -> float | None:
        """Seconds after which it ends."""


class NumberedPlace(Place[Happening]):
    """What a watch of numbered events has received, and what it requests next.

    Attributes:
        gone: the error that says that there is no such fence or alarm.
    """

    gone: type[DynhullError]

    def __init__(self, watching: WatchingNumbered, retries: int) -> None:
        super().__init__(watching.timeout, watching.reconnect, retries)
        self.request = type(watching.request)()
        self.request.CopyFrom(watching.request)
        self._reports_progress = watching.request.HasField("progress_interval")
        self._closed = False

    def take(self, message: Any) -> Sequence[Happening]:
        """The events of a message. The next connection continues after them, with or without a consumer."""
        self._connected()
        self.request.uid = message.uid or self.request.uid
        self.request.after_sequence = message.sequence
        events = self._events(message)
        self._closed = any(event.type == "closed" for event in events)
        if not events and self._reports_progress:
            return [self._progress(message.sequence)]
        return events

    def end(self, error: DynhullError) -> Sequence[Happening]:
        """Prepare the next connection after one has ended; raises the error if there is none."""
        if self._closed and isinstance(error, self.gone):
            self.ended = True
        else:
            self.lost = error
            self._continue_later(error)
        return ()

    @abstractmethod
    def _events(self, message: Any) -> list[Any]:
        """The events of a message."""

    @abstractmethod
    def _progress(self, sequence: int) -> Happening:
        """That nothing has happened up to a sequence."""


def encode_start(request: Any, consumer: str | None, after: int | None, progress_interval: float | None) -> None:
    """Where a watch of numbered events begins, and how often it says that nothing has happened."""
    if consumer is not None:
        request.consumer = text("consumer", consumer)
    elif after is not None:
        request.after_sequence = whole("after", after)
    else:
        request.only_new = True
    if progress_interval is not None:
        request.progress_interval.CopyFrom(encode_duration(progress_interval, "progress_interval"))
