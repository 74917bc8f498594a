"""Each call once: what is sent, how the answer is read, and what to tell whoever calls.

`HullClient` and `AsyncHullClient` are made of these functions and those in `uses`, which are their documentation too.
"""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from typing import Any, Generic, TypeVar
from uuid import uuid4

import numpy as np
import numpy.typing as npt
from google.protobuf.duration_pb2 import Duration
from google.protobuf.message import Message

from dynhull.arrays import as_points
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2

from . import messages
from .batch import Missing, encode_batch
from .hull_copy import HullCopy
from .messages import (
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

Answer = TypeVar("Answer")


@dataclass(frozen=True, slots=True)
class Call(Generic[Answer]):
    """A call to be made.

    Attributes:
        method: the RPC's name.
        request: the message to send.
        decode: from the message received to the answer.
        timeout: seconds; None for the client's.
        repeatable: whether it may be sent again when nobody knows what became of it.
    """

    method: str
    request: Message
    decode: Callable[[Any], Answer]
    timeout: float | None
    repeatable: bool = True


def create_hull(name: str, *, timeout: float | None = None) -> Call[HullInfo]:
    """Make an empty hull; HullExistsError where there is one of that name.

    A name is 1 to 200 letters, digits and "._-/".
    """
    request = pb.CreateHullRequest(name=name)
    return Call("CreateHull", request, lambda response: messages.decode_info(response.hull), timeout, repeatable=False)


def delete_hull(name: str, *, timeout: float | None = None) -> Call[None]:
    """Remove a hull with its points."""
    return Call("DeleteHull", pb.DeleteHullRequest(name=name), lambda _: None, timeout, repeatable=False)


def list_page(prefix: str, page_token: str, timeout: float | None) -> Call[tuple[list[HullInfo], str]]:
    """A page of hulls, and the token of the next one; empty for the last."""

    def decode(response: pb.ListHullsResponse) -> tuple[list[HullInfo], str]:
        return [messages.decode_info(each) for each in response.hulls], response.next_page_token

    return Call("ListHulls", pb.ListHullsRequest(prefix=prefix, page_token=page_token), decode, timeout)


def apply(
    name: str,
    *,
    insert: npt.ArrayLike | None = None,
    delete: npt.ArrayLike | None = None,
    move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    missing: Missing = "raise",
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
        missing: for a point to delete that is not there: "raise" refuses the batch with PointMissingError, which
            names the row; "count" passes over it and counts it.
        producer: who numbers the batch, so that it is applied once however often it is sent.
        sequence: its number. A producer's numbers to a hull are 1, 2, 3, ...; SequenceGapError tells the next one.
        timeout: seconds, instead of the client's.
    """
    batch = encode_batch(insert, delete, move, missing)
    request = pb.ApplyRequest(name=name, batch=batch, producer=producer, sequence=sequence)
    return Call(
        "Apply", request, lambda response: messages.decode_applied(response.result), timeout, repeatable=sequence > 0
    )


def last_sequence(name: str, producer: str, *, timeout: float | None = None) -> Call[int]:
    """The number of the last batch of a producer that was applied; 0 where there is none."""
    request = pb.GetProducerRequest(name=name, producer=producer)
    return Call("GetProducer", request, lambda response: int(response.last_sequence), timeout)


def locate(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Located]:
    """Where each of (n, 2) points is: +1 inside, 0 on the boundary, -1 outside. Exact.

    With a `min_revision`, waits until the hull has it; so do the other reads.
    """
    request = pb.LocateRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.LocateResponse) -> Located:
        return Located(response.revision, np.frombuffer(response.sides, np.int8))

    return Call("Locate", request, decode, timeout)


def count(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Counted]:
    """How many times each of (n, 2) points is there."""
    request = pb.CountRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.CountResponse) -> Counted:
        return Counted(response.revision, np.array(response.counts, np.int64))

    return Call("Count", request, decode, timeout)


def support(
    name: str, directions: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
) -> Call[Supported]:
    """The extreme vertex in each of (n, 2) directions, of any length but 0. Exact.

    HullEmptyError where there are no points.
    """
    vectors = encoded(directions, "directions")
    request = pb.SupportRequest(name=name, min_revision=min_revision, directions=vectors)

    def decode(response: pb.SupportResponse) -> Supported:
        return Supported(response.revision, messages.decode_points(response.vertices))

    return Call("Support", request, decode, timeout)


def tangents(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Tangents]:
    """Left and right tangent points from each of (n, 2) points; NaN for those not strictly outside. Exact."""
    request = pb.TangentsRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.TangentsResponse) -> Tangents:
        left, right = messages.decode_points(response.left), messages.decode_points(response.right)
        return Tangents(response.revision, np.stack((left, right), axis=1))

    return Call("Tangents", request, decode, timeout)


def distance(name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Call[Distances]:
    """How far each of (n, 2) points is from the hull: 0 inside and on the boundary, infinite from an empty hull."""
    request = pb.DistanceRequest(name=name, min_revision=min_revision, points=encoded(xy, "xy"))

    def decode(response: pb.DistanceResponse) -> Distances:
        return Distances(response.revision, np.array(response.distances, np.float64))

    return Call("Distance", request, decode, timeout)


def intersect_lines(
    name: str, p: npt.ArrayLike, q: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
) -> Call[Crossings]:
    """Where the lines through each of (n, 2) points p and q enter and leave the hull; NaN for one that misses."""
    request = pb.IntersectLinesRequest(
        name=name, min_revision=min_revision, origins=encoded(p, "p"), targets=encoded(q, "q")
    )

    def decode(response: pb.IntersectLinesResponse) -> Crossings:
        entries, exits = messages.decode_points(response.entries), messages.decode_points(response.exits)
        return Crossings(response.revision, np.stack((entries, exits), axis=1))

    return Call("IntersectLines", request, decode, timeout)


def get_hull(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Hull]:
    """The vertices, counts, area, perimeter, centroid and bounds."""
    return Call("GetHull", pb.GetHullRequest(name=name, min_revision=min_revision), messages.decode_hull, timeout)


def sample_points(name: str, size: int = 1000, *, min_revision: int = 0, timeout: float | None = None) -> Call[Sampled]:
    """At most `size` of the points, and never more than 100 000; all where they are no more.

    A point that comes or goes changes at most one of the sample.
    """
    request = pb.SamplePointsRequest(name=name, sample_size=size, min_revision=min_revision)

    def decode(response: pb.SamplePointsResponse) -> Sampled:
        return Sampled(response.revision, messages.decode_points(response.points))

    return Call("SamplePoints", request, decode, timeout)


def verify(name: str, *, min_revision: int = 0, timeout: float | None = None) -> Call[Verification]:
    """Compare the live hull with Chan's algorithm on the stored points."""
    request = pb.VerifyRequest(name=name, min_revision=min_revision)
    return Call("Verify", request, messages.decode_verification, timeout)


@dataclass(frozen=True, slots=True)
class Ingesting:
    """An ingest to be made."""

    name: str
    missing: Missing
    timeout: float | None

    def first(self) -> pb.IngestRequest:
        """The first message only names the hull, so that a wrong name is an error before there is a batch."""
        return pb.IngestRequest(name=self.name)

    def batch(
        self,
        insert: npt.ArrayLike | None,
        delete: npt.ArrayLike | None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None,
    ) -> pb.IngestRequest:
        """The message of a batch."""
        return pb.IngestRequest(batch=encode_batch(insert, delete, move, self.missing))


def ingest(name: str, *, missing: Missing = "raise", timeout: float | None = None) -> Ingesting:
    """A stream of batches, for use in a with statement.

    >>> with client.ingest("fleet") as stream:  # doctest: +SKIP
    ...     for minute in minutes:
    ...         stream.apply(move=(before, after))
    >>> stream.summary.batches  # doctest: +SKIP
    1440
    """
    return Ingesting(name, missing, timeout)


@dataclass(frozen=True, slots=True)
class Writing:
    """A writer to be opened."""

    name: str
    producer: str
    batch_points: int
    linger: float
    in_flight: int
    missing: Missing
    stop_on_error: bool
    patience: float


def writer(
    name: str,
    *,
    producer: str | None = None,
    batch_points: int = 8192,
    linger: float = 0.02,
    in_flight: int = 32,
    missing: Missing = "raise",
    stop_on_error: bool = False,
    patience: float = 60.0,
) -> Writing:
    """A writer that gathers points into batches, each applied exactly once, for use in a with statement.

    >>> with client.writer("fleet") as writer:  # doctest: +SKIP
    ...     for before, after in moves:
    ...         writer.put(move=(before, after))

    It needs at most about `in_flight + 1` batches of memory: `put` waits while that many are not acknowledged.

    Args:
        name: the hull.
        producer: who numbers the batches. A writer of the same name goes on where an earlier one was acknowledged;
            without, a new name. Two at a time must not have the same.
        batch_points: a batch is sent when it has so many points, or more.
        linger: or so many seconds after its first ones.
        in_flight: at most so many batches are under way at a time.
        missing: as of `apply`.
        stop_on_error: whether a refused batch ends the writer; else the batches after it are applied all the same.
        patience: seconds without a server until the writer gives up.
    """
    for argument, value in (("batch_points", batch_points), ("in_flight", in_flight)):
        if value < 1:
            raise ValueError(f"{argument} must be at least 1, got {value}")
    producer = f"writer-{uuid4().hex}" if producer is None else producer
    return Writing(name, producer, batch_points, linger, in_flight, missing, stop_on_error, patience)


@dataclass(frozen=True, slots=True)
class Watching:
    """A watch to be made."""

    request: pb.WatchRequest
    copy: HullCopy | None
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
    reconnect: bool = True,
    timeout: float | None = None,
) -> Watching:
    """Follow a hull: an iterator of events, with which a `HullCopy` keeps a copy of the hull.

    >>> copy = HullCopy()
    >>> for event in client.watch("fleet", copy=copy):  # doctest: +SKIP
    ...     print(event.revision, len(copy.vertices))

    Args:
        name: the hull.
        min_revision: the first event waits for it.
        max_rate: at most so many events a second; 0 for no bound. Changes in between are taken together.
        progress_interval: a Progress after so many seconds without an event; None for none.
        measures: whether events carry measures.
        copy: a copy that the watch brings up to date itself, before it returns an event. What it holds already is
            gone on from.
        resume: a copy that the caller brings up to date with the events: changes since then instead of a snapshot.
        directions: (k, 2) vectors; instead of vertices, `Sketch` events with the extreme vertices in these.
        reconnect: whether the watch goes on by itself after a lost connection, for as long as it takes: with what has
            changed since, or with a snapshot where the server has forgotten that. The first connection must come about.
            Otherwise UnavailableError, and RevisionForgottenError where the server cannot go on from a copy.
        timeout: seconds after which the watch ends with DeadlineError; None for never.
    """
    request = pb.WatchRequest(
        name=name, min_revision=min_revision, max_events_per_second=max_rate, include_measures=measures
    )
    if copy is not None and resume is not None:
        raise ValueError("give a copy for the watch to keep, or one to resume from, not both")
    held = copy if copy is not None and copy.uid else resume
    if held is not None:
        request.resume.uid, request.resume.revision = held.uid, held.revision
    if directions is not None:
        request.directions.CopyFrom(encoded(directions, "directions"))
    if progress_interval is not None:
        duration = Duration()
        duration.FromTimedelta(timedelta(seconds=progress_interval))
        request.progress_interval.CopyFrom(duration)
    return Watching(request, copy, reconnect, timeout)


def encoded(xy: npt.ArrayLike, name: str) -> points_pb2.Points:
    """Points as sent; ValueError or TypeError names the argument and the first bad row."""
    return messages.encode_points(as_points(xy, name))
