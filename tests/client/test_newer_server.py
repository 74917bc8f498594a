"""A client handles errors and events of later server versions, which it does not know."""

from collections.abc import Iterator
from concurrent import futures

import grpc
import numpy as np
import pytest
from google.protobuf.any_pb2 import Any
from google.rpc.error_details_pb2 import ErrorInfo
from google.rpc.status_pb2 import Status
from grpc_status.rpc_status import to_status

import dynhull_client
from dynhull_client import (
    Change,
    DeadlineError,
    DynhullError,
    HullClient,
    HullCopy,
    LimitExceededError,
    Snapshot,
    UnauthenticatedError,
    UnavailableError,
)
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceServicer, add_HullServiceServicer_to_server
from dynhull_proto.v1.points_pb2 import Points
from dynhull_server.rpc.status import error_status
from dynhull_server.state import errors as refusals

UNKNOWN_EVENT = b"\xfa\x06\x03new"  # field 111, three bytes


class Newer(HullServiceServicer):
    """Refuses every read with `status`; of a watch, sends `events`."""

    def __init__(self) -> None:
        self.status = Status()
        self.events: list[pb.WatchResponse] = []
        self.asked = 0

    def GetHull(self, _: pb.GetHullRequest, context: grpc.ServicerContext) -> None:  # noqa: N802
        self.asked += 1
        context.abort_with_status(to_status(self.status))

    def Stream(self, requests: Iterator[pb.StreamRequest], context: grpc.ServicerContext) -> Iterator[None]:  # noqa: N802
        next(requests)
        next(requests)
        context.abort_with_status(to_status(self.status))
        yield

    def GetProducer(self, *_: object) -> pb.GetProducerResponse:  # noqa: N802
        return pb.GetProducerResponse()

    def Watch(self, *_: object) -> Iterator[pb.WatchResponse]:  # noqa: N802
        yield from self.events


def refusal(code: grpc.StatusCode, reason: str, domain: str = "dynhull.v1", **metadata: str) -> Status:
    status = Status(code=code.value[0], message=f"no: {reason}")
    packed = Any()
    packed.Pack(ErrorInfo(reason=reason, domain=domain, metadata=metadata))
    status.details.append(packed)
    return status


def packed(*pairs: tuple[float, float]) -> Points:
    return Points(packed=np.array(pairs, "<f8").tobytes())


@pytest.fixture(scope="module")
def server() -> Iterator[tuple[Newer, str]]:
    servicer = Newer()
    running = grpc.server(futures.ThreadPoolExecutor(4))
    add_HullServiceServicer_to_server(servicer, running)
    port = running.add_insecure_port("127.0.0.1:0")
    running.start()
    yield servicer, f"127.0.0.1:{port}"
    running.stop(None).wait()


@pytest.mark.parametrize("code", ["FAILED_PRECONDITION", "INVALID_ARGUMENT", "NOT_FOUND", "RESOURCE_EXHAUSTED"])
def test_an_unknown_reason_keeps_its_code_and_words(
    server: tuple[Newer, str], connect: type[HullClient], code: str
) -> None:
    newer, address = server
    newer.status = refusal(grpc.StatusCode[code], "HULL_ON_HOLIDAY", value="fleet", row="all of them", until="May")
    with connect(address) as client, pytest.raises(DynhullError, match="no: HULL_ON_HOLIDAY") as caught:
        client.get_hull("fleet")
    error = caught.value
    assert type(error) is DynhullError
    assert (error.code, error.reason, error.value, error.row) == (
        grpc.StatusCode[code],
        "HULL_ON_HOLIDAY",
        "fleet",
        None,
    )
    assert error.metadata["until"] == "May"


def test_what_passes_is_tried_again_whatever_its_reason(server: tuple[Newer, str], connect: type[HullClient]) -> None:
    newer, address = server
    newer.status, newer.asked = refusal(grpc.StatusCode.UNAVAILABLE, "MOVING_HOUSE"), 0
    with connect(address, retries=1) as client, pytest.raises(DynhullError, match="MOVING_HOUSE"):
        client.get_hull("fleet")
    assert newer.asked == 2


@pytest.mark.parametrize(
    ("code", "kind"),
    [
        (grpc.StatusCode.UNAUTHENTICATED, UnauthenticatedError),
        (grpc.StatusCode.RESOURCE_EXHAUSTED, LimitExceededError),
        (grpc.StatusCode.UNAVAILABLE, UnavailableError),
        (grpc.StatusCode.DEADLINE_EXCEEDED, DeadlineError),
        (grpc.StatusCode.FAILED_PRECONDITION, DynhullError),
        (grpc.StatusCode.NOT_FOUND, DynhullError),
    ],
)
def test_an_error_of_a_proxy_has_no_reason(
    server: tuple[Newer, str], connect: type[HullClient], code: grpc.StatusCode, kind: type[DynhullError]
) -> None:
    newer, address = server
    newer.status = refusal(code, "POINT_MISSING", domain="proxy.example")
    with connect(address, retries=0) as client, pytest.raises(DynhullError) as caught:
        client.get_hull("fleet")
    assert type(caught.value) is kind
    assert caught.value.reason == ""


def test_an_unknown_refusal_of_a_batch_is_the_batchs_alone(
    server: tuple[Newer, str], connect: type[HullClient]
) -> None:
    newer, address = server
    newer.status = refusal(grpc.StatusCode.FAILED_PRECONDITION, "POINT_ON_HOLIDAY")
    with connect(address) as client, client.writer("fleet") as writer:
        refused = writer.put(insert=[[1, 2]])
        with pytest.raises(DynhullError, match="POINT_ON_HOLIDAY"):
            writer.flush()
        assert type(refused.exception()) is DynhullError


REFUSALS = [
    refusals.PointMissingError("deletes", 0, (1.0, 2.0)),
    refusals.HullNotFoundError("a"),
    refusals.HullExistsError("a"),
    refusals.SequenceGapError("p", 3, 2),
    refusals.RestoredError("a", "uid", "p", 2),
    refusals.HullEmptyError("a"),
    refusals.HullUnsuitableError("a", "has the point (1.0, 2.0)", (1.0, 2.0)),
    refusals.HullReplacedError("a", "uid"),
    refusals.RevisionForgottenError(1, 2, 3),
    refusals.LimitExceededError("max_hulls", 1),
    refusals.OutcomeUnknownError("the disk"),
]


@pytest.mark.parametrize("error", REFUSALS, ids=lambda error: type(error).__name__)
def test_the_servers_errors_have_classes_of_the_same_names(
    server: tuple[Newer, str], connect: type[HullClient], error: Exception
) -> None:
    newer, address = server
    newer.status = error_status(error)
    with connect(address, retries=0) as client, pytest.raises(DynhullError) as caught:
        client.get_hull("fleet")
    assert type(caught.value) is getattr(dynhull_client, type(error).__name__)


def test_unknown_events_are_passed_over_with_a_note(
    server: tuple[Newer, str], connect: type[HullClient], caplog: pytest.LogCaptureFixture
) -> None:
    newer, address = server
    strange = pb.WatchResponse.FromString(pb.WatchResponse(revision=6).SerializeToString() + UNKNOWN_EVENT)
    snapshot = pb.HullSnapshot(vertices=packed((1, 2)), uid="u")
    change = pb.HullChange(added=packed((3, 4)), added_indices=[1])
    newer.events = [
        pb.WatchResponse(revision=5, point_count=1, snapshot=snapshot),
        strange,
        strange,
        pb.WatchResponse(revision=7, point_count=2, change=change),
    ]
    copy = HullCopy()
    with connect(address) as client, client.watch("fleet", copy=copy) as watch:
        assert [type(event) for event in watch] == [Snapshot, Change]
    assert copy.vertices.tolist() == [[1, 2], [3, 4]]
    (note,) = [record.getMessage() for record in caplog.records if record.name == "dynhull_client"]
    assert "kind of event" in note
    assert "111" in note
