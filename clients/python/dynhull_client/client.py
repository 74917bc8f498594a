"""The synchronous client."""

from collections.abc import Callable, Iterator
from datetime import timedelta
from types import TracebackType
from typing import Any, Self

import grpc
import numpy as np
import numpy.typing as npt
from google.protobuf.duration_pb2 import Duration

from dynhull.arrays import as_points
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

from . import messages
from .batch import Missing, encode_batch
from .connection import open_channel
from .errors import error_of
from .ingest import Ingest
from .messages import Applied, Counted, Crossings, Distances, Hull, HullInfo, Located, Supported, Tangents, Verification
from .watch import HullCopy, Watch

DEFAULT_ADDRESS = "127.0.0.1:50051"
DEFAULT_TIMEOUT = 30.0


class HullClient:
    """A connection to a dynhull server. Safe to share between threads; a context manager, closed on leaving.

    Every method raises a `DynhullError`: `UnavailableError` where there is no server, `DeadlineError` after the
    timeout, `HullNotFoundError` where there is no such hull, `InvalidRequestError` where the server refuses a value.
    Arrays that are no finite points raise ValueError or TypeError, as in `dynhull`, and nothing is sent.

    Args:
        address: host:port.
        timeout: seconds a call may take unless the call says otherwise; None for no limit. Ingests and watches have
            none of themselves.
        token: the bearer token to show. Over an encrypted connection only, or on this machine.
        tls: TLS with the server; None for none. `grpc.ssl_channel_credentials()` trusts what the machine trusts; it
            also takes a root certificate, and a client's key and certificate.
        wait_for_ready: whether calls wait, within their timeout, for a server that is not there yet.
    """

    def __init__(
        self,
        address: str = DEFAULT_ADDRESS,
        *,
        timeout: float | None = DEFAULT_TIMEOUT,
        wait_for_ready: bool = False,
        token: str | None = None,
        tls: grpc.ChannelCredentials | None = None,
    ) -> None:
        self._timeout = timeout
        self._wait_for_ready = wait_for_ready
        self._channel = open_channel(address, token, tls)
        self._stub = HullServiceStub(self._channel)

    def close(self) -> None:
        """Close the connection; calls under way end."""
        self._channel.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def create_hull(self, name: str, *, timeout: float | None = None) -> HullInfo:
        """Make an empty hull; HullExistsError where there is one of that name.

        A name is 1 to 200 letters, digits and "._-/".
        """
        response = self._call(self._stub.CreateHull, pb.CreateHullRequest(name=name), timeout)
        return messages.decode_info(response.hull)

    def delete_hull(self, name: str, *, timeout: float | None = None) -> None:
        """Remove a hull with its points."""
        self._call(self._stub.DeleteHull, pb.DeleteHullRequest(name=name), timeout)

    def list_hulls(self, prefix: str = "", *, timeout: float | None = None) -> Iterator[HullInfo]:
        """The hulls whose names begin with `prefix`, in the order of their names, fetched as they are wanted."""
        request = pb.ListHullsRequest(prefix=prefix)
        while True:
            response = self._call(self._stub.ListHulls, request, timeout)
            yield from map(messages.decode_info, response.hulls)
            request.page_token = response.next_page_token
            if not request.page_token:
                return

    def apply(
        self,
        name: str,
        *,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        missing: Missing = "raise",
        producer: str = "",
        sequence: int = 0,
        timeout: float | None = None,
    ) -> Applied:
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
        response = self._call(self._stub.Apply, request, timeout)
        return messages.decode_applied(response.result)

    def ingest(self, name: str, *, missing: Missing = "raise", timeout: float | None = None) -> Ingest:
        """A stream of batches, for use in a with statement.

        >>> with client.ingest("fleet") as stream:  # doctest: +SKIP
        ...     for minute in minutes:
        ...         stream.apply(move=(before, after))
        >>> stream.summary.batches  # doctest: +SKIP
        1440
        """
        return Ingest(
            name,
            missing,
            lambda requests: self._stub.Ingest.future(requests, timeout, wait_for_ready=self._wait_for_ready),
        )

    def locate(self, name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Located:
        """Where each of (n, 2) points is: +1 inside, 0 on the boundary, -1 outside. Exact.

        With a `min_revision`, waits until the hull has it; so do the other reads.
        """
        request = pb.LocateRequest(
            name=name, min_revision=min_revision, points=messages.encode_points(as_points(xy, "xy"))
        )
        response = self._call(self._stub.Locate, request, timeout)
        return Located(response.revision, np.frombuffer(response.sides, np.int8))

    def count(self, name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None) -> Counted:
        """How many times each of (n, 2) points is there."""
        request = pb.CountRequest(
            name=name, min_revision=min_revision, points=messages.encode_points(as_points(xy, "xy"))
        )
        response = self._call(self._stub.Count, request, timeout)
        return Counted(response.revision, np.array(response.counts, np.int64))

    def support(
        self, name: str, directions: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
    ) -> Supported:
        """The extreme vertex in each of (n, 2) directions, of any length but 0. Exact.

        HullEmptyError where there are no points.
        """
        vectors = messages.encode_points(as_points(directions, "directions"))
        request = pb.SupportRequest(name=name, min_revision=min_revision, directions=vectors)
        response = self._call(self._stub.Support, request, timeout)
        return Supported(response.revision, messages.decode_points(response.vertices))

    def tangents(
        self, name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
    ) -> Tangents:
        """Left and right tangent points from each of (n, 2) points; NaN for those not strictly outside. Exact."""
        points = messages.encode_points(as_points(xy, "xy"))
        request = pb.TangentsRequest(name=name, min_revision=min_revision, points=points)
        response = self._call(self._stub.Tangents, request, timeout)
        left, right = messages.decode_points(response.left), messages.decode_points(response.right)
        return Tangents(response.revision, np.stack((left, right), axis=1))

    def distance(
        self, name: str, xy: npt.ArrayLike, *, min_revision: int = 0, timeout: float | None = None
    ) -> Distances:
        """How far each of (n, 2) points is from the hull: 0 inside and on the boundary, infinite from an empty hull."""
        points = messages.encode_points(as_points(xy, "xy"))
        request = pb.DistanceRequest(name=name, min_revision=min_revision, points=points)
        response = self._call(self._stub.Distance, request, timeout)
        return Distances(response.revision, np.array(response.distances, np.float64))

    def intersect_lines(
        self,
        name: str,
        p: npt.ArrayLike,
        q: npt.ArrayLike,
        *,
        min_revision: int = 0,
        timeout: float | None = None,
    ) -> Crossings:
        """Where the lines through each of (n, 2) points p and q enter and leave the hull; NaN for one that misses."""
        request = pb.IntersectLinesRequest(
            name=name,
            min_revision=min_revision,
            origins=messages.encode_points(as_points(p, "p")),
            targets=messages.encode_points(as_points(q, "q")),
        )
        response = self._call(self._stub.IntersectLines, request, timeout)
        entries, exits = messages.decode_points(response.entries), messages.decode_points(response.exits)
        return Crossings(response.revision, np.stack((entries, exits), axis=1))

    def last_sequence(self, name: str, producer: str, *, timeout: float | None = None) -> int:
        """The number of the last batch of a producer that was applied; 0 where there is none."""
        response = self._call(self._stub.GetProducer, pb.GetProducerRequest(name=name, producer=producer), timeout)
        return int(response.last_sequence)

    def get_hull(self, name: str, *, min_revision: int = 0, timeout: float | None = None) -> Hull:
        """The vertices, counts, area, perimeter, centroid and bounds."""
        request = pb.GetHullRequest(name=name, min_revision=min_revision)
        return messages.decode_hull(self._call(self._stub.GetHull, request, timeout))

    def watch(
        self,
        name: str,
        *,
        min_revision: int = 0,
        max_rate: float = 0.0,
        progress_interval: float | None = None,
        measures: bool = False,
        resume: HullCopy | None = None,
        directions: npt.ArrayLike | None = None,
        timeout: float | None = None,
    ) -> Watch:
        """Follow a hull: an iterator of events, with which a `HullCopy` keeps a copy of the hull.

        Args:
            name: the hull.
            min_revision: the first event waits for it.
            max_rate: at most so many events a second; 0 for no bound. Changes in between are taken together.
            progress_interval: a Progress after so many seconds without an event; None for none.
            measures: whether events carry measures.
            resume: a copy to bring up to date: changes since then instead of a snapshot. RevisionForgottenError where
                the server cannot.
            directions: (k, 2) vectors; instead of vertices, `Sketch` events with the extreme vertices in these.
            timeout: seconds after which the watch ends with DeadlineError; None for never.
        """
        request = pb.WatchRequest(
            name=name, min_revision=min_revision, max_events_per_second=max_rate, include_measures=measures
        )
        if resume is not None:
            request.resume.uid, request.resume.revision = resume.uid, resume.revision
        if directions is not None:
            request.directions.CopyFrom(messages.encode_points(as_points(directions, "directions")))
        if progress_interval is not None:
            duration = Duration()
            duration.FromTimedelta(timedelta(seconds=progress_interval))
            request.progress_interval.CopyFrom(duration)
        return Watch(self._stub.Watch(request, timeout, wait_for_ready=self._wait_for_ready))

    def verify(self, name: str, *, min_revision: int = 0, timeout: float | None = None) -> Verification:
        """Compare the live hull with Chan's algorithm on the stored points."""
        request = pb.VerifyRequest(name=name, min_revision=min_revision)
        return messages.decode_verification(self._call(self._stub.Verify, request, timeout))

    def _call(self, method: Callable[..., Any], request: Any, timeout: float | None) -> Any:
        if timeout is None:
            timeout = self._timeout
        try:
            return method(request, timeout, wait_for_ready=self._wait_for_ready)
        except grpc.RpcError as error:
            raise error_of(error) from None
