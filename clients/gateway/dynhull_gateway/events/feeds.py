"""Watches of hulls, each shared by all its readers: an event is received and encoded once.

A reader that falls behind the last events gets the whole hull instead of the changes that it has missed. So a slow one
costs no more memory than a fast one.
"""

import asyncio
from collections import deque
from collections.abc import AsyncGenerator
from dataclasses import dataclass
from time import monotonic
from typing import TYPE_CHECKING, Any, Literal

from dynhull_client import (
    AsyncHullClient,
    AsyncWatch,
    Deleted,
    DynhullError,
    Event,
    HullCopy,
    HullNotFoundError,
    Measures,
    Progress,
    Sketch,
    Snapshot,
)

from ..figures import Figures
from .messages import COMMENT, message, problem
from .shared import SharedWatch

if TYPE_CHECKING:
    from datetime import datetime

Form = Literal["changes", "vertices", "geojson"]

KEPT = 64
# A reader that comes from another gateway may know a revision that this one is about to receive.
PATIENCE_SECONDS = 5.0


@dataclass(frozen=True, slots=True)
class View:
    """What of a hull is watched, and in which form events show it."""

    token: str | None
    name: str
    form: Form
    rate: float
    keys: bool
    measures: bool
    layer: int = 1
    max_vertices: int | None = None


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
        self._copy = HullCopy()
        self._known = False  # whether the copy holds the hull
        self._measures: Measures | None = None
        self._changed: datetime | None = None
        self._error: float | None = None  # how far the hull reaches beyond the vertices of a sketch
        self._events: deque[_Sent] = deque(maxlen=KEPT)
        self._count = 0
        self._snapshot: bytes | None = None

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
            if place is None and self._known and patience <= 0:
                place, resume = self._count, None
                yield self._whole()
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
        view = self._view
        return self._client.watch(
            view.name,
            copy=self._copy,
            max_rate=view.rate,
            keys=view.keys,
            measures=view.measures,
            layer=view.layer,
            max_vertices=view.max_vertices,
            follow=True,
        )

    def passes(self, error: DynhullError) -> bool:
        """Whether the watch goes on later: also of a hull that is not there so far."""
        return super().passes(error) or isinstance(error, HullNotFoundError)

    def take(self, event: Event) -> None:
        """Keep an event."""
        self._snapshot = None
        self._known = not isinstance(event, Deleted)
        if isinstance(event, Sketch):
            self._error = event.error
            event = _whole_sketch(event)
            self._copy.update(event)
        if isinstance(event, Deleted):
            text = message("deleted", "", {"revision": event.revision})
            self._events.clear()
        else:
            self._changed = event.changed
            if not isinstance(event, Progress):
                self._measures = event.measures
            text = self._text(event)
        self._events.append(_Sent(event.revision, text))
        self._count += 1
        self.tell()

    def _text(self, event: Event) -> bytes:
        whole = isinstance(event, Snapshot) or (self._view.form != "changes" and not isinstance(event, Progress))
        if whole:
            return self._whole()
        kind = type(event).__name__.lower()
        return message(kind, self._ident(), {name: value for name, value in shown(event).items() if name != "uid"})

    def _whole(self) -> bytes:
        """The hull as it is now. O(h) once per event."""
        if self._snapshot is None:
            self._snapshot = message("snapshot", self._ident(), self._state())
        return self._snapshot

    def _state(self) -> dict[str, Any]:
        copy = self._copy
        head: dict[str, Any] = {"revision": copy.revision, "points": copy.points}
        if self._measures is not None:
            head["measures"] = shown(self._measures)
        if self._changed is not None:
            head["changed"] = self._changed
        if self._error is not None:
            head["error"] = self._error
        if self._view.form == "geojson":
            geometry = copy.__geo_interface__ if len(copy.vertices) else None
            return {"type": "Feature", "id": self._view.name, "geometry": geometry, "properties": head}
        keys = {"vertex_keys": copy.vertex_keys} if self._view.keys else {}
        return {**head, "vertices": copy.vertices.tolist(), **keys, "center": copy.center}

    def _ident(self) -> str:
        """None for a sketch: each is complete, so that a reader who connects again needs no place."""
        return f"{self._copy.uid}:{self._copy.revision}" if self._copy.uid else ""


def shown(value: Any) -> dict[str, Any]:
    """A value of the SDK as JSON has it, without what is not there."""
    named = {name: getattr(value, name) for name in value.__dataclass_fields__}
    return {name: _plain(each) for name, each in named.items() if each is not None}


def _whole_sketch(sketch: Sketch) -> Snapshot:
    """A sketch as the snapshot of a hull that has only these vertices."""
    head = sketch.revision, sketch.points, sketch.vertices, sketch.measures
    return Snapshot(*head, vertex_keys=sketch.keys, center=sketch.center, changed=sketch.changed)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    return shown(value) if isinstance(value, Measures) else value
