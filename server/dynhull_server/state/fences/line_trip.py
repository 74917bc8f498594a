"""A trip on hulls with fences: its batches, and the events that follow from them, are committed together."""

from collections.abc import Iterable

from ..changes import Change
from ..events import Request
from ..hull_state import HullState
from ..trip import Leg
from .event_block import EventBlock, block_of, joined
from .fence_leg import FenceLeg
from .fence_work import FenceWork
from .fenced_trip import Ground
from .records import AppendEvents, KeptFence
from .subjects import Subjects


class LineTrip(FenceWork):
    """Runs requests, and says what is to be committed, and what is left if that fails.

    Args:
        legs: the hulls that the requests name.
        requests: the requests to run.
        now: seconds on a monotonic clock.
        pause: seconds before the storage is examined again.
        ground: what there is of fences.

    Attributes:
        events: all events that it has made, also the last ones of fences that it deletes; None for none.
        examined: the numbers of the fences that are examined after a failure.
    """

    __slots__ = ("events", "examined")

    def __init__(self, legs: list[Leg], requests: list[Request], now: float, pause: float, ground: Ground) -> None:
        super().__init__(legs, requests, now, pause, ground)
        self.events: EventBlock | None = None
        self.examined: list[int] = []

    def run(self) -> None:
        """Run the requests."""
        super().run()
        self.log.settle()
        self.events = self._block(self.fence_legs.values())
        if self.left:
            del self.requests[-len(self.left) :]

    def changes(self) -> list[Change]:
        """The changes to commit."""
        legs = self.fence_legs.values()
        stored = self.events
        if not legs:  # nothing but crossings
            of_events = [] if stored is None else [AppendEvents(stored)]
            return [*super().changes(), *of_events]
        if any(leg.deleted for leg in legs):
            stored = self._block([leg for leg in legs if not leg.deleted])
        return [
            *(change for leg in self.legs for change in leg.changes()),
            *(change for leg in legs for change in leg.settings()),
            *([] if stored is None else [AppendEvents(stored)]),
            *(change for leg in legs for change in leg.changes()),
        ]

    def _block(self, legs: Iterable[FenceLeg]) -> EventBlock | None:
        """The events of crossings, then those of these legs; None for none."""
        crossed, of_legs = self.log.block(), {leg.fence.number: leg.events for leg in legs if leg.events}
        found = [crossed] if crossed is not None else []
        if of_legs:
            found.append(block_of(of_legs))
        return joined(found) if found else None

    def touched(self) -> dict[str, Subjects]:
        """The hulls by name whose subjects may differ from what the storage has, if the trip is not committed.

        An examination reads all hulls of the trip anew, also those that it has not changed.
        """
        touched: dict[str, Subjects] = {}
        for line in self.lines:
            for name in self._by_name:
                if name in line.subjects:
                    touched[name] = line.subjects[name]
                if name in line.areas:
                    for fence in line.areas[name].fences.values():
                        touched |= fence.subjects
        for leg in self.fence_legs.values():
            if not leg.created:
                touched |= leg.fence.subjects
        for each in self.legs:
            if each.before is None:  # a hull that is created has none in the storage
                touched.pop(each.name, None)
        return touched

    def landed(self, states: list[HullState | None], fences: list[KeptFence | None]) -> bool:
        """Whether the trip was committed, given what the storage has of its hulls and the examined fences."""
        found = dict(zip(self.examined, fences, strict=True))
        if not super().landed(states, fences):
            return False
        told = self.log.told
        lasts = {} if told is None else dict(zip(told.fences.tolist(), told.lasts.tolist(), strict=True))
        kept = ((found[number], last) for number, last in lasts.items() if number not in self.fence_legs)
        return all(leg.landed(found[number]) for number, leg in self.fence_legs.items()) and all(
            each is not None and each.last == last for each, last in kept
        )

    def pairs(self) -> set[int]:
        """The numbers of the fences that compare its hulls as wholes."""
        return {fence.number for line in self.lines for name in self._by_name for fence in line.pairs.get(name, ())}

    def dismiss(self) -> None:
        """Forget the subjects of hulls that it has deleted."""
        for leg in self.legs:
            if leg.before is not None and leg.after is None:
                for line in self.lines:
                    line.dismiss(leg.name)

    def undo_created(self) -> None:
        """Forget fences and hulls that were not created after all."""
        for each in self.legs:
            if each.before is None:
                for line in self.lines:
                    line.dismiss(each.name)
        for number in [number for number, leg in self.fence_legs.items() if leg.created]:
            self._drop(self.fence_legs.pop(number).fence)
