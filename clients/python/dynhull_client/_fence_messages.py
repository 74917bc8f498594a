"""Fences and their events, as values."""

from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from dynhull_proto.v1 import fence_pb2, fence_service_pb2
from dynhull_surface.settings import FenceSettings

from ._areas import Area, Prefix, decode_area
from ._keys import KeyTuple, decode_names
from ._settings import decode_settings, documenting_settings
from ._times import decode_time

EventType = Literal[
    "enter",
    "exit",
    "cross",
    "dwell",
    "missing",
    "arrived",
    "transfer",
    "begin",
    "cease",
    "snapshot",
    "closed",
    "lost",
    "progress",
    "unknown",
]
FenceCause = Literal[
    "subject_moved",
    "area_moved",
    "subject_appeared",
    "subject_removed",
    "subject_expired",
    "fence_created",
    "fence_changed",
    "time_passed",
]


def words_of(names: Iterable[tuple[str, int]], prefix: str) -> dict[int, Any]:
    """The words for the numbers on the wire but 0: FENCE_EVENT_TYPE_ENTER is "enter"."""
    return {number: name.removeprefix(prefix).lower() for name, number in names if number}


TYPES: dict[int, EventType] = words_of(fence_pb2.FenceEventType.items(), "FENCE_EVENT_TYPE_")
CAUSES: dict[int, FenceCause] = words_of(fence_pb2.FenceCause.items(), "FENCE_CAUSE_")


@dataclass(frozen=True, slots=True)
class FenceConsumer:
    """A durable reader of a fence.

    Attributes:
        name: its name.
        acknowledged: the last acknowledged sequence; 0 before the first.
        backlog: the number of events that are kept and not acknowledged.
        oldest: the time of the oldest event in the backlog; None if there is none.
        lost: the number of events that were dropped before this consumer acknowledged them.
    """

    name: str
    acknowledged: int
    backlog: int
    oldest: datetime | None
    lost: int


@documenting_settings(FenceSettings)
@dataclass(frozen=True, slots=True, kw_only=True)
class Fence(FenceSettings):
    """A fence with its settings, as given to `create_fence`, its counts and its consumers.

    Attributes:
        name: its name.
        area: the name of a hull, a `Circle`, or a tuple of `Polygon`.
        subjects: the name of a keyed hull, or a `Prefix`; None for a fence around another hull.
        other_hull: the hull that is compared as a whole; None for a fence around keys.
        expected: the keys that should be inside; None for none.
        SETTINGS
        created: when it was created.
        uid: differs from that of an earlier or later fence of the same name.
        last_sequence: the sequence of the last event; 0 before the first.
        first_sequence: the sequence of the oldest event that is kept; last_sequence + 1 if none is.
        inside: the number of subjects inside.
        subject_count: the number of keys compared with the area.
        consumers: its durable consumers, by name.
    """

    area: Area
    subjects: str | Prefix | None
    expected: KeyTuple | None
    created: datetime
    uid: str
    last_sequence: int
    first_sequence: int
    inside: int
    subject_count: int
    consumers: tuple[FenceConsumer, ...]


@dataclass(frozen=True, slots=True)
class SubjectsInside:
    """Keys of one hull that are inside a fence, ascending, strings bytewise, at a revision of the hull."""

    hull: str
    keys: KeyTuple
    revision: int


@dataclass(frozen=True, slots=True)
class Inside:
    """The subjects inside a fence, all at one moment, by hull. The events up to `sequence` lead to them."""

    sequence: int
    subjects: tuple[SubjectsInside, ...]

    def __len__(self) -> int:
        return sum(len(each.keys) for each in self.subjects)


@dataclass(frozen=True, slots=True)
class FenceEvent:
    """An event of a fence.

    Attributes:
        type: what happened. "enter" and "exit" of a subject, which alternate; "cross": it passed through the area
            between two positions outside; "dwell": it has been inside for the configured time; "missing": a key that
            should be inside is not at its deadline; "arrived": it is inside after all; "transfer": it was inside as a
            key of `previous_hull` and is inside as a key of `hull`; "begin" and "cease": two hulls intersect or are
            near, or no longer; "snapshot": the subjects that were inside at first; "closed": the fence was deleted.
            "lost": events were dropped before they could be sent; "progress": nothing has happened for a while.
            "unknown": a type that this version of the client does not know.
        sequence: counted per fence from 1, without gaps; of "lost" and "progress", the sequence that they lead to.
        fence: the name of the fence.
        uid: the uid of the fence; with `sequence` it identifies the event.
        cause: why it happened; an event may have several causes.
        hull: the hull of the subject, or the other hull; empty if there is no single one.
        key: the key of the subject; None if there is no single one.
        revision: the revision of the subject's hull; 0 if there is no single one.
        area_revision: the revision of the area's hull; 0 for other areas.
        position: (x, y) of the subject; None if it is gone.
        previous_position: (x, y) at the revision before; None if the subject is new.
        distance: the distance from the position to the area: 0 inside; of "begin" and "cease", that of the hulls. None
            if the subject is gone, infinite if the area is empty.
        event_time: the event time of the position; None if it has none.
        time: when the server made the event; None for "lost" and "progress".
        first_time: with `confirmations` or `min_dwell`, when the subject changed its side; with `by_accuracy` alone,
            since when its position has been on this side, if it was not certain at once; of "dwell", since when it has
            been inside; of "missing" by an age, since when it is outside; of "arrived", when it was missing; None
            otherwise.
        inside: of "snapshot" and "closed", the subjects that were inside, by hull.
        first: of "lost", the first sequence that was dropped; 0 otherwise.
        last: of "lost", the last sequence that was dropped; 0 otherwise.
        conflated: the number of events left out before this one because they cancel each other.
        previous_hull: of a subject of a prefix that one batch has moved from another hull, the name of that one, where
            `previous_position` is; empty otherwise. A list of the subjects inside loses the key of this hull by "exit"
            and "transfer".
        previous_hull_revision: the revision of that hull that has removed the key; 0 otherwise.
        after: the sequence after which a later watch continues behind this event. It is `sequence`, unless events were
            left out of what was sent together: then that of the last one is beyond what was left out, and that of the
            others is None.
    """

    type: EventType
    sequence: int
    fence: str = ""
    uid: str = ""
    cause: frozenset[FenceCause] = frozenset()
    hull: str = ""
    key: str | int | None = None
    revision: int = 0
    area_revision: int = 0
    position: tuple[float, float] | None = None
    previous_position: tuple[float, float] | None = None
    distance: float | None = None
    event_time: datetime | None = None
    time: datetime | None = None
    first_time: datetime | None = None
    inside: tuple[SubjectsInside, ...] = ()
    first: int = 0
    last: int = 0
    conflated: int = 0
    previous_hull: str = ""
    previous_hull_revision: int = 0
    after: int | None = None


def decode_fence(message: fence_pb2.Fence) -> Fence:
    """A fence."""
    config = message.config
    return Fence(
        name=message.name,
        area=decode_area(config),
        subjects=_subjects(config),
        other_hull=config.other_hull if config.HasField("other_hull") else None,
        expected=decode_names(config.expected) if config.HasField("expected") else None,
        **decode_settings(FenceSettings, config),
        created=decode_time(message.create_time),
        uid=message.uid,
        last_sequence=message.last_sequence,
        first_sequence=message.first_sequence,
        inside=message.inside_count,
        subject_count=message.subject_count,
        consumers=tuple(map(decode_consumer, message.consumers)),
    )


def decode_consumer(message: fence_pb2.FenceConsumer) -> FenceConsumer:
    """A durable consumer."""
    oldest = decode_time(message.oldest_event_time) if message.HasField("oldest_event_time") else None
    return FenceConsumer(message.name, message.acknowledged_sequence, message.backlog, oldest, message.lost)


def decode_inside(parts: list[fence_service_pb2.ReadInsideResponse]) -> Inside:
    """The subjects inside, received in one or more parts; the keys of one hull may be in several."""
    found: dict[str, SubjectsInside] = {}
    for part in parts:
        for each in map(_subjects_inside, part.subjects):
            before = found.get(each.hull)
            keys = each.keys if before is None else (*before.keys, *each.keys)
            found[each.hull] = SubjectsInside(each.hull, keys, each.revision)
    return Inside(parts[0].sequence, tuple(found.values()))


def decode_fence_event(
    message: fence_pb2.FenceEvent, fence: str, uid: str, conflated: int, after: int | None
) -> FenceEvent:
    """An event of a fence."""
    chosen = message.WhichOneof("key")
    return FenceEvent(
        type=TYPES.get(message.type, "unknown"),
        sequence=message.sequence,
        fence=fence,
        uid=uid,
        cause=frozenset(CAUSES[each] for each in message.causes if each in CAUSES),
        hull=message.subject_hull,
        key=None if chosen is None else getattr(message, chosen),
        revision=message.subject_revision,
        area_revision=message.area_revision,
        position=_position(message.position) if message.HasField("position") else None,
        previous_position=_position(message.previous_position) if message.HasField("previous_position") else None,
        distance=message.distance if message.HasField("distance") else None,
        event_time=decode_time(message.event_time) if message.HasField("event_time") else None,
        time=decode_time(message.time),
        first_time=decode_time(message.first_time) if message.HasField("first_time") else None,
        inside=tuple(map(_subjects_inside, message.inside)),
        conflated=conflated,
        previous_hull=message.previous_hull,
        previous_hull_revision=message.previous_hull_revision,
        after=after,
    )


def _subjects(config: fence_pb2.FenceConfig) -> str | Prefix | None:
    if config.HasField("subject_prefix"):
        return Prefix(config.subject_prefix)
    return config.subject_hull if config.HasField("subject_hull") else None


def _subjects_inside(message: fence_pb2.FenceSubjects) -> SubjectsInside:
    return SubjectsInside(message.hull, decode_names(message.keys), message.revision)


def _position(message: fence_pb2.FencePosition) -> tuple[float, float]:
    return message.x, message.y
