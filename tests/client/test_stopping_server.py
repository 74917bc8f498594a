"""A server that stops: gRPC cancels the calls that have arrived, and that the server has not begun."""

from collections.abc import Iterator
from concurrent import futures

import grpc
import numpy as np
import pytest

from dynhull_client import HullClient, UnavailableError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.batch_pb2 import BatchResult
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceServicer, add_HullServiceServicer_to_server
from dynhull_proto.v1.points_pb2 import Points


class Stopping(HullServiceServicer):
    """Ends each second call without a word.

    Attributes:
        applied: the numbers of the batches that it was sent in streams.
        stopped: how many calls it has ended.
    """

    def __init__(self) -> None:
        self.applied: list[int] = []
        self.stopped = 0
        self._calls = self._watches = 0

    def _may_stop(self, context: grpc.ServicerContext) -> None:
        self._calls += 1
        if self._calls % 2:
            self.stopped += 1
            context.abort(grpc.StatusCode.CANCELLED, "CANCELLED")

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


def test_reads_are_repeated_and_batches_without_a_number_are_not(
    stopping: tuple[Stopping, str], connect: type[HullClient]
) -> None:
    servicer, address = stopping
    with connect(address) as client:
        client.get_hull("fleet")
        with pytest.raises(UnavailableError, match="the server ended the call"):
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
