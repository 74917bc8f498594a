"""Who must be inside of fences, computed from scratch from positions and areas: exact, and without the index."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain

import numpy as np
import numpy.typing as npt

from dynhull import convex_hull, orient2d
from dynhull.arrays import Points
from dynhull.globe import Boundary, Gnomonic, project_hull
from dynhull.keys import Keys, key_list
from dynhull.range_search import RangeSearch

from ...alarms.rule import AlarmRule
from ...alarms.values import Seen, holds, seen
from ...records import Center, Contents
from ..events.order import one_by_one
from ..index.globe import laid_polygons, rings_of
from ..index.pair import nearness
from ..index.subjects import area_vertices
from ..model.config import CircleArea, FenceConfig, HullArea
from ..model.faults import FenceFault
from ..model.fence import Fence
from ..model.records import Delay, Key

Rows = npt.NDArray[np.intp]
NO_ROW = -1
CORNERS_OF_A_POLYGON = 3
ERRORS = 2e-6  # metres: of what decides by the margin, and of what it is compared with


@dataclass(frozen=True, slots=True)
class Side:
    """Which keys of a hull are on the inner side of a fence.

    Attributes:
        fence: the name of the fence.
        config: its settings.
        vertices: the vertices of the hull that is its area; None for other areas.
        keys: the keys.
        delays: the delays of keys of the hull.
    """

    fence: str
    config: FenceConfig
    vertices: Points | None
    keys: Keys
    delays: Mapping[Key, Delay] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Nearness:
    """Whether two hulls as wholes are near, as a fence has it; each by its vertices, and with their common centre."""

    fence: str
    limit: float
    area: Points
    other: Points
    center: Center | None
    near: bool


@dataclass(frozen=True, slots=True)
class AlarmState:
    """Whether an alarm is raised for a hull, or waits, and what its rule is about."""

    alarm: str
    rule: AlarmRule
    seen: Seen
    geographic: bool
    raised: bool
    waits: bool

    def fault(self, hull: str) -> FenceFault | None:
        """What is wrong, None for nothing. Between the two bounds the state depends on the way; silence is of time."""
        rule = self.rule
        if rule.silence:
            return None
        if self.raised:
            cleared = holds(rule.clears, self.seen, rule, geographic=self.geographic)
            return FenceFault(self.alarm, hull, None, 0, "cleared", "raised") if cleared else None
        raises = holds(rule.raises, self.seen, rule, geographic=self.geographic)
        if raises != self.waits if rule.hold else raises:
            expected = "not" if not raises else "to wait" if rule.hold else "raised"
            return FenceFault(self.alarm, hull, None, 0, expected, "waiting" if self.waits else "not raised")
        return None


@dataclass(slots=True)
class Sides:
    """What fences have about one hull at one moment.

    Attributes:
        hull: the name of the hull.
        contents: its keys and their positions; None where no fence compares them.
        center: the centre of a geographic hull; None for a plane.
        sides: the fences that compare its keys.
        pairs: the fences that compare it as a whole.
        alarms: the alarms at it.
    """

    hull: str
    contents: Contents | None = None
    center: Center | None = None
    sides: list[Side] = field(default_factory=list)
    pairs: list[Nearness] = field(default_factory=list)
    alarms: list[AlarmState] = field(default_factory=list)

    def __len__(self) -> int:
        """The number of fences."""
        return len(self.sides) + len(self.pairs) + len(self.alarms)


def sides_of(name: str, fences: Iterable[Fence]) -> Sides:
    """A copy of what fences have about a hull. O(n log n) for n keys, and for each fence those inside."""
    found = Sides(name)
    for fence in fences:
        config, pair = fence.row.config, fence.pair
        if pair is not None:
            vertices = pair.area.state.vertices(), pair.other.state.vertices()
            found.pairs.append(Nearness(fence.name, config.near, *vertices, pair.area.state.center, pair.near))
            continue
        if fence.watched is not None and config.rule is not None:
            watched = fence.watched.of[name]
            geographic, other = watched.hull.row.settings.geographic, None if fence.area is None else fence.area.state
            looked = seen(config.rule, watched.hull.state, other, geographic=geographic)
            found.alarms.append(AlarmState(fence.name, config.rule, looked, geographic, watched.raised, watched.waits))
            continue
        subjects = fence.subjects[name]
        if found.contents is None:
            found.contents, found.center = subjects.hull.state.entities(), subjects.hull.state.center
        vertices_of_area = area_vertices(config, fence.area)
        delays = {} if fence.delays is None else dict(fence.delays.of(name))
        inside = subjects.index.inside(fence.number)
        found.sides.append(Side(fence.name, config, vertices_of_area, inside, delays))
    return found


def wrong_sides(found: Sides) -> Iterator[FenceFault]:
    """The keys whose side is not the one that their position and the area allow, and hulls that are not near as told.

    Within the margin the side depends on the way, and both are allowed.
    """
    for pair in found.pairs:
        near, _ = nearness(pair.area, pair.other, pair.limit, pair.center)
        if near != pair.near:
            yield FenceFault(pair.fence, found.hull, None, 0, _distance(near), _distance(pair.near))
    for alarm in found.alarms:
        fault = alarm.fault(found.hull)
        if fault is not None:
            yield fault
    if not found.sides or found.contents is None:
        return
    frame = None if found.center is None else Gnomonic(found.center)
    points = found.contents.points if frame is None else frame.project_all(found.contents.points)
    assert found.contents.keys is not None  # the hull is keyed
    keys = found.contents.keys
    rows = _rows_of(keys)
    search = RangeSearch(points)
    for side in found.sides:
        must, may = _allowed(search, points, side, frame)
        inside = np.array([rows.get(key, NO_ROW) for key in one_by_one(side.keys)], np.intp)
        for place in np.flatnonzero(inside == NO_ROW).tolist():
            yield FenceFault(side.fence, found.hull, _key(side.keys, place), 0, "no such key", "inside")
        inside = inside[inside != NO_ROW]
        if frame is not None and side.config.margin:
            may = np.union1d(must, _in_margin(side, found.contents.points, np.setdiff1d(inside, must)))
        for row in np.setdiff1d(inside, may).tolist():
            yield FenceFault(side.fence, found.hull, _key(keys, row), 0, "outside", "inside")
        for row in np.setdiff1d(must, inside).tolist():
            yield FenceFault(side.fence, found.hull, _key(keys, row), 0, "inside", "outside")
        if side.delays:
            yield from _wrong_delays(found.hull, side, set(inside.tolist()), rows)


def _wrong_delays(hull: str, side: Side, inside: set[int], rows: Mapping[Key, int]) -> Iterator[FenceFault]:
    """The delays of keys that are not on the side to which they wait to change."""
    for key, delay in side.delays.items():
        waits = "to enter" if delay.enters else "to leave"
        if key not in rows:
            yield FenceFault(side.fence, hull, key, 0, "no such key", f"waits {waits}")
        elif (rows[key] in inside) != delay.enters:
            where = "inside" if delay.enters else "outside"
            yield FenceFault(side.fence, hull, key, 0, f"{where}, as it waits {waits}", "the opposite")


def _allowed(search: RangeSearch, points: Points, side: Side, frame: Gnomonic | None) -> tuple[Rows, Rows]:
    """The rows of the points that must be inside, and of those that may be; on the globe without the margin."""
    config, area = side.config, side.config.area
    if config.of_others:
        return _of_the_others(points, config.margin)

    def select(margin: float) -> Rows:
        if isinstance(area, HullArea):
            assert side.vertices is not None  # those of the area
            vertices = side.vertices if frame is None else project_hull(frame, side.vertices)
            return search.hull(vertices, closed=config.closed, margin=margin)
        if isinstance(area, CircleArea) and frame is None:
            return search.disk(area.x, area.y, area.radius, closed=config.closed, margin=margin)
        anywhere = config.kind == "prefix"
        polygons = (
            rings_of(area, None) if frame is None else laid_polygons(frame, area, config.margin, anywhere=anywhere)
        )
        if not polygons:
            return np.empty(0, np.intp)
        return search.polygons(polygons, closed=config.closed, margin=margin)

    must = select(0.0)
    return must, select(config.margin) if config.margin and frame is None else must


def _in_margin(side: Side, places: Points, rows: Rows) -> Rows:
    """Those of the rows, outside of the area, whose places are within the margin in metres, but for errors."""
    boundary = Boundary(chain.from_iterable(rings_of(side.config.area, side.vertices)))
    return rows[boundary.distance(places[rows]) <= side.config.margin + ERRORS]


def _of_the_others(points: Points, margin: float) -> tuple[Rows, Rows]:
    """As `_allowed`, where each point is compared with the hull of the others. O(n) for each vertex.

    Only a vertex at which there is one point can be outside.
    """
    vertices = convex_hull(points)
    every = np.arange(len(points))
    alone, near = [], []
    for number, vertex in enumerate(vertices):
        (at,) = np.nonzero((points == vertex).all(axis=1))
        if len(at) > 1:
            continue
        alone.append(at[0])
        before, after = vertices[number - 1], vertices[(number + 1) % len(vertices)]
        if len(vertices) < CORNERS_OF_A_POLYGON:
            beyond = points[every != at[0]]
        else:  # the others' hull differs from that of all beside the vertex only
            beyond = points[(np.asarray(orient2d(before, after, points)) < 0) & (every != at[0])]
        others = convex_hull(np.vstack([np.delete(vertices, number, axis=0), beyond]))
        if len(RangeSearch(vertex[None]).hull(others, margin=margin)):
            near.append(at[0])
    must = np.setdiff1d(every, np.array(alone, np.intp))
    return must, np.union1d(must, np.array(near, np.intp))


def _rows_of(keys: Keys) -> dict[Key, int]:
    return {key: row for row, key in enumerate(one_by_one(keys))}


def _key(keys: Keys, row: int) -> Key:
    key: Key = key_list(keys[row : row + 1])[0]
    return key


def _distance(near: bool) -> str:
    return "the hulls intersect or are near" if near else "the hulls are apart"
