"""Keys of a hull as features."""

import bisect
from collections import OrderedDict
from dataclasses import dataclass, replace
from datetime import datetime
from http import HTTPStatus
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull_client import AsyncHullClient, Entities, HullInfo

from ..problems import ProblemError
from ..schemas import NO_TIME
from .filters import Matching, Page, in_range

KEPT = 16
KEPT_KEYS = 1_000_000  # of all that are kept, beside the latest: about 200 bytes each

Key = str | int


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All keys of a hull at one revision, ascending."""

    place: str  # UID:REVISION
    keys: list[Key]
    order: list[bytes] | list[int]
    points: npt.NDArray[np.float64]
    times: npt.NDArray[np.datetime64] | None

    @classmethod
    def of(cls, uid: str, found: Entities) -> "Snapshot":
        """The SDK's answer."""
        keys: list[Key] = [key if isinstance(key, str) else int(key) for key in found.keys]
        numbers = [key for key in keys if isinstance(key, int)]
        order: list[int] | list[bytes] = [str(key).encode() for key in keys]
        if numbers:
            order = numbers
        return cls(f"{uid}:{found.revision}", keys, order, found.points, found.times)

    def page(self, page: Page, *, standing: bool) -> Matching:
        """The features of a page; those `standing` at the end of an interval may be there for long."""
        wanted = np.ones(len(self.keys), np.bool_)
        if page.box is not None:
            wanted &= page.box.holds(self.points)
        if page.interval is not None and self.times is not None:
            interval = replace(page.interval, begin=None) if standing else page.interval
            wanted &= interval.holds(self.times) | (self.times == NO_TIME)
        matched = int(wanted.sum())
        if page.after is not None:
            wanted[: self._row_after(page.after)] = False
        rows = np.flatnonzero(wanted)
        shown = rows[: page.most].tolist()
        following = str(self.keys[shown[-1]]) if len(rows) > page.most else None
        return Matching([self.feature(row) for row in shown], following, matched)

    def feature(self, row: int) -> dict[str, Any]:
        """A key as a GeoJSON Feature."""
        time = None if self.times is None else self.times[row]
        return feature(self.keys[row], self.points[row].tolist(), time)

    def _row_after(self, key: str) -> int:
        if self.order and isinstance(self.order[0], int):
            return bisect.bisect_right(self.order, int(key) if key.isdecimal() else -1)
        return bisect.bisect_right(self.order, key.encode("utf-8", "replace"))


class Snapshots:
    """Snapshots that have further pages, so that all of them are of one revision."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[str | None, str, str], Snapshot] = OrderedDict()
        self._keys = 0

    async def of(
        self, client: AsyncHullClient, token: str | None, hull: HullInfo, place: str | None, then: datetime | None
    ) -> Snapshot:
        """The snapshot at a place, UID:REVISION, or of then, or of now; ProblemError if that revision is gone."""
        kept = None if place is None else self._kept.get((token, hull.name, place))
        if kept is not None:
            return kept
        found = await _read(client, hull, then)
        if place in (None, found.place):
            return found
        detail = f"the gateway no longer has revision {place}: begin again, without after and revision"
        raise ProblemError(HTTPStatus.GONE, detail, "PAGE_GONE", field="revision", value=place)

    def keep(self, token: str | None, name: str, snapshot: Snapshot) -> None:
        """Keep a snapshot for its further pages, in place of the oldest."""
        known = self._kept.pop((token, name, snapshot.place), None)
        self._keys += len(snapshot.keys) - (0 if known is None else len(known.keys))
        self._kept[token, name, snapshot.place] = snapshot
        while len(self._kept) > 1 and (len(self._kept) > KEPT or self._keys > KEPT_KEYS):
            _, oldest = self._kept.popitem(last=False)
            self._keys -= len(oldest.keys)


async def _read(client: AsyncHullClient, hull: HullInfo, then: datetime | None) -> Snapshot:
    if then is None:
        return Snapshot.of(hull.uid, await client.entities(hull.name))
    if then < hull.created:
        return Snapshot(f"{hull.uid}:0", [], [], np.empty((0, 2)), None)
    past = await client.at(hull.name, then)
    return Snapshot.of(past.uid, await past.entities())


def feature(key: Key, lonlat: list[float], time: np.datetime64 | None) -> dict[str, Any]:
    """A key as a GeoJSON Feature, with a longitude from -180 to 180."""
    when = {} if time is None or time == NO_TIME else {"time": f"{np.datetime_as_string(time)}Z"}
    return {
        "type": "Feature",
        "id": key,
        "geometry": {"type": "Point", "coordinates": [in_range(np.array(lonlat[0])).item(), lonlat[1]]},
        "properties": {"key": key, **when},
    }
