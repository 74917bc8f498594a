"""Fences get back what the storage has of them after a failed commit."""

from collections.abc import Callable

from ...hull_state import HullState
from ...registry import Registry
from ...trip import Trip
from ..index.pair import Pair
from ..model.records import KeptFence
from ..trip.part import FencePart
from .restored import Restored, adopt, restore, watch_again


def reading(
    trip: Trip, part: FencePart
) -> tuple[list[int], Callable[[list[HullState | None], list[KeptFence | None]], Restored | None]]:
    """The numbers of the fences that a trip concerns, and what to make of those that the storage has.

    That is None if the trip was committed.
    """
    touched = part.touched()
    compared = {number for subjects in touched.values() for number in subjects.fences}
    # By a hull that it creates, whose subjects are not touched, it crosses others: they tell whether it was committed.
    crossed = set() if part.crossed is None else set(part.crossed.fences.tolist())
    numbers = sorted(compared | crossed | part.legs.keys() | part.pairs())

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
        if fence.watched is not None:
            fence.watched = fence.watched.renewed(fence.area)
            watch_again(fence, kept)
            fence.count_inside()
    adopt(restored, part.touched())
