"""What a watch of many hulls returns."""

from dataclasses import dataclass
from datetime import datetime
from typing import Any, Literal

from dynhull._shown import Shown
from dynhull._value import Value
from dynhull.arrays import Points
from dynhull_proto.v1 import hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._messages import Measures, decode_measures, decode_points, shown_geometry, shown_svg
from ._times import decode_time

ManyKind = Literal["state", "unchanged", "gone", "restored", "complete", "position"]


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ManyChange(Value, Shown):
    """What has become of one of many hulls, or how far the watch is.

    Attributes:
        kind: "state", the newest state of a hull; "unchanged", a hull that is as it was at the position which the watch
            went on from; "gone", a hull that was deleted; "restored", the server was led back, and what came before is
            no more; "complete", all hulls that there are have been named; "position", how far the watch is.
        hull: its name; empty where the change is not about one.
        position: what `watch_many` goes on from, also after a restart of the program or of the server; None before the
            first picture is complete.
        uid: differs from that of an earlier or later hull of the same name.
        revision: its revision.
        points: the number of points with duplicates: in a keyed hull, of keys.
        distinct: the number of distinct points.
        held: the number of keys in quarantine.
        vertex_count: the number of vertices.
        measures: its measures; None for a hull without points.
        changed: when its last batch was committed, by the clock of the server; None where that is not known.
        clock: its clock, as in `HullInfo`.
        geographic: whether its points are longitudes and latitudes in degrees.
        center: longitude and latitude of the centre of a geographic hull; None if it has none so far.
        vertices: (h, 2) vertices, or some of them, if the watch is of outlines; else None.
        error: how far the hull reaches beyond these vertices: 0 for all of them.
    """

    kind: ManyKind
    hull: str = ""
    position: bytes | None = None
    uid: str = ""
    revision: int = 0
    points: int = 0
    distinct: int = 0
    held: int = 0
    vertex_count: int = 0
    measures: Measures | None = None
    changed: datetime | None = None
    clock: datetime | None = None
    geographic: bool = False
    center: tuple[float, float] | None = None
    vertices: Points | None = None
    error: float = 0.0

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The outline as a GeoJSON geometry; AttributeError if the watch is of summaries."""
        return shown_geometry(self._outline, self.center)

    def _repr_svg_(self) -> str:
        return shown_svg(self._outline, self.center, f"{self.hull}: {self.points} points at revision {self.revision}")

    @property
    def _outline(self) -> Points:
        if self.vertices is None:
            raise AttributeError('only a watch with contents="outline" has vertices')
        return self.vertices


def decode_now(message: pb.HullNow, position: bytes | None) -> ManyChange:
    """What is known of a hull; `position` is that of the watch."""
    if message.presence == pb.HULL_PRESENCE_GONE:
        return ManyChange("gone", message.name, position)
    if message.presence == pb.HULL_PRESENCE_UNCHANGED:
        return ManyChange("unchanged", message.name, position)
    return ManyChange(
        "state",
        message.name,
        position,
        message.uid,
        message.revision,
        message.point_count,
        message.distinct_count,
        message.held_count,
        message.vertex_count,
        decode_measures(message.measures) if message.HasField("measures") else None,
        decode_time(message.changed_time) if message.HasField("changed_time") else None,
        decode_time(message.clock_time) if message.HasField("clock_time") else None,
        message.frame == hull_pb2.FRAME_GEOGRAPHIC,
        (message.center.longitude, message.center.latitude) if message.HasField("center") else None,
        decode_points(message.vertices) if message.HasField("vertices") else None,
        message.error,
    )
