"""Fences as the storage has them, after a start or a failed commit.

With a margin the side of a subject depends on its way, so it is never recomputed from positions: it is what was stored,
and the events since.
"""

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from dynhull import FenceIndex
from dynhull.keys import key_list

from ...hull_state import HullState
from ...registry import Registry
from ..index.pair import Pair
from ..index.subjects import Subjects, frame_of, indexed, lay
from ..model.fence import Fence
from ..model.records import EventType, KeptFence, Key, Members


@dataclass(frozen=True, slots=True)
class Restored:
    """Fences as the storage has them.

    Attributes:
        kept: the fences by number.
        indexes: the index of each hull with subjects, by name.
    """

    kept: Mapping[int, KeptFence]
    indexes: dict[str, FenceIndex]


def restore(subjects: Iterable[Subjects], states: Mapping[str, HullState], kept: Mapping[int, KeptFence]) -> Restored:
    """Indexes with the subjects inside that the storage has.

    Args:
        subjects: the hulls whose subjects are restored.
        states: the states of hulls by name, where they are not the hulls' own.
        kept: all fences of these hulls, by number.

    Raises:
        RuntimeError: who is inside, as stored, contradicts the positions.
    """
    inside = {number: members_after(each) for number, each in kept.items()}
    delayed: defaultdict[tuple[int, str], set[Key]] = defaultdict(set)
    for number, fence_kept in kept.items():
        for hull, key in fence_kept.delays:
            delayed[number, hull].add(key)
    indexes = {}
    for each in subjects:
        state = states.get(each.hull.name)
        if state is None:  # the hull itself stays
            each.index.detach()
            state = each.hull.state
        index = indexes[each.hull.name] = FenceIndex(indexed(state), frame_of(state))
        for number, fence in each.fences.items():
            config = kept[number].row.config
            vertices = None
            if fence.area is not None:
                vertices = states.get(fence.area.name, fence.area.state).layer(config.area_layer)
            reported = inside[number].get(each.hull.name, set())
            members = each.keys(reported ^ delayed[number, each.hull.name])
            lay(index, number, config, vertices, members, frame_of(state))
        if len(index.take()):
            raise RuntimeError(f"the subjects inside, as stored, contradict the keys of the hull {each.hull.name!r}")
    return Restored(kept, indexes)


def bring_back(kept: Sequence[KeptFence], registry: Registry) -> list[Fence]:
    """Add the fences that the storage has kept to those that there are."""
    subjects: dict[str, Subjects] = {}
    fences = []
    for each in kept:
        fence = Fence(each.row)
        registry.add_fence(fence)
        fence.restored(each)
        config = each.row.config
        fence.area = None if config.area_hull is None else registry.get(config.area_hull)
        if config.kind == "other" and fence.area is not None and fence.watched is None:
            fence.pair = Pair(fence.area, registry.get(config.subjects), config.near)
            fence.pair.look()
        if fence.watched is not None:
            fence.watched.other = fence.area
            for name in registry.compared(config):
                fence.watched.add(registry.get(name))
            watch_again(fence, each)
            fences.append(fence)
            continue
        for name in registry.compared(config):
            if name not in subjects:
                subjects[name] = Subjects(registry.get(name))
            subjects[name].fences[fence.number] = fence
            fence.subjects[name] = subjects[name]
        fences.append(fence)
    adopt(restore(subjects.values(), {}, {each.row.number: each for each in kept}), subjects)
    for fence in fences:
        if fence.pair is not None or fence.watched is not None:
            fence.count_inside()
    return fences


def watch_again(fence: Fence, kept: KeptFence) -> None:
    """Give the hulls of an alarm what the storage has of them."""
    if fence.watched is not None:
        fence.watched.restore(members_after(kept), kept.delays)
        fence.time = max(fence.time, fence.watched.newest)


def adopt(restored: Restored, subjects: Mapping[str, Subjects]) -> None:
    """Give subjects their restored indexes."""
    for name, index in restored.indexes.items():
        subjects[name].index = index
        subjects[name].follow_state()
        for fence in subjects[name].fences.values():
            subjects[name].note_delays(fence)
    for fence in {fence.number: fence for each in subjects.values() for fence in each.fences.values()}.values():
        fence.count_inside()
        fence.count_expected()


def members_after(kept: KeptFence) -> dict[str, set[Key]]:
    """The subjects that are inside after the last event, by hull; a hull that is near as a whole has none.

    O(those stored + events).
    """
    inside = _by_hull(kept.inside.members)
    for event in kept.events:
        if event.type is EventType.SNAPSHOT:
            inside = _by_hull(event.inside)
        elif event.key is not None and event.type in (EventType.EXIT, EventType.TRANSFER):
            hull, key = event.former
            inside[hull].remove(key)
        if event.key is not None and event.type in (EventType.ENTER, EventType.TRANSFER):
            inside.setdefault(event.hull, set()).add(event.key)
        elif event.type is EventType.BEGIN:
            inside[event.hull] = set()
        elif event.type is EventType.CEASE:
            del inside[event.hull]
    return inside


def _by_hull(members: Iterable[Members]) -> dict[str, set[Key]]:
    """Subjects by hull; those of one hull may come in several pieces."""
    inside: dict[str, set[Key]] = {}
    for each in members:
        inside.setdefault(each.hull, set()).update(key_list(each.keys))
    return inside
