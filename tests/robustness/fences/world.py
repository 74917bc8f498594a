"""A model of hulls with keys and of fences, and random requests to them."""

import random
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from sides import Disk, Point, Rings, Shape, apart, hull, shape_of_hull

from dynhull.keys import PackedKeys
from dynhull_server.state.batch import Batch, KeyedBatch, Write
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, HullArea, PolygonArea
from dynhull_server.state.fences.model.records import Cause, EventType, FenceEvent, Origin
from dynhull_server.state.fences.model.requests import Acknowledge, CreateFence, DeleteFence, PassTime, ReplaceFence
from dynhull_server.state.records import NO_TIME, HullSettings
from dynhull_server.state.requests import Birth, CreateHull, DeleteHull, Expire, WriteBatch, WriteTogether

KEYED, ZONE = ("k/a", "k/b", "k/c"), "zone"
GUEST = "k/c"  # it comes and goes
HULLS = (*KEYED, ZONE)
KEYS = [f"é{i}" for i in range(8)]
FENCES = ["f0", "f1", "f2", "f3", "f4"]
TICK = 100_000
NONE = np.empty((0, 2))
NO_KEYS = PackedKeys(b"", b"")
SHAPES = [
    [[(0, 0), (4, 0), (4, 4), (0, 4)]],
    [[(0, 0), (8, 0), (8, 8), (0, 8)], [(2, 2), (6, 2), (6, 6), (2, 6)]],
    [[(1, 1), (5, 1), (1, 5)]],
    [[(0, 0), (8, 0), (4, 3), (8, 8), (0, 8), (3, 4)]],
]

Positions = dict[str, dict[str, Point]]
Subject = tuple[str, str]


def halves(length: float) -> int:
    """A length in halves: all coordinates and lengths are multiples of a half."""
    doubled = int(2 * length)
    assert doubled == 2 * length
    return doubled


def exact(xy: Iterable[float]) -> Point:
    x, y = xy
    return halves(x), halves(y)


@cache
def fixed_shape(area: CircleArea | PolygonArea) -> Shape:
    if isinstance(area, CircleArea):
        return Disk(exact((area.x, area.y)), halves(area.radius))
    polygons = ([np.frombuffer(ring).reshape(-1, 2).tolist() for ring in polygon] for polygon in area.polygons)
    return Rings(tuple(tuple(tuple(map(exact, ring)) for ring in polygon) for polygon in polygons))


@dataclass
class Delayed:
    """A change of side that is no event yet."""

    since: int
    reports: int
    cause: int


@dataclass
class FenceModel:
    """A fence: its settings, who is inside as its events say and by its area alone, and its events."""

    config: FenceConfig
    uid: str
    inside: set[Subject] = field(default_factory=set)
    beyond: set[Subject] = field(default_factory=set)
    delays: dict[Subject, Delayed] = field(default_factory=dict)
    stays: dict[Subject, int] = field(default_factory=dict)  # since when who has not made a dwell event
    time: int = NO_TIME
    near: bool = False
    events: list[FenceEvent] = field(default_factory=list)
    last: int = 0
    consumers: dict[str, int] = field(default_factory=dict)

    def take_along(self, source: Subject, to: Subject) -> bool:
        """A subject has another name. Returns whether it is inside, as the events say."""
        inside = source in self.inside
        for known in (self.inside, self.beyond):
            if source in known:
                known.remove(source)
                known.add(to)
        if source in self.delays:
            self.delays[to] = self.delays.pop(source)
        if source in self.stays:
            self.stays[to] = self.stays.pop(source)
        return inside


class World:
    """What was committed."""

    def __init__(self) -> None:
        self.positions: Positions = {name: {} for name in KEYED}
        self.there = set(HULLS) - {GUEST}
        self.deadlines: dict[str, dict[str, int]] = {name: {} for name in KEYED}
        self.clocks: dict[str, int | None] = dict.fromkeys(KEYED)
        self.zone: list[Point] = []
        self.revisions = dict.fromkeys(HULLS, 0)
        self.fences: dict[str, FenceModel] = {}
        self.time = 0  # of the present request
        self._origin: Origin | None = None  # of the present subject

    # Areas

    def shape(self, config: FenceConfig, key: str | None = None) -> Shape:
        area = config.area
        if not isinstance(area, HullArea):
            return fixed_shape(area)
        if area.name == ZONE:
            return shape_of_hull(self.zone)
        others = self.positions[area.name]
        return shape_of_hull(p for other, p in others.items() if not (area.without_self and other == key))

    # Changes, each with the events that follow from it

    def committed(self, request: Any) -> None:
        self.time = request.parts[0].arrived if isinstance(request, WriteTogether) else _time_of(request)
        match request:
            case WriteBatch():
                self._write([request.write])
            case WriteTogether():
                self._write(request.parts, together=True)
            case Expire():
                if request.result:
                    before = self._now()
                    self._expire(request.name, request.time)
                    self._judge(before)
            case CreateHull():
                self._come(request.name)
            case DeleteHull():
                self._go(request.name)
            case CreateFence():
                self._create(request)
            case ReplaceFence():
                self._replace(request)
            case DeleteFence():
                del self.fences[request.name]
            case PassTime():
                if self.fences[request.name].uid == request.fence.row.uid:
                    self._pass_time(request.name)
            case Acknowledge():
                fence = self.fences[request.name]
                known = fence.consumers.get(request.consumer, 0)
                fence.consumers[request.consumer] = max(known, request.sequence or 0)

    def _write(self, parts: Sequence[Write], *, together: bool = False) -> None:
        before = self._now()
        removed: dict[str, set[str]] = {}
        for part in parts:
            if self._ends(part):
                self._expire(part.name, self._clock(part.name, part.arrived))
                if not together:
                    self._judge(before)
                    before = self._now()
        for part in parts:
            batch = part.batch
            if isinstance(batch, KeyedBatch):  # who has expired is not removed
                removed[part.name] = set(batch.removes) & self.positions[part.name].keys()
            self._apply(part)
        self._judge(before, removed, {part.name: _put(part) for part in parts})

    def _come(self, name: str) -> None:
        self.there.add(name)
        self.revisions[name] = 0
        self.clocks[name] = None

    def _go(self, name: str) -> None:
        self.there.remove(name)
        keys, self.positions[name], self.deadlines[name] = self.positions[name], {}, {}
        for fence in self.fences.values():
            left = sorted((key for subject, key in fence.inside if subject == name), key=str.encode)
            for key in left:
                self._tell(fence, EventType.EXIT, (name, key), keys[key], None, int(Cause.REMOVED))
            fence.beyond = {each for each in fence.beyond if each[0] != name}
            fence.delays = {each: delay for each, delay in fence.delays.items() if each[0] != name}

    def subjects(self, config: FenceConfig) -> list[str]:
        return [name for name in KEYED if name in self.there and config.compares(name)]

    def near(self, config: FenceConfig) -> bool:
        area, other = (self.corners(name) for name in (config.area_hull, config.subjects))
        return not apart(area, other, halves(config.near))

    def corners(self, name: str | None) -> list[Point]:
        return hull(self.zone if name == ZONE else self.positions[str(name)].values())

    def _ends(self, part: Write) -> bool:
        if self.clocks.get(part.name) is None:
            return False
        clock = self._clock(part.name, part.arrived)
        return any(end <= clock for end in self.deadlines[part.name].values())

    def _clock(self, name: str, time: int) -> int:
        """The clock of a hull for a batch: it goes in ticks, and never back."""
        return max(self.clocks[name] or 0, time - time % TICK)

    def _expire(self, name: str, time: int) -> None:
        self.clocks[name] = clock = max(self.clocks[name] or 0, time)
        for key in [key for key, end in self.deadlines[name].items() if end <= clock]:
            del self.positions[name][key], self.deadlines[name][key]
        self.revisions[name] += 1

    def _apply(self, part: Write) -> None:
        batch, name = part.batch, part.name
        if name not in self.there:  # the batch has created it
            self._come(name)
        self.revisions[name] += 1
        if isinstance(batch, Batch):
            for p in batch.deletes.tolist():
                if exact(p) in self.zone:  # otherwise it is ignored
                    self.zone.remove(exact(p))
            self.zone += map(exact, batch.inserts.tolist())
            return
        if self.clocks[name] is not None or batch.ttl is not None:
            self.clocks[name] = self._clock(name, part.arrived)
        for key in batch.removes:
            self.positions[name].pop(key, None)
            self.deadlines[name].pop(key, None)
        for key, p in zip(batch.keys, batch.points.tolist(), strict=True):
            self.positions[name][key] = exact(p)
            self.deadlines[name].pop(key, None)
            if batch.ttl is not None:
                self.deadlines[name][key] = part.arrived + batch.ttl

    def _now(self) -> tuple[Positions, dict[str, Shape]]:
        positions = {name: dict(keys) for name, keys in self.positions.items()}
        return positions, {name: self.shape(fence.config) for name, fence in self.fences.items()}

    def _judge(
        self,
        before: tuple[Positions, dict[str, Shape]],
        removed: dict[str, set[str]] | None = None,
        put: dict[str, set[str]] | None = None,
    ) -> None:
        """Make the events of the difference between two states, given which keys were removed, and which put."""
        places, shapes = before
        transfers = self._transfers(places, removed or {}, put or {})
        for name, fence in self.fences.items():
            if fence.config.kind == "other":
                self._look_at_pair(fence, 0)
                continue
            area = self.shape(fence.config) != shapes[name]
            compared = self.subjects(fence.config)
            moved = {to: source for to, source in transfers.items() if to[0] in compared and source[0] in compared}
            taken = {source: fence.take_along(source, to) for to, source in moved.items()}
            for subject in compared:
                was, now = places[subject], self.positions[subject]
                reports = (put or {}).get(subject, set())
                for key in sorted(was.keys() | now.keys(), key=str.encode):
                    source = moved.get((subject, key))
                    if source is not None:
                        there, here = places[source[0]][key], now[key]
                        self._go_over(fence, source, subject, there, here, area=area, inside=taken[source])
                        continue
                    if (subject, key) in taken:
                        continue
                    cause = Cause(0)
                    if key not in was:
                        cause = Cause.APPEARED
                    elif key not in now:
                        cause = Cause.REMOVED if key in (removed or {}).get(subject, ()) else Cause.EXPIRED
                    elif was[key] != now[key]:
                        cause = Cause.MOVED
                    if area or was != now or key in reports:
                        own = key in reports
                        self._look(fence, (subject, key), was.get(key), now.get(key), int(cause), area=area, own=own)

    def _transfers(
        self, before: Positions, removed: dict[str, set[str]], put: dict[str, set[str]]
    ) -> dict[Subject, Subject]:
        """The keys that a batch has moved from one hull to another, with the subjects that they were."""
        found: dict[Subject, Subject] = {}
        for source, keys in sorted(removed.items()):
            for key in keys:
                for target, new in sorted(put.items()):
                    there = key in new and key not in before[target] and key in self.positions[target]
                    if there and target != source and (target, key) not in found:
                        found[target, key] = source, key
                        break
        return found

    def _go_over(
        self, fence: FenceModel, source: Subject, hull: str, was: Point, now: Point, *, area: bool, inside: bool
    ) -> None:
        """A subject has changed hulls; what was known of it went along. `inside`: as the events say, before."""
        subject = hull, source[1]
        known = subject in fence.beyond and subject not in fence.delays
        self._origin = Origin(source[0], self.revisions[source[0]])
        made = len(fence.events)
        self._look(fence, subject, was, now, int(Cause.MOVED), area=area, own=True)
        told = {event.type for event in fence.events[made:]} - {EventType.CROSS}
        if inside and not told:
            shown = was if known and subject in fence.beyond else None
            causes = Cause.MOVED | (Cause.AREA if area and not fence.config.delays else Cause(0))
            self._tell(fence, EventType.TRANSFER, subject, shown, now, int(causes))
        self._origin = None

    def _look_at_pair(self, fence: FenceModel, cause: int) -> None:
        if self.near(fence.config) != fence.near:
            fence.near = not fence.near
            kind = EventType.BEGIN if fence.near else EventType.CEASE
            self._tell(fence, kind, (fence.config.subjects, None), None, None, cause)

    def _look(
        self,
        fence: FenceModel,
        subject: tuple[str, str],
        was: Point | None,
        now: Point | None,
        cause: int,
        *,
        area: bool,
        own: bool,
    ) -> None:
        config, inside = fence.config, subject in fence.beyond
        shape = self.shape(config, subject[1])
        if now is None:
            after = False
        elif inside:
            after = not shape.farther(now, halves(config.margin), closed=config.closed)
        else:
            after = shape.holds(now, closed=config.closed)
        (fence.beyond.add if after else fence.beyond.discard)(subject)
        kind = None
        if now is None and subject in fence.delays:
            self._drop(fence, subject, cause)
        elif (config.delays or subject in fence.delays) and after != inside and now is not None:
            self._turn(fence, subject, cause | (Cause.AREA if area else 0))
        elif after != inside:
            kind = EventType.ENTER if after else EventType.EXIT
        elif subject in fence.delays:
            pass
        elif config.crosses and not inside and was is not None and now is not None and was != now:
            kind = EventType.CROSS if shape.passed(was, now) else None
        if kind is not None:
            self._tell(fence, kind, subject, was, now, cause | (Cause.AREA if area else 0))
        if own and subject in fence.delays and fence.delays[subject].reports < config.confirmations:
            fence.delays[subject].reports += 1
            self._end(fence, subject, 0)

    def _turn(self, fence: FenceModel, subject: Subject, cause: int) -> None:
        """A subject has changed its side; on the one that the events say, it is back."""
        if fence.delays.pop(subject, None) is None:
            fence.time = max(fence.time, self.time)
            fence.delays[subject] = Delayed(fence.time, 0, cause)

    def _drop(self, fence: FenceModel, subject: Subject, cause: int) -> None:
        """A subject is gone before its change of side was an event."""
        del fence.delays[subject]
        if subject in fence.inside:
            self._tell(fence, EventType.EXIT, subject, None, None, cause)

    def _end(self, fence: FenceModel, subject: Subject, more: int) -> None:
        """Make the event of a change of side if nothing is missing any more."""
        delay, config, time = fence.delays.get(subject), fence.config, max(fence.time, self.time)
        if delay is None or delay.reports < config.confirmations or time - delay.since < config.min_dwell:
            return
        del fence.delays[subject]
        kind = EventType.EXIT if subject in fence.inside else EventType.ENTER
        place = self.positions[subject[0]][subject[1]]
        self._tell(fence, kind, subject, None, place, delay.cause | more, first=delay.since)

    def _pass_time(self, name: str) -> None:
        """Each event comes when it is due."""
        fence, now = self.fences[name], self.time
        config = fence.config
        while True:
            times = [each.since + config.min_dwell for each in fence.delays.values() if config.min_dwell]
            waits = [each.reports >= config.confirmations for each in fence.delays.values() if config.min_dwell]
            times = [time for time, ripe in zip(times, waits, strict=True) if ripe]
            times += [since + config.dwell for since in fence.stays.values() if config.dwell]
            if not times or min(times) > now:
                break
            self.time = min(times)
            for subject in sorted(fence.delays, key=_in_order) if config.min_dwell else ():
                if self.time - fence.delays[subject].since >= config.min_dwell:
                    self._end(fence, subject, int(Cause.TIME))
            for subject, since in sorted(fence.stays.items(), key=lambda each: _in_order(each[0])):
                if config.dwell and self.time - since >= config.dwell:
                    place = self.positions[subject[0]][subject[1]]
                    self._tell(fence, EventType.DWELL, subject, None, place, int(Cause.TIME), first=since)
        self.time = now

    def _tell(
        self,
        fence: FenceModel,
        kind: EventType,
        subject: tuple[str, str | None] | None,
        was: Point | None,
        now: Point | None,
        cause: int,
        first: int = NO_TIME,
    ) -> None:
        area = fence.config.area_hull
        name, key = subject or ("", None)
        fence.last += 1
        fence.time = max(fence.time, self.time)
        if key is not None:
            self._follow(fence, kind, (name, key))
        fence.events.append(
            FenceEvent(
                fence.last,
                kind,
                cause,
                name,
                key,
                self.revisions[name] if name else 0,
                self.revisions[area] if area else 0,
                None if now is None else (now[0] / 2, now[1] / 2),
                None if was is None else (was[0] / 2, was[1] / 2),
                None if now is None else self._rounded_distance(fence.config, key, now),
                NO_TIME,
                fence.time,
                first,
                origin=self._origin,
            )
        )

    def _follow(self, fence: FenceModel, kind: EventType, subject: Subject) -> None:
        if kind is EventType.ENTER:
            fence.inside.add(subject)
            fence.stays[subject] = fence.time
        elif kind is EventType.EXIT:
            fence.inside.remove(subject)
            fence.stays.pop(subject, None)
        elif kind is EventType.DWELL:
            del fence.stays[subject]

    def _rounded_distance(self, config: FenceConfig, key: str | None, place: Point) -> float:
        return self.shape(config, key).distance(place, closed=config.closed)

    def _create(self, request: CreateFence) -> None:
        config = request.config
        fence = self.fences[request.name] = FenceModel(config, request.birth.uid)
        fence.time = self.time if config.dwell else NO_TIME
        told = config.initial == "events"
        if config.kind == "other":
            fence.near = self.near(config)
            if told and fence.near:
                self._tell(fence, EventType.BEGIN, (config.subjects, None), None, None, int(Cause.CREATED))
        for name in self.subjects(config):
            for key, place in sorted(self.positions[name].items(), key=lambda each: each[0].encode()):
                if self.shape(config, key).holds(place, closed=config.closed):
                    fence.beyond.add((name, key))
                    if told:
                        self._tell(fence, EventType.ENTER, (name, key), None, place, int(Cause.CREATED))
                    fence.inside.add((name, key))
                    fence.stays[name, key] = self.time
        if config.initial == "snapshot":
            self._tell(fence, EventType.SNAPSHOT, None, None, None, int(Cause.CREATED))

    def _replace(self, request: ReplaceFence) -> None:
        fence = self.fences[request.name]
        if fence.config == request.config:
            return
        anew = fence.config.dwell != request.config.dwell
        if anew and request.config.dwell:
            fence.time = max(fence.time, self.time)
        fence.config = request.config
        made = len(fence.events)
        if fence.config.kind == "other":
            self._look_at_pair(fence, int(Cause.CHANGED))
        for name in self.subjects(fence.config):
            for key, place in sorted(self.positions[name].items(), key=lambda each: each[0].encode()):
                self._look_again(fence, (name, key), place)
        for subject in sorted(fence.delays, key=_in_order):
            self._end(fence, subject, int(Cause.CHANGED))
        ordered = sorted(fence.events[made:], key=lambda event: (event.hull, (event.key or "").encode()))
        numbers = [event.sequence for event in fence.events[made:]]
        fence.events[made:] = [event._replace(sequence=number) for event, number in zip(ordered, numbers, strict=True)]
        if anew:
            fence.stays = dict.fromkeys(fence.inside, fence.time)

    def _look_again(self, fence: FenceModel, subject: Subject, place: Point) -> None:
        self._look(fence, subject, place, place, int(Cause.CHANGED), area=False, own=False)


def _time_of(request: Any) -> int:
    time: int = request.write.arrived if isinstance(request, WriteBatch) else getattr(request, "time", 0)
    return time


def _in_order(subject: Subject) -> tuple[str, bytes]:
    return subject[0], subject[1].encode()


def _put(part: Write) -> set[str]:
    batch = part.batch
    return set(batch.keys) if isinstance(batch, KeyedBatch) else set()


class Chance:
    """Draws requests."""

    def __init__(self, rng: random.Random, world: World, *, rules: bool = False) -> None:
        self._rng = rng
        self._rules = rules  # whether fences wait: for reports, or for the time that `PassTime` says
        self._world = world
        self._births = 0

    def batch(self, name: str, time: int, to: Any) -> WriteBatch:
        rng = self._rng
        made: Batch | KeyedBatch
        if name == ZONE:
            there = sorted(self._world.zone)
            gone = rng.sample(there, min(len(there), rng.choice([0, 0, 1, 2, 9])))
            new = [p for p in self._points(rng.choice([0, 1, 1, 2, 3])).tolist() if exact(p) not in gone]
            made = Batch(
                np.array(new, float).reshape(-1, 2),
                np.array(gone, float).reshape(-1, 2) / 2,
                0,
                count_missing=True,
            )
        else:
            keys = rng.sample(KEYS, rng.choice([1, 1, 2, 3]))
            removed = rng.randrange(len(keys) + 1) if rng.random() < 0.3 else 0
            puts = keys[removed:]
            ttl = rng.choice([None, None, None, TICK, 3 * TICK])
            made = KeyedBatch(
                "str", PackedKeys.pack(puts), self._points(len(puts)), PackedKeys.pack(keys[:removed]), ttl=ttl
            )
        birth = self.birth() if name == GUEST and rng.random() < 0.5 else None
        return WriteBatch(to, Write(name, made, time, 3), birth)

    def of_guest(self, time: int, to: Any) -> Any:
        """The creation or the deletion of a hull."""
        if GUEST in self._world.there and self._rng.random() < 0.8:
            return DeleteHull(to, GUEST, time)
        return CreateHull(to, GUEST, self.birth(), HullSettings("str"))

    def _points(self, n: int) -> np.ndarray:
        return np.array([[self._rng.randrange(-4, 24) / 2 for _ in range(2)] for _ in range(n)]).reshape(-1, 2)

    def together(self, time: int, to: Any) -> WriteTogether:
        if self._rng.random() < 0.4:
            return WriteTogether(to, self._transfer(time, to))
        names = self._rng.sample(HULLS, self._rng.choice([2, 2, 3]))
        return WriteTogether(to, [self.batch(name, time, to).write for name in names])

    def _transfer(self, time: int, to: Any) -> list[Write]:
        """Keys that change hulls, and perhaps others that move."""
        source, target = self._rng.sample(sorted(self._world.there - {ZONE}), 2)
        there = sorted(self._world.positions[source])
        keys = self._rng.sample(there, min(len(there), self._rng.choice([1, 1, 2])))
        points = self._points(len(keys))
        if self._rng.random() < 0.3:
            points = np.array([self._world.positions[source][key] for key in keys], float).reshape(-1, 2) / 2
        packed = PackedKeys.pack(keys)
        leaving, coming = (self.batch(name, time, to).write for name in (source, target))
        parts = [
            leaving._replace(content=KeyedBatch("str", NO_KEYS, NONE, packed)),
            coming._replace(content=KeyedBatch("str", packed, points, NO_KEYS)),
        ]
        if self._rng.random() < 0.3:
            parts.append(self.batch(ZONE, time, to).write)
        return self._rng.sample(parts, len(parts))

    def birth(self) -> Birth:
        self._births += 1
        return Birth(f"uid{self._births}", 1.0)

    def config(self, before: FenceConfig | None = None) -> FenceConfig:
        """Settings of a fence; of the same subjects as `before`."""
        rng = self._rng
        kind: Any = rng.choice(["hull", "hull", "prefix", "other"]) if before is None else before.kind
        subjects = {"prefix": "k/", "hull": rng.choice(KEYED[:2]), "other": rng.choice(KEYED[:2])}[kind]
        subjects = subjects if before is None else before.subjects
        initial: Any = rng.choice(["snapshot", "events", "none"])
        if kind == "other":
            area = rng.choice([name for name in (*KEYED[:2], ZONE) if name != subjects])
            return FenceConfig(HullArea(area), kind, subjects, near=rng.choice([0.0, 0.0, 1.0, 2.5]), initial=initial)
        closed, margin = rng.random() < 0.7, rng.choice([0.0, 0.0, 0.5, 1.0, 1.5])
        chosen = rng.choice(["zone", "other", "self", "circle", "polygon", "polygon"])
        area = self._area(chosen, subjects)
        if isinstance(area, HullArea) and area.without_self:
            closed, margin = True, margin or 0.5
        crosses = closed and not isinstance(area, HullArea) and rng.random() < 0.5
        dwell, confirmations, min_dwell = 0, 0, 0
        if self._rules and rng.random() < 0.5:
            dwell = rng.choice([0, TICK, 4 * TICK])
            confirmations = rng.choice([0, 0, 2, 3])
            min_dwell = rng.choice([0, 0, TICK, 3 * TICK])
        return FenceConfig(
            area,
            kind,
            subjects,
            closed,
            margin,
            initial=initial,
            crosses=crosses,
            dwell=dwell,
            confirmations=confirmations,
            min_dwell=min_dwell,
        )

    def _area(self, chosen: str, subjects: str) -> Any:
        rng = self._rng
        if chosen == "zone":
            return HullArea(ZONE)
        if chosen == "self" and subjects in KEYED:
            return HullArea(subjects, without_self=True)
        if chosen in ("other", "self"):
            return HullArea(rng.choice(KEYED[:2]))
        if chosen == "circle":
            return CircleArea(float(rng.randrange(8)), float(rng.randrange(8)), rng.choice([0.0, 1.0, 2.5, 5.0]))
        rings = tuple(np.array(ring, "<f8").tobytes() for ring in rng.choice(SHAPES))
        more = ((np.array([[9, 9], [11, 9], [9, 11]], "<f8").tobytes(),),) if rng.random() < 0.3 else ()
        return PolygonArea((rings, *more))

    def burst(self, time: int, to: Any) -> list[Any]:
        """Requests to create fences around the same hulls, or to delete fences, all at once; some of them twice."""
        names = self._rng.choices(FENCES, k=self._rng.randrange(2, 6))
        if self._rng.random() < 0.5:
            return [DeleteFence(to, name, time) for name in names]
        config = self.config()
        margins = self._rng.choices([0.0, 1.0], k=len(names)) if config.kind == "hull" else [config.margin] * len(names)
        if isinstance(config.area, HullArea):
            margins = [config.margin] * len(names)
        return [
            CreateFence(to, name, time, replace(config, margin=margin), self.birth())
            for name, margin in zip(names, margins, strict=True)
        ]

    def of_fences(self, time: int, to: Any) -> Any:
        rng = self._rng
        name = rng.choice(FENCES)
        fence = self._world.fences.get(name)
        if fence is None or rng.random() < 0.1:
            return CreateFence(to, name, time, self.config(), self.birth())
        kind = rng.choice(["delete", "replace", "same", "ack", "ack", "ack"])
        if kind == "delete":
            return DeleteFence(to, name, time)
        if kind == "ack":
            return Acknowledge(to, name, time, rng.choice(["x", "y"]), rng.randrange(fence.last + 1))
        config = fence.config if kind == "same" else replace(self.config(fence.config), initial="none")
        return ReplaceFence(to, name, time, config)
