"""Batches in columns as few records: as many as are needed to lead to the same state.

Of a key that many batches move only the last place counts. What stands for itself (points that leave, a condition,
the quarantine, a new centre) stays a record of its own.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.keys import Keys, PackedKeys

from ...compiled import native
from ...state.contents.key_rows import select_keys
from ...state.records import FOREVER, NO_TIME, HullSettings, KeyRows, PointRows, Record, Rows, Times
from .columns import DELETE, INSERT, PUT, REMOVE, ROWS, Batches

Flags = npt.NDArray[np.bool_]
Codes = npt.NDArray[np.signedinteger]


def gathered(batches: Batches, settings: HullSettings, after: int, until: int) -> Iterator[Record]:
    """The batches after one revision up to another one, many as one.

    Applied in order to the state at revision `after`, they lead to the same state as the batches themselves. Each has
    the revision of the last batch that it stands for, and does not say who has numbered these.
    """
    first, last = batches.places(after, until)
    alone = _alone(batches, settings, first, last)
    place = first
    for end in [*(first + np.flatnonzero(alone)).tolist(), last]:
        if place < end:
            yield from _as_one(batches, settings, place, end)
        if end < last:
            yield batches.at(end)
        place = end + 1


def key_codes(keys: Keys) -> Codes:
    """A number for each key, the same for equal ones, from 0 and without a gap."""
    if not isinstance(keys, PackedKeys):
        return np.unique(keys, return_inverse=True)[1]
    if native is not None:
        return np.frombuffer(native.key_codes(keys.lengths, keys.data), np.int32)
    return _codes(keys)


def _codes(keys: PackedKeys) -> npt.NDArray[np.int32]:
    numbers: dict[str, int] = {}
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], np.int32)


def last_places_count(settings: HullSettings) -> bool:
    """Whether of batches that put and remove keys the last place of each key is all that counts."""
    recent = settings.window is not None and settings.window.max_points > 0  # who is among them depends on each batch
    return settings.identity != "multiset" and not settings.by_event_time and not recent


def _alone(batches: Batches, settings: HullSettings, first: int, last: int) -> Flags:
    """Which of some batches stand for themselves."""
    window = settings.window
    if settings.identity != "multiset" and window is not None and window.max_points:
        return np.ones(last - first, np.bool_)  # who is among the newest depends on each batch
    rows = batches.rows(first, last)
    columns = batches.columns
    apart = columns.kind[rows] != ROWS
    said = columns.detail[rows]
    if any(said):
        apart |= np.fromiter((each is not None for each in said), np.bool_, len(said))
    if settings.identity == "multiset" and window is not None:
        apart |= columns.op[rows] == DELETE  # of equal points, the oldest
    if settings.by_event_time:
        apart |= columns.op[rows] == REMOVE  # what is put after it may be older
    if first == last or not apart.any():
        return np.zeros(last - first, np.bool_)
    return np.logical_or.reduceat(apart, batches.starts[first:last] - rows.start)


def _as_one(batches: Batches, settings: HullSettings, first: int, last: int) -> Iterator[Record]:
    """Batches that have the effect of one: as that, unless only some of their points have times."""
    if last - first > 1:
        rows = (
            _points(batches, first, last) if settings.identity == "multiset" else _keys(batches, settings, first, last)
        )
        if rows is not None:
            yield replace(batches.at(last - 1), rows=rows)
            return
    for place in range(first, last):
        yield batches.at(place)


def _points(batches: Batches, first: int, last: int) -> Rows | None:
    rows = batches.rows(first, last)
    points, ops, times = (
        each[rows] for each in (batches.columns.points, batches.columns.op, batches.columns.event_time)
    )
    inserted = ops == INSERT
    if _some_only(times[inserted], NO_TIME):
        return None
    dated = _dated(times[inserted], NO_TIME)
    return PointRows(points[inserted], points[ops == DELETE], times=times[inserted] if dated else None)


def _keys(batches: Batches, settings: HullSettings, first: int, last: int) -> Rows | None:
    """The last place of each key."""
    rows, columns = batches.rows(first, last), batches.columns
    keys = batches.keys(rows.start, rows.stop)
    at = np.flatnonzero(columns.keyed[rows]) + rows.start
    names = ("op", "points", "event_time", "expire_time", "accuracy")
    found = {name: getattr(columns, name)[at] for name in names}
    newest = _newest(key_codes(keys), found["event_time"] if settings.by_event_time else None)
    return last_of_keys(found, slice(None), newest, partial(select_keys, keys))


def last_of_keys(
    columns: dict[str, npt.NDArray[Any]], rows: Any, newest: Flags, select: Callable[[Flags], Keys]
) -> Rows | None:
    """The last place of each key; None if only some of the points have times.

    Args:
        columns: columns of rows.
        rows: which of these count, numbers or all; each has a key.
        newest: which of those that count are the last ones of their keys.
        select: returns the keys of some of those that count.
    """
    put = taken(columns["op"], rows, len(newest)) == PUT
    puts, count = _among(rows, put), int(np.count_nonzero(put))
    times, deadlines = (taken(columns[name], puts, count) for name in ("event_time", "expire_time"))
    if _some_only(times, NO_TIME) or _some_only(deadlines, FOREVER):
        return None
    stays = newest & put
    at, count = _among(rows, stays), int(np.count_nonzero(stays))
    return KeyRows(
        select(stays),
        taken(columns["points"], at, count),
        select(newest & ~put),
        taken(columns["event_time"], at, count) if _dated(times, NO_TIME) else None,
        taken(columns["expire_time"], at, count) if _dated(deadlines, FOREVER) else None,
        accuracies=taken(columns["accuracy"], at, count),
    )


def _among(rows: Any, which: Flags) -> Any:
    """Some of the rows that are given by their numbers, or are all there are."""
    return which if isinstance(rows, slice) else rows[which]


def taken(values: npt.NDArray[Any], rows: Any, count: int) -> npt.NDArray[Any]:
    """The `count` rows of a column that are chosen. What is the same in all rows takes no memory for each."""
    if values.strides[0] == 0:
        return values[:count]
    found: npt.NDArray[Any]
    if values.ndim == 1 or isinstance(rows, slice):
        found = values[rows]
    else:  # those of two numbers as one item each: these are copied in a third of the time
        found = values.view(np.complex128)[:, 0][rows].view(np.float64).reshape(-1, 2)
    return found


def _newest(codes: Codes, times: Times | None) -> Flags:
    """Which rows are the last ones of their keys: those with the greatest time, and of these the last."""
    order = np.arange(len(codes)) if times is None else np.argsort(times, kind="stable")
    last = np.zeros(int(codes.max(initial=-1)) + 1, np.intp)
    last[codes[order]] = order  # the last one of a key is what stays
    newest = np.zeros(len(codes), np.bool_)
    newest[last] = True
    return newest


def _some_only(times: Times, none: int) -> bool:
    """Whether some points have a time, and others have none."""
    return 0 < int(np.count_nonzero(times == none)) < len(times)


def _dated(times: Times, none: int) -> bool:
    """Whether points have times, which then all of them have."""
    return len(times) > 0 and bool(times[0] != none)
