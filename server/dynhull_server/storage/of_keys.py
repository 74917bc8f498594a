"""What of a state, and of batches, is about some keys."""

import json

import numpy as np
import numpy.typing as npt

from dynhull.keys import PackedKeys, key_list, take_keys

from ..state.records import FOREVER, NO_TIME, Contents, Keys, Times
from ..state.tracks import EXPIRE, NO_KEY, PUT, REMOVE, KeyChanges
from ..state.ways import KeyWays, Stamps
from .segments import columns as segment
from .segments.columns import SegmentColumns
from .segments.gathered import key_codes


def contents_of_keys(contents: Contents, keys: Keys) -> tuple[npt.NDArray[np.int32], Contents]:
    """Which of some keys are there, and their points, times, deadlines and accuracies."""
    if contents.keys is None:
        return np.empty(0, np.int32), Contents()
    places = _places(contents.keys, keys)
    chosen = places != NO_KEY
    times, deadlines = _rows(contents.times, chosen), _rows(contents.deadlines, chosen)
    accuracies = None if contents.accuracies is None else contents.accuracies[chosen]
    return places[chosen], Contents(contents.points[chosen], None, times, deadlines, accuracies=accuracies)


def changes_of_keys(columns: SegmentColumns, keys: Keys) -> KeyChanges:
    """What batches do to some keys, without what is held out of the hull."""
    rows = np.full(len(columns), NO_KEY, np.int32)
    rows[columns.keyed] = _places(columns.keys, keys)
    said = (columns.kind == segment.ROWS) & (columns.op == segment.NONE)
    revisions = columns.revision[said].tolist()
    details = [columns.detail[row] for row in np.flatnonzero(said).tolist()]
    words = {revision: json.loads(detail) for revision, detail in zip(revisions, details, strict=True) if detail}
    expires = columns.kind == segment.EXPIRY
    chosen = ((columns.kind == segment.ROWS) & (rows != NO_KEY)) | expires
    ops = np.where(columns.op == segment.PUT, PUT, np.where(expires, EXPIRE, REMOVE)).astype(np.int8)
    return KeyChanges(
        rows[chosen],
        ops[chosen],
        columns.revision[chosen],
        columns.committed[chosen],
        columns.points[chosen],
        columns.event_time[chosen],
        columns.expire_time[chosen],
        columns.accuracy[chosen],
        columns.clock[chosen],
        {revision: each["condition"] for revision, each in words.items() if "condition" in each},
    )


def ways_of(columns: SegmentColumns) -> KeyWays | None:
    """What batches do to all keys, one key after the other; None if they do more than to put and remove keys."""
    ops, keyed = columns.op, columns.keyed
    plain = (
        bool((columns.kind == segment.ROWS).all())
        and bool(((ops == segment.PUT) | (ops == segment.REMOVE) == keyed).all())
        and columns.detail.count(None) == len(columns)
        and bool((columns.committed != NO_TIME).all())
        and bool((columns.clock == NO_TIME).all())
        and bool((columns.event_time == NO_TIME).all())
        and bool((columns.expire_time == FOREVER).all())
    )
    if not plain:
        return None
    codes = key_codes(columns.keys)
    order = np.argsort(codes, kind="stable")
    starts = np.flatnonzero(np.diff(codes[order], prepend=-1))
    rows = np.flatnonzero(keyed)[order]
    x, y = columns.points[rows].T
    of_all = Stamps(columns.revision, columns.commit, columns.committed)
    stamps = of_all[rows]
    return KeyWays(take_keys(columns.keys, order[starts]), starts, x, y, lambda: stamps, lambda: of_all)


def _places(keys: Keys, wanted: Keys) -> npt.NDArray[np.int32]:
    """The place of each key among those that are wanted; NO_KEY for others. O(size of the keys)."""
    if isinstance(keys, PackedKeys):
        packed = PackedKeys.pack(key_list(wanted))
        codes = key_codes(PackedKeys(packed.lengths + keys.lengths, packed.data + keys.data))
        of_codes = np.full(int(codes.max(initial=-1)) + 1, NO_KEY, np.int32)
        of_codes[codes[: len(packed)]] = np.arange(len(packed))
        found: npt.NDArray[np.int32] = of_codes[codes[len(packed) :]]
        return found
    order = np.argsort(wanted).astype(np.int32)
    if not len(order):
        return np.full(len(keys), NO_KEY, np.int32)
    values = np.asarray(wanted)[order]
    at = np.minimum(np.searchsorted(values, keys), len(order) - 1)
    return np.where(values[at] == keys, order[at], np.int32(NO_KEY))


def _rows(times: Times | None, which: npt.NDArray[np.bool_]) -> Times | None:
    return None if times is None else times[which]
