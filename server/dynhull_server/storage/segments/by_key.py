"""Rows of a segment as its file has them: by key, then revision.

So the last place of each key is where another key begins, and is found without a table of keys. What lies by revision
is made of it when it is asked for: of a few batches these alone, of all batches once.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.keys import Keys

from ...state.records import HullSettings, Identity, Record
from .columns import NONE, ROWS, Batches, Integers, SegmentColumns
from .gathered import last_of_keys, last_places_count, taken

Places = npt.NDArray[np.int32]

# Batches of fewer rows than this part of all are put in order alone.
FEW = 16
# Rows that are put in order at a time for a reader of all batches: their memory is used again. That for all rows
# would be new each time, which takes longer than what is done with it.
PART_ROWS = 2**15
# Parts in order that are kept, so that several readers find theirs.
PARTS = 4


@dataclass(slots=True)
class RowsByKey:
    """Rows of one hull, by key, then revision and place; those without a key come last.

    Attributes:
        identity: what identifies a point of the hull.
        first: the first revision.
        starts: of each revision the number of rows before it, and the number of all rows.
        places: the place of each row among all by revision.
        rows: the row at each place.
        of_revisions: `commit`, `committed` and `clock` of each revision; none where most have one row.
        of_rows: the other columns, of each row.
        codes: a number for the key of each row, greater than those of the keys before it; NONE without a key.
        packed: returns the keys with some numbers.
        detail: of the rows that have one what no column has, as JSON.
    """

    identity: Identity
    first: int
    starts: Places
    places: Places
    rows: Places
    of_revisions: dict[str, Integers]
    of_rows: dict[str, npt.NDArray[Any]]
    codes: Places
    packed: Callable[[Places], Keys]
    detail: dict[int, str]
    _batches: Batches | None = field(default=None, init=False)
    _parts: list[tuple[int, int, Batches]] = field(default_factory=list, init=False)  # the last used at the end
    _turn: Any = field(default_factory=Lock, init=False)

    def __len__(self) -> int:
        return len(self.places)

    def batches(self) -> Batches:
        """All batches, by revision. O(n) the first time."""
        with self._turn:
            if self._batches is None:
                self._batches = Batches(self.columns(0, len(self.starts) - 1))
            return self._batches

    def next_batches(self, after: int) -> Batches:
        """The batches that follow a revision, and perhaps some before it: not all of them, but one at least."""
        place, _ = self._numbers(after, after)
        with self._turn:
            if self._batches is not None:
                return self._batches
            part = next((each for each in self._parts if each[0] <= place < each[1]), None)
            if part is None:
                end = int(np.searchsorted(self.starts, self.starts[place] + PART_ROWS, side="right")) - 1
                end = min(max(end, place + 1), len(self.starts) - 1)
                part = place, end, Batches(self.columns(place, end))
            else:
                self._parts.remove(part)
            self._parts = [*self._parts, part][-PARTS:]
            return part[2]

    def batches_between(self, after: int, until: int) -> Batches:
        """The batches after one revision up to another one; of others some may be there, too."""
        begin, end = self._numbers(after, until)
        return Batches(self.columns(begin, end)) if self._are_few(begin, end) else self.batches()

    def last_places(self, settings: HullSettings, after: int, until: int) -> Record | None:
        """What the batches after one revision up to another one come to as one; None for `gathered` to do it."""
        begin, end = self._numbers(after, until)
        if self._are_few(begin, end) or self.detail or not last_places_count(settings):
            return None
        start, stop = int(self.starts[begin]), int(self.starts[end])
        rows: Any = slice(None)
        if stop - start < len(self):
            rows = np.flatnonzero((self.places >= start) & (self.places < stop))
        if (taken(self.of_rows["kind"], rows, stop - start) != ROWS).any():
            return None
        codes = self.codes[rows]
        if (codes == NONE).any():  # a batch of nothing
            keyed = np.flatnonzero(codes != NONE)
            rows, codes = keyed if isinstance(rows, slice) else rows[keyed], codes[keyed]
        newest = np.append(codes[1:] != codes[:-1], True)[: len(codes)]
        found = last_of_keys(self.of_rows, rows, newest, lambda which: self.packed(codes[which]))
        if found is None:
            return None
        return replace(Batches(self.columns(end - 1, end)).at(0), rows=found)

    def columns(self, begin: int, end: int) -> SegmentColumns:
        """The rows of some revisions, by revision and place."""
        start, stop = int(self.starts[begin]), int(self.starts[end])
        rows = self.rows[start:stop]
        if stop - start == len(self) and bool((np.diff(rows) == 1).all()):  # as a state, where every key is another one
            ordered: Any = slice(None)
        else:
            ordered = rows
        counts = np.diff(self.starts[begin : end + 1])
        place = np.arange(start, stop)
        place -= _repeated(self.starts[begin:end], counts)
        codes = self.codes[ordered]
        keyed = codes != NONE
        detail: list[str | None] = [None] * (stop - start)
        if self.detail:
            detail = [self.detail.get(row) for row in rows.tolist()]
        columns: dict[str, Any] = {
            name: _repeated(values[begin:end], counts) for name, values in self.of_revisions.items()
        }
        columns |= {name: taken(values, ordered, stop - start) for name, values in self.of_rows.items()}
        return SegmentColumns(
            identity=self.identity,
            revision=_repeated(self.first + np.arange(begin, end), counts),
            place=place,
            keyed=keyed,
            keys=self.packed(codes if keyed.all() else codes[keyed]),
            detail=detail,
            **columns,
        )

    def _are_few(self, begin: int, end: int) -> bool:
        return bool((self.starts[end] - self.starts[begin]) * FEW <= len(self))

    def _numbers(self, after: int, until: int) -> tuple[int, int]:
        """The numbers of the first revision after one, and of the first one after another, from 0."""
        last = len(self.starts) - 1
        begin, end = (min(max(each + 1 - self.first, 0), last) for each in (after, until))
        return begin, max(begin, end)


def _repeated(values: npt.NDArray[Any], counts: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """The value of each revision for all of its rows. What has the same in all takes no memory for each."""
    if len(values) == 1 or (values.strides == (0,) and len(values)):
        return np.broadcast_to(values[0], int(counts.sum()))
    return np.repeat(values, counts)
