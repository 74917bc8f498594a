"""What the server answers, as values with numpy arrays. Points are (n, 2) arrays of float64."""

from dataclasses import dataclass
from datetime import UTC, datetime

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points as Points
from dynhull_proto.v1 import batch_pb2, hull_pb2, hull_service_pb2, points_pb2


@dataclass(frozen=True, slots=True)
class HullInfo:
    """A hull and how much it holds; `points` with multiplicity, `distinct` without.

    `uid` tells it from an earlier or later hull of the same name.
    """

    name: str
    revision: int
    points: int
    distinct: int
    created: datetime
    uid: str


@dataclass(frozen=True, slots=True)
class Measures:
    """Measures of a hull in the unit of its coordinates; NaN where a hull without points has none.

    `bounds` are least x, least y, greatest x, greatest y.
    """

    area: float
    perimeter: float
    centroid: tuple[float, float]
    bounds: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class Hull:
    """A hull at one revision: vertices counter-clockwise from the lexicographically smallest, and their measures."""

    info: HullInfo
    vertices: Points
    measures: Measures

    @property
    def revision(self) -> int:
        """The revision."""
        return self.info.revision


@dataclass(frozen=True, slots=True)
class Applied:
    """What a batch did, and the number of points after it. A move counts as one deleted and one inserted.

    `missing` is the number of deletes passed over because the point was not there. A `duplicate` had been applied
    before; its counts are 0, and the revision is one that has it.
    """

    revision: int
    inserted: int
    deleted: int
    missing: int
    hull_changed: bool
    points: int
    duplicate: bool = False


@dataclass(frozen=True, slots=True)
class Ingested:
    """What an ingest did in all its `batches`, and the hull's revision and number of points after the last.

    `duplicates` are batches that had been applied before, by an earlier call of the same producer.
    """

    batches: int
    revision: int
    inserted: int
    deleted: int
    missing: int
    points: int
    duplicates: int = 0


@dataclass(frozen=True, slots=True)
class Located:
    """Where points are: `sides` as int8, +1 inside, 0 on the boundary, -1 outside."""

    revision: int
    sides: npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True)
class Counted:
    """How many times points are there, an integer each."""

    revision: int
    counts: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Supported:
    """The extreme vertices, (n, 2), one for each direction."""

    revision: int
    vertices: Points


@dataclass(frozen=True, slots=True)
class Distances:
    """Distances of points to the hull, (n,): 0 inside and on the boundary, infinite from an empty hull."""

    revision: int
    distances: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Sampled:
    """Some of the points, (n, 2), in lexicographic order."""

    revision: int
    points: Points


@dataclass(frozen=True, slots=True)
class Crossings:
    """(n, 2, 2) where lines enter and leave the hull, as of `DynamicHull.intersect_lines`."""

    revision: int
    crossings: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Tangents:
    """(n, 2, 2) left and right tangent points, as of `DynamicHull.tangents`."""

    revision: int
    tangents: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Snapshot:
    """The whole hull; `uid` is the hull's, for resuming."""

    revision: int
    points: int
    vertices: Points
    measures: Measures | None
    uid: str = ""


@dataclass(frozen=True, slots=True)
class Change:
    """What to do to the vertices at the event before; see `HullCopy`.

    Strike the rows `removed_rows`, move the first `rotation` of the rest to the end, put in `added` so that they stand
    at `added_rows` of the result.
    """

    revision: int
    points: int
    removed: Points
    removed_rows: npt.NDArray[np.intp]
    added: Points
    added_rows: npt.NDArray[np.intp]
    rotation: int
    measures: Measures | None


@dataclass(frozen=True, slots=True)
class Sketch:
    """The extreme vertices in the directions asked for, one each; none where the hull has no points."""

    revision: int
    points: int
    vertices: Points
    measures: Measures | None


@dataclass(frozen=True, slots=True)
class Progress:
    """The hull at this revision is the one of the event before."""

    revision: int
    points: int


Event = Snapshot | Change | Sketch | Progress


@dataclass(frozen=True, slots=True)
class ChanRound:
    """One round of Chan's algorithm.

    Groups of at most `guess` points, `steps` vertices found, the estimated `cost` n log2(guess), and whether the hull
    closed.
    """

    guess: int
    groups: int
    steps: int
    cost: float
    closed: bool


@dataclass(frozen=True, slots=True)
class Difference:
    """The first row in which two lists of vertices differ; None where a list has ended."""

    row: int
    live: tuple[float, float] | None
    recomputed: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class Verification:
    """The live hull against the hull of the stored points computed anew; no `difference` where `equal`."""

    revision: int
    equal: bool
    points: int
    vertices: int
    rounds: tuple[ChanRound, ...]
    difference: Difference | None


def encode_points(xy: Points) -> points_pb2.Points:
    """Points as sent."""
    return points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())


def decode_points(message: points_pb2.Points) -> Points:
    """Points as received: the client asks for packed ones."""
    return np.frombuffer(message.packed, "<f8").reshape(-1, 2).astype(np.float64)


def decode_info(message: hull_pb2.Hull) -> HullInfo:
    """A hull's counts."""
    created = message.create_time.ToDatetime(UTC)
    return HullInfo(
        message.name, message.revision, message.point_count, message.distinct_point_count, created, message.uid
    )


def decode_measures(message: hull_pb2.Measures) -> Measures:
    """A hull's measures."""
    return Measures(
        message.area,
        message.perimeter,
        (message.centroid_x, message.centroid_y),
        (message.min_x, message.min_y, message.max_x, message.max_y),
    )


def decode_hull(message: hull_service_pb2.GetHullResponse) -> Hull:
    """A hull."""
    return Hull(decode_info(message.hull), decode_points(message.vertices), decode_measures(message.measures))


def decode_applied(message: batch_pb2.BatchResult) -> Applied:
    """What a batch did."""
    return Applied(
        message.revision,
        message.inserted,
        message.deleted,
        message.missing,
        message.hull_changed,
        message.point_count,
        message.duplicate,
    )


def decode_ingested(message: hull_service_pb2.IngestResponse) -> Ingested:
    """What an ingest did."""
    return Ingested(
        message.batches,
        message.revision,
        message.inserted,
        message.deleted,
        message.missing,
        message.point_count,
        message.duplicates,
    )


def decode_event(message: hull_service_pb2.WatchResponse) -> Event:
    """What a watcher is told."""
    measures = decode_measures(message.measures) if message.HasField("measures") else None
    if message.HasField("snapshot"):
        snapshot = message.snapshot
        return Snapshot(message.revision, message.point_count, decode_points(snapshot.vertices), measures, snapshot.uid)
    if message.HasField("sketch"):
        return Sketch(message.revision, message.point_count, decode_points(message.sketch.vertices), measures)
    if message.HasField("change"):
        change = message.change
        return Change(
            message.revision,
            message.point_count,
            decode_points(change.removed),
            np.array(change.removed_indices, np.intp),
            decode_points(change.added),
            np.array(change.added_indices, np.intp),
            change.rotation,
            measures,
        )
    return Progress(message.revision, message.point_count)


def decode_verification(message: hull_service_pb2.VerifyResponse) -> Verification:
    """The outcome of a verification."""
    difference = None
    if message.HasField("first_difference"):
        first = message.first_difference
        difference = Difference(first.index, _only(first.live), _only(first.recomputed))
    rounds = tuple(ChanRound(r.guess, r.groups, r.steps, r.cost, r.closed) for r in message.rounds)
    return Verification(message.revision, message.equal, message.point_count, message.vertex_count, rounds, difference)


def _only(message: points_pb2.Points) -> tuple[float, float] | None:
    return next(((x, y) for x, y in decode_points(message).tolist()), None)
