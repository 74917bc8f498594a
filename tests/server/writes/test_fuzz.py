"""Every request is answered with a status and detail of the contract, and a refused request changes nothing."""

import math
import os
import struct
from collections import Counter
from collections.abc import Iterator

import grpc
import pytest
from google.protobuf.descriptor import Descriptor, FieldDescriptor
from google.protobuf.message import Message
from google.protobuf.message_factory import GetMessageClass
from google.rpc.error_details_pb2 import ErrorInfo
from grpc_health.v1 import health_pb2, health_pb2_grpc
from grpc_status import rpc_status
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from patience import PATIENCE
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

# `make fuzz-server` sends more.
EXAMPLES = int(os.environ.get("FUZZ_EXAMPLES", "4"))

METHODS = list(pb.DESCRIPTOR.services_by_name["HullService"].methods)
CODES = {
    grpc.StatusCode.OK,
    grpc.StatusCode.INVALID_ARGUMENT,
    grpc.StatusCode.NOT_FOUND,
    grpc.StatusCode.ALREADY_EXISTS,
    grpc.StatusCode.FAILED_PRECONDITION,
    grpc.StatusCode.OUT_OF_RANGE,
    grpc.StatusCode.RESOURCE_EXHAUSTED,
}
# How a read ends that waits for a revision, and a watch that waits for a change, after so many seconds.
WAITING = {grpc.StatusCode.DEADLINE_EXCEEDED, grpc.StatusCode.CANCELLED}
WAIT = 0.05

DOUBLES = st.one_of(
    st.sampled_from([0.0, -0.0, 1.0, math.nan, math.inf, -math.inf, 5e-324, 1.7976931348623157e308]), st.floats()
)
UNSIGNED = st.one_of(st.integers(0, 3), st.sampled_from([2**31, 2**32 - 1, 2**63, 2**64 - 1]))
FIELDS = {
    FieldDescriptor.TYPE_DOUBLE: DOUBLES,
    FieldDescriptor.TYPE_UINT64: UNSIGNED,
    FieldDescriptor.TYPE_UINT32: UNSIGNED.map(lambda value: value % 2**32),
    FieldDescriptor.TYPE_INT32: st.sampled_from([0, 1, 7, -1, 2**31 - 1, -(2**31)]),
    FieldDescriptor.TYPE_INT64: st.sampled_from([0, 1, -1, 2**63 - 1, -(2**63)]),
    FieldDescriptor.TYPE_BOOL: st.booleans(),
    FieldDescriptor.TYPE_ENUM: st.sampled_from([0, 1, 2, 3, 77, -1]),
    FieldDescriptor.TYPE_STRING: st.one_of(
        st.sampled_from(["a", "b", "", "a b", "a" * 201, "\0", "ä", "../a"]), st.text(max_size=5)
    ),
    FieldDescriptor.TYPE_BYTES: st.one_of(
        st.lists(DOUBLES, max_size=8).map(lambda values: struct.pack(f"<{len(values)}d", *values)),
        st.binary(max_size=40),
    ),
}


@st.composite
def messages(draw: st.DrawFn, descriptor: Descriptor) -> Message:
    """A message with arbitrary values in any of its fields."""
    message = GetMessageClass(descriptor)()
    for name in {"name", "other_name"} & set(descriptor.fields_by_name):
        setattr(message, name, "a")
    # Few at a time, so that each has its say before another is refused.
    for field in draw(st.lists(st.sampled_from(list(descriptor.fields)), max_size=3, unique_by=lambda f: f.name)):
        set_field(draw, message, field)
    return message


def set_field(draw: st.DrawFn, message: Message, field: FieldDescriptor) -> None:
    if field.message_type is not None and field.is_repeated:
        getattr(message, field.name).extend(draw(st.lists(messages(field.message_type), max_size=3)))
    elif field.message_type is not None:
        getattr(message, field.name).CopyFrom(draw(messages(field.message_type)))
    elif field.is_repeated:
        getattr(message, field.name).extend(draw(st.lists(FIELDS[field.type], max_size=8)))
    else:
        setattr(message, field.name, draw(FIELDS[field.type]))


def requests(method) -> st.SearchStrategy[list[bytes]]:
    """Requests for a method: arbitrary messages, damaged messages, and bytes that are no message."""
    well_formed = messages(method.input_type).map(lambda message: message.SerializeToString())
    bent = st.tuples(well_formed, st.integers(0, 60), st.binary(min_size=1, max_size=3)).map(
        lambda parts: parts[0][: parts[1]] + parts[2] + parts[0][parts[1] + 1 :]
    )
    one = st.one_of(well_formed, well_formed, bent, st.binary(max_size=60))
    return st.lists(one, max_size=4) if method.client_streaming else st.lists(one, min_size=1, max_size=1)


def waits(method) -> bool:
    """Whether a call may wait for what does not come. All others have time: after a deadline, a change may be made."""
    return method.server_streaming or "min_revision" in method.input_type.fields_by_name


def send(channel: grpc.Channel, method, sent: list[bytes]) -> grpc.RpcError | None:
    """The error a call ends with, None where it is answered."""
    kind = f"{'stream' if method.client_streaming else 'unary'}_{'stream' if method.server_streaming else 'unary'}"
    call = getattr(channel, kind)(f"/{method.containing_service.full_name}/{method.name}")
    try:
        answer = call(iter(sent) if method.client_streaming else sent[0], timeout=WAIT if waits(method) else PATIENCE)
        if isinstance(answer, Iterator):
            list(answer)
    except grpc.RpcError as error:
        return error
    return None


def check_refusal(method, error: grpc.RpcError) -> None:
    code = error.code()
    if code in WAITING and waits(method):
        return
    assert code in CODES, error
    status = rpc_status.from_call(error)
    info = ErrorInfo()
    assert status is not None, error
    assert status.details[0].Unpack(info), error
    assert info.domain == "dynhull.v1"
    if info.reason == "INVALID_FIELD":
        assert info.metadata["field"]
        assert "value" in info.metadata
        assert info.metadata["field"].split(".")[0] in error.details()


@pytest.fixture(scope="module")
def channel() -> Iterator[grpc.Channel]:
    """A server of this module's own, which must not log a warning."""
    with server_process("--max-hulls", "20") as server, grpc.insecure_channel(server.address) as channel:
        yield channel


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.name)
def test_whatever_is_sent(channel: grpc.Channel, method) -> None:
    seen: Counter[str] = Counter()
    stub = HullServiceStub(channel)
    health = health_pb2_grpc.HealthStub(channel)

    def state() -> list[tuple[str, str, int, int]]:
        hulls = stub.ListHulls(pb.ListHullsRequest()).hulls
        return [(hull.name, hull.uid, hull.revision, hull.point_count) for hull in hulls]

    def create(name: str) -> None:
        """A hull that can be read in every way."""
        stub.CreateHull(pb.CreateHullRequest(name=name))
        points = points_pb2.Points(coordinates=[0.25, 1, 0.5, -1e308, 1, 1.5, 5e-324, 0])
        stub.Apply(pb.ApplyRequest(name=name, batch=batch_pb2.Batch(inserts=points)))

    @settings(max_examples=EXAMPLES, suppress_health_check=list(HealthCheck))
    @given(requests(method))
    @example([b""])
    def fuzz(sent: list[bytes]) -> None:
        if "a" not in [name for name, *_ in state()]:
            create("a")
        before = state()
        error = send(channel, method, sent)
        if error is None:
            seen["OK"] += 1
            return
        seen[error.code().name] += 1
        check_refusal(method, error)
        if not method.client_streaming:
            assert state() == before
        assert all(stub.Verify(pb.VerifyRequest(name=name)).equal for name, *_ in state())
        assert health.Check(health_pb2.HealthCheckRequest()).status == health_pb2.HealthCheckResponse.SERVING

    fuzz()
    print(method.name, dict(seen))
    assert seen["INVALID_ARGUMENT"] > 0
