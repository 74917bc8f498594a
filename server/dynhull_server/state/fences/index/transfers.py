"""Keys that one batch removes from a hull and puts into another: for fences that compare both, subjects that move."""

from collections.abc import Iterator, Mapping

from dynhull.keys import key_list

from ..model.fence import Fence
from ..model.records import Key, Origin
from .keys_changed import KeysChanged
from .subjects import Subjects

# By the name of the hull where they are now, and by key: where they come from.
Transfers = Mapping[str, Mapping[Key, Origin]]


def carry(subjects: Mapping[str, Subjects], changed: Mapping[str, KeysChanged]) -> Transfers:
    """Let the subjects move that a batch over several hulls has moved, before anybody looks who has crossed.

    A key that leaves several hulls, or comes into several, goes from the first to the first in the order of names.
    O(rows of the batch).

    Args:
        subjects: the hulls whose keys are compared, by name.
        changed: what has happened to the keys of hulls, by name.
    """
    found: dict[str, dict[Key, Origin]] = {}
    for source, target, keys in _candidates(changed):
        before, after = subjects.get(source), subjects.get(target)
        if before is None or after is None or before.fences.keys().isdisjoint(after.fences):
            continue
        if before.hull.row.settings.identity != after.hull.row.settings.identity:
            continue
        carried = after.index.carry(before.index, after.keys(keys))
        if not carried.any():
            continue
        origin = Origin(source, before.hull.state.counts.revision)
        moved = [key for key, each in zip(key_list(after.keys(keys)), carried.tolist(), strict=True) if each]
        after.bring(before, moved)
        found.setdefault(target, {}).update(dict.fromkeys(moved, origin))
    return found


def known_to(fence: Fence, origins: Mapping[Key, Origin]) -> Mapping[Key, Origin]:
    """Those subjects that come from hulls which the fence compares; for it, the others are new."""
    return {key: origin for key, origin in origins.items() if origin.hull in fence.subjects} if origins else origins


def _candidates(changed: Mapping[str, KeysChanged]) -> Iterator[tuple[str, str, list[Key]]]:
    """The pairs of hulls with the keys that the batch removes from one and puts into the other, in order."""
    put: dict[Key, list[str]] = {}
    for name, each in sorted(changed.items()):
        for key in () if each.rows is None else key_list(each.rows.keys):
            put.setdefault(key, []).append(name)
    for source, each in sorted(changed.items()):
        pairs: dict[str, list[Key]] = {}
        for key in () if each.rows is None else key_list(each.rows.removes):
            for target in put.get(key, ()) if key not in each.expired else ():
                pairs.setdefault(target, []).append(key)
        for target, keys in sorted(pairs.items()):
            yield source, target, keys
