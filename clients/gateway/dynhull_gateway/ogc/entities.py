"""Keys of a hull as features."""

import bisect
from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull_client import AsyncHullClient, Entities

from .filters import Found, Page

KEPT = 4
NO_TIME = np.datetime64(0, "us")  # of a key without event time

Key = str | int


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All keys of a hull at one revision, ascending."""

    revision: int
    keys: list[Key]
    order: list[bytes] | list[int]
    points: npt.NDArray[np.float64]
    times: npt.NDArray[np.datetime64] | None

    @classmethod
    def of(cls, found: Entities) -> "Snapshot":
        """The SDK's answer."""
        keys: list[Key] = [key if isinstance(key, str) else int(key) for key in found.keys]
        numbers = [key for key in keys if isinstance(key, int)]
        order: list[int] | list[bytes] = [str(key).encode() for key in keys]
        if numbers:
            order = numbers
        return cls(found.revision, keys, order, found.points, found.times)

    def page(self, page: Page) -> Found:
        """The features of a page."""
        wanted = np.ones(len(self.keys), np.bool_)
        if page.box is not None:
            wanted &= page.box.holds(self.points)
        if page.interval is not None and self.times is not None:
            wanted &= page.interval.holds(self.times) | (self.times == NO_TIME)
        matched = int(wanted.sum())
        if page.after is not None:
            wanted[: self._row_after(page.after)] = False
        rows = np.flatnonzero(wanted)
        shown = rows[: page.most].tolist()
        following = str(self.keys[shown[-1]]) if len(rows) > page.most else None
        return Found([self.feature(row) for row in shown], following, matched)

    def feature(self, row: int) -> dict[str, Any]:
        """A key as a GeoJSON Feature."""
        time = None if self.times is None else self.times[row]
        return feature(self.keys[row], self.points[row].tolist(), time)

    def _row_after(self, key: str) -> int:
        if self.order and isinstance(self.order[0], int):
            return bisect.bisect_right(self.order, int(key) if key.isdecimal() else -1)
        return bisect.bisect_right(self.order, key.encode("utf-8", "replace"))


class Snapshots:
    """The last snapshots that pages were made of: those after the first one are of the same revision, if it is here."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str | None, str, int], Snapshot] = OrderedDict()

    async def of(self, client: AsyncHullClient, token: str | None, name: str, revision: int | None) -> Snapshot:
        """The snapshot of a revision, or of now."""
        kept = None if revision is None else self._kept.get((token, name, revision))
        if kept is not None:
            return kept
        found = Snapshot.of(await client.entities(name))
        self._kept[token, name, found.revision] = found
        while len(self._kept) > KEPT:
            self._kept.popitem(last=False)
        return found


def feature(key: Key, lonlat: list[float], time: np.datetime64 | None) -> dict[str, Any]:
    """A key as a GeoJSON Feature."""
    when = None if time is None or time == NO_TIME else f"{np.datetime_as_string(time)}Z"
    return {
        "type": "Feature",
        "id": key,
        "geometry": {"type": "Point", "coordinates": lonlat},
        "properties": {"key": key, "time": when},
    }
