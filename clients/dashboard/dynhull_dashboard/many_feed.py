"""All hulls of a prefix, watched once for all viewers."""

import asyncio
import json
import time
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import islice

import numpy as np

from dynhull_client import AsyncHullClient, AsyncManyWatch, DynhullError, ManyChange

from .degrees import outline, shown

# States of a hull a second, and its vertices: of many hulls each is small in the picture.
MAX_RATE, MOST_VERTICES = 2.0, 24
RETRY_SECONDS, SLICE_SECONDS = 1.0, 0.02
# Edges of hulls that are smaller than this, in degrees, are straight in the picture, but near a pole.
STRAIGHT, POLAR = 1.0, 80.0
# Names of hulls that are gone, kept for viewers who have yet to hear of it, before these get all hulls again.
MOST_GONE = 1_000


@dataclass(frozen=True, slots=True)
class Place:
    """How far a viewer is.

    Attributes:
        generation: the number of times that all began anew.
        version: that of what it has been sent last.
    """

    generation: int = -1
    version: int = 0


@dataclass(frozen=True, slots=True)
class Outlined:
    """A hull; without a state one that is gone.

    Attributes:
        version: a number that is greater than those of all that changed before.
        text: what the page is sent.
        state: what is known of it.
    """

    version: int
    text: str
    state: ManyChange | None


class ManyFeed:
    """The newest outlines of the hulls of a prefix, kept up to date until closed.

    Attributes:
        prefix: what their names begin with.
        complete: whether all that there are have arrived.
    """

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        self.prefix = prefix
        self.complete = False
        self._client = client
        self._hulls: OrderedDict[str, Outlined] = OrderedDict()
        self._generation = self._version = self._gone = 0
        self._watch: AsyncManyWatch | None = None
        self._failure: DynhullError | None = None
        self._task = asyncio.create_task(self._run())

    def __len__(self) -> int:
        return len(self._hulls) - self._gone

    async def close(self) -> None:
        """Stop following the hulls."""
        self._task.cancel()
        await asyncio.wait([self._task])

    @property
    def trouble(self) -> DynhullError | None:
        """The error that interrupts the watch at the moment; None while there is none."""
        return self._failure or (self._watch.lost if self._watch else None)

    def newest(self, count: int) -> list[Outlined]:
        """The hulls that have changed last, the newest first."""
        there = (each for each in reversed(self._hulls.values()) if each.state is not None)
        return list(islice(there, count))

    def since(self, place: Place) -> tuple[Place, str | None]:
        """What has changed since a viewer was sent something, as JSON, and how far it is then."""
        now = Place(self._generation, self._version)
        # Those that the page has stay until all are there again; before there were any, each is shown as it comes.
        if now == place or (self._generation and not self.complete):
            return place, None
        whole = place.generation != now.generation
        texts = [each.text for each in self._after(-1 if whole else place.version) if each.state or not whole]
        begin = json.dumps({"kind": "many", "prefix": self.prefix, "whole": whole})
        return now, f'{begin[:-1]}, "hulls": [{",".join(texts)}]}}'

    def _after(self, version: int) -> Iterable[Outlined]:
        found = []
        for each in reversed(self._hulls.values()):
            if each.version <= version:
                break
            found.append(each)
        return reversed(found)

    async def _run(self) -> None:
        """Follow the hulls. The watch survives lost connections; where it is refused it is tried again."""
        while True:
            try:
                async with self._client.watch_many(
                    self.prefix, contents="outline", max_vertices=MOST_VERTICES, max_rate=MAX_RATE
                ) as self._watch:
                    begun = time.monotonic()
                    async for change in self._watch:
                        self._failure = None
                        self._take(change)
                        if time.monotonic() - begun > SLICE_SECONDS:  # pages are sent what there is meanwhile
                            await asyncio.sleep(0)
                            begun = time.monotonic()
            except DynhullError as error:
                self._failure = error
            self._begin_anew()
            await asyncio.sleep(RETRY_SECONDS)

    def _take(self, change: ManyChange) -> None:
        if change.kind == "restored":
            self._begin_anew()
        elif change.kind == "complete":
            self.complete = True
        elif change.kind in ("state", "gone"):
            self._version += 1
            before = self._hulls.get(change.hull)
            self._gone += (change.kind == "gone") - (before is not None and before.state is None)
            state = change if change.kind == "state" else None
            self._hulls[change.hull] = Outlined(self._version, _drawing(change), state)
            self._hulls.move_to_end(change.hull)
            if self._gone > MOST_GONE + len(self._hulls) / 2:
                for name in [name for name, each in self._hulls.items() if each.state is None]:
                    del self._hulls[name]
                self._gone, self._generation = 0, self._generation + 1

    def _begin_anew(self) -> None:
        self._hulls.clear()
        self._gone, self._generation, self.complete = 0, self._generation + 1, False


def _drawing(change: ManyChange) -> str:
    """The outline of a hull as JSON, without corners for one that is gone."""
    if change.vertices is None:
        return json.dumps({"hull": change.hull, "revision": 0, "x": [], "y": [], "rings": None, "gone": True})
    corners = shown(change.vertices, change.center)
    x, y = corners.T.tolist()
    rings = None
    if change.center is not None:  # rings say that it is on the globe; great circles take long
        straight = len(corners) and (np.ptp(corners, axis=0) < STRAIGHT).all() and abs(corners[0, 1]) < POLAR
        rings = [ring.tolist() for ring in ([corners] if straight else outline(change.vertices, change.center))]
    return json.dumps({"hull": change.hull, "revision": change.revision, "x": x, "y": y, "rings": rings})
