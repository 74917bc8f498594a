"""Events as a client receives them, beside those that must be there: every field that follows from what was sent.

The server's clock is not known, so that times are compared with each other, and with the time of the machine.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import inf, nextafter
from typing import Any

from sides import Disk, Point, Shape, apart, edges, squared, turn
from world import GUEST, FenceModel, World, exact

from dynhull_proto.v1 import fence_pb2
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.records import Cause, EventType, FenceEvent, Key, Origin
from dynhull_server.state.records import NO_TIME

# Microseconds after which a subject that stays must have made its event, also on a busy machine.
PATIENT = 30_000_000
# Events that are kept to be compared with those that another watch has seen.
KEPT = 1_000


def must(condition: object, *words: object) -> None:
    """End the torture with these words unless something holds."""
    if not condition:
        raise AssertionError(" ".join(map(str, words)))


# Distances


@dataclass(frozen=True)
class Distance:
    """The distance from an area: the root of `square`, less `less`, both in halves; infinite without a square.

    With `about` it is not promised to the last bit.
    """

    square: Fraction | None
    less: int = 0
    about: bool = False

    def rounds_to(self, value: float) -> bool:
        """Whether that is the double nearest to the distance, or one `about` there."""
        if self.square is None or value == inf:
            return value == inf and self.square is None
        if self.about:
            return abs(Fraction(2 * value) ** 2 - self.square) <= self.square / 10**12
        bounds = [(Fraction(value) + Fraction(nextafter(value, to))) / 2 for to in (-inf, inf)]
        least, most = (2 * bound + self.less for bound in bounds)
        return value >= 0 and (least <= 0 or least**2 <= self.square) and self.square <= most**2


def distance(shape: Shape, p: Point, *, closed: bool) -> Distance:
    """The distance of a point from an area; of an open area without inner points there is nothing to be near to."""
    if isinstance(shape, Disk):
        if not shape.radius and not closed:
            return Distance(None)
        if shape.holds(p, closed=True):
            return Distance(Fraction(0))
        return Distance(Fraction(squared(p, shape.center)), shape.radius)
    if not shape.polygons or (not closed and all(len(exterior) < 3 for exterior, *_ in shape.polygons)):
        return Distance(None)
    if shape.holds(p, closed=True):
        return Distance(Fraction(0))
    return Distance(min(_from_segment(p, a, b) for a, b in shape.boundary()))


def _from_segment(p: Point, a: Point, b: Point) -> Fraction:
    along = (p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])
    if 0 < along < squared(a, b):
        return Fraction(turn(a, b, p) ** 2, squared(a, b))
    return Fraction(min(squared(p, a), squared(p, b)))


def between(one: Sequence[Point], other: Sequence[Point]) -> Distance:
    """The distance of two hulls, given by their corners."""
    if not one or not other:
        return Distance(None)
    if not apart(one, other, 0):
        return Distance(Fraction(0))
    ways = [(p, edge) for p in one for edge in edges(other)] + [(p, edge) for p in other for edge in edges(one)]
    return Distance(min(_from_segment(p, a, b) for p, (a, b) in ways), about=True)


# What must be there


@dataclass(frozen=True)
class Expectation:
    """An event of the model, and what the model leaves out.

    Attributes:
        event: the event; its sequence does not count stays.
        distance: the distance of the subject, or of two hulls; None where the event has none.
        inside: who is inside, in a snapshot.
    """

    event: FenceEvent
    distance: Distance | None
    inside: frozenset[tuple[str, Key]]


class ToldWorld(World):
    """A world that keeps what each event must say."""

    def __init__(self) -> None:
        super().__init__()
        self.expected: dict[str, list[Expectation]] = {}
        self.event_times: dict[tuple[str, str], int] = {}
        self.places: dict[tuple[str, int], dict[str, Point]] = {}

    def forget(self) -> None:
        """All events so far have been compared: forget the revisions before the present ones."""
        for expected in self.expected.values():
            expected.clear()
        self.places = {
            (name, revision): places
            for (name, revision), places in self.places.items()
            if revision == self.revisions[name]
        }

    def committed(self, request: Any) -> None:
        """Take in a request, and what follows from it."""
        super().committed(request)
        for name, fence in self.fences.items():
            fence.events.clear()
            self.expected.setdefault(name, [])

    def _apply(self, part: Write) -> None:
        super()._apply(part)
        batch = part.batch
        if isinstance(batch, KeyedBatch):
            self.event_times |= {(part.name, key): part.arrived for key in batch.keys}
            self.places[part.name, self.revisions[part.name]] = dict(self.positions[part.name])

    def _expire(self, name: str, time: int) -> None:
        super()._expire(name, time)
        self.places[name, self.revisions[name]] = dict(self.positions[name])

    def _tell(self, fence: FenceModel, *about: Any, **more: Any) -> None:
        super()._tell(fence, *about, **more)
        event, config = fence.events[-1], fence.config
        far: Distance | None = None
        if event.type in (EventType.BEGIN, EventType.CEASE):
            far = between(self.corners(config.area_hull), self.corners(config.subjects))
        elif event.position is not None and event.key is not None:
            far = distance(self.shape(config, str(event.key)), exact(event.position), closed=config.closed)
        event_time = NO_TIME
        if event.position is not None and event.key is not None:
            event_time = self.event_times[event.hull, str(event.key)]
        inside = frozenset(fence.inside) if event.type is EventType.SNAPSHOT else frozenset()
        name = next(name for name, each in self.fences.items() if each is fence)
        told = Expectation(event._replace(event_time=event_time), far, inside)
        self.expected.setdefault(name, []).append(told)


# What is there


@dataclass
class Reader:
    """Compares the events of one fence, from its creation on, with those that must be there.

    Args:
        prefix: before the names of hulls.
        dwell: microseconds after which a subject that stays makes an event, 0 for never.
    """

    prefix: str
    dwell: int
    last: int = 0
    time: int = 0
    compared: int = 0
    stays: int = 0
    since: dict[tuple[str, Key], int | None] = field(default_factory=dict)
    kept: dict[int, fence_pb2.FenceEvent] = field(default_factory=dict)

    def take(self, message: fence_pb2.FenceEvent, world: ToldWorld, expected: list[Expectation], now: int) -> EventType:
        """Take the next event, which was made at the time `now` of the machine or earlier."""
        event = decoded(message, self.prefix)
        must(event.sequence == self.last + 1, "after", self.last, "comes", event)
        must(self.time <= event.time <= now, "the time of", event, "is not between", self.time, "and", now)
        self.last, self.time = event.sequence, event.time
        self.kept[event.sequence] = message
        if event.type is EventType.DWELL:
            self._stay(event, world.places)
            return event.type
        must(self.compared < len(expected), "nothing makes", event)
        must(same(event, expected[self.compared]), event, "is there, and must be", expected[self.compared])
        self.compared += 1
        self._follow(event, expected[self.compared - 1])
        return event.type

    def _stay(self, event: FenceEvent, places: dict[tuple[str, int], dict[str, Point]]) -> None:
        subject = event.hull, event.key
        must(subject in self.since and event.key is not None, "who is not inside makes", event)  # type: ignore[comparison-overlap]
        since = self.since[subject]  # type: ignore[index]
        must(since is not None and since in (0, event.first_time), "since", since, "comes", event)
        must(event.time - event.first_time >= self.dwell, "too early:", event)
        must(event.causes == Cause.TIME and event.position is not None, event)
        there = places.get((event.hull, event.subject_revision), {}).get(str(event.key))
        must(event.hull == GUEST or exact(event.position or ()) == there, "at", there, "is not", event)
        self.since[subject] = None  # type: ignore[index]
        self.stays += 1

    def _follow(self, event: FenceEvent, expected: Expectation) -> None:
        """Record since when subjects are inside: 0 if it is not known, None if their event has been made."""
        if event.type is EventType.SNAPSHOT:
            self.since = dict.fromkeys(expected.inside, event.time)
        elif event.key is not None and event.type is EventType.ENTER:
            must((event.hull, event.key) not in self.since, "inside already:", event)
            self.since[event.hull, event.key] = event.time
        elif event.key is not None and event.type is EventType.TRANSFER:
            must(event.former in self.since, "not inside:", event)
            must((event.hull, event.key) not in self.since, "inside already:", event)
            self.since[event.hull, event.key] = self.since.pop(event.former)
        elif event.key is not None and event.type is EventType.EXIT:
            must(event.former in self.since, "not inside:", event)
            since = self.since.pop(event.former)
            late = self.dwell and since is not None and since and event.time - since > self.dwell + PATIENT
            must(not late, "it has made no event of its stay since", since, event)

    def forget(self) -> None:
        """All events so far have been compared: keep the newest, for comparison with what was seen at once."""
        self.compared = 0
        for sequence in list(self.kept)[:-KEPT]:
            del self.kept[sequence]

    def waiting(self) -> list[tuple[str, Key]]:
        """Who has not made the event of its stay."""
        return [subject for subject, since in self.since.items() if self.dwell and since is not None]


def same(event: FenceEvent, expected: Expectation) -> bool:
    """Whether an event is the expected one; its sequence and time are compared elsewhere."""
    other = expected.event
    far = expected.distance
    if (event.distance is None) != (far is None) or (far is not None and not far.rounds_to(event.distance or 0.0)):
        return False
    members = {(each.hull, key) for each in event.inside for key in each.keys}
    expected_causes = {other.causes}
    if event.type in (EventType.BEGIN, EventType.CEASE):
        if not other.causes:  # who has moved, the model does not know
            expected_causes = {Cause.AREA, Cause.MOVED, Cause.AREA | Cause.MOVED}
    elif not other.causes:  # the others have moved, of whom the subject itself is not one
        expected_causes = {Cause.AREA}
    known = other._replace(
        sequence=event.sequence, time=event.time, distance=event.distance, inside=event.inside, causes=event.causes
    )
    return event == known and event.causes in expected_causes and members == expected.inside


@dataclass(frozen=True)
class Inside:
    """The keys of one hull in a snapshot."""

    hull: str
    keys: list[str]


def decoded(message: fence_pb2.FenceEvent, prefix: str) -> FenceEvent:
    """An event, with the names of hulls as the model has them."""
    causes = sum(1 << cause - 1 for cause in message.causes)
    positions = [
        (each.x, each.y) if message.HasField(name) else None  # type: ignore[arg-type]
        for name, each in (("position", message.position), ("previous_position", message.previous_position))
    ]
    times = [
        each.ToMicroseconds() if message.HasField(name) else NO_TIME  # type: ignore[arg-type]
        for name, each in (("event_time", message.event_time), ("first_time", message.first_time))
    ]
    return FenceEvent(
        message.sequence,
        EventType(message.type),
        causes,
        message.subject_hull.removeprefix(prefix),
        message.string_key if message.WhichOneof("key") else None,
        message.subject_revision,
        message.area_revision,
        positions[0],
        positions[1],
        message.distance if message.HasField("distance") else None,
        times[0],
        message.time.ToMicroseconds(),
        times[1],
        tuple(Inside(each.hull.removeprefix(prefix), list(keys_of(each.keys))) for each in message.inside),  # type: ignore[arg-type]
        Origin(message.previous_hull.removeprefix(prefix), message.previous_hull_revision)
        if message.previous_hull
        else None,
    )


def keys_of(keys: Any) -> Iterator[str]:
    """The keys of a message, packed or not."""
    if keys.strings:
        yield from keys.strings
        return
    at = 0
    for length in keys.lengths:
        yield keys.text[at : at + length].decode()
        at += length
