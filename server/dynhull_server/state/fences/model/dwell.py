"""Who has been inside of a fence for how long, and has not made its event so far."""

from collections import OrderedDict
from collections.abc import Iterable
from itertools import islice

import numpy as np

from dynhull.keys import key_list

from ...records import NO_TIME, Keys, Times
from .records import EventType, FenceEvent, KeptFence, Members, Subject, Waits


class Dwelling:
    """The subjects inside that wait for their event, with the times since when they count.

    It follows from committed events alone, so that a restart finds it again in the storage.

    Args:
        waits: since when subjects count that were inside before.
        members: who is inside already, and waits. O(n log n).
    """

    def __init__(self, waits: Waits, members: Iterable[Members] = ()) -> None:
        self._waits = waits
        found: list[tuple[int, Subject]] = []
        for each in members:
            times = [waits.time] * len(each.keys) if each.since is None else each.since.tolist()
            found += [
                (time, (each.hull, key))
                for key, time in zip(key_list(each.keys), times, strict=True)
                if time != NO_TIME
            ]
        # By numbers in the order of times: of one fence the time of events never goes back. A subject that goes over
        # to another hull keeps its number.
        self._waiting: OrderedDict[int, tuple[int, Subject]] = OrderedDict()
        self._numbers: dict[Subject, int] = {}
        self._next = 0
        for time, subject in sorted(found, key=lambda each: each[0]):
            self._begin(subject, time)

    @property
    def first(self) -> int | None:
        """Since when the one counts that has waited longest; None if nobody waits."""
        return next((time for time, _ in self._waiting.values()), None)

    def first_after(self, time: int) -> int | None:
        """Since when the one counts that has waited longest, of those since after a time. O(others)."""
        return next((since for since, _ in self._waiting.values() if since > time), None)

    def __len__(self) -> int:
        """The number of subjects that wait."""
        return len(self._waiting)

    def copy(self) -> "Dwelling":
        """Another one with the same subjects. O(n)."""
        other = Dwelling(self._waits)
        other._waiting, other._numbers, other._next = self._waiting.copy(), self._numbers.copy(), self._next
        return other

    def follow(self, events: Iterable[FenceEvent]) -> None:
        """Take in the next events."""
        for event in events:
            before = event.sequence <= self._waits.sequence
            time = self._waits.time if before else event.time
            if event.type is EventType.SNAPSHOT:
                for each in event.inside:
                    for key in key_list(each.keys):
                        self._begin((each.hull, key), time)
            elif event.key is not None and event.type is EventType.ENTER:
                self._begin((event.hull, event.key), time)
            elif event.key is not None and event.type is EventType.TRANSFER:
                self._rename(event.former, (event.hull, event.key))
            elif event.key is not None and (
                event.type is EventType.EXIT or (event.type is EventType.DWELL and not before)
            ):
                self._end(event.former)

    def subjects(self) -> Iterable[Subject]:
        """Those that wait."""
        return self._numbers.keys()

    def due(self, until: int, most: int) -> list[tuple[Subject, int]]:
        """At most that many subjects that have counted since `until` or longer, with their times."""
        found = []
        for time, subject in islice(self._waiting.values(), most):
            if time > until:
                break
            found.append((subject, time))
        return found

    def times(self, hull: str, keys: Keys) -> Times:
        """Since when keys of a hull count; NO_TIME for those that have made their event."""
        numbers = (self._numbers.get((hull, key)) for key in key_list(keys))
        return np.array([NO_TIME if each is None else self._waiting[each][0] for each in numbers], np.int64)

    def _begin(self, subject: Subject, time: int) -> None:
        self._end(subject)
        self._numbers[subject] = self._next
        self._waiting[self._next] = time, subject
        self._next += 1

    def _rename(self, former: Subject, subject: Subject) -> None:
        number = self._numbers.pop(former, None)
        if number is not None:
            self._numbers[subject] = number
            self._waiting[number] = self._waiting[number][0], subject

    def _end(self, subject: Subject) -> None:
        number = self._numbers.pop(subject, None)
        if number is not None:
            del self._waiting[number]


def dwelling_after(kept: KeptFence) -> Dwelling | None:
    """Who waits after the last stored event; None for a fence that does not ask how long. O(stored + events)."""
    if not kept.row.config.dwell:
        return None
    inside = kept.inside
    members: Iterable[Members] = inside.members
    if inside.sequence <= kept.row.waits.sequence:  # what they had made of it then no longer counts
        members = [each._replace(since=None) for each in members]
    dwelling = Dwelling(kept.row.waits, members)
    dwelling.follow(kept.events)
    return dwelling
