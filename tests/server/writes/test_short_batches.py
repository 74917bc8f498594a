"""The short way of Stream beside the whole way: the same results, refusals and bytes."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from typing import Any

import grpc
import numpy as np
import pytest
from google.protobuf.message import DecodeError

from dynhull_client import HullClient
from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.compiled import native
from dynhull_server.rpc.encode import encode_applied
from dynhull_server.rpc.short_batches import PointsMessage, PutsMessage, acknowledgement, acknowledgements, received
from dynhull_server.state.batch import Applied

STREAM = "/dynhull.v1.HullService/Stream"
REFUSED = grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.FAILED_PRECONDITION
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


def numbered(*batches: dict[str, Any], **others: Any) -> bytes:
    """A message with batches that put `keys` at `points`."""
    request = pb.StreamRequest(**others)
    for each in batches:
        packed = np.array(each["points"], "<f8").tobytes()
        more = {name: value for name, value in each.items() if name not in ("keys", "points")}
        puts = batch_pb2.Puts(keys=each["keys"], points={"packed": packed})
        request.batches.add(batch=batch_pb2.Batch(puts=puts), **more)
    data: bytes = request.SerializeToString()
    return data


def integers(*keys: int) -> points_pb2.Keys:
    return points_pb2.Keys(packed_integers=np.array(keys, "<u8").tobytes())


def strings(*keys: str | bytes) -> points_pb2.Keys:
    encoded = [key.encode() if isinstance(key, str) else key for key in keys]
    return points_pb2.Keys(lengths=bytes(map(len, encoded)), text=b"".join(encoded))


def in_another_order(data: bytes) -> bytes:
    """The same message with its batch in two pieces, which no short way reads."""
    rest = pb.StreamRequest.FromString(data)
    if rest.batches:
        rest.batches[0].batch.missing_keys = batch_pb2.MISSING_KEY_POLICY_COUNT  # as by default
    if not rest.HasField("batch"):
        whole: bytes = rest.SerializeToString()
        return whole
    policy = pb.StreamRequest(batch={"missing_points": rest.batch.missing_points})
    part: bytes = policy.SerializeToString()
    return data + (part or pb.StreamRequest(batch={}).SerializeToString())


def stream(channel: grpc.Channel, messages: Sequence[bytes]) -> Answers:
    """The responses, or the results of those that have several, and all of a refusal that has ended them."""
    call: Any = channel.stream_stream(STREAM)
    answers = []
    try:
        for each in call(iter(messages)):
            results = pb.StreamResponse.FromString(each).results  # as many together as were there at the moment
            answers.extend([result.SerializeToString() for result in results] or [each])  # those before a refusal count
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
@pytest.mark.parametrize(("kind", "keys"), [("int", integers), ("str", lambda *keys: strings(*map(chr, keys)))])
def test_equal_results_of_keys(same: Callable[..., Answers], hull: str, kind: str, keys: Any) -> None:
    random = np.random.default_rng(3)
    messages = [pb.StreamRequest(name=hull, accept_results=True).SerializeToString()]
    for size in (1, 2, 9, 200):
        chosen = [random.choice(1000, size, replace=False) + 100 for _ in range(5)]
        batches = [{"keys": keys(*each.tolist()), "points": random.normal(size=(size, 2))} for each in chosen]
        messages += [numbered(*batches), numbered({"keys": keys(500), "points": [[-0.0, 7.0]]}, name=hull)]
    answers, code = same(*messages, keyed=kind)
    results = [pb.NumberedResult.FromString(each).result for each in answers[1:]]
    assert (len(results), code) == (4 * 6, "OK")
    assert sum(result.moved for result in results) > 50


@needs_compiled
def test_equal_results_of_numbered_keys(same: Callable[..., Answers], hull: str) -> None:
    first = pb.StreamRequest(name=hull, accept_results=True, producer="p").SerializeToString()
    batches = [{"keys": integers(key), "points": [[key, 1.0]], "sequence": key} for key in (1, 2, 2, 3)]
    answers, code = same(first, numbered(*batches), numbered(batches[1]), keyed="int")
    results = [pb.NumberedResult.FromString(each).result for each in answers[1:]]
    assert ([result.duplicate for result in results], code) == ([False, False, True, False, True], "OK")
    for wrong in (0, 9):  # no number, and a gap
        last = {"keys": integers(7), "points": [[1.0, 1.0]], "sequence": wrong}
        answers, error = same(first, numbered(*batches), numbered(last), keyed="int")
        assert (len(answers), error[0] in REFUSED) == (1 + len(batches), True)
    unnumbered = pb.StreamRequest(name=hull, accept_results=True).SerializeToString()
    _, error = same(unnumbered, numbered({"keys": integers(7), "points": [[1.0, 1.0]], "sequence": 4}))
    assert error[0] == grpc.StatusCode.INVALID_ARGUMENT


@needs_compiled
@pytest.mark.parametrize(
    "wrong",
    [
        {"keys": integers(1, 2), "points": [[0.0, 0.0], [NAN, 0.0]]},
        {"keys": integers(1, 2), "points": [[0.0, 0.0]]},
        {"keys": integers(3, 3), "points": [[0.0, 0.0], [1.0, 0.0]]},
        {"keys": strings("a"), "points": [[0.0, 0.0]]},
        {"keys": strings("a", ""), "points": [[0.0, 0.0], [1.0, 0.0]]},
        {"keys": strings(b"\xff"), "points": [[0.0, 0.0]]},
        {"keys": points_pb2.Keys(lengths=b"\2", text=b"a"), "points": [[0.0, 0.0]]},
        {"keys": points_pb2.Keys(packed_integers=b"123"), "points": [[0.0, 0.0]]},
        {"keys": integers(1), "points": [[0.0, 0.0]], "after_sequence": 3},
    ],
)
def test_equal_refusals_of_keys(same: Callable[..., Answers], hull: str, wrong: dict[str, Any]) -> None:
    first = pb.StreamRequest(name=hull, accept_results=True).SerializeToString()
    good = {"keys": integers(1), "points": [[4.0, 4.0]]}
    answers, error = same(first, numbered(good), numbered(good, wrong, good), keyed="int")
    assert (len(answers), error[0] in REFUSED) == (1 + 2, True)  # those before it are applied


@needs_compiled
def test_equal_refusals_of_several(same: Callable[..., Answers], hull: str) -> None:
    one = {"keys": integers(1), "points": [[4.0, 4.0]]}
    _, error = same(pb.StreamRequest(name=hull).SerializeToString(), numbered(one), keyed="int")
    assert error[0] == grpc.StatusCode.INVALID_ARGUMENT
    several = pb.StreamRequest(name=hull, accept_results=True).SerializeToString()
    _, error = same(several, numbered(*[one] * 257), keyed="int")
    assert error[0] == grpc.StatusCode.INVALID_ARGUMENT
    _, error = same(several, numbered(one, name=f"{hull}-2"), keyed="int")
    assert error[0] == grpc.StatusCode.INVALID_ARGUMENT


def changes(examples: list[bytes], random: np.random.Generator, within: int | None = None) -> Iterator[bytes]:
    """Messages with up to two changed bytes, among the first `within` if that is given; some end early."""
    for turn in range(20_000):
        data = bytearray(examples[turn % len(examples)])
        for place in random.integers(min(len(data), within or len(data)), size=random.integers(3)):
            data[place] = random.integers(256)
        yield bytes(data[: len(data) - random.integers(2) * random.integers(20)])


@needs_compiled
def test_reads_only_keys_that_it_understands() -> None:
    """Of any bytes, what is read short is all that the message has."""
    assert native is not None
    random = np.random.default_rng(6)
    puts = [{"keys": keys, "points": [[1.0, 2.0]] * 2} for keys in (integers(1, 2), strings("a", "bc"))]
    examples = [numbered({**each, "sequence": number}, each) for each in puts for number in (0, 300)]
    examples += [numbered(each, name="abc") for each in puts]
    for called in ("", "abc"):
        batch = pb.StreamRequest.FromString(numbered(puts[0])).batches[0].batch
        examples.append(pb.StreamRequest(name=called, batch=batch).SerializeToString())
    assert all(native.puts_message(data) for data in examples)
    short = 0
    for changed in changes(examples, random):
        found = native.puts_message(changed)
        if found is None:
            continue
        name, several, batches = found
        try:
            meant = pb.StreamRequest.FromString(changed)
        except DecodeError:  # of a name that is not UTF-8, which is none of a hull
            with pytest.raises(UnicodeDecodeError):
                name.decode()
            continue
        short += 1
        read = pb.StreamRequest(name=name.decode())
        for sequence, numbers, lengths, text, points in batches:
            found_batch = read.batches.add(sequence=sequence).batch if several else read.batch
            keys = {"lengths": lengths, "text": text} if numbers is None else {"packed_integers": numbers}
            found_batch.puts.CopyFrom(batch_pb2.Puts(keys=keys, points={"packed": points}))
        assert meant == read
    assert short > 1000


@needs_compiled
def test_reads_only_what_it_understands() -> None:
    """Of any bytes, what is read short is all that the message has."""
    assert native is not None
    random = np.random.default_rng(5)
    examples = [message(name, CORNERS[:size], field) for name in ("", "a" * 3) for size in (1, 4) for field in FIELDS]
    examples.append(message("a" * 200, np.zeros((2000, 2))))
    assert all(native.points_message(data) for data in examples)
    short = 0
    for changed in changes(examples, random, 24):
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
        data, keys = message(name, CORNERS), numbered({"keys": integers(1), "points": [[1.0, 1.0]]}, name=name)
        ways = (data, PointsMessage), (in_another_order(data), pb.StreamRequest)
        for way, kind in (*ways, (keys, PutsMessage), (in_another_order(keys), pb.StreamRequest)):
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


@needs_compiled
def test_equal_bytes_of_several_results() -> None:
    random = np.random.default_rng(8)
    names = [each.name for each in fields(Applied) if each.name not in ("hull_changed", "duplicate", "clock", "held")]
    outcomes = []
    for _ in range(500):
        values: dict[str, Any] = {name: int(random.integers(2**63 - 1)) >> int(random.integers(64)) for name in names}
        values |= {name: bool(random.integers(2)) for name in ("hull_changed", "duplicate")}
        outcomes.append((int(random.integers(2**63 - 1)) >> int(random.integers(64)), Applied(**values)))
    of_few = Applied(5, 1, 0, 0, True, 9, clock=10**15), Applied(5, 1, 0, 0, True, 9, held=(1, 4))
    for several in (outcomes, [], outcomes[:1], [*outcomes[:2], (3, of_few[0])], [(0, of_few[1]), *outcomes[:2]]):
        response = pb.StreamResponse()
        for sequence, applied in several:
            encode_applied(applied, response.results.add(sequence=sequence).result)
        data = response.SerializeToString()
        for most in (len(data), len(data) - 1):
            found = acknowledgements(several, most)
            assert (found if isinstance(found, bytes) else found.SerializeToString()) == data
            assert len(data) <= most or not isinstance(found, bytes)
