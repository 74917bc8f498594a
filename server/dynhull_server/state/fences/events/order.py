"""Whether the events of a fence follow from each other, and lead to its state."""

from collections.abc import Iterable, Iterator

from dynhull.keys import key_list

from ...records import NO_TIME, Keys
from ..model.faults import FenceFault
from ..model.records import Consumer, EventType, FenceEvent, Key, Members, Subject

# Faults of one fence, at most: one fault can make all later events wrong.
MOST_FAULTS = 100
KEYS_TOGETHER = 8192
BEGINS = {EventType.ENTER: True, EventType.BEGIN: True, EventType.EXIT: False, EventType.CEASE: False}
WORDS = {True: "inside", False: "outside"}


class EventOrder:
    """Takes in the events of a fence in order.

    Args:
        fence: the name of the fence.
        after: the sequence of the event before the first.
        inside: who was inside then; None if that is not known.

    Attributes:
        faults: what is wrong.
        last: the sequence of the last event.
        balance: how many more have entered than left; None if that is not known.
    """

    def __init__(self, fence: str, after: int = 0, inside: Iterable[Members] | None = None) -> None:
        self.faults: list[FenceFault] = []
        self.last = after
        self.balance: int | None = 0
        self._fence = fence
        self._inside: dict[Subject | str, bool] = {}
        self._is_complete = inside is not None
        self._time = NO_TIME
        for subject in subjects_of(inside or ()):
            self._inside[subject] = True

    def dropped(self, first: int) -> None:
        """Take note that the events before a sequence are no longer kept."""
        if first > self.last + 1:
            self.last = first - 1
            self._inside.clear()
            self._is_complete, self.balance = False, None

    def take(self, events: Iterable[FenceEvent]) -> None:
        """Take in the next events."""
        for event in events:
            if event.sequence != self.last + 1:
                self._blame(event, f"sequence {self.last + 1}", f"sequence {event.sequence}")
            self.last = event.sequence
            if event.time < self._time:
                self._blame(event, f"a time of {self._time} or later", f"the time {event.time}")
            self._time = event.time
            self._follow(event)

    def finish(
        self, inside: Iterable[Subject | str], last: int, consumers: Iterable[Consumer] = ()
    ) -> list[FenceFault]:
        """What is wrong.

        Args:
            inside: who is inside after the last event: subjects, and the name of a hull that is near as a whole.
            last: the sequence of the last event.
            consumers: the consumers.
        """
        if self.last != last:
            self._note(FenceFault(self._fence, "", None, 0, f"{last} as the last event", f"event {self.last}"))
        now = set(inside)
        for subject, entered in self._inside.items():
            if entered != (subject in now):
                self._blame_state(subject, WORDS[entered], WORDS[not entered])
        if self._is_complete:
            for subject in now - self._inside.keys():
                self._blame_state(subject, WORDS[False], WORDS[True])
        for consumer in consumers:
            if consumer.acknowledged > last:
                words = f"{consumer.acknowledged} acknowledged by consumer {consumer.name!r}"
                self._note(FenceFault(self._fence, "", None, 0, f"at most {last} acknowledged", words))
        return self.faults

    def inside(self) -> Iterator[Subject | str]:
        """Who is inside, if that was known at the beginning."""
        return (subject for subject, inside in self._inside.items() if inside)

    def _follow(self, event: FenceEvent) -> None:
        if event.type is EventType.SNAPSHOT:
            self._inside = dict.fromkeys(subjects_of(event.inside), True)
            self._is_complete, self.balance = True, None
            return
        if event.type is EventType.CLOSED:
            return
        subject = event.hull if event.key is None else (event.hull, event.key)
        former = subject if event.key is None else event.former
        before = self._inside.get(former, False if self._is_complete else None)
        after = BEGINS.get(event.type)
        must_be = event.type in (EventType.DWELL, EventType.TRANSFER, EventType.ARRIVED) if after is None else not after
        if before not in (None, must_be):
            self._blame(event, f"a subject that is {WORDS[must_be]}", f"{event.type.name.lower()} of one that is not")
        if former != subject and (event.type is EventType.TRANSFER or after is not None):
            if self._inside.get(subject):
                self._blame(event, f"a subject that is {WORDS[False]}", "a transfer to one that is inside already")
            self._inside[former], self._inside[subject] = False, event.type is EventType.TRANSFER
        if after is not None:
            self._inside[subject] = after
            if self.balance is not None:
                self.balance += 1 if after else -1

    def _blame(self, event: FenceEvent, expected: str, found: str) -> None:
        self._note(FenceFault(self._fence, event.hull, event.key, event.sequence, expected, found))

    def _blame_state(self, subject: Subject | str, expected: str, found: str) -> None:
        hull, key = (subject, None) if isinstance(subject, str) else subject
        self._note(FenceFault(self._fence, hull, key, 0, f"{expected}, as the events say", found))

    def _note(self, fault: FenceFault) -> None:
        if len(self.faults) < MOST_FAULTS:
            self.faults.append(fault)


def subjects_of(members: Iterable[Members]) -> Iterator[Subject | str]:
    """The subjects, and the names of hulls that are near as wholes."""
    for each in members:
        if not len(each.keys):
            yield each.hull
        for key in one_by_one(each.keys):
            yield each.hull, key


def one_by_one(keys: Keys) -> Iterator[Key]:
    """The keys, some unpacked at a time: a list of many keeps other threads waiting."""
    for first in range(0, len(keys), KEYS_TOGETHER):
        yield from key_list(keys[first : first + KEYS_TOGETHER])
