"""Watches of many hulls, each shared by all its readers: the newest state of a hull is encoded once.

A reader has no queue. It remembers how far it is, and takes the newest states of what has changed since. One that comes
back with a position has a watch of its own until it has all, and then goes on with the shared one.
"""

import asyncio
from collections import OrderedDict
from collections.abc import AsyncGenerator, AsyncIterator, Iterator
from dataclasses import dataclass
from typing import Any, Literal

from pydantic_core import to_json

from dynhull_client import AsyncHullClient, AsyncManyWatch, DynhullError, ManyChange

from .documents import HullNow
from .messages import COMMENT, message, place, problem
from .shared import SharedWatch

# States in one event.
TOGETHER = 500
# Names of hulls that are gone, kept for readers who have yet to hear of it, and as many as half of all.
MOST_GONE = 1_000


@dataclass(frozen=True, slots=True)
class ManyView:
    """Which hulls are watched, and what of them."""

    token: str | None
    prefix: str
    names: tuple[str, ...]
    outlines: bool
    max_vertices: int | None
    rate: float

    def arguments(self) -> dict[str, Any]:
        """Those of `watch_many`."""
        contents: Literal["outline", "summary"] = "outline" if self.outlines else "summary"
        names = list(self.names) or None
        return {
            "prefix": self.prefix,
            "names": names,
            "contents": contents,
            "max_vertices": self.max_vertices,
            "max_rate": self.rate,
        }


@dataclass(slots=True)
class _Now:
    """The newest that is known of a hull; no text for one that is gone."""

    version: int
    text: bytes | None


class ManyFeed(SharedWatch[ManyChange]):
    """The hulls of a view."""

    def __init__(self, client: AsyncHullClient, view: ManyView) -> None:
        super().__init__(f"the hulls {view.prefix!r}")
        self._client = client
        self._view = view
        self._hulls: OrderedDict[str, _Now] = OrderedDict()
        self._version = 0
        self._generation = 0
        self._gone = 0
        self._complete = self._restored = False
        self._position: bytes | None = None

    async def read(self, position: bytes | None, keepalive: float) -> AsyncGenerator[bytes, None]:
        """All hulls, or what differs from a position, then what changes; a comment after a long pause."""
        version = generation = -1
        if position is not None:
            version, generation = self._version, self._generation
            try:
                async with self._client.watch_many(**self._view.arguments(), position=position) as watch:
                    async for text in _picture(watch):
                        yield text
            except DynhullError as error:
                yield problem(error)
                return
        while self.failure is None:
            news = self.news
            if self._complete and generation != self._generation:
                for text in self._whole(restored=self._restored and generation >= 0):
                    yield text
                version, generation = self._version, self._generation
            elif self._complete and version < self._version:
                until = self._version
                for text in self._after(version):
                    yield text
                version = until
            else:
                try:
                    async with asyncio.timeout(keepalive):
                        await news.wait()
                    if version == self._version and self._position is not None:
                        yield place(self._position.hex())
                except TimeoutError:
                    yield COMMENT
        yield problem(self.failure)

    def _whole(self, *, restored: bool) -> Iterator[bytes]:
        yield message("restored" if restored else "begin", "", {})
        found = [now.text for now in self._hulls.values() if now.text is not None]
        position = "" if self._position is None else self._position.hex()
        for first in range(0, len(found), TOGETHER):
            yield packed(found[first : first + TOGETHER], [])
        yield message("complete", position, {"hulls": len(found)})

    def _after(self, version: int) -> Iterator[bytes]:
        states: list[bytes] = []
        gone: list[str] = []
        for name, now in reversed(self._hulls.items()):
            if now.version <= version:
                break
            if now.text is None:
                gone.append(name)
            else:
                states.append(now.text)
        states.reverse()
        position = "" if self._position is None else self._position.hex()
        for first in range(0, max(len(states), 1), TOGETHER):
            last = first + TOGETHER >= len(states)
            yield packed(states[first : first + TOGETHER], gone if last else [], position if last else "")

    def watch(self) -> AsyncManyWatch:
        """A watch from the position on."""
        return self._client.watch_many(**self._view.arguments(), position=self._position)

    def take(self, change: ManyChange) -> None:
        """Keep what has become of a hull, or how far the watch is."""
        if change.kind == "restored":
            self._begin_anew(restored=self._complete)
            self._complete = False
        elif change.kind in ("state", "gone"):
            self._version += 1
            self._hulls[change.hull] = _Now(self._version, state(change) if change.kind == "state" else None)
            self._hulls.move_to_end(change.hull)
            self._gone += change.kind == "gone"
            if self._gone > MOST_GONE + len(self._hulls) / 2:
                self._begin_anew(restored=False)
        elif change.kind == "complete":
            self._complete = True
        if change.position is not None:
            self._position = change.position
        if self._complete:
            self.tell()

    def _begin_anew(self, *, restored: bool) -> None:
        """Have all readers get a whole picture: states go back, or too many names are kept of hulls that are gone."""
        for name in [name for name, now in self._hulls.items() if restored or now.text is None]:
            del self._hulls[name]
        self._gone, self._restored = 0, restored
        self._generation += 1


async def _picture(watch: AsyncIterator[ManyChange]) -> AsyncIterator[bytes]:
    """The events of a watch that goes on from a position, up to its being complete."""
    states: list[bytes] = []
    same: list[str] = []
    begun = False
    count = 0
    async for change in watch:
        if not begun:
            begun = True
            yield message("restored" if change.kind == "restored" else "begin", "", {})
        if change.kind == "state":
            states.append(state(change))
        elif change.kind == "unchanged":
            same.append(change.hull)
        elif change.kind == "complete":
            count += len(states) + len(same)
            yield packed(states, [], "", same)
            yield message("complete", (change.position or b"").hex(), {"hulls": count})
            return
        if len(states) + len(same) >= TOGETHER:
            count += len(states) + len(same)
            yield packed(states, [], "", same)
            states, same = [], []


def state(change: ManyChange) -> bytes:
    """What is known of a hull, as JSON."""
    return to_json(HullNow.model_validate(change), inf_nan_mode="null", exclude_none=True)


def packed(states: list[bytes], gone: list[str], ident: str = "", same: list[str] | None = None) -> bytes:
    """An event with states, and with names of hulls that are gone, or as they were."""
    data = (
        b'{"hulls":[' + b",".join(states) + b'],"gone":' + to_json(gone) + b',"unchanged":' + to_json(same or []) + b"}"
    )
    return b"event: hulls\n" + (f"id: {ident}\n".encode() if ident else b"") + b"data: " + data + b"\n\n"
