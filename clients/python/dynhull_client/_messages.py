"""The server's answers, as values with read-only numpy arrays. Points are (n, 2) arrays of float64."""

from collections.abc import Iterable
from dataclasses import dataclass, fields
from datetime import datetime, timedelta
from math import nan
from operator import attrgetter
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from dynhull import globe
from dynhull._shown import Shown, geometry, svg
from dynhull._value import Value
from dynhull.arrays import Points as Points
from dynhull.keys import Keys, KeyType
from dynhull_proto.v1 import batch_pb2, hull_pb2, hull_service_pb2, points_pb2
from dynhull_surface.counts import COUNTS
from dynhull_surface.counts import Applied as Applied
from dynhull_surface.counts import Ingested as Ingested
from dynhull_surface.settings import Ahead, Clock, Ordering

from ._accuracies import decode_accuracies
from ._keys import KeyTuple, decode_keys, decode_names, join_keys
from ._quarantine_messages import Quarantine, decode_quarantine
from ._times import Times, decode_time, decode_times

# In the uid of a hull that a backup has brought back, before what is new with each copy.
INCARNATION = "."

Cause = Literal["batch", "expiry", "recenter"]
BATCH: Cause = "batch"
CAUSES: dict[int, Cause] = {batch_pb2.CAUSE_EXPIRY: "expiry", batch_pb2.CAUSE_RECENTER: "recenter"}

KEY_TYPES: dict[int, KeyType] = {hull_pb2.IDENTITY_STRING_KEYS: "str", hull_pb2.IDENTITY_INTEGER_KEYS: "int"}


@dataclass(frozen=True, slots=True)
class Window:
    """A hull's sliding window: points leave when they are too old or too many.

    A hull that is ordered by event time may have `max_skew` alone: no points leave then.

    Attributes:
        max_age: the age at which points leave; None for no such limit.
        max_points: the number of points beyond which the oldest leave; None for no such limit.
        clock: the clock that decides what is too old: "server", or "data" for the greatest event time so far.
        max_skew: how far an event time may be ahead of the server's clock; None for any distance.
        ahead: whether a batch with an event time further ahead is refused ("refuse"), or the time reduced ("clamp").
    """

    max_age: timedelta | None = None
    max_points: int | None = None
    clock: Clock = "server"
    max_skew: timedelta | None = None
    ahead: Ahead = "refuse"


@dataclass(frozen=True, slots=True)
class HullInfo:
    """A hull, its size and its settings.

    Attributes:
        name: its name.
        revision: its revision.
        points: the number of points with duplicates: in a keyed hull, of keys.
        distinct: the number of distinct points.
        created: when it was created.
        uid: differs from that of an earlier or later hull of the same name.
        keyed: the kind of its keys; None for a hull without keys.
        window: its sliding window; None for a hull without one.
        ordering: which of two positions of a key is the later one: by arrival or by event time.
        point_limit: the number of points beyond which a batch is refused; None for the server's own limit.
        clock: its clock, which decides what is too old; None if it has none so far.
        geographic: whether its points are longitudes and latitudes in degrees.
        center: longitude and latitude of the centre of a geographic hull; None if it has none so far.
        quarantine: the rules of its quarantine; None for a hull that has never had any.
        held: the number of keys in quarantine.
        shards: the number of shards that its points are divided among; None for a hull that is not divided. Of a keyed
            hull over shards `distinct` is 0, because it is not known.
        changed: when its newest batch was committed, or points last left by time; None where that is not known.
        erased: as of the past: whether it may lack keys that it had then, because `erase_history` has erased them.
    """

    name: str
    revision: int
    points: int
    distinct: int
    created: datetime
    uid: str
    keyed: KeyType | None = None
    window: Window | None = None
    ordering: Ordering = "arrival"
    point_limit: int | None = None
    clock: datetime | None = None
    geographic: bool = False
    center: tuple[float, float] | None = None
    quarantine: Quarantine | None = None
    held: int = 0
    shards: int | None = None
    changed: datetime | None = None
    erased: bool = False

    @property
    def restored(self) -> bool:
        """Whether a backup has brought the hull back, so that it may lack batches after that backup."""
        return INCARNATION in self.uid


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Measures(Value):
    """Measures of a hull in the unit of its coordinates; `centroid` and `bounds` are NaN without points.

    Of a geographic hull, square metres and metres on WGS 84 between the geodesics; `centroid` is NaN.

    `bounds` are the least x, least y, greatest x and greatest y; of a geographic hull west, south, east and north in
    degrees, west greater than east across the antimeridian, NaN from servers before 1.1.

    `diameter` is the greatest distance of two points, and `width` the least one of parallel lines with all points
    between, on the globe NaN. Both are NaN for hulls of more than 256 vertices (`get_measures` has them), and
    from servers before 1.1.
    """

    area: float
    perimeter: float
    centroid: tuple[float, float]
    bounds: tuple[float, float, float, float]
    diameter: float = nan
    width: float = nan


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Hull(Value, Shown):
    """A hull at one revision: (h, 2) vertices, counter-clockwise from the lexicographically smallest, and measures.

    `vertex_keys` has the key of each vertex, of several at one place the least; None for a hull without keys.
    """

    info: HullInfo
    vertices: Points
    measures: Measures
    vertex_keys: KeyTuple | None = None

    @property
    def revision(self) -> int:
        """The revision."""
        return self.info.revision

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """A GeoJSON Feature with the name, revision, number of points, area and perimeter as properties."""
        return {
            "type": "Feature",
            "id": self.info.name,
            "geometry": shown_geometry(self.vertices, self.info.center),
            "properties": {
                "name": self.info.name,
                "revision": self.info.revision,
                "points": self.info.points,
                "area": self.measures.area,
                "perimeter": self.measures.perimeter,
            },
        }

    def _repr_html_(self) -> str:
        from html import escape  # only notebooks need it

        info, measures = self.info, self.measures
        picture = shown_svg(self.vertices, info.center, info.name)
        caption = f"{info.points} points, {len(self.vertices)} vertices, area {measures.area:.6g}"
        return (
            f"<figure>{picture}<figcaption><b>{escape(info.name)}</b> at revision "
            f"{info.revision}: {caption}</figcaption></figure>"
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Located(Value):
    """The side of each point or key, (n,) int8: +1 inside, 0 on the boundary, -1 outside, -128 for a missing key.

    `keys_revision` is the revision of the other hull, if keys of another hull were located.
    """

    revision: int
    sides: npt.NDArray[np.int8]
    keys_revision: int | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Positions(Value):
    """The positions of n keys.

    Attributes:
        revision: the hull's revision.
        positions: (n, 2) a position in each row, NaN for a missing key.
        present: (n,) whether the hull has the key.
        times: (n,) the event time of each key as datetime64[us] in UTC; 1970-01-01 for a key without one, NaT for a
            missing key; None if the hull has no times.
        accuracies: (n,) how far each may be from where its key really is, 0 for a missing key; None if all are exact.
    """

    revision: int
    positions: Points
    present: npt.NDArray[np.bool_]
    times: Times | None = None
    accuracies: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Entities(Value):
    """All n keys of a hull at one revision, with their positions.

    Attributes:
        revision: the hull's revision.
        keys: n keys, ascending, strings bytewise: `dynhull.keys.PackedKeys` or (n,) uint64.
        points: (n, 2) their positions.
        times: as in `Positions`.
        accuracies: as in `Positions`.
    """

    revision: int
    keys: Keys
    points: Points
    times: Times | None = None
    accuracies: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Stored(Value):
    """Some of the points of a hull, n of them, with what it has stored of each.

    Attributes:
        info: the hull, at the revision that all parts are of.
        points: (n, 2) the points, as often as the hull has them.
        keys: n keys, ascending, strings bytewise: `dynhull.keys.PackedKeys` or (n,) uint64; None if it is not keyed.
        times: (n,) event times as datetime64[us] in UTC, NaT for a point without one; None if the hull has none.
        expire_times: (n,) when each leaves the hull, likewise; None if no put has said so.
        accuracies: (n,) how far each may be from where it really is; None if no position has an error.
    """

    info: HullInfo
    points: Points
    keys: Keys | None = None
    times: Times | None = None
    expire_times: Times | None = None
    accuracies: npt.NDArray[np.float64] | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Counted(Value):
    """The multiplicity of each point, (n,) int64; 0 for a point that the hull does not hold."""

    revision: int
    counts: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Supported(Value):
    """The extreme vertex in each direction, (n, 2), and its key if requested."""

    revision: int
    vertices: Points
    keys: KeyTuple | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Distances(Value):
    """Distances of points or keys to the hull, (n,).

    0 inside and on the boundary, infinite from an empty hull, NaN for a missing key. `keys_revision` as in `Located`.
    """

    revision: int
    distances: npt.NDArray[np.float64]
    keys_revision: int | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sampled(Value):
    """A sample of the points, (n, 2), in lexicographic order, and a key of each if requested."""

    revision: int
    points: Points
    keys: KeyTuple | None = None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Crossings(Value):
    """The points where each line enters and leaves the hull, (n, 2, 2), as in `DynamicHull.intersect_lines`."""

    revision: int
    crossings: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Tangents(Value):
    """The left and right tangent points, (n, 2, 2), as in `DynamicHull.tangents`."""

    revision: int
    tangents: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Snapshot(Value, Shown):
    """The whole hull. `uid` identifies it when a watch resumes.

    This and the other events have the cause of their revision, "batch", "expiry" or "recenter"; the hull's clock at
    that revision, None for a hull without one; the centre of a geographic hull; and when the hull `changed` last, as in
    `HullInfo`. In a replay `erased` says whether the hull may lack keys that it had at that revision, as in `HullInfo`.
    Keys are None unless requested.
    """

    revision: int
    points: int
    vertices: Points
    measures: Measures | None
    uid: str = ""
    vertex_keys: KeyTuple | None = None
    cause: Cause = "batch"
    clock: datetime | None = None
    center: tuple[float, float] | None = None
    changed: datetime | None = None
    erased: bool = False

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry."""
        return shown_geometry(self.vertices, self.center)

    def _repr_svg_(self) -> str:
        return shown_svg(
            self.vertices, self.center, f"revision {self.revision}: {self.points} points, {len(self.vertices)} vertices"
        )


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Change(Value):
    """The difference to the vertices of the previous event, which `HullCopy` applies.

    Remove the rows `removed_rows`, move the first `rotation` of the remaining rows to the end, and insert `added` so
    that they become rows `added_rows` of the result, with the keys `added_keys`. Then rows `renamed_rows` have the keys
    `renamed_keys`: vertices that were there before and have another key now.
    """

    revision: int
    points: int
    removed: Points
    removed_rows: npt.NDArray[np.intp]
    added: Points
    added_rows: npt.NDArray[np.intp]
    rotation: int
    measures: Measures | None
    added_keys: KeyTuple | None = None
    renamed_rows: npt.NDArray[np.intp] | None = None
    renamed_keys: KeyTuple | None = None
    cause: Cause = "batch"
    clock: datetime | None = None
    center: tuple[float, float] | None = None
    changed: datetime | None = None
    erased: bool = False


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sketch(Value):
    """The extreme vertex in each requested direction, (k, 2), or at most `max_vertices` of the vertices and keys.

    `error` is how far the hull reaches beyond these vertices (Hausdorff's distance), the exact value rounded up; on the
    globe in metres, rounded up by 1.1 % at most; 0.0 in a watch with directions. (0, 2) if the hull has no points.
    """

    revision: int
    points: int
    vertices: Points
    measures: Measures | None
    keys: KeyTuple | None = None
    cause: Cause = "batch"
    clock: datetime | None = None
    center: tuple[float, float] | None = None
    error: float = 0.0
    uid: str = ""
    changed: datetime | None = None
    erased: bool = False


@dataclass(frozen=True, slots=True)
class Progress:
    """The hull at this revision is the same as at the previous event."""

    revision: int
    points: int
    cause: Cause = "batch"
    clock: datetime | None = None
    center: tuple[float, float] | None = None
    changed: datetime | None = None
    erased: bool = False


@dataclass(frozen=True, slots=True)
class Deleted:
    """The watched hull was deleted after this revision; a new one of the same name begins with a Snapshot.

    Only a watch with `follow=True` reports this. `points` is 0.
    """

    revision: int
    points: int = 0


Event = Snapshot | Change | Sketch | Progress | Deleted
"""Type of the events of a watch."""


@dataclass(frozen=True, slots=True)
class ChanRound:
    """One round of Chan's algorithm.

    It had `groups` groups of at most `guess` points, found `steps` vertices at an estimated `cost` of n log2(guess),
    and `closed` says whether the hull was complete.
    """

    guess: int
    groups: int
    steps: int
    cost: float
    closed: bool


@dataclass(frozen=True, slots=True)
class Difference:
    """The first row in which two lists of vertices differ; None for a list that has fewer rows."""

    row: int
    live: tuple[float, float] | None
    recomputed: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class FenceDifference:
    """One thing about a fence that is not as it must be.

    Attributes:
        fence: its name.
        hull: with `key`, the subject, if there is one.
        key: the key of the subject; None if it has none.
        sequence: that of the wrong event; 0 for who is inside.
        expected: in words, what must be.
        found: what is.
    """

    fence: str
    hull: str
    key: str | int | None
    sequence: int
    expected: str
    found: str


@dataclass(frozen=True, slots=True)
class Verification:
    """The live hull compared with a hull computed anew from the stored points.

    Attributes:
        revision: the hull's revision.
        equal: whether its vertices are those of the stored points.
        points: the number of points.
        vertices: the number of vertices.
        rounds: the rounds of Chan's algorithm.
        difference: the first row in which the vertices differ; None if they are equal.
        keys_equal: whether the points of a keyed hull are the positions of its keys; True for a hull without keys.
        fences: the number of fences that compare the hull or its keys.
        fence_differences: what is wrong with who is inside of them and with their events, the first of it.
    """

    revision: int
    equal: bool
    points: int
    vertices: int
    rounds: tuple[ChanRound, ...]
    difference: Difference | None
    keys_equal: bool = True
    fences: int = 0
    fence_differences: tuple[FenceDifference, ...] = ()

    @property
    def whole(self) -> bool:
        """Whether everything that was compared is as it must be."""
        return self.equal and self.keys_equal and not self.fence_differences


def shown_geometry(vertices: Points, center: tuple[float, float] | None) -> dict[str, Any]:
    """The hull as a GeoJSON geometry; on the globe, cut at 180 degrees (RFC 7946)."""
    return geometry(vertices) if center is None else globe.geojson(vertices)


def shown_svg(vertices: Points, center: tuple[float, float] | None, title: str) -> str:
    """A drawing of the hull; on the globe, in the projection about its centre, in which its edges are straight."""
    return svg(vertices if center is None else globe.Gnomonic(center).project_all(vertices), title)


def encode_points(xy: Points) -> points_pb2.Points:
    """Points in the form of a message."""
    return points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())


def decode_points(message: points_pb2.Points) -> Points:
    """Points as received, packed, which is what the client requests."""
    return np.frombuffer(message.packed, "<f8").reshape(-1, 2).astype(np.float64, copy=False)


def decode_info(message: hull_pb2.Hull) -> HullInfo:
    """A hull, its size and its settings."""
    config = message.config
    return HullInfo(
        message.name,
        message.revision,
        message.point_count,
        message.distinct_point_count,
        decode_time(message.create_time),
        message.uid,
        KEY_TYPES.get(config.identity),
        _window(config.window) if config.HasField("window") else None,
        "event_time" if config.ordering == hull_pb2.ORDERING_EVENT_TIME else "arrival",
        config.max_points or None,
        _clock(message),
        config.frame == hull_pb2.FRAME_GEOGRAPHIC,
        decode_center(message),
        decode_quarantine(message.quarantine) if message.HasField("quarantine") else None,
        message.held_count,
        config.shards or None,
        _changed(message),
        message.erased,
    )


def decode_center(message: hull_pb2.Hull | hull_service_pb2.WatchResponse) -> tuple[float, float] | None:
    """The centre of a geographic hull; None if it has none."""
    return (message.center.longitude, message.center.latitude) if message.HasField("center") else None


def decode_measures(message: hull_pb2.Measures) -> Measures:
    """Measures of a hull."""
    return Measures(
        message.area,
        message.perimeter,
        (message.centroid_x, message.centroid_y),
        (message.min_x, message.min_y, message.max_x, message.max_y),
        message.diameter if message.HasField("diameter") else nan,
        message.width if message.HasField("width") else nan,
    )


def decode_hull(message: hull_service_pb2.GetHullResponse) -> Hull:
    """A hull with vertices and measures."""
    info = decode_info(message.hull)
    keys = None if info.keyed is None else decode_names(message.vertex_keys)
    return Hull(info, decode_points(message.vertices), decode_measures(message.measures), keys)


# In the order of the fields of Applied, around its clock: one call for many fields is faster than each by its name.
_ON_THE_WIRE = [{"points": "point_count"}.get(each.name, each.name) for each in fields(Applied)]
_before_clock = attrgetter(*_ON_THE_WIRE[: _ON_THE_WIRE.index("clock")])
_after_clock = attrgetter(*_ON_THE_WIRE[_ON_THE_WIRE.index("clock") + 1 :])
_counts = attrgetter(*COUNTS)


def decode_applied(message: batch_pb2.BatchResult) -> Applied:
    """The effect of a batch."""
    held, held_rows, *left = _after_clock(message)
    values: tuple[Any, ...] = (*_before_clock(message), _clock(message), held, tuple(held_rows), *left)
    return Applied(*values)


def decode_ingested(message: hull_service_pb2.IngestResponse) -> Ingested:
    """The effect of an ingest."""
    return Ingested(
        batches=message.batches,
        revision=message.revision,
        points=message.point_count,
        duplicates=message.duplicates,
        **dict(zip(COUNTS, _counts(message), strict=True)),
    )


def decode_positions(message: hull_service_pb2.GetPositionsResponse) -> Positions:
    """The positions of keys."""
    present = np.frombuffer(message.present, np.bool_)
    times = decode_times(message.times) if message.HasField("times") else None
    if times is not None:
        times[~present] = np.datetime64("NaT")
    return Positions(message.revision, decode_points(message.positions), present, times, decode_accuracies(message))


def decode_entities(parts: Iterable[hull_service_pb2.ReadEntitiesResponse]) -> Entities:
    """All keys of a hull, received in one or more parts."""
    received = list(parts)
    return Entities(
        received[0].revision,
        join_keys([decode_keys(part.keys) for part in received]),
        np.concatenate([decode_points(part.positions) for part in received]),
        np.concatenate([decode_times(part.times) for part in received]) if received[0].HasField("times") else None,
        np.concatenate([decode_accuracies(part) for part in received]) if received[0].HasField("accuracies") else None,
    )


def decode_stored(message: hull_service_pb2.ReadPointsResponse, info: HullInfo) -> Stored:
    """A part of the points of a hull."""
    keys = None if info.keyed is None else decode_keys(message.keys)
    if info.keyed == "int" and not len(message.points.packed):
        keys = np.empty(0, np.uint64)
    return Stored(
        info,
        decode_points(message.points),
        keys,
        _known(message.times, message.timed) if message.HasField("times") else None,
        _known(message.expire_times, message.expires) if message.HasField("expire_times") else None,
        decode_accuracies(message),
    )


def _known(message: points_pb2.Times, known: bytes) -> Times:
    """Times, NaT where none is known."""
    times = decode_times(message)
    return np.where(np.frombuffer(known, np.bool_), times, np.datetime64("NaT")) if known else times


def decode_event(message: hull_service_pb2.WatchResponse, *, keys: bool = False) -> Event | None:
    """An event of a watch; None if this version of the client does not know its kind."""
    measures = decode_measures(message.measures) if message.HasField("measures") else None
    head = message.revision, message.point_count
    cause, clock, center = CAUSES.get(message.cause, BATCH), _clock(message), decode_center(message)
    last = _changed(message), message.erased
    if message.HasField("snapshot"):
        snapshot = message.snapshot
        named = decode_names(snapshot.vertex_keys) if keys else None
        vertices = decode_points(snapshot.vertices)
        return Snapshot(*head, vertices, measures, snapshot.uid, named, cause, clock, center, *last)
    if message.HasField("sketch"):
        named = decode_names(message.sketch.keys) if keys else None
        sketch = message.sketch
        vertices = decode_points(sketch.vertices)
        return Sketch(*head, vertices, measures, named, cause, clock, center, sketch.error, sketch.uid, *last)
    if message.HasField("change"):
        change = message.change
        return Change(
            *head,
            decode_points(change.removed),
            np.array(change.removed_indices, np.intp),
            decode_points(change.added),
            np.array(change.added_indices, np.intp),
            change.rotation,
            measures,
            decode_names(change.added_keys) if keys else None,
            np.array(change.renamed_indices, np.intp) if keys else None,
            decode_names(change.renamed_keys) if keys else None,
            cause,
            clock,
            center,
            *last,
        )
    if message.HasField("progress"):
        return Progress(*head, cause, clock, center, *last)
    return None


def decode_verification(message: hull_service_pb2.VerifyResponse) -> Verification:
    """The result of a verification."""
    difference = None
    if message.HasField("first_difference"):
        first = message.first_difference
        difference = Difference(first.index, _only(first.live), _only(first.recomputed))
    rounds = tuple(ChanRound(r.guess, r.groups, r.steps, r.cost, r.closed) for r in message.rounds)
    counts = message.point_count, message.vertex_count
    differences = tuple(map(_decode_fence_difference, message.fence_differences))
    return Verification(
        message.revision,
        message.equal,
        *counts,
        rounds,
        difference,
        message.keys_equal,
        message.fence_count,
        differences,
    )


def _decode_fence_difference(message: hull_service_pb2.FenceDifference) -> FenceDifference:
    chosen = message.WhichOneof("key")
    key = None if chosen is None else getattr(message, chosen)
    return FenceDifference(message.fence, message.subject_hull, key, message.sequence, message.expected, message.found)


def _window(message: hull_pb2.Window) -> Window:
    return Window(
        message.max_age.ToTimedelta() if message.HasField("max_age") else None,
        message.max_points or None,
        "data" if message.clock == hull_pb2.CLOCK_DATA else "server",
        message.max_skew.ToTimedelta() if message.HasField("max_skew") else None,
        "clamp" if message.ahead == hull_pb2.AHEAD_POLICY_CLAMP else "refuse",
    )


def _clock(message: hull_pb2.Hull | batch_pb2.BatchResult | hull_service_pb2.WatchResponse) -> datetime | None:
    return decode_time(message.clock_time) if message.HasField("clock_time") else None


def _changed(message: hull_pb2.Hull | hull_service_pb2.WatchResponse) -> datetime | None:
    return decode_time(message.changed_time) if message.HasField("changed_time") else None


def _only(message: points_pb2.Points) -> tuple[float, float] | None:
    return next(((x, y) for x, y in decode_points(message).tolist()), None)
