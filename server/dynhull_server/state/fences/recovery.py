"""Fences get back what the storage has of them: at a start, and after a failed commit."""

from collections.abc import Callable, Mapping, Sequence

from ..hull_state import HullState
from ..registry import Registry
from ..trip import Trip
from .fence import Fence
from .pair import Pair
from .part import FencePart
from .records import KeptFence
from .restoring import Restored, restore
from .subjects import Subjects


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
        if config.kind == "other" and fence.area is not None:
            fence.pair = Pair(fence.area, registry.get(config.subjects), config.near)
            fence.pair.look()
        for name in registry.compared(config):
            if name not in subjects:
                subjects[name] = Subjects(registry.get(name))
            subjects[name].fences[fence.number] = fence
            fence.subjects[name] = subjects[name]
        fences.append(fence)
    _adopt(restore(subjects.values(), {}, {each.row.number: each for each in kept}), subjects)
    for fence in fences:
        if fence.pair is not None:
            fence.count_inside()
    return fences


def reading(
    trip: Trip, part: FencePart
) -> tuple[list[int], Callable[[list[HullState | None], list[KeptFence | None]], Restored | None]]:
    """The numbers of the fences that a trip concerns, and what to make of those that the storage has.

    That is None if the trip was committed.
    """
    touched = part.touched()
    numbers = sorted(
        {number for subjects in touched.values() for number in subjects.fences} | part.legs.keys() | part.pairs()
    )

    def restored(states: list[HullState | None], kept: list[KeptFence | None]) -> Restored | None:
        if trip.unknown and trip.landed(states, kept):
            return None
        stored = dict(zip(numbers, kept, strict=True))
        found = {name: state for name, state in zip(trip.legs, states, strict=True) if state is not None}
        there = {number: each for number, each in stored.items() if each is not None}
        return restore(touched.values(), found, there)

    return numbers, restored


def give_back(part: FencePart, restored: Restored, registry: Registry) -> None:
    """Return fences to what the storage has of them: the changes of the trip were not committed."""
    part.undo_created()
    for kept in restored.kept.values():
        fence = registry.fences[kept.row.name]
        fence.restored(kept)
        fence.area = None if kept.row.config.area_hull is None else registry.get(kept.row.config.area_hull)
        if fence.pair is not None and fence.area is not None:
            fence.pair = Pair(fence.area, fence.pair.other, fence.row.config.near)
            fence.pair.look()
            fence.count_inside()
    _adopt(restored, part.touched())


def _adopt(restored: Restored, subjects: Mapping[str, Subjects]) -> None:
    """Give subjects their restored indexes."""
    for name, index in restored.indexes.items():
        subjects[name].index = index
        subjects[name].follow_state()
        for fence in subjects[name].fences.values():
            subjects[name].note_delays(fence)
    for fence in {fence.number: fence for each in subjects.values() for fence in each.fences.values()}.values():
        fence.count_inside()
