"""The server's answers, as values with read-only numpy arrays. Points are (n, 2) arrays of float64."""

from dataclasses import dataclass
from datetime import UTC, datetime
from html import escape
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull._shown import geometry, svg
from dynhull._value import Value
from dynhull.arrays import Points as Points
from dynhull_proto.v1 import batch_pb2, hull_pb2, hull_service_pb2, points_pb2


@dataclass(frozen=True, slots=True)
class HullInfo:
    """A hull and its size: `points` counts duplicates, `distinct` does not.

    `uid` differs from that of an earlier or later hull of the same name.
    """

    name: str
    revision: int
    points: int
    distinct: int
    created: datetime
    uid: str


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Measures(Value):
    """Measures of a hull in the unit of its coordinates; `centroid` and `bounds` are NaN without points.

    `bounds` are the least x, least y, greatest x and greatest y.
    """

    area: float
    perimeter: float
    centroid: tuple[float, float]
    bounds: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Hull(Value):
    """A hull at one revision: (h, 2) vertices, counter-clockwise from the lexicographically smallest, and measures."""

    info: HullInfo
    vertices: Points
    measures: Measures

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
            "geometry": geometry(self.vertices),
            "properties": {
                "name": self.info.name,
                "revision": self.info.revision,
                "points": self.info.points,
                "area": self.measures.area,
                "perimeter": self.measures.perimeter,
            },
        }

    def _repr_html_(self) -> str:
        info, measures = self.info, self.measures
        caption = f"{info.points} points, {len(self.vertices)} vertices, area {measures.area:.6g}"
        return (
            f"<figure>{svg(self.vertices, info.name)}<figcaption><b>{escape(info.name)}</b> at revision "
            f"{info.revision}: {caption}</figcaption></figure>"
        )


@dataclass(frozen=True, slots=True)
class Applied:
    """The effect of a batch, and the number of points after it. A move counts as one deleted and one inserted.

    `missing` counts the deletes that were skipped because the hull did not hold the point. A `duplicate` had been
    applied before: its counts are 0, and the revision is one that includes it.
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
    """The effect of all `batches` of an ingest, and the hull's revision and number of points after the last one.

    `duplicates` counts the batches that an earlier call of the same producer had applied before.
    """

    batches: int
    revision: int
    inserted: int
    deleted: int
    missing: int
    points: int
    duplicates: int = 0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Located(Value):
    """The side of each point, (n,) int8: +1 inside, 0 on the boundary, -1 outside."""

    revision: int
    sides: npt.NDArray[np.int8]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Counted(Value):
    """The multiplicity of each point, (n,) int64; 0 for a point that the hull does not hold."""

    revision: int
    counts: npt.NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Supported(Value):
    """The extreme vertex in each direction, (n, 2)."""

    revision: int
    vertices: Points


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Distances(Value):
    """Distances of points to the hull, (n,): 0 inside and on the boundary, infinite from an empty hull."""

    revision: int
    distances: npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sampled(Value):
    """A sample of the points, (n, 2), in lexicographic order."""

    revision: int
    points: Points


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
class Snapshot(Value):
    """The whole hull. `uid` identifies it when a watch resumes."""

    revision: int
    points: int
    vertices: Points
    measures: Measures | None
    uid: str = ""

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry."""
        return geometry(self.vertices)

    def _repr_svg_(self) -> str:
        return svg(self.vertices, f"revision {self.revision}: {self.points} points, {len(self.vertices)} vertices")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Change(Value):
    """The difference to the vertices of the previous event, which `HullCopy` applies.

    Remove the rows `removed_rows`, move the first `rotation` of the remaining rows to the end, and insert `added` so
    that they become rows `added_rows` of the result.
    """

    revision: int
    points: int
    removed: Points
    removed_rows: npt.NDArray[np.intp]
    added: Points
    added_rows: npt.NDArray[np.intp]
    rotation: int
    measures: Measures | None


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Sketch(Value):
    """The extreme vertex in each requested direction, (k, 2); (0, 2) if the hull has no points."""

    revision: int
    points: int
    vertices: Points
    measures: Measures | None


@dataclass(frozen=True, slots=True)
class Progress:
    """The hull at this revision is the same as at the previous event."""

    revision: int
    points: int


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
class Verification:
    """The live hull compared with a hull computed anew from the stored points; `difference` is None if `equal`."""

    revision: int
    equal: bool
    points: int
    vertices: int
    rounds: tuple[ChanRound, ...]
    difference: Difference | None


def encode_points(xy: Points) -> points_pb2.Points:
    """Points in the form of a message."""
    return points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())


def decode_points(message: points_pb2.Points) -> Points:
    """Points as received, packed, which is what the client requests."""
    return np.frombuffer(message.packed, "<f8").reshape(-1, 2).astype(np.float64, copy=False)


def decode_info(message: hull_pb2.Hull) -> HullInfo:
    """A hull and its size."""
    created = message.create_time.ToDatetime(UTC)
    return HullInfo(
        message.name, message.revision, message.point_count, message.distinct_point_count, created, message.uid
    )


def decode_measures(message: hull_pb2.Measures) -> Measures:
    """Measures of a hull."""
    return Measures(
        message.area,
        message.perimeter,
        (message.centroid_x, message.centroid_y),
        (message.min_x, message.min_y, message.max_x, message.max_y),
    )


def decode_hull(message: hull_service_pb2.GetHullResponse) -> Hull:
    """A hull with vertices and measures."""
    return Hull(decode_info(message.hull), decode_points(message.vertices), decode_measures(message.measures))


def decode_applied(message: batch_pb2.BatchResult) -> Applied:
    """The effect of a batch."""
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
    """The effect of an ingest."""
    return Ingested(
        message.batches,
        message.revision,
        message.inserted,
        message.deleted,
        message.missing,
        message.point_count,
        message.duplicates,
    )


def decode_event(message: hull_service_pb2.WatchResponse) -> Event | None:
    """An event of a watch; None if this version of the client does not know its kind."""
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
    if message.HasField("progress"):
        return Progress(message.revision, message.point_count)
    return None


def decode_verification(message: hull_service_pb2.VerifyResponse) -> Verification:
    """The result of a verification."""
    difference = None
    if message.HasField("first_difference"):
        first = message.first_difference
        difference = Difference(first.index, _only(first.live), _only(first.recomputed))
    rounds = tuple(ChanRound(r.guess, r.groups, r.steps, r.cost, r.closed) for r in message.rounds)
    return Verification(message.revision, message.equal, message.point_count, message.vertex_count, rounds, difference)


def _only(message: points_pb2.Points) -> tuple[float, float] | None:
    return next(((x, y) for x, y in decode_points(message).tolist()), None)
