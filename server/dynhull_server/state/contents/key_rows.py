"""Rows of keys: some of them, several changes as one, and how the library and the storage write times."""

from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull import Put
from dynhull.arrays import Points
from dynhull.keys import PackedKeys, key_list

from ..errors import KeyRepeatedError
from ..records import NO_TIME, Contents, KeyRows, Keys, Times
from .deadlines import Key
from .live import AnyKeyedHull

REMOVED = -1


def update(hull: AnyKeyedHull, rows: KeyRows, points: Points) -> Put:
    """Put the keys of a change at points."""
    keys, times, only = rows.keys, rows.times, rows.condition
    if times is None:
        return hull.update(keys, points, None, only=only)
    dated = times != NO_TIME
    if dated.all():
        return hull.update(keys, points, library_times(times), only=only)
    # Released together: some were held with a time, some without.
    with_time = hull.update(select_keys(keys, dated), points[dated], library_times(times[dated]), only=only)
    without = hull.update(select_keys(keys, ~dated), points[~dated], None, only=only)
    return Put(*map(sum, zip(with_time, without, strict=True)))


def stored_times(times: npt.NDArray[np.float64]) -> Times:
    """The library's times as they are stored: NO_TIME instead of NaN."""
    none = np.isnan(times)
    stored = np.where(none, 0.0, times).astype(np.int64)
    stored[none] = NO_TIME
    return stored


def library_times(times: Times) -> npt.NDArray[np.float64]:
    """The inverse of `stored_times`."""
    return np.where(times == NO_TIME, np.nan, times.astype(np.float64))


def selected(rows: KeyRows, which: npt.NDArray[np.bool_]) -> KeyRows:
    """The puts of some rows, and all removes."""
    times = None if rows.times is None else rows.times[which]
    deadlines = None if rows.deadlines is None else rows.deadlines[which]
    accuracies = None if rows.accuracies is None else rows.accuracies[which]
    keys = select_keys(rows.keys, which)
    return KeyRows(keys, rows.points[which], rows.removes, times, deadlines, rows.condition, accuracies=accuracies)


def select_keys(keys: Keys, which: npt.NDArray[np.bool_]) -> Keys:
    """The keys of some rows."""
    if not isinstance(keys, PackedKeys):
        return keys[which]
    lengths = np.frombuffer(keys.lengths, np.uint8)
    return PackedKeys(lengths[which], np.frombuffer(keys.data, np.uint8)[np.repeat(which, lengths)])


def refuse_repeated(rows: KeyRows) -> None:
    """Raise KeyRepeatedError if a key comes twice among the puts and removes. O(k)."""
    keys = [*key_list(rows.keys), *key_list(rows.removes)]
    if len(set(keys)) == len(keys):
        return
    puts = len(rows.keys)
    seen: dict[Key, int] = {}
    for number, key in enumerate(keys):
        first = seen.setdefault(key, number)
        if first != number:
            places = [("puts.keys", each) if each < puts else ("removes", each - puts) for each in (first, number)]
            raise KeyRepeatedError(key, places[0], places[1])


def merged(group: list[KeyRows]) -> KeyRows:
    """One change with the effect of several: the last position of each key."""
    if len(group) == 1:
        return group[0]
    last: dict[Key, int] = {}  # the row of the last put, REMOVED after a removal
    number = 0
    for rows in group:
        for key in key_list(rows.removes):
            last[key] = REMOVED
        for key in key_list(rows.keys):
            last[key] = number
            number += 1
    put = [key for key, row in last.items() if row != REMOVED]
    chosen = np.array([last[key] for key in put], np.intp)
    dated = [rows.times for rows in group if rows.times is not None]
    times = np.concatenate(dated)[chosen] if dated else None
    kind = group[0].keys
    points = np.concatenate([rows.points for rows in group])[chosen]
    removed = [key for key, row in last.items() if row == REMOVED]
    accuracies = None
    if any(rows.accuracies is not None for rows in group):
        columns = [np.zeros(len(rows.keys)) if rows.accuracies is None else rows.accuracies for rows in group]
        accuracies = np.concatenate(columns)[chosen]
    return KeyRows(of_kind(put, kind), points, of_kind(removed, kind), times, accuracies=accuracies)


def of_kind(keys: list[Any], kind: Keys) -> Keys:
    """Keys in the way that others are kept."""
    return PackedKeys.pack(keys) if isinstance(kind, PackedKeys) else np.array(keys, np.uint64)


def key_at(keys: Keys, row: int) -> Key:
    """The key of a row."""
    return keys[row] if isinstance(keys, PackedKeys) else int(keys[row])


def keys_match(contents: Contents, points: Points) -> bool:
    """Whether the positions of the keys are these points in lexicographic order, and each key comes once."""
    keys = contents.keys
    assert keys is not None  # those of a keyed hull
    different = len(set(keys)) if isinstance(keys, PackedKeys) else len(np.unique(keys))
    if not different == len(keys) == len(contents.points):
        return False
    x, y = contents.points.T
    return np.array_equal(contents.points[np.lexsort((y, x))], points)


def no_keys(kind: str) -> Keys:
    """No keys of a kind, "str" or "int"."""
    return PackedKeys(b"", b"") if kind == "str" else np.empty(0, np.uint64)
