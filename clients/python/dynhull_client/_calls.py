"""Each call once: the request, how to read the answer, and the documentation.

The methods of `HullClient` and `AsyncHullClient` are made of these functions and those in `uses`.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import timedelta
from numbers import Real
from typing import TYPE_CHECKING, Any, Generic, Literal, Never, TypeVar
from uuid import uuid4

import numpy as np
from google.protobuf.duration_pb2 import Duration

from dynhull.arrays import as_points
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2

from . import _messages as messages
from ._batch import encode_batch
from ._errors import DynhullError, HullExistsError, HullNotFoundError
from ._messages import (
    Applied,
    Counted,
    Crossings,
    Distances,
    Hull,
    HullInfo,
    Located,
    Sampled,
    Supported,
    Tangents,
    Verification,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt
    from google.protobuf.message import Message

    from ._hull_copy import HullCopy

Answer = TypeVar("Answer")


def _nothing(_: DynhullError) -> None:
    return None


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """A call to make.

    Attributes:
        method: the RPC's name.
        request: the message to send.
        decode: makes the answer from the message received.
        timeout: seconds; None for the client's.
        repeatable: whether it may be sent again when its outcome is unknown.
        instead: the call to make after an error; None for none.
        awaits_hull: whether to repeat it until there is a hull and a server.
    """

    method: str
    request: Message
    decode: Callable[[Any], Answer]
    timeout: float | None
    repeatable: bool = True
    instead: Callable[[DynhullError], Call[Answer] | None] = _nothing
    awaits_hull: bool = False


def require_not_negative(**numbers: float | None) -> None:
    """Raise ValueError if one of the arguments is negative or not a number."""
    for argument, value in numbers.items():
        if isinstance(value, Real) and not value >= 0:
            raise ValueError(f"{argument} must be at least 0, got {value}")


def create_hull(name: str, *, exist_ok: bool = False, timeout: float | None = None) -> Call[HullInfo]:
    """Create an empty hull.

    Args:
        name: 1 to 200 letters a to z and A to Z, digits and "._-/".
        exist_ok: whether to return an existing hull of that name, with its points, instead of raising HullExistsError.
        timeout: seconds, instead of the client's.
    """
    create: Call[HullInfo] = Call(
        "CreateHull",
        pb.CreateHullRequest(name=name),
        lambda response: messages.decode_info(response.hull),
        timeout,
        repeatable=exist_ok,
        instead=lambda error: existing if exist_ok and isinstance(error, HullExistsError) else None,
    )
    existing: Call[HullInfo] = Call(
        "GetHull",
        pb.GetHullRequest(name=name, view=pb.HULL_VIEW_BASIC),
        lambda response: messages.decode_info(response.hull),
        timeout,
        instead=lambda error: create if isinstance(error, HullNotFoundError) else None,  # deleted in the meantime
    )
    return create


def wait_for_hull(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[HullInfo]:
    """Wait until there is a hull of that name, and a server if there is none yet.

    The client asks again after 0.1 to 1 seconds. DeadlineError after the timeout.

    Args:
        name: the hull.
        min_revision: a revision that the hull must have reached.
        timeout: seconds, instead of the client's.
    """
    request = pb.GetHullRequest(name=name, min_revision=min_revision, view=pb.HULL_VIEW_BASIC)
    return Call("GetHull", request, lambda response: messages.decode_info(response.hull), timeout, awaits_hull=True)


def delete_hull(name: str, *, timeout: float | None = None) -> Call[None]:
    """Delete a hull and its points."""
    return Call("DeleteHull", pb.DeleteHullRequest(name=name), lambda _: None, timeout, repeatable=False)


def list_page(prefix: str, page_token: str, timeout: float | None) -> Call[tuple[list[HullInfo], str]]:
    """A page of hulls, and the token of the next page, which is empty after the last."""

    def decode(response: pb.ListHullsResponse) -> tuple[list[HullInfo], str]:
        return [messages.decode_info(each) for each in response.hulls], response.next_page_token

    return Call("ListHulls", pb.ListHullsRequest(prefix=prefix, page_token=page_token), decode, timeout)


def apply(  # noqa: D417  # unnamed takes nothing
    name: str,
    *unnamed: Never,
    insert: npt.ArrayLike | None = None,
    delete: npt.ArrayLike | None = None,
    move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    missing: Literal["raise", "count"] = "raise",
    producer: str = "",
    sequence: int = 0,
    timeout: float | None = None,
) -> Call[Applied]:
    """Apply one batch: all of it or nothing, as one revision.

    Args:
        name: the hull.
        insert: (n, 2) points to insert.
        delete: (n, 2) points to delete.
        move: origins and destinations, (n, 2) each: row by row a delete and an insert.
        missing: for a point to delete that the hull does not hold: "raise" refuses the batch with PointMissingError,
            which names the row; "count" skips the point and counts it.
        producer: a name for the sender that numbers the batch, so that it is applied once however often it is sent.
        sequence: the batch's number. A producer numbers its batches to a hull 1, 2, 3, ...; SequenceGapError reports
            the next number.
        timeout: seconds, instead of the client's.
    """
    if unnamed:
        raise TypeError(
            f"apply({name!r}, points) does not say what to do with the points: "
            f"write apply({name!r}, insert=points) or apply({name!r}, delete=points)"
        )
    batch = encode_batch(insert, delete, move, missing)
    request = pb.ApplyRequest(name=name, batch=batch, producer=producer, sequence=sequence)
    return Call(
        "Apply", request, lambda response: messages.decode_applied(response.result), timeout, repeatable=sequence > 0
    )


def last_sequence(name: str, producer: str, *, timeout: float | None = None) -> Call[int]:
    """The number of the last batch of a producer that was applied; 0 if there is none."""
    request = pb.GetProducerRequest(name=name, producer=producer)
    return Call("GetProducer", request, lambda response: int(response.last_sequence), timeout)


def locate(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Located]:
    """The side of each of (n, 2) points: +1 inside, 0 on the boundary, -1 outside. Exact.

    With `min_revision`, this and the other reads wait until the hull has reached that revision.
    """
    request = pb.LocateRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.LocateResponse) -> Located:
        return Located(response.revision, np.frombuffer(response.sides, np.int8))

    return Call("Locate", request, decode, timeout)


def count(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Counted]:
    """The multiplicity of each of (n, 2) points; 0 for a point that the hull does not hold."""
    request = pb.CountRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.CountResponse) -> Counted:
        return Counted(response.revision, np.array(response.counts, np.int64))

    return Call("Count", request, decode, timeout)


def support(
    name: str, directions: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
) -> Call[Supported]:
    """The extreme vertex in each of (n, 2) directions, which may have any length but 0. Exact.

    HullEmptyError if the hull has no points.
    """
    vectors = encoded(directions, "directions")
    request = pb.SupportRequest(name=name, min_revision=min_revision, directions=vectors)

    def decode(response: pb.SupportResponse) -> Supported:
        return Supported(response.revision, messages.decode_points(response.vertices))

    return Call("Support", request, decode, timeout)


def tangents(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Tangents]:
    """The left and right tangent points of each of (n, 2) points; NaN for points not strictly outside. Exact."""
    request = pb.TangentsRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.TangentsResponse) -> Tangents:
        left, right = messages.decode_points(response.left), messages.decode_points(response.right)
        return Tangents(response.revision, np.stack((left, right), axis=1))

    return Call("Tangents", request, decode, timeout)


def distance(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Distances]:
    """The distance of each of (n, 2) points to the hull: 0 inside and on the boundary, inf if the hull is empty."""
    request = pb.DistanceRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.DistanceResponse) -> Distances:
        return Distances(response.revision, np.array(response.distances, np.float64))

    return Call("Distance", request, decode, timeout)


def intersect_lines(
    name: str, p: npt.ArrayLike, q: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
) -> Call[Crossings]:
    """The points where the line through each of (n, 2) p and q enters and leaves the hull; NaN if it misses."""
    request = pb.IntersectLinesRequest(
        name=name, min_revision=min_revision, origins=encoded(p, "p"), targets=encoded(q, "q")
    )

    def decode(response: pb.IntersectLinesResponse) -> Crossings:
        entries, exits = messages.decode_points(response.entries), messages.decode_points(response.exits)
        return Crossings(response.revision, np.stack((entries, exits), axis=1))

    return Call("IntersectLines", request, decode, timeout)


def get_hull(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Hull]:
    """The vertices, size, area, perimeter, centroid and bounds."""
    return Call("GetHull", pb.GetHullRequest(name=name, min_revision=min_revision), messages.decode_hull, timeout)


def sample_points(name: str, size: int = 1000, *, min_revision: int = 0, timeout: float | None = None) -> Call[Sampled]:
    """A sample of at most `size` points, and never more than 100 000; all points if there are no more.

    Inserting or deleting a point changes at most one point of the sample.
    """
    request = pb.SamplePointsRequest(name=name, sample_size=size, min_revision=min_revision)

    def decode(response: pb.SamplePointsResponse) -> Sampled:
        return Sampled(response.revision, messages.decode_points(response.points))

    return Call("SamplePoints", request, decode, timeout)


def verify(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Verification]:
    """Compare the live hull with one that Chan's algorithm computes from the stored points."""
    request = pb.VerifyRequest(name=name, min_revision=min_revision)
    return Call("Verify", request, messages.decode_verification, timeout)


@dataclass(frozen=True, slots=True)
class Ingesting:
    """An ingest to begin."""

    name: str
    missing: Literal["raise", "count"]
    timeout: float | None

    def first(self) -> pb.IngestRequest:
        """The first message, which only names the hull: a wrong name fails before the first batch."""
        return pb.IngestRequest(name=self.name)

    def batch(
        self,
        insert: npt.ArrayLike | None,
        delete: npt.ArrayLike | None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None,
    ) -> pb.IngestRequest:
        """The message for a batch."""
        return pb.IngestRequest(batch=encode_batch(insert, delete, move, self.missing))


def ingest(name: str, *, missing: Literal["raise", "count"] = "raise", timeout: float | None = None) -> Ingesting:
    """A stream of batches in one call, for use in a with statement. `missing` as for `apply`.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> with client.ingest("fleet") as stream:  # doctest: +SKIP
    ...     for minute in minutes:
    ...         stream.apply(move=(before, after))
    >>> stream.summary.batches  # doctest: +SKIP
    1440
    """
    return Ingesting(name, missing, timeout)


@dataclass(frozen=True, slots=True)
class Writing:
    """A writer to open."""

    name: str
    producer: str
    batch_points: int
    linger: float
    in_flight: int
    missing: Literal["raise", "count"]
    stop_on_error: bool
    patience: float


def writer(
    name: str,
    *,
    producer: str | None = None,
    batch_points: int = 8192,
    linger: float = 0.02,
    in_flight: int = 32,
    missing: Literal["raise", "count"] = "raise",
    stop_on_error: bool = False,
    patience: float = 60.0,
) -> Writing:
    """A writer that gathers points into batches, each applied exactly once.

    >>> from dynhull_client import HullClient
    >>> client = HullClient()  # doctest: +SKIP
    >>> with client.writer("fleet") as writer:  # doctest: +SKIP
    ...     for before, after in moves:
    ...         writer.put(move=(before, after))

    Without a with statement, end with `close()`: points that were not sent by then are lost otherwise. The writer needs
    memory for about `in_flight + 1` batches: `put` waits while that many are not acknowledged.

    Args:
        name: the hull.
        producer: a name for the sender that numbers the batches; by default a new one. A writer with the name of an
            earlier one continues after the last batch that was acknowledged. Two writers at the same time must not
            share a name.
        batch_points: a batch is sent when it has this many points,
        linger: or this many seconds after its first point.
        in_flight: the most batches that are sent and not acknowledged.
        missing: as for `apply`.
        stop_on_error: whether a refused batch ends the writer; otherwise the batches after it are still applied.
        patience: seconds without a server after which the writer gives up.
    """
    for argument, value in (("batch_points", batch_points), ("in_flight", in_flight)):
        if value < 1:
            raise ValueError(f"{argument} must be at least 1, got {value}")
    producer = f"writer-{uuid4().hex}" if producer is None else producer
    return Writing(name, producer, batch_points, linger, in_flight, missing, stop_on_error, patience)


@dataclass(frozen=True, slots=True)
class Watching:
    """A watch to begin."""

    request: pb.WatchRequest
    copy: HullCopy | None
    follow: bool
    reconnect: bool
    timeout: float | None


def watch(
    name: str,
    *,
    min_revision: int = 0,
    max_rate: float = 0.0,
    progress_interval: float | None = None,
    measures: bool = False,
    copy: HullCopy | None = None,
    resume: HullCopy | None = None,
    directions: npt.ArrayLike | None = None,
    follow: bool = False,
    reconnect: bool = True,
    timeout: float | None = None,
) -> Watching:
    """Follow a hull: an iterator of events, from which a `HullCopy` maintains a copy of the hull.

    >>> from dynhull_client import HullClient, HullCopy
    >>> client, copy = HullClient(), HullCopy()  # doctest: +SKIP
    >>> for event in client.watch("fleet", copy=copy):  # doctest: +SKIP
    ...     print(event.revision, len(copy.vertices))

    Args:
        name: the hull.
        min_revision: the first event waits until the hull has reached it.
        max_rate: the most events a second, each with all changes since the one before; 0 for no limit.
        progress_interval: seconds without an event after which a Progress is sent; None for never.
        measures: whether events include measures.
        copy: a copy that the watch itself updates before it returns an event. If the copy holds the hull already, the
            watch continues from there.
        resume: a copy that the caller updates: the watch begins with the changes since then, not with a snapshot.
        directions: (k, 2) vectors; the watch then sends no vertices but `Sketch` events with the extreme vertices in
            these directions.
        follow: whether the watch survives the deletion of the hull: it returns a `Deleted` event, and a Snapshot when
            there is a new hull of that name. It also waits for a hull that does not exist yet. Without it,
            HullNotFoundError ends the watch. With `directions`, the watch notices only a deletion that happens while it
            is connected.
        reconnect: whether the watch continues after a lost connection, however long that takes, with the changes since
            then, or with a snapshot if the server no longer has them. The first connection must succeed. Without it,
            UnavailableError ends the watch, as does RevisionForgottenError if the server cannot continue from a copy.
        timeout: seconds after which the watch ends with DeadlineError; None for never.
    """
    request = pb.WatchRequest(
        name=name, min_revision=min_revision, max_events_per_second=max_rate, include_measures=measures
    )
    if copy is not None and resume is not None:
        raise ValueError("give either copy, which the watch updates, or resume, which the caller updates, not both")
    held = copy if copy is not None and copy.uid else resume
    if held is not None:
        request.resume.uid, request.resume.revision = held.uid, held.revision
    if directions is not None:
        request.directions.CopyFrom(encoded(directions, "directions"))
    if progress_interval is not None:
        duration = Duration()
        duration.FromTimedelta(timedelta(seconds=progress_interval))
        request.progress_interval.CopyFrom(duration)
    return Watching(request, copy, follow, reconnect, timeout)


def encoded(xy: npt.ArrayLike, name: str) -> points_pb2.Points:
    """Points in the form of a message; ValueError or TypeError names the argument and the first bad row."""
    return messages.encode_points(as_points(xy, name))
