"""Several points as one: those of a hull in parts, and those of several hulls."""

from collections.abc import Iterable, Sequence

import numpy as np

from dynhull.keys import PackedKeys, key_list

from ..records import FOREVER, NO_TIME, Contents, HeldRows, Keys, Times


def in_one(parts: Iterable[Contents]) -> Contents:
    """The contents of a hull in parts, one after the other. These have the same columns, but those without points."""
    parts = list(parts)
    if len(parts) == 1:
        return parts[0]
    points = np.concatenate([np.empty((0, 2)), *(part.points for part in parts)])
    columns = {name: [getattr(part, name) for part in parts] for name in ("times", "deadlines", "accuracies")}
    there = {name: [each for each in column if each is not None] for name, column in columns.items()}
    found = {name: np.concatenate(column) for name, column in there.items() if column}
    keys = [part.keys for part in parts if part.keys is not None]
    held = held_in_one([part.held for part in parts if part.held is not None])
    return Contents(points, _keys_in_one(keys) if keys else None, held=held, **found)


def held_in_one(parts: Sequence[HeldRows]) -> HeldRows | None:
    """All positions in quarantine of several parts; None without any part."""
    if len(parts) <= 1:
        return parts[0] if parts else None
    columns = ("points", "times", "deadlines", "speeds", "growths", "revisions", "confirmed", "accuracies")
    return HeldRows(
        _keys_in_one([part.keys for part in parts]),
        **{name: np.concatenate([getattr(part, name) for part in parts]) for name in columns},
    )


def _keys_in_one(parts: Sequence[Keys]) -> Keys:
    strings = [each for each in parts if isinstance(each, PackedKeys)]
    if strings:
        return PackedKeys(b"".join(each.lengths for each in strings), b"".join(each.data for each in strings))
    return np.concatenate([each for each in parts if isinstance(each, np.ndarray)])


def joined(parts: Sequence[Contents]) -> Contents:
    """All points, in the order of their keys, else of their times, else of their coordinates. O(n log n).

    The parts have no quarantine, and no key in common.
    """
    if len(parts) == 1:
        return parts[0]
    points = np.concatenate([each.points for each in parts])
    lengths = [len(each) for each in parts]
    times = _joined_times([each.times for each in parts], lengths, NO_TIME)
    deadlines = _joined_times([each.deadlines for each in parts], lengths, FOREVER)
    accuracies = None
    if any(each.accuracies is not None for each in parts):
        accuracies = np.concatenate([np.zeros(len(p)) if p.accuracies is None else p.accuracies for p in parts])
    keys = [each.keys for each in parts if each.keys is not None]
    if not keys:
        order = np.lexsort((points[:, 1], points[:, 0]) if times is None else (points[:, 1], points[:, 0], times))
        return Contents(points[order], None, None if times is None else times[order], None)
    names = [key for each in keys for key in key_list(each)]
    order = np.array(sorted(range(len(names)), key=names.__getitem__), np.intp)
    ordered = [names[row] for row in order.tolist()]
    sorted_keys: Keys = PackedKeys.pack(ordered) if isinstance(keys[0], PackedKeys) else np.array(ordered, np.uint64)
    times, deadlines = (None if each is None else each[order] for each in (times, deadlines))
    accuracies = None if accuracies is None else accuracies[order]
    return Contents(points[order], sorted_keys, times, deadlines, accuracies=accuracies)


def _joined_times(parts: Sequence[Times | None], lengths: Sequence[int], none: int) -> Times | None:
    """The times of all, with `none` for those of parts that have none; None where no part has any."""
    if all(part is None for part in parts):
        return None
    filled = [np.full(n, none) if part is None else part for part, n in zip(parts, lengths, strict=True)]
    return np.concatenate(filled)
