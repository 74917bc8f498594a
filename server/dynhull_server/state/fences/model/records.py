"""What the storage keeps of fences: their settings, events, consumers, and who is inside."""

from dataclasses import dataclass, field
from enum import IntEnum, IntFlag
from typing import NamedTuple

from ...records import NO_TIME, Keys, Times
from .config import FenceConfig

Key = str | int
Subject = tuple[str, Key]  # the name of its hull, and its key
Position = tuple[float, float]


class EventType(IntEnum):
    """What happened; the numbers are those of the contract, and stored."""

    ENTER = 1
    EXIT = 2
    CROSS = 3
    DWELL = 4
    BEGIN = 5
    CEASE = 6
    SNAPSHOT = 7
    CLOSED = 8
    TRANSFER = 9
    MISSING = 10
    ARRIVED = 11


class Cause(IntFlag):
    """Why it happened: a set. The first five are those of `dynhull.Crossings`."""

    MOVED = 1
    AREA = 2
    APPEARED = 4
    REMOVED = 8
    EXPIRED = 16
    CREATED = 32
    CHANGED = 64
    TIME = 128


class Members(NamedTuple):
    """Some keys of one hull, ascending, and the revision of the hull.

    Attributes:
        since: since when each key waits for its dwell event, NO_TIME if it has made it; None if that is not known.
    """

    hull: str
    keys: Keys
    revision: int
    since: Times | None = None


class AlarmStanding(NamedTuple):
    """What else an alarm has about a hull.

    Attributes:
        previous: the measure before the condition began to hold; None where there was none.
        acknowledged: when somebody has acknowledged the alarm, NO_TIME for nobody.
        muted: until when it is muted, NO_TIME for not at all.
    """

    previous: float | None = None
    acknowledged: int = NO_TIME
    muted: int = NO_TIME


class Delay(NamedTuple):
    """A change of side that is no event yet. Or what an alarm has about a hull, whose key is then empty.

    Or, of the hull without a name, what a fence knows of a key that it expects inside: `enters` says that it was
    reported missing, and `since` when; otherwise `since` is since when it is outside, NO_TIME if it is inside. Under
    the empty key `since` is up to when deadlines have passed.

    Attributes:
        enters: whether the subject is on the side of the area, though it is reported outside; or the opposite. Of an
            alarm, whether the condition holds, but not yet for long enough.
        since: when it changed its side, in microseconds since 1970 by the server's clock. Of an alarm, since when the
            condition holds, NO_TIME if it does not.
        reports: the number of its reports since then, that one included if it was its own; 0 where they do not count.
            Of an alarm, the revision with which the condition began to hold.
        causes: why it changed its side.
        standing: of an alarm, what else is known.
        doubt: whether no position on that side was certain so far, with `by_accuracy`; `causes` are then those of the
            last one.
    """

    enters: bool
    since: int
    reports: int
    causes: int
    standing: AlarmStanding | None = None
    doubt: bool = False


class Origin(NamedTuple):
    """The hull that a subject comes from, and the revision that removed it there."""

    hull: str
    revision: int


class FenceEvent(NamedTuple):
    """One event.

    Attributes:
        sequence: counted per fence from 1.
        type: what happened.
        causes: why.
        hull: the name of the subject's hull; empty where there is no subject.
        key: the key of the subject, or None.
        subject_revision, area_revision: the revisions of the two hulls; 0 where there is none.
        position, previous: the position of the subject, and that at the revision before; None where it has none.
        distance: the distance from the position to the area; None if the subject is gone.
        event_time: the time of the position, NO_TIME if it has none.
        time: when the event was made, in microseconds since 1970 by the server's clock.
        first_time: since when the subject has been inside, in a dwell event; since when it has been outside, in one
            that it is missing by its age; when it was missing, in one that it has arrived; when it changed its side, in
            one that was delayed; otherwise NO_TIME.
        inside: the subjects that were inside, in a snapshot and at the end.
        origin: where the subject comes from, if the same batch has moved it from another hull; `previous` is there.
    """

    sequence: int
    type: EventType
    causes: int
    hull: str
    key: Key | None
    subject_revision: int
    area_revision: int
    position: Position | None
    previous: Position | None
    distance: float | None
    event_time: int
    time: int
    first_time: int = NO_TIME
    inside: tuple[Members, ...] = ()
    origin: Origin | None = None

    @property
    def former(self) -> Subject:
        """The subject as it was called before."""
        assert self.key is not None  # callers ask for those of subjects
        return self.hull if self.origin is None else self.origin.hull, self.key


class Waits(NamedTuple):
    """Since when subjects count that were inside when the fence began to ask for how long.

    Attributes:
        sequence: the sequence of the last event then.
        time: the time of the server's clock, in microseconds since 1970.
    """

    sequence: int = 0
    time: int = 0


NO_WAITS = Waits()


@dataclass(frozen=True, slots=True)
class FenceRow:
    """A fence as stored.

    Attributes:
        number: its number, never used for another fence or hull.
        name: its name.
        uid: distinguishes it from other fences of its name.
        created: seconds since 1970.
        config: its settings.
        waits: since when subjects count that were inside before.
    """

    number: int
    name: str
    uid: str
    created: float
    config: FenceConfig
    waits: Waits = NO_WAITS


@dataclass(frozen=True, slots=True)
class Consumer:
    """A durable reader of a fence.

    Attributes:
        name: its name.
        acknowledged: the last sequence it has acknowledged.
        lost: the number of events that were dropped before it acknowledged them.
    """

    name: str
    acknowledged: int = 0
    lost: int = 0


@dataclass(frozen=True, slots=True)
class Inside:
    """The subjects that were inside after an event.

    Attributes:
        sequence: the sequence of that event.
        members: the subjects, by hull.
        time: the time of that event, which is perhaps no longer kept; NO_TIME if it is not known.
    """

    sequence: int = 0
    members: tuple[Members, ...] = ()
    time: int = NO_TIME


@dataclass(slots=True)
class KeptFence:
    """A fence in the storage.

    Attributes:
        row: the fence.
        inside: the subjects that were inside after an event.
        events: the events after that one, all of them.
        first: the sequence of the oldest event that is kept; that of the next event if there is none.
        consumers: its consumers.
        delays: the changes of side that are no events yet.
    """

    row: FenceRow
    inside: Inside = field(default_factory=Inside)
    events: list[FenceEvent] = field(default_factory=list)
    first: int = 1
    consumers: dict[str, Consumer] = field(default_factory=dict)
    delays: dict[Subject, Delay] = field(default_factory=dict)

    @property
    def last(self) -> int:
        """The sequence of the last event, 0 before the first."""
        return self.events[-1].sequence if self.events else self.inside.sequence


# Changes of fences, committed like those of hulls.


@dataclass(frozen=True, slots=True)
class AddFence:
    """A new fence, and who is inside of it."""

    row: FenceRow
    inside: Inside


@dataclass(frozen=True, slots=True)
class ChangeFence:
    """New settings of a fence."""

    row: FenceRow


@dataclass(frozen=True, slots=True)
class DropFence:
    """The deletion of a fence with its events and consumers."""

    number: int


@dataclass(frozen=True, slots=True)
class PutDelays:
    """Delays of subjects, new or changed; None for those that have ended."""

    number: int
    delays: dict[Subject, Delay | None]


@dataclass(frozen=True, slots=True)
class DropEvents:
    """The deletion of the events before the sequence `first`; perhaps some of them stay."""

    number: int
    first: int


@dataclass(frozen=True, slots=True)
class PutConsumer:
    """A consumer, new or changed."""

    number: int
    consumer: Consumer


@dataclass(frozen=True, slots=True)
class DropConsumer:
    """The deletion of a consumer."""

    number: int
    name: str
