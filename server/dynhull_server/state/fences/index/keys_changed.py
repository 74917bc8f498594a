"""What a batch or an expiry has done to the keys of a hull."""

from collections.abc import Collection, Container, Iterable, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, fields, replace

import numpy as np
import numpy.typing as npt

from dynhull import Crossings
from dynhull.keys import key_list, take_keys

from ...batch import Applied
from ...contents.keyed import Keyed
from ...contents.live import AnyKeyedHull
from ...hull import Hull
from ...records import Expiry, KeyRows, Record
from ..model.records import Cause, Key


@dataclass(slots=True)
class KeysChanged:
    """What has happened to the keys of a hull.

    Attributes:
        rows: the batch; None where keys have only expired.
        expired: the keys whose deadline had come, in an expiry or before a batch to one of several hulls.
        fewer: whether others may have left, too old or too many.
    """

    rows: KeyRows | None = None
    expired: AbstractSet[Key] = frozenset()
    fewer: bool = False
    _removed: set[Key] | None = field(default=None, init=False)

    def why_gone(self, key: Key) -> Cause:
        """Why a key left."""
        if self._removed is None:
            self._removed = set() if self.rows is None else set(key_list(self.rows.removes)) - set(self.expired)
        return Cause.REMOVED if key in self._removed else Cause.EXPIRED

    def gone(self, waiting: Collection[Key]) -> Iterable[Key]:
        """Those of some keys that may have left. O(rows of the batch), or of all if points are too old or too many."""
        if self.fewer:
            return list(waiting)
        left = () if self.rows is None else key_list(self.rows.removes)
        return {key for each in (left, self.expired) for key in each if key in waiting}

    def reports(self, hull: AnyKeyedHull, asked: Container[Key], new: Collection[Key] = ()) -> list[Key]:
        """Those of some keys whose position the batch has written; all but `new` were there before it. O(its rows)."""
        rows = self.rows
        if rows is None:
            return []
        found = [row for row, key in enumerate(key_list(rows.keys)) if key in asked]
        keys = take_keys(rows.keys, np.array(found, np.intp))
        written = np.ones(len(found), np.bool_)
        if rows.condition == "absent":  # only a key that has expired
            written &= np.array([key in self.expired or key in new for key in key_list(keys)], np.bool_)
        if hull.ordered and rows.times is not None:
            written &= ~(rows.times[found] < hull.times(keys))
        return [key for key, each in zip(key_list(keys), written.tolist(), strict=True) if each]


def of_batch(
    hull: Hull, applied: Applied, journal: Sequence[Record], expired: AbstractSet[Key] = frozenset()
) -> KeysChanged:
    """What an applied batch, the last one of the journal, has done to keys."""
    rows = journal[-1].rows
    fewer = _limited(hull) and (applied.evicted or applied.expired)
    return KeysChanged(rows if isinstance(rows, KeyRows) else None, expired, bool(fewer))


def of_expiry(hull: Hull) -> KeysChanged:
    """What an expiry has done to keys."""
    contents = hull.state.contents
    ended = contents.ended if isinstance(contents, Keyed) else ()
    return KeysChanged(None, frozenset(ended), _limited(hull))


def of_record(hull: Hull, record: Record, expired: AbstractSet[Key] = frozenset()) -> KeysChanged:
    """What a revision that was applied again has done to keys; `expired` are those of an expiry that it counts with."""
    if isinstance(record.rows, Expiry):
        return of_expiry(hull)
    return KeysChanged(record.rows if isinstance(record.rows, KeyRows) else None, expired, _limited(hull))


def _limited(hull: Hull) -> bool:
    window = hull.row.settings.window
    return window is not None and window.limited


def some(crossings: Crossings, rows: npt.NDArray[np.intp]) -> Crossings:
    """Some rows of crossings."""
    columns = {each.name: getattr(crossings, each.name)[rows] for each in fields(crossings) if each.name != "keys"}
    return Crossings(**columns, keys=take_keys(crossings.keys, rows))


def with_expiries(crossings: Crossings, expired: AbstractSet[Key]) -> Crossings:
    """The crossings; keys whose time had come were not removed by the batch that followed at once. O(crossings)."""
    gone = np.flatnonzero(crossings.causes & Cause.REMOVED)
    ended = gone[
        np.fromiter((key in expired for key in key_list(take_keys(crossings.keys, gone))), np.bool_, len(gone))
    ]
    causes = crossings.causes.copy()
    causes[ended] ^= np.uint8(Cause.REMOVED | Cause.EXPIRED)
    return replace(crossings, causes=causes)
