"""The points of several hulls as those of one."""

from collections.abc import Sequence

import numpy as np

from dynhull.keys import PackedKeys, key_list

from ..records import FOREVER, NO_TIME, Contents, Keys, Times


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
