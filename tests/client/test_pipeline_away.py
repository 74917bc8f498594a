"""Pipelines, while one of several workers is away: its reads are refused within a call that goes on."""

from collections.abc import Iterator
from concurrent import futures

import grpc
import pytest
from google.rpc import code_pb2, status_pb2

from dynhull_client import HullClient, UnavailableError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceServicer, add_HullServiceServicer_to_server

AWAY = status_pb2.Status(code=code_pb2.UNAVAILABLE, message="the worker is away")


class Gateway(HullServiceServicer):
    """Answers reads with the number of answers so far, and refuses those of `a` for a number of calls."""

    def __init__(self) -> None:
        self.away = 0
        self.calls = 0
        self.answers = 0

    def Query(self, requests: Iterator[pb.QueryRequest], _: object) -> Iterator[pb.QueryResponse]:  # noqa: N802
        self.calls += 1
        here = self.away <= 0
        self.away -= 1
        for request in requests:
            response = pb.QueryResponse()
            for read in request.reads:
                answer = response.answers.add()
                if here or read.get_hull.name != "a":
                    self.answers += 1
                    answer.get_hull.hull.revision = self.answers
                else:
                    answer.error.MergeFromString(AWAY.SerializeToString())
            yield response


@pytest.fixture
def gateway() -> Iterator[tuple[Gateway, str]]:
    servicer = Gateway()
    server = grpc.server(futures.ThreadPoolExecutor(8))
    add_HullServiceServicer_to_server(servicer, server)
    port = server.add_insecure_port("127.0.0.1:0")
    server.start()
    yield servicer, f"127.0.0.1:{port}"
    server.stop(0).wait()


def test_reads_are_asked_again_from_the_refused_one_in_order(
    connect: type[HullClient], gateway: tuple[Gateway, str]
) -> None:
    servicer, address = gateway
    servicer.away = 2
    with connect(address) as client, client.pipeline() as pipeline:
        asked = [pipeline.get_hull(name) for name in "bbabab"]
    revisions = [each.result().revision for each in asked]
    assert revisions == sorted(revisions)
    assert servicer.calls == 3


def test_a_worker_that_stays_away_has_its_reads_refused_and_no_others(
    connect: type[HullClient], gateway: tuple[Gateway, str]
) -> None:
    servicer, address = gateway
    servicer.away = 1000
    with connect(address, retries=2) as client, client.pipeline(batch_reads=2) as pipeline:
        for _ in range(2):  # what was found once is not found out again for each read
            asked = [pipeline.get_hull(name) for name in "abab"]
            pipeline.flush()
            assert [type(each.exception()) for each in asked] == [UnavailableError, type(None)] * 2
            assert servicer.calls == 3


def test_without_repetitions_a_read_is_refused_at_once(connect: type[HullClient], gateway: tuple[Gateway, str]) -> None:
    servicer, address = gateway
    servicer.away = 1
    with connect(address, retries=0) as client, client.pipeline() as pipeline:
        asked = [pipeline.get_hull(name) for name in "ab"]
        pipeline.flush()
        assert [type(each.exception()) for each in asked] == [UnavailableError, type(None)]
        assert servicer.calls == 1
