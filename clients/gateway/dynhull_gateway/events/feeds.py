"""Watches of hulls, each shared by all its readers: an event is received and encoded once.

A reader that falls behind the last events gets the whole hull instead of the changes that it has missed. So a slow one
costs no more memory than a fast one.
"""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from time import monotonic

from dynhull_client import AsyncHullClient, AsyncWatch, Deleted, DynhullError, Event, HullNotFoundError

from ..figures import Figures
from .messages import COMMENT, problem
from .shared import SharedWatch
from .texts import HullTexts, View

KEPT = 64
# A reader that comes from another gateway may know a revision that this one is about to receive.
PATIENCE_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class _Sent:
    revision: int
    text: bytes


class Feed(SharedWatch[Event]):
    """The events of a hull in one view; also of one that is deleted and created again."""

    def __init__(self, client: AsyncHullClient, view: View) -> None:
        super().__init__(f"hull {view.name!r}")
        self._client = client
        self._view = view
        self._texts = HullTexts(view)
        self._copy = self._texts.copy
        self._events: deque[_Sent] = deque(maxlen=KEPT)
        self._count = 0

    async def read(
        self, resume: tuple[str, int] | None, keepalive: float, figures: Figures
    ) -> AsyncGenerator[bytes, None]:
        """The events after the place that a reader has, or from a snapshot on; a comment after a long pause."""
        place: int | None = None
        begun = monotonic()
        while self.failure is None:
            news = self.news
            if place is None and resume is not None:
                place = self._place(*resume)
            ahead = resume is not None and resume[0] == self._copy.uid and resume[1] > self._copy.revision
            patience = begun + PATIENCE_SECONDS - monotonic() if ahead else 0.0
            if place is None and self._texts.known and patience <= 0:
                place, resume = self._count, None
                yield self._texts.whole()
            elif place is not None and place < self._count - len(self._events):
                figures.skipped.inc()
                place = None
            elif place is not None and place < self._count:
                sent = self._events[place - self._count]
                place += 1
                yield sent.text
            else:
                try:
                    async with asyncio.timeout(min(keepalive, patience) if patience > 0 else keepalive):
                        await news.wait()
                except TimeoutError:
                    yield COMMENT
        yield problem(self.failure)

    def _place(self, uid: str, revision: int) -> int | None:
        """The count of events up to a revision; None if it is not known."""
        if uid != self._copy.uid:
            return None
        if revision == self._copy.revision:
            return self._count
        first = self._count - len(self._events)
        found = (number for number, sent in enumerate(self._events, first + 1) if sent.revision == revision)
        return next(found, None)

    def watch(self) -> AsyncWatch:
        """The watch of the hull, which updates the copy."""
        return self._client.watch(self._view.name, copy=self._copy, follow=True, **self._view.options())

    def passes(self, error: DynhullError) -> bool:
        """Whether the watch goes on later: also of a hull that is not there so far."""
        return super().passes(error) or isinstance(error, HullNotFoundError)

    def take(self, event: Event) -> None:
        """Keep an event."""
        text = self._texts.take(event)
        if isinstance(event, Deleted):
            self._events.clear()
        self._events.append(_Sent(event.revision, text))
        self._count += 1
        self.tell()
