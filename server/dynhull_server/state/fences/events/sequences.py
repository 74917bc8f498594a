"""Crossings become events: they get their numbers and times, those of each fence after its last one."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from dynhull import Crossings
from dynhull.crossings import PackedCrossings

from ....compiled import Native
from ...records import NO_TIME, Times
from ..model.records import Cause, EventType
from ..model.tallies import Column, Tallies
from .block import EVENT, RUN, Bytes, EventBlock, Integers, key_columns

# A cause as the index knows it, and what it is here.
Swap = tuple[Cause, Cause]
# The type of an event by its change of side, -1 for the last one.
TYPES = bytes((EventType.CROSS, EventType.ENTER, EventType.EXIT))
TYPE_COLUMN = np.frombuffer(TYPES, np.uint8)
NO_AREAS: Mapping[int, int] = MappingProxyType({})


class Told(NamedTuple):
    """What a trip has said so far of k fences, by ascending numbers.

    Attributes:
        fences: (k,) their numbers.
        places: (k,) where they are counted.
        lasts: (k,) the sequence of the last event of each.
        times: (k,) its time.
        made: (k,) the number of events.
        changes: (k,) by how many more subjects are inside.
    """

    fences: Integers
    places: Integers
    lasts: Integers
    times: Integers
    made: Integers
    changes: Integers

    def of(self, number: int) -> tuple[int, int] | None:
        """The last sequence of a fence, and the time of that event; None if nothing was said."""
        row = int(self.fences.searchsorted(number))
        if row == len(self.fences) or self.fences[row] != number:
            return None
        return int(self.lasts[row]), int(self.times[row])


class Crossed(NamedTuple):
    """Crossings of one revision, by fence, whose events have no numbers yet. The C++ of `numbered` takes it as it is.

    Attributes:
        packed: the crossings.
        hull: the name of the hull of the subjects.
        revision: the revision of that hull.
        areas: those of the hulls that are areas, by the numbers of the fences; None where none is.
        event_times: the times of the positions, or None.
        swap: a cause, and the one that it stands for.
        now: the time.
    """

    packed: PackedCrossings
    hull: str
    revision: int
    areas: dict[int, int] | None
    event_times: Times | None
    swap: Swap | None
    now: int


def numbered(waiting: Sequence[Crossed], before: Callable[[Integers], Told]) -> tuple[EventBlock, Told]:
    """The events of crossings whose times never go back, and what they say of their fences. O(n log n) for n events.

    Args:
        waiting: the crossings, in the order in which they came.
        before: what was known of some fences, by ascending numbers.
    """
    found = [each.packed.unpack() for each in waiting]
    counts = [len(each) for each in found]
    fences, changes = _column(found, "fences"), _column(found, "changes")
    points, previous = _column(found, "points"), _column(found, "previous")
    n = len(fences)
    # Of each fence the events follow each other.
    order = fences.argsort(kind="stable")
    ascending = fences[order]
    groups = first_rows(ascending)
    made = sizes(groups, n)
    numbers = ascending[groups]
    known = before(numbers)
    sequences = np.empty(n, np.int64)
    sequences[order] = np.arange(1, n + 1) + (known.lasts - groups).repeat(made)
    times = np.empty(n, np.int64)
    times[order] = known.times.repeat(made)
    np.maximum(times, np.array([each.now for each in waiting]).repeat(counts), out=times)  # they never go back
    told = Told(
        numbers,
        known.places,
        known.lasts + made,
        times[order[groups + made - 1]],
        known.made + made,
        known.changes + np.add.reduceat(changes[order], groups, dtype=np.int64),
    )
    ends = np.cumsum(counts)
    first = first_rows(fences, ends[:-1])
    moments = ends.searchsorted(first, "right")  # of each run, which crossings it is part of
    names = tuple({each.hull: None for each in waiting})
    keys = [key_columns(each.keys) for each in found]
    runs = np.empty(len(first), RUN)
    runs["fence"] = fences[first]
    runs["first"] = sequences[first]
    runs["count"] = sizes(first, n)
    runs["hull"] = np.array([names.index(each.hull) for each in waiting])[moments]
    runs["kind"] = np.array([kind for kind, _, _ in keys])[moments]
    runs["subject_revision"] = np.array([each.revision for each in waiting])[moments]
    runs["area_revision"] = 0
    if any(each.areas for each in waiting):
        pairs = zip(fences[first].tolist(), moments.tolist(), strict=True)
        runs["area_revision"] = [(waiting[moment].areas or NO_AREAS).get(number, 0) for number, moment in pairs]
    runs["time"] = times[first]
    rows = np.empty(n, EVENT)
    rows["type"] = TYPE_COLUMN[changes]
    rows["causes"] = _joined([_caused(each.causes, of.swap) for each, of in zip(found, waiting, strict=True)])
    rows["length"] = np.frombuffer(b"".join([lengths for _, lengths, _ in keys]), np.uint8)
    rows["x"], rows["y"] = points.T
    rows["before_x"], rows["before_y"] = previous.T
    rows["distance"] = np.where(np.isnan(points[:, 0]), np.nan, _column(found, "distances"))
    rows["event_time"] = rows["first_time"] = NO_TIME
    if any(each.event_times is not None for each in waiting):
        columns = (each.event_times for each in waiting)
        rows["event_time"] = _joined(
            [np.full(count, NO_TIME) if each is None else each for count, each in zip(counts, columns, strict=True)]
        )
    return EventBlock(runs, rows, b"".join([data for _, _, data in keys]), names), told


def numbered_natively(native: Native, waiting: list[Crossed], tallies: Tallies) -> tuple[EventBlock, Told]:
    """As `numbered`, after what is counted of the fences. O(n + runs log n)."""
    names = tuple(dict.fromkeys([each.hull for each in waiting]))
    runs, rows, keys, told = native.numbered(waiting, names, TYPES, tallies.at, tallies.rows, Column.LAST, Column.TIME)
    block = EventBlock(np.frombuffer(runs, RUN), np.frombuffer(rows, EVENT), keys, names)
    return block, Told(*np.frombuffer(told, np.int64).reshape(len(Told._fields), -1))


def _column(found: Sequence[Crossings], name: str) -> Any:
    return _joined([getattr(each, name) for each in found])


def _joined(columns: list[Any]) -> Any:
    return columns[0] if len(columns) == 1 else np.concatenate(columns)


def first_rows(numbers: Integers, more: Integers | None = None) -> Integers:
    """The rows at which the number of another fence begins, and some more."""
    begins = np.empty(len(numbers), np.bool_)
    begins[0] = True
    np.not_equal(numbers[1:], numbers[:-1], out=begins[1:])
    if more is not None:
        begins[more] = True
    return begins.nonzero()[0]


def sizes(starts: Integers, end: int) -> Integers:
    """How many rows there are from each of some rows to the next, or to the end."""
    found = np.empty(len(starts), np.int64)
    np.subtract(starts[1:], starts[:-1], out=found[:-1])
    found[-1] = end - starts[-1]
    return found


def caused(causes: int, swap: Swap | None) -> int:
    """A set of causes with one cause in the place of another one."""
    return causes & ~swap[0] | swap[1] if swap is not None and causes & swap[0] else causes


def _caused(causes: Bytes, swap: Swap | None) -> Bytes:
    if swap is None:
        return causes
    meant, stands_for = np.uint8(swap[0]), np.uint8(swap[1])
    return np.where(causes & meant, causes & ~meant | stands_for, causes)
