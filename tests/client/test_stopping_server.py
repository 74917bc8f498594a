"""Calls that a server has not begun: it stops or starts, or their connection has too many of them."""

from collections.abc import Callable, Iterator
from concurrent import futures

import grpc
import numpy as np
import pytest
from grpc_status.rpc_status import to_status

from dynhull_client import HullClient, UnavailableError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.batch_pb2 import BatchResult
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceServicer, add_HullServiceServicer_to_server
from dynhull_proto.v1.points_pb2 import Points
from dynhull_server.rpc.status import DrainingError, StartingError, error_status

Ending = Callable[[grpc.ServicerContext], None]

# What gRPC says of a call beyond those that a connection may have.
CROWDED = "Stream removed (RST_STREAM (Received RST_STREAM with error code 7))"
NOT_BEGUN: dict[str, Ending] = {
    "gRPC": lambda context: context.abort(grpc.StatusCode.CANCELLED, "CANCELLED"),
    "crowded": lambda context: context.abort(grpc.StatusCode.UNAVAILABLE, CROWDED),
    "draining": lambda context: context.abort_with_status(to_status(error_status(DrainingError()))),
    "starting": lambda context: context.abort_with_status(to_status(error_status(StartingError()))),
}


def begun(context: grpc.ServicerContext) -> None:
    """What gRPC says of a call that the server has begun, and does not complete in time."""
    context.abort(grpc.StatusCode.UNAVAILABLE, "Cancelling all calls")


class Stopping(HullServiceServicer):
    """Ends each call but every second one.

    Attributes:
        end: how.
        every: which calls it does not end, in place of every second one.
        applied: the numbers of the batches that it was sent in streams.
        stopped: how many calls it has ended.
    """

    def __init__(self) -> None:
        self.end = NOT_BEGUN["gRPC"]
        self.every = 2
        self.applied: list[int] = []
        self.stopped = 0
        self._calls = self._watches = 0

    def _may_stop(self, context: grpc.ServicerContext) -> None:
        self._calls += 1
        if self._calls % self.every:
            self.stopped += 1
            self.end(context)

    def GetHull(self, _: pb.GetHullRequest, context: grpc.ServicerContext) -> pb.GetHullResponse:  # noqa: N802
        self._may_stop(context)
        return pb.GetHullResponse()

    def Apply(self, _: pb.ApplyRequest, context: grpc.ServicerContext) -> pb.ApplyResponse:  # noqa: N802
        self._may_stop(context)
        return pb.ApplyResponse()

    def GetProducer(self, *_: object) -> pb.GetProducerResponse:  # noqa: N802
        return pb.GetProducerResponse()

    def Stream(  # noqa: N802
        self, requests: Iterator[pb.StreamRequest], context: grpc.ServicerContext
    ) -> Iterator[pb.StreamResponse]:
        self._may_stop(context)
        for request in requests:
            if request.sequence:
                self.applied.append(request.sequence)
                yield pb.StreamResponse(sequence=request.sequence, result=BatchResult(revision=request.sequence))

    def Watch(self, _: pb.WatchRequest, context: grpc.ServicerContext) -> Iterator[pb.WatchResponse]:  # noqa: N802
        self._watches += 1
        if self._watches != 2:
            snapshot = pb.HullSnapshot(vertices=Points(packed=np.array([[1.0, 2.0]]).tobytes()), uid="u")
            yield pb.WatchResponse(revision=self._watches, snapshot=snapshot)
        context.abort(grpc.StatusCode.CANCELLED, "CANCELLED")


@pytest.fixture
def stopping() -> Iterator[tuple[Stopping, str]]:
    servicer = Stopping()
    server = grpc.server(futures.ThreadPoolExecutor(4))
    add_HullServiceServicer_to_server(servicer, server)
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    yield servicer, f"127.0.0.1:{port}"
    server.stop(None).wait()


@pytest.mark.parametrize("end", NOT_BEGUN.values(), ids=NOT_BEGUN)
def test_calls_that_the_server_has_not_begun_are_repeated_whatever_they_are(
    stopping: tuple[Stopping, str], connect: type[HullClient], end: Ending
) -> None:
    servicer, address = stopping
    servicer.end = end
    with connect(address) as client:
        client.get_hull("fleet")
        client.apply("fleet", insert=[[1, 2]])
    assert servicer.stopped == 2
    with connect(address, retries=0) as client, pytest.raises(UnavailableError):
        client.apply("fleet", insert=[[1, 2]])


def test_a_call_on_a_connection_that_has_too_many_is_repeated_as_long_as_it_may_take(
    stopping: tuple[Stopping, str], connect: type[HullClient]
) -> None:
    servicer, address = stopping
    servicer.end, servicer.every = NOT_BEGUN["crowded"], 4
    with connect(address, retries=1) as client:
        client.apply("fleet", insert=[[1, 2]])
    assert servicer.stopped == 3
    with (
        connect(address, retries=0) as client,
        pytest.raises(UnavailableError, match=r"has not begun the call: .*; try again") as caught,
    ):
        client.apply("fleet", insert=[[1, 2]])
    assert caught.value.reason == "TOO_MANY_CALLS"


def test_of_those_that_it_may_have_begun_batches_without_a_number_are_not(
    stopping: tuple[Stopping, str], connect: type[HullClient]
) -> None:
    servicer, address = stopping
    servicer.end = begun
    with connect(address) as client:
        client.get_hull("fleet")
        with pytest.raises(UnavailableError, match="Cancelling all calls"):
            client.apply("fleet", insert=[[1, 2]])
    assert servicer.stopped == 2


def test_writers_and_watches_go_on(stopping: tuple[Stopping, str], connect: type[HullClient]) -> None:
    servicer, address = stopping
    with connect(address) as client:
        with client.writer("fleet", batch_points=1) as writer:
            writer.put(insert=[[1, 2]])
        assert (servicer.applied, servicer.stopped) == ([1], 1)
        with client.watch("fleet") as watch:
            first, second = next(watch), next(watch)
        assert (first.revision, second.revision) == (1, 3)
