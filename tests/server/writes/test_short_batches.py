"""The short way of Stream beside the whole way: the same results, refusals and bytes."""

from collections.abc import Callable, Sequence
from typing import Any

import grpc
import numpy as np
import pytest
from google.protobuf.message import DecodeError

from dynhull_client import HullClient
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.compiled import native
from dynhull_server.rpc.encode import encode_applied
from dynhull_server.rpc.short_batches import PointsMessage, acknowledgement, received
from dynhull_server.state.batch import Applied

STREAM = "/dynhull.v1.HullService/Stream"
NAN, INFINITY = float("nan"), float("inf")
FIELDS = "inserts", "deletes"
CORNERS = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]

needs_compiled = pytest.mark.skipif(native is None, reason="without the compiled module there is one way only")

Answers = tuple[list[bytes], Any]


def message(name: str, points: object, field: str = "inserts", **others: Any) -> bytes:
    packed = np.array(points, "<f8").tobytes()
    request = pb.StreamRequest(name=name, batch={field: {"packed": packed}}, **others)
    data: bytes = request.SerializeToString()
    return data


def in_another_order(data: bytes) -> bytes:
    """The same message with its batch in two pieces, which no short way reads."""
    rest = pb.StreamRequest.FromString(data)
    policy = pb.StreamRequest(batch={"missing_points": rest.batch.missing_points})
    part: bytes = policy.SerializeToString()
    return data + (part or pb.StreamRequest(batch={}).SerializeToString())


def stream(channel: grpc.Channel, messages: Sequence[bytes]) -> Answers:
    """The responses, and all of a refusal that has ended them."""
    call: Any = channel.stream_stream(STREAM)
    answers = []
    try:
        for each in call(iter(messages)):
            answers.append(each)  # noqa: PERF402  # those before a refusal count
    except grpc.RpcError as error:
        return answers, (error.code(), error.details(), error.trailing_metadata())
    return answers, "OK"


@pytest.fixture
def same(channel: grpc.Channel, client: HullClient, hull: str) -> Callable[..., Answers]:
    """Sends messages both ways to an empty hull, and returns the answers, which are the same."""

    def send(*messages: bytes, **config: Any) -> Answers:
        found = []
        for way in (bytes, in_another_order):
            client.delete_hull(hull)
            client.create_hull(hull, **config)
            found.append(stream(channel, [way(each) for each in messages]))
        short, whole = found
        assert short == whole
        return short

    return send


@needs_compiled
def test_equal_results(same: Callable[..., Answers], hull: str) -> None:
    random = np.random.default_rng(3)
    blocks = [random.normal(size=(size, 2)) for size in (1, 1, 2, 7, 8, 64, 1000)]
    messages = [message(hull, CORNERS), message("", [[-0.0, 1.0]])]
    messages += [message("", block) for block in blocks] + [message(hull, block, "deletes") for block in blocks]
    messages += [message(hull, [[9.0, 9.0]])] * 140  # revisions and counts of more than seven bits
    answers, code = same(*messages)
    assert (len(answers), code) == (len(messages), "OK")
    last = pb.StreamResponse.FromString(answers[-1]).result
    assert (last.revision, last.point_count, last.inserted) == (len(messages), 4 + 1 + 140, 1)


@needs_compiled
@pytest.mark.parametrize("bad", [[[NAN, 0.0]], [[0.0, 0.0], [0.0, INFINITY]]])
@pytest.mark.parametrize("field", ["inserts", "deletes"])
def test_equal_refusals_of_points(same: Callable[..., Answers], hull: str, bad: object, field: str) -> None:
    answers, error = same(message(hull, CORNERS), message(hull, bad, field), message(hull, CORNERS))
    assert (len(answers), error[0]) == (1, grpc.StatusCode.INVALID_ARGUMENT)


@needs_compiled
def test_equal_refusals_of_batches(same: Callable[..., Answers], hull: str) -> None:
    answers, error = same(message(hull, CORNERS), message(hull, [[7.0, 7.0]], "deletes"), message(hull, CORNERS))
    assert (len(answers), error[0]) == (1, grpc.StatusCode.FAILED_PRECONDITION)
    answers, error = same(message(hull, CORNERS), message(hull, [[999.0, 7.0]]), geographic=True)
    assert (len(answers), error[0]) == (1, grpc.StatusCode.INVALID_ARGUMENT)
    answers, error = same(message(hull, CORNERS), message(hull, CORNERS), keyed="int")
    assert (len(answers), error[0]) == (0, grpc.StatusCode.FAILED_PRECONDITION)


@needs_compiled
def test_equal_refusals_of_what_is_beside(same: Callable[..., Answers], hull: str) -> None:
    first = message(hull, CORNERS)
    for wrong in (message(f"{hull}-2", CORNERS), message("a b", CORNERS), message(hull, CORNERS, sequence=1)):
        answers, error = same(first, wrong, first)
        assert (len(answers), error[0]) == (1, grpc.StatusCode.INVALID_ARGUMENT)
    numbered = [message(hull, CORNERS, producer="p", sequence=number) for number in (1, 2)]
    answers, error = same(*numbered, message(hull, CORNERS))
    assert (len(answers), error[0]) == (2, grpc.StatusCode.INVALID_ARGUMENT)


@needs_compiled
def test_reads_only_what_it_understands() -> None:
    """Of any bytes, what is read short is all that the message has."""
    assert native is not None
    random = np.random.default_rng(5)
    examples = [message(name, CORNERS[:size], field) for name in ("", "a" * 3) for size in (1, 4) for field in FIELDS]
    examples.append(message("a" * 200, np.zeros((2000, 2))))
    assert all(native.points_message(data) for data in examples)
    short = 0
    for turn in range(20_000):
        data = bytearray(examples[turn % len(examples)])
        for place in random.integers(min(len(data), 24), size=random.integers(3)):
            data[place] = random.integers(256)
        changed = bytes(data[: len(data) - random.integers(2) * random.integers(20)])
        found = native.points_message(changed)
        if found is None:
            continue
        short += 1
        name, inserts, start = found
        try:
            meant = pb.StreamRequest.FromString(changed)
        except DecodeError:  # of a name that is not UTF-8, which is none of a hull
            with pytest.raises(UnicodeDecodeError):
                name.decode()
            continue
        field = "inserts" if inserts else "deletes"
        assert meant == pb.StreamRequest(name=name.decode(), batch={field: {"packed": changed[start:]}})
    assert short > 1000


@needs_compiled
def test_which_way() -> None:
    read = received(lambda data: (pb.StreamRequest.FromString(data), len(data)))
    for name in ("", "a"):
        data = message(name, CORNERS)
        for way, kind in ((data, PointsMessage), (in_another_order(data), pb.StreamRequest)):
            found = read(way)
            assert isinstance(found, tuple)
            assert (type(found[0]), found[1]) == (kind, len(way))
    assert type(read(message("a", CORNERS, producer="p", sequence=1))[0]) is pb.StreamRequest  # type: ignore[index]
    assert type(read(message("a", np.zeros((2**14 + 1, 2))))[0]) is pb.StreamRequest  # type: ignore[index]


@needs_compiled
def test_equal_bytes_of_results() -> None:
    random = np.random.default_rng(7)
    for _ in range(2000):
        revision, inserted, deleted, missing, points, sequence = (
            int(random.integers(2**63 - 1)) >> int(random.integers(64)) for _ in range(6)
        )
        applied = Applied(revision, inserted, deleted, missing, bool(random.integers(2)), points)
        response = pb.StreamResponse(sequence=sequence)
        encode_applied(applied, response.result)
        assert acknowledgement(sequence, applied) == response.SerializeToString()
    for more in ({"duplicate": True}, {"moved": 3}, {"clock": 10**15}, {"held": (1, 4)}):
        applied = Applied(5, 1, 0, 0, True, 9, **more)
        response = pb.StreamResponse(sequence=2)
        encode_applied(applied, response.result)
        assert acknowledgement(2, applied) == response.SerializeToString()
