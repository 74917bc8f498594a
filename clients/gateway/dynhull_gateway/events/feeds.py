"""Watches of hulls, each shared by all its readers: an event is received and encoded once.

A reader that falls behind the last events gets the whole hull instead of the changes that it has missed. So a slow one
costs no more memory than a fast one.
"""

import asyncio
import json
import logging
from collections import deque
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass
from time import monotonic
from typing import Any, Literal

import grpc

from dynhull_client import (
    AsyncHullClient,
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
from ..refusals import of_refusal
from .messages import COMMENT, message

log = logging.getLogger(__name__)

Form = Literal["changes", "vertices", "geojson"]

KEPT = 64
RETRY_SECONDS = 0.5
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


class Feed:
    """The events of a hull in one view.

    Attributes:
        readers: the number of those who read it.
        failure: why it has ended; None while it has not.
    """

    def __init__(self, client: AsyncHullClient, view: View) -> None:
        self.readers = 0
        self.failure: DynhullError | None = None
        self._client = client
        self._view = view
        self._copy = HullCopy()
        self._known = False  # whether the copy holds the hull
        self._measures: Measures | None = None
        self._error: float | None = None  # how far the hull reaches beyond the vertices of a sketch
        self._events: deque[_Sent] = deque(maxlen=KEPT)
        self._count = 0
        self._snapshot: bytes | None = None
        self._news = asyncio.Event()
        self._task = asyncio.create_task(self._follow(), name=f"events of {view.name}")

    async def close(self) -> None:
        """End the watch."""
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def read(self, resume: tuple[str, int] | None, keepalive: float, figures: Figures) -> AsyncIterator[bytes]:
        """The events after the place that a reader has, or from a snapshot on; a comment after a long pause."""
        place: int | None = None
        begun = monotonic()
        while self.failure is None:
            news = self._news
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
        yield message("problem", "", of_failure(self.failure))

    def _place(self, uid: str, revision: int) -> int | None:
        """The count of events up to a revision; None if it is not known."""
        if uid != self._copy.uid:
            return None
        if revision == self._copy.revision:
            return self._count
        first = self._count - len(self._events)
        found = (number for number, sent in enumerate(self._events, first + 1) if sent.revision == revision)
        return next(found, None)

    async def _follow(self) -> None:
        """Watch the hull; also one that is deleted and created again, and over restarts of the server."""
        view = self._view
        while self.failure is None:
            try:
                watch = self._client.watch(
                    view.name,
                    copy=self._copy,
                    max_rate=view.rate,
                    keys=view.keys,
                    measures=view.measures,
                    layer=view.layer,
                    max_vertices=view.max_vertices,
                    follow=True,
                )
                async with watch:
                    async for event in watch:
                        self._add(event)
            except DynhullError as error:
                if error.code == grpc.StatusCode.UNAVAILABLE or isinstance(error, HullNotFoundError):
                    await asyncio.sleep(RETRY_SECONDS)
                    continue
                self._fail(error)
            except Exception:  # whatever it is, the readers must not wait for ever
                log.exception("the events of hull %r ended", view.name)
                self._fail(DynhullError("the gateway failed", grpc.StatusCode.INTERNAL, "", {}))

    def _fail(self, error: DynhullError) -> None:
        self.failure = error
        self._tell()

    def _add(self, event: Event) -> None:
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
            if not isinstance(event, Progress):
                self._measures = event.measures
            text = self._text(event)
        self._events.append(_Sent(event.revision, text))
        self._count += 1
        self._tell()

    def _tell(self) -> None:
        self._news.set()
        self._news = asyncio.Event()

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


class Feeds:
    """The feeds that are read."""

    def __init__(self) -> None:
        self._feeds: dict[View, Feed] = {}

    async def read(
        self, client: AsyncHullClient, view: View, resume: tuple[str, int] | None, keepalive: float, figures: Figures
    ) -> AsyncIterator[bytes]:
        """The events of a feed, which is there while somebody reads it."""
        feed = self._feeds.get(view)
        if feed is None or feed.failure is not None:
            feed = self._feeds[view] = Feed(client, view)
        feed.readers += 1
        try:
            async for text in feed.read(resume, keepalive, figures):
                yield text
        finally:
            feed.readers -= 1
            if not feed.readers:
                if self._feeds.get(view) is feed:
                    del self._feeds[view]
                await feed.close()


def shown(value: Any) -> dict[str, Any]:
    """A value of the SDK as JSON has it, without what is not there."""
    named = {name: getattr(value, name) for name in value.__dataclass_fields__}
    return {name: _plain(each) for name, each in named.items() if each is not None}


def of_failure(error: DynhullError) -> Any:
    """The problem details of what ends a stream."""
    return json.loads(bytes(of_refusal(error).body))


def _whole_sketch(sketch: Sketch) -> Snapshot:
    """A sketch as the snapshot of a hull that has only these vertices."""
    head = sketch.revision, sketch.points, sketch.vertices, sketch.measures
    return Snapshot(*head, vertex_keys=sketch.keys, center=sketch.center)


def _plain(value: Any) -> Any:
    if hasattr(value, "tolist"):
        return value.tolist()
    return shown(value) if isinstance(value, Measures) else value
