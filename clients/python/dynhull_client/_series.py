"""The call for the measures that a server has kept of a hull, made as those in `_calls`, and its answer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from dynhull._value import Value
from dynhull_proto.v1 import hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

from ._calls import Call
from ._times import Times, decode_time, decode_times, encode_duration

if TYPE_CHECKING:
    from datetime import datetime, timedelta

    import numpy.typing as npt


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Series(Value):
    """How a hull was over the last time: n rows, the oldest first. The last one is of now.

    A row says how the hull was at its time, and since its `changed_times`; the hull was so until the `changed_times` of
    the next row, or has changed in between for less than `interval`. Areas and lengths are in the units of the
    coordinates; on the globe in square metres and metres.

    Attributes:
        uid: distinguishes the hull from others of its name.
        geographic: whether it is on the globe.
        since: the time from which on the server has kept rows, or those that were asked for.
        interval: seconds between two rows of a hull that changes all the time; 0.0 where the server keeps none.
        times: (n,) the time of each row, in UTC.
        changed_times: (n,) when the newest batch was committed, or points last left by time; NaT where that is not
            known.
        revisions: (n,) revisions of the hull.
        points: (n,) numbers of points.
        vertices: (n,) numbers of vertices.
        areas: (n,) areas.
        perimeters: (n,) lengths of the boundary.
        diameters: (n,) greatest distances of two vertices; NaN of more than 256 vertices.
        widths: (n,) least distances of two parallel lines around the hull; NaN of more than 256 vertices, and on the
            globe.
    """

    uid: str
    geographic: bool
    since: datetime
    interval: float
    times: Times
    changed_times: Times
    revisions: npt.NDArray[np.uint64]
    points: npt.NDArray[np.uint64]
    vertices: npt.NDArray[np.uint32]
    areas: npt.NDArray[np.float64]
    perimeters: npt.NDArray[np.float64]
    diameters: npt.NDArray[np.float64]
    widths: npt.NDArray[np.float64]

    @property
    def rates(self) -> npt.NDArray[np.float64]:
        """(n,) revisions a second before each row, in `interval` or since the row before it; NaN for the first one."""
        rates = np.full(len(self.times), np.nan)
        seconds = np.diff(self.times) / np.timedelta64(1, "s")
        if self.interval:
            seconds = np.minimum(seconds, self.interval)
        with np.errstate(divide="ignore", invalid="ignore"):
            rates[1:] = np.diff(self.revisions.astype(np.int64)) / seconds
        return rates


def series(name: str, last: float | timedelta | str | None = None, *, timeout: float | None = None) -> Call[Series]:
    """How the measures of a hull were over the last hour: a row about every ten seconds in which it changed.

    The server keeps them in memory (`dynhull serve --series-kept`), and begins anew when it starts, or when another one
    takes the hull over: `since` says when.

    Args:
        name: the hull.
        last: rows of the last seconds only, or of a timedelta, and the one before them.
        timeout: seconds, instead of the client's.
    """
    request = pb.GetSeriesRequest(name=name, last=None if last is None else encode_duration(last, "last"))
    return Call("GetSeries", request, _decode, timeout)


def _decode(response: pb.GetSeriesResponse) -> Series:
    changed = decode_times(response.changed_times)
    doubles: list[Any] = [response.areas, response.perimeters, response.diameters, response.widths]
    return Series(
        response.uid,
        response.frame == hull_pb2.FRAME_GEOGRAPHIC,
        decode_time(response.since_time),
        response.interval.ToTimedelta().total_seconds(),
        decode_times(response.times),
        np.where(changed.view(np.int64) == 0, np.datetime64("NaT"), changed),
        np.array(response.revisions, np.uint64),
        np.array(response.point_counts, np.uint64),
        np.array(response.vertex_counts, np.uint32),
        *(np.array(column, np.float64) for column in doubles),
    )
