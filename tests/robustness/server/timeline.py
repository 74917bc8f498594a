"""The model of hulls with keys, times, windows and deadlines.

What such a hull holds is a function of its batches and of its clock: `Contents` applies the batches as if nothing ever
expired, and `Contents.at` leaves out what has expired. That is right for the batches that `draw` makes, because their
effect does not depend on whether an old position has expired already:

* a key with a deadline gets no earlier deadline, unless it was removed, and no earlier event time
* in a hull with a limit on the age, the earlier of two positions of a key never replaces the later one
* what expires for its age is older than what stays, so the limit on the number evicts the same points
* no two points of a hull without keys are equal
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

import dynhull
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2

Key = str | int | tuple[float, float]

SECOND = 1_000_000  # in the unit of times
BEGINNING, NEVER = -(2**53), 2**53  # the earliest and the latest time on the wire
STRINGS, INTEGERS = hull_pb2.IDENTITY_STRING_KEYS, hull_pb2.IDENTITY_INTEGER_KEYS
POINTS = hull_pb2.IDENTITY_MULTISET
DATA, SERVER = hull_pb2.CLOCK_DATA, hull_pb2.CLOCK_SERVER
KEYS = 300
MIDDLE = 180.0, 10.0  # of the places on the globe


@dataclass(frozen=True, slots=True)
class Kind:
    """The settings of a hull; times in microseconds. Without a clock it has no window."""

    name: str
    identity: int
    timed: bool = True
    clock: int = hull_pb2.CLOCK_UNSPECIFIED
    max_age: int = 0
    max_points: int = 0
    deadlines: bool = False
    geographic: bool = False

    @property
    def keyed(self) -> bool:
        return self.identity != POINTS

    @property
    def follows_server(self) -> bool:
        return self.clock == SERVER or self.deadlines

    def config(self) -> hull_pb2.HullConfig:
        config = hull_pb2.HullConfig(identity=self.identity)
        if self.geographic:
            config.frame = hull_pb2.FRAME_GEOGRAPHIC
        if self.clock:
            config.window.clock, config.window.max_points = self.clock, self.max_points
            config.window.max_age.FromMicroseconds(self.max_age)
        if self.timed and self.keyed:
            config.ordering = hull_pb2.ORDERING_EVENT_TIME
        return config


TIMED = [
    Kind("timed/deadlines", STRINGS, deadlines=True),
    Kind("timed/data", STRINGS, clock=DATA, max_age=2 * SECOND, max_points=150),
    Kind("timed/data-points", POINTS, clock=DATA, max_age=3 * SECOND, max_points=200),
    Kind("timed/server", INTEGERS, clock=SERVER, max_age=3 * SECOND // 2, deadlines=True),
    Kind("timed/server-points", POINTS, clock=SERVER, max_age=6 * SECOND // 5),
    Kind("globe/deadlines", STRINGS, deadlines=True, geographic=True),
    Kind("globe/data-points", POINTS, clock=DATA, max_age=3 * SECOND, max_points=200, geographic=True),
]
FLEETS = [Kind(f"fleet/{each}", INTEGERS, timed=False) for each in "ab"]


@dataclass(frozen=True, slots=True)
class Entity:
    """A position, its event time, and when it leaves."""

    x: float
    y: float
    time: int = 0
    deadline: int = NEVER


@dataclass(slots=True)
class Change:
    """What a batch does to one hull. A point without a key is named by its coordinates."""

    puts: dict[Key, Entity] = field(default_factory=dict)
    removes: list[Key] = field(default_factory=list)


class Contents:
    """The entities of a hull, with those that have expired."""

    def __init__(self, kind: Kind, entities: dict[Key, Entity] | None = None) -> None:
        self.kind = kind
        self.entities = dict(entities or {})

    def apply(self, change: Change) -> None:
        entities = self.entities
        for key in change.removes:
            entities.pop(key, None)
        for key, entity in change.puts.items():
            known = entities.get(key)
            if known is None or entity.time >= known.time:
                entities[key] = entity
        most = self.kind.max_points
        if most and len(entities) > most:
            for key in sorted(entities, key=lambda key: (entities[key].time, key))[:-most]:
                del entities[key]

    def at(self, clock: int | None) -> dict[Key, Entity]:
        """The entities that have not expired when the hull's clock is `clock`."""
        if clock is None:
            return dict(self.entities)
        oldest = clock - self.kind.max_age if self.kind.max_age else BEGINNING - 1
        return {key: each for key, each in self.entities.items() if each.time > oldest and each.deadline > clock}


class Timeline:
    """The contents of a hull after each batch of a writer; its batches have this change at `part`."""

    def __init__(self, kind: Kind, batches: list[tuple[Change, ...]], part: int) -> None:
        self.kind = kind
        self._batches, self._part = batches, part
        self._bases: list[tuple[int, dict[Key, Entity]]] = [(0, {})]

    def after(self, sequence: int) -> Contents:
        start, entities = next(each for each in reversed(self._bases) if each[0] <= sequence)
        contents = Contents(self.kind, entities)
        for batch in self._batches[start:sequence]:
            contents.apply(batch[self._part])
        return contents

    def keep(self, clock: int | None) -> Contents:
        """The contents now, kept without what has expired by the clock, which was that after the last batch."""
        entities = self.after(len(self._batches)).at(clock)
        self._bases.append((len(self._batches), entities))
        return Contents(self.kind, entities)


def outline(kind: Kind, entities: dict[Key, Entity]) -> tuple[np.ndarray, tuple[Key, ...]]:
    """The vertices, and the least key at each.

    On the globe they are the same about every centre, because no three random places are within nanometres of a line.
    """
    names: dict[tuple[float, float], Key] = {}
    for key, each in entities.items():
        place = each.x, each.y
        names[place] = min(key, names.get(place, key), key=_order)
    points = np.array(sorted(names), dtype=float).reshape(-1, 2)
    if kind.geographic:
        vertices = dynhull.GeoHull(points, center=MIDDLE).vertices()
    else:
        vertices = dynhull.static.monotone_chain(points)
    return vertices, tuple(names[place] for place in map(tuple, vertices.tolist()))


def _order(key: Key) -> Any:
    return key.encode() if isinstance(key, str) else key


# Batches


def draw(rng: np.random.Generator, sent: Contents, now: int) -> Change:
    """A batch to a hull to which `sent` was sent before."""
    kind = sent.kind
    change = Change()
    limited = kind.deadlines and rng.random() < 0.6
    for _ in range(rng.integers(1, 12)):
        key, x, y = _place(rng, kind)
        known = sent.entities.get(key)
        age = rng.integers(SECOND // 2) if rng.random() < 0.9 else rng.integers(5 * SECOND)
        time = now - int(age)
        deadline = now + int(rng.choice((SECOND // 20, SECOND // 3, 2 * SECOND, 3600 * SECOND))) if limited else NEVER
        if known is not None and known.deadline != NEVER:
            time, deadline = max(time, known.time), max(deadline, known.deadline)
        elif known is not None and limited:
            deadline = NEVER
        change.puts[key] = Entity(x, y, time, deadline)
    if rng.random() < 0.5:
        known_keys = [key for key in sent.entities if key not in change.puts]
        change.removes = [known_keys[i] for i in rng.permutation(len(known_keys))[: rng.integers(1, 6)]]
    return change


def _place(rng: np.random.Generator, kind: Kind) -> tuple[Key, float, float]:
    """A key, of which there are few, and a place; places on a grid have several keys."""
    x, y = rng.normal(size=2).tolist()
    if kind.keyed:
        x, y = round(x, 1) + 0.0, round(y, 1) + 0.0
    if kind.geographic:
        x, y = _on_globe(x, y)
    if not kind.keyed:
        return (x, y), x, y
    number = int(rng.integers(KEYS))
    key = f"entité {number}" if kind.identity == STRINGS else number
    return key, x, y


def _on_globe(x: float, y: float) -> tuple[float, float]:
    """A longitude and a latitude around the antimeridian; a grid becomes one without rows along great circles."""
    lon = MIDDLE[0] + 9 * x + 2.3 * y + 0.37 * x * y
    return lon - 360 * (x > y), MIDDLE[1] + 8 * y + 0.21 * x * x


def encode(kind: Kind, change: Change) -> batch_pb2.Batch:
    """The message."""
    entities = list(change.puts.values())
    points = points_pb2.Points(packed=np.array([(each.x, each.y) for each in entities], float).tobytes())
    times = _times([each.time for each in entities]) if kind.timed else None
    if not kind.keyed:
        deletes = points_pb2.Points(packed=np.array(change.removes, float).tobytes())
        count = batch_pb2.MISSING_POINT_POLICY_COUNT
        return batch_pb2.Batch(inserts=points, insert_times=times, deletes=deletes, missing_points=count)
    deadlines = [each.deadline for each in entities]
    ends = _times(deadlines) if any(each != NEVER for each in deadlines) else None
    puts = batch_pb2.Puts(keys=_keys(list(change.puts)), points=points, times=times, expire_times=ends)
    # Without times nothing expires, so that every key is there which the model has.
    missing = batch_pb2.MISSING_KEY_POLICY_COUNT if kind.timed else batch_pb2.MISSING_KEY_POLICY_REFUSE
    return batch_pb2.Batch(puts=puts, removes=_keys(change.removes), missing_keys=missing)


def _times(times: list[int]) -> points_pb2.Times:
    return points_pb2.Times(packed=np.array(times, "<i8").tobytes())


def _keys(keys: list[Any]) -> points_pb2.Keys:
    if keys and isinstance(keys[0], str):
        return points_pb2.Keys(strings=keys)
    return points_pb2.Keys(integers=keys)
