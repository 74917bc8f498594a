"""Keyed hulls through a real server: batches of keys, what is refused, and questions about keys."""

import struct
from collections.abc import Iterator

import grpc
import numpy as np
import pytest
from entity_messages import COORDINATES, INTEGERS, SECOND, STRINGS, duration, keys, points, puts, times, window
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from refusal import refusal
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

INVALID, FAILED = grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.FAILED_PRECONDITION
SQUARE = {"a": (0, 0), "b": (4, 0), "c": (4, 4), "d": (0, 4)}
COUNTS = ("inserted", "moved", "deleted", "missing", "stale", "late", "skipped", "clamped", "evicted")


@pytest.fixture(scope="module")
def stub() -> Iterator[HullServiceStub]:
    with server_process("--create-on-write") as server, grpc.insecure_channel(server.address) as channel:
        yield HullServiceStub(channel)


@pytest.fixture
def hull(stub: HullServiceStub, name: str) -> str:
    """A hull of string keys with a square."""
    stub.CreateHull(pb.CreateHullRequest(name=name, config=hull_pb2.HullConfig(identity=STRINGS)))
    stub.Apply(pb.ApplyRequest(name=name, batch=puts(SQUARE)))
    return name


def apply(stub: HullServiceStub, name: str, batch: batch_pb2.Batch) -> dict[str, int]:
    """The counts of a batch that are not 0."""
    result = stub.Apply(pb.ApplyRequest(name=name, batch=batch)).result
    return {each: getattr(result, each) for each in COUNTS if getattr(result, each)}


def entities(stub: HullServiceStub, name: str) -> dict[str | int, tuple[float, float]]:
    found: dict[str | int, tuple[float, float]] = {}
    for part in stub.ReadEntities(pb.ReadEntitiesRequest(name=name, encoding=COORDINATES)):
        xy = part.positions.coordinates
        names = list(part.keys.strings) or list(part.keys.integers)
        found |= dict(zip(names, zip(xy[::2], xy[1::2], strict=True), strict=True))
    return found


def test_keys_are_put_move_and_are_removed(stub: HullServiceStub, hull: str) -> None:
    assert apply(stub, hull, puts({"a": (1, 1), "b": (4, 0), "e": (2, 2)})) == {"inserted": 1, "moved": 2}
    assert apply(stub, hull, batch_pb2.Batch(removes=keys("c", "x", "e"))) == {"deleted": 2, "missing": 1}
    both = puts({"a": (-1, 0), "f": (9, 9)})
    both.removes.CopyFrom(keys("d", "y"))
    assert apply(stub, hull, both) == {"inserted": 1, "moved": 1, "deleted": 1, "missing": 1}
    assert entities(stub, hull) == {"a": (-1, 0), "b": (4, 0), "f": (9, 9)}
    assert apply(stub, hull, puts({"a": (0, 0), "g": (5, 5)}, condition=2)) == {"inserted": 1, "skipped": 1}
    assert apply(stub, hull, puts({"a": (0, 1), "h": (5, 5)}, condition=3)) == {"moved": 1, "skipped": 1}
    assert apply(stub, hull, batch_pb2.Batch()) == {}
    after = stub.GetHull(pb.GetHullRequest(name=hull, include_keys=True, encoding=COORDINATES))
    assert (after.hull.revision, after.hull.point_count) == (7, 4)
    assert list(after.vertices.coordinates) == [0, 1, 4, 0, 9, 9]
    assert list(after.vertex_keys.strings) == ["a", "b", "f"]
    verified = stub.Verify(pb.VerifyRequest(name=hull))
    assert verified.equal
    assert verified.keys_equal


def test_packed_keys_in_streams_are_applied_once(stub: HullServiceStub, name: str) -> None:
    """Integers and strings, packed, to hulls that the first batch creates."""
    numbers = struct.pack("<3Q", 2**64 - 1, 0, 7)
    put = batch_pb2.Puts(keys=points_pb2.Keys(packed_integers=numbers), points=points(0, 0, 1, 1, 2, 5))
    requests = [
        pb.StreamRequest(name=f"{name}-i", batch=batch_pb2.Batch(puts=put), producer="p", sequence=each)
        for each in (1, 2, 2)
    ]
    results = [each.result for each in stub.Stream(iter(requests))]
    assert [(each.inserted, each.moved, each.duplicate) for each in results] == [
        (3, 0, False),
        (0, 3, False),
        (0, 0, True),
    ]
    assert entities(stub, f"{name}-i") == {0: (1, 1), 7: (2, 5), 2**64 - 1: (0, 0)}
    text = points_pb2.Keys(lengths=bytes([2, 255, 1]), text="é".encode() + b"x" * 255 + b"z")
    put = batch_pb2.Puts(keys=text, points=points(0, 0, 1, 1, 2, 5))
    summary = stub.Ingest(iter([pb.IngestRequest(name=f"{name}-s", batch=batch_pb2.Batch(puts=put))] * 2))
    assert (summary.batches, summary.inserted, summary.moved) == (2, 3, 3)
    assert entities(stub, f"{name}-s") == {"é": (0, 0), "x" * 255: (1, 1), "z": (2, 5)}
    for suffix, identity in (("i", INTEGERS), ("s", STRINGS)):
        assert stub.GetHull(pb.GetHullRequest(name=f"{name}-{suffix}")).hull.config.identity == identity


@pytest.mark.whole_hull("keys of another hull")
def test_questions_about_keys(stub: HullServiceStub, hull: str, name: str) -> None:
    apply(stub, hull, puts({"p": (2, 2), "q": (4, 2), "aa": (4, 0)}))
    found = stub.GetPositions(pb.GetPositionsRequest(name=hull, keys=keys("q", "nobody"), encoding=COORDINATES))
    assert (found.revision, found.present, list(found.positions.coordinates[:2])) == (2, b"\1\0", [4, 2])
    assert np.isnan(found.positions.coordinates[2:]).all()
    located = stub.Locate(pb.LocateRequest(name=hull, keys=keys("p", "nobody", "q")))
    assert np.frombuffer(located.sides, np.int8).tolist() == [1, -128, 0]
    assert (located.revision, located.keys_revision) == (2, 0)
    stub.Apply(pb.ApplyRequest(name=f"{name}-area", batch=batch_pb2.Batch(inserts=points(0, 0, 3, 0, 3, 3, 0, 3))))
    located = stub.Locate(pb.LocateRequest(name=f"{name}-area", keys=keys("p", "q", "nobody"), keys_of=hull))
    assert np.frombuffer(located.sides, np.int8).tolist() == [1, -1, -128]
    assert (located.revision, located.keys_revision) == (1, 2)
    far = stub.Distance(pb.DistanceRequest(name=f"{name}-area", keys=keys("q", "p", "nobody"), keys_of=hull))
    assert list(far.distances[:2]) == [1, 0]
    assert np.isnan(far.distances[2])
    extremes = stub.Support(
        pb.SupportRequest(name=hull, directions=points(1, -1, 0, 1), include_keys=True, encoding=COORDINATES)
    )
    assert list(extremes.keys.strings) == ["aa", "d"]
    many = points_pb2.Points(packed=np.tile([1.0, -1.0, 1.0, 1.0], (5000, 1)).tobytes())
    extremes = stub.Support(pb.SupportRequest(name=hull, directions=many, include_keys=True, encoding=COORDINATES))
    assert list(extremes.keys.strings) == ["aa", "c"] * 5000
    sampled = stub.SamplePoints(pb.SamplePointsRequest(name=hull, include_keys=True, encoding=COORDINATES))
    assert list(sampled.keys.strings) == ["a", "d", "p", "aa", "b", "q", "c"]
    assert list(sampled.points.coordinates) == [0, 0, 0, 4, 2, 2, 4, 0, 4, 0, 4, 2, 4, 4]
    few = stub.SamplePoints(pb.SamplePointsRequest(name=hull, sample_size=3, include_keys=True, encoding=COORDINATES))
    everyone = entities(stub, hull)
    assert [everyone[key] for key in few.keys.strings] == list(
        zip(few.points.coordinates[::2], few.points.coordinates[1::2], strict=True)
    )


def test_all_entities_come_in_parts_of_one_revision(stub: HullServiceStub, name: str) -> None:
    count = 70_000
    xy = np.random.default_rng(3).random((count, 2))
    put = batch_pb2.Puts(
        keys=points_pb2.Keys(packed_integers=np.arange(count, dtype="<u8")[::-1].tobytes()),
        points=points_pb2.Points(packed=xy[::-1].tobytes()),
    )
    stub.Apply(pb.ApplyRequest(name=name, batch=batch_pb2.Batch(puts=put)))
    parts = list(stub.ReadEntities(pb.ReadEntitiesRequest(name=name)))
    assert [len(part.keys.packed_integers) // 8 for part in parts] == [8_192] * 8 + [count - 65_536]
    assert b"".join(part.keys.packed_integers for part in parts) == np.arange(count, dtype="<u8").tobytes()
    assert b"".join(part.positions.packed for part in parts) == xy.tobytes()
    most = b"".join(part.keys.packed_integers for part in parts[:8])
    located = stub.Locate(pb.LocateRequest(name=name, keys=points_pb2.Keys(packed_integers=most)))
    assert len(located.sides) == 65_536
    assert -1 not in np.frombuffer(located.sides, np.int8)


MISSING = batch_pb2.Batch(removes=keys("a", "x"), missing_keys=batch_pb2.MISSING_KEY_POLICY_REFUSE)
TWICE_APART = puts({"a": (0, 0), "e": (1, 1)})
TWICE_APART.removes.CopyFrom(keys("b", "e"))
LONG = "x" * 256
REFUSED_BATCHES = {
    "a key put twice": (
        batch_pb2.Batch(puts=batch_pb2.Puts(keys=keys("e", "f", "e"), points=points(*range(6)))),
        (
            "KEY_REPEATED",
            {"field": "batch.puts.keys", "row": "2", "value": "e", "first_field": "batch.puts.keys", "first_row": "0"},
        ),
    ),
    "a key removed twice": (
        batch_pb2.Batch(removes=keys("a", "a")),
        (
            "KEY_REPEATED",
            {"field": "batch.removes", "row": "1", "value": "a", "first_field": "batch.removes", "first_row": "0"},
        ),
    ),
    "a key put and removed": (
        TWICE_APART,
        (
            "KEY_REPEATED",
            {"field": "batch.removes", "row": "1", "value": "e", "first_field": "batch.puts.keys", "first_row": "1"},
        ),
    ),
    "a missing key": (MISSING, ("KEY_MISSING", {"field": "batch.removes", "row": "1", "value": "x"})),
    "points": (batch_pb2.Batch(inserts=points(1, 2)), ("HULL_UNSUITABLE", {"field": "batch.inserts"})),
    "points to delete": (batch_pb2.Batch(deletes=points(1, 2)), ("HULL_UNSUITABLE", {"field": "batch.deletes"})),
    "integers": (batch_pb2.Batch(removes=keys(7)), ("HULL_UNSUITABLE", {"field": "batch.removes"})),
    "times of points": (
        batch_pb2.Batch(puts=puts({"e": (1, 1)}).puts, insert_times=times(5)),
        ("INVALID_FIELD", {"field": "batch.insert_times", "value": "present"}),
    ),
    "a life of points": (
        batch_pb2.Batch(inserts=points(1, 2), puts=batch_pb2.Puts(ttl=duration(1))),
        ("INVALID_FIELD", {"field": "batch.puts.ttl", "value": "present"}),
    ),
    "a life of centuries": (
        puts({"e": (1, 1)}, ttl=Duration(seconds=2**53 // 10**6)),
        ("INVALID_FIELD", {"field": "batch.puts.ttl", "value": f"{2**53 // 10**6 * 10**6} microseconds"}),
    ),
    "points and keys": (
        batch_pb2.Batch(inserts=points(1, 2), removes=keys("a")),
        ("INVALID_FIELD", {"field": "batch", "value": "points and keys"}),
    ),
    "strings and integers": (
        batch_pb2.Batch(puts=puts({"e": (1, 1)}).puts, removes=keys(7)),
        ("INVALID_FIELD", {"field": "batch.removes", "value": "strings and integers"}),
    ),
    "two encodings": (
        batch_pb2.Batch(removes=points_pb2.Keys(strings=["a"], integers=[7])),
        ("INVALID_FIELD", {"field": "batch.removes", "value": "several encodings"}),
    ),
    "an empty key": (
        batch_pb2.Batch(removes=keys("a", "")),
        ("INVALID_FIELD", {"field": "batch.removes", "row": "1", "value": "''"}),
    ),
    "a long key": (
        puts({"e": (1, 1), LONG: (1, 2)}),
        ("INVALID_FIELD", {"field": "batch.puts.keys", "row": "1", "value": f"'{LONG[:119]}... (258 characters)"}),
    ),
    "an empty packed key": (
        batch_pb2.Batch(removes=points_pb2.Keys(lengths=b"\1\0\1", text=b"ab")),
        ("INVALID_FIELD", {"field": "batch.removes", "row": "1", "value": "b''"}),
    ),
    "a cut character": (
        batch_pb2.Batch(removes=points_pb2.Keys(lengths=b"\2\1", text=b"a\xc3\xa9")),
        ("INVALID_FIELD", {"field": "batch.removes", "row": "0", "value": r"b'a\xc3'"}),
    ),
    "lengths without text": (
        batch_pb2.Batch(removes=points_pb2.Keys(lengths=b"\2\1")),
        ("INVALID_FIELD", {"field": "batch.removes.lengths", "value": "3 bytes"}),
    ),
    "a part of an integer": (
        batch_pb2.Batch(removes=points_pb2.Keys(packed_integers=bytes(9))),
        ("INVALID_FIELD", {"field": "batch.removes.packed_integers", "value": "9 bytes"}),
    ),
    "a key without a point": (
        batch_pb2.Batch(puts=batch_pb2.Puts(keys=keys("e", "f"), points=points(1, 2))),
        ("INVALID_FIELD", {"field": "batch.puts.points", "value": "1 points"}),
    ),
    "a point without a key": (
        batch_pb2.Batch(puts=batch_pb2.Puts(points=points(1, 2))),
        ("INVALID_FIELD", {"field": "batch.puts.points", "value": "1 points"}),
    ),
    "a point that is none": (
        puts({"e": (1, 1), "f": (0, float("inf"))}),
        ("INVALID_FIELD", {"field": "batch.puts.points", "row": "1", "value": "(0.0, inf)"}),
    ),
    "too few times": (
        puts({"e": (1, 1), "f": (0, 1)}, at=[5]),
        ("INVALID_FIELD", {"field": "batch.puts.times", "value": "1 times"}),
    ),
    "a time beyond all": (
        puts({"e": (1, 1), "f": (0, 1)}, at=[5, 2**53 + 1]),
        ("INVALID_FIELD", {"field": "batch.puts.times", "row": "1", "value": f"{2**53 + 1} microseconds"}),
    ),
    "a timestamp beyond all": (
        puts({"e": (1, 1)}, times=points_pb2.Times(timestamps=[Timestamp(seconds=-(2**62))])),
        ("INVALID_FIELD", {"field": "batch.puts.times", "row": "0", "value": f"{-(2**62)} seconds"}),
    ),
    "two encodings of times": (
        puts({"e": (1, 1)}, times=points_pb2.Times(packed=bytes(8), timestamps=[Timestamp()])),
        ("INVALID_FIELD", {"field": "batch.puts.times", "value": "packed and timestamps"}),
    ),
    "a life of nothing": (
        puts({"e": (1, 1)}, ttl=Duration()),
        ("INVALID_FIELD", {"field": "batch.puts.ttl", "value": "0 s and 0 ns"}),
    ),
    "a negative life": (
        puts({"e": (1, 1)}, ttl=Duration(seconds=-3)),
        ("INVALID_FIELD", {"field": "batch.puts.ttl", "value": "-3 s and 0 ns"}),
    ),
    "two ends": (
        puts({"e": (1, 1)}, ttl=duration(1), expire_times=times(5)),
        ("INVALID_FIELD", {"field": "batch.puts.ttl", "value": "ttl and expire_times"}),
    ),
    "a condition of the future": (
        puts({"e": (1, 1)}, condition=9),
        ("INVALID_FIELD", {"field": "batch.puts.condition", "value": "9"}),
    ),
    "a policy of the future": (
        batch_pb2.Batch(removes=keys("a"), missing_keys=9),
        ("INVALID_FIELD", {"field": "batch.missing_keys", "value": "9"}),
    ),
}


@pytest.mark.parametrize("case", REFUSED_BATCHES)
def test_a_refused_batch_of_keys_changes_nothing(stub: HullServiceStub, hull: str, case: str) -> None:
    batch, (reason, metadata) = REFUSED_BATCHES[case]
    code, info, details = refusal(lambda: stub.Apply(pb.ApplyRequest(name=hull, batch=batch)))
    assert info.reason == reason
    assert code == (FAILED if reason in ("HULL_UNSUITABLE", "KEY_MISSING") else INVALID)
    assert dict(info.metadata) == {"value": hull} | metadata
    assert details
    assert stub.GetHull(pb.GetHullRequest(name=hull)).hull.revision == 1
    assert entities(stub, hull) == SQUARE


BAD_WINDOWS = {
    "no limit": (window(), "config.window", "empty"),
    "no age": (window(max_age=Duration()), "config.window.max_age", "0 s and 0 ns"),
    "a negative age": (window(max_age=Duration(seconds=-1)), "config.window.max_age", "-1 s and 0 ns"),
    "a fraction of a microsecond": (window(max_age=Duration(nanos=1500)), "config.window.max_age", "0 s and 1500 ns"),
    "an age beyond all times": (
        window(max_age=Duration(seconds=2**40)),
        "config.window.max_age",
        f"{2**40} s and 0 ns",
    ),
    "a clock of the future": (window(1, clock=9), "config.window.clock", "9"),
    "a negative skew": (window(1, max_skew=Duration(seconds=-1)), "config.window.max_skew", "-1 s and 0 ns"),
    "a policy of the future": (window(1, ahead=9), "config.window.ahead", "9"),
    "a skew without an order": (window(max_skew=Duration(seconds=1)), "config.window", "empty"),
    "too many points": (window(max_points=2**63), "config.window.max_points", str(2**63)),
}
BAD_CONFIGS = {case: (hull_pb2.HullConfig(window=each), *rest) for case, (each, *rest) in BAD_WINDOWS.items()} | {
    "an ordering of the future": (hull_pb2.HullConfig(identity=STRINGS, ordering=9), "config.ordering", "9"),
    "an ordering without keys": (
        hull_pb2.HullConfig(ordering=hull_pb2.ORDERING_EVENT_TIME),
        "config.ordering",
        "ORDERING_EVENT_TIME",
    ),
    "a clock of event times without a window": (
        hull_pb2.HullConfig(
            identity=STRINGS,
            ordering=hull_pb2.ORDERING_EVENT_TIME,
            window=window(max_skew=Duration(seconds=1), clock=hull_pb2.CLOCK_DATA),
        ),
        "config.window.clock",
        "CLOCK_DATA",
    ),
}


@pytest.mark.parametrize("case", BAD_CONFIGS)
def test_bad_settings_are_named(stub: HullServiceStub, name: str, case: str) -> None:
    config, field, value = BAD_CONFIGS[case]
    code, info, _ = refusal(lambda: stub.CreateHull(pb.CreateHullRequest(name=name, config=config)))
    assert (code, dict(info.metadata)) == (INVALID, {"field": field, "value": value})
    code, _, _ = refusal(lambda: stub.GetHull(pb.GetHullRequest(name=name)))
    assert code == grpc.StatusCode.NOT_FOUND


def test_settings_come_back(stub: HullServiceStub, name: str) -> None:
    config = hull_pb2.HullConfig(
        identity=INTEGERS,
        max_points=9,
        window=window(
            1.5, max_points=7, clock=hull_pb2.CLOCK_DATA, max_skew=Duration(), ahead=hull_pb2.AHEAD_POLICY_CLAMP
        ),
        ordering=hull_pb2.ORDERING_EVENT_TIME,
        frame=hull_pb2.FRAME_PLANE,
    )
    assert stub.CreateHull(pb.CreateHullRequest(name=name, config=config)).hull.config == config
    (listed,) = stub.ListHulls(pb.ListHullsRequest(prefix=name)).hulls
    assert listed.config == config


QUESTIONS = {
    "GetPositions": ("keys", lambda name: pb.GetPositionsRequest(name=name, keys=keys("a"))),
    "ReadEntities": ("name", lambda name: pb.ReadEntitiesRequest(name=name)),
    "Locate": ("keys", lambda name: pb.LocateRequest(name=name, keys=keys("a"))),
    "Distance": ("keys", lambda name: pb.DistanceRequest(name="area", keys=keys("a"), keys_of=name)),
    "Support": ("include_keys", lambda name: pb.SupportRequest(name=name, directions=points(1, 0), include_keys=True)),
    "SamplePoints": ("include_keys", lambda name: pb.SamplePointsRequest(name=name, include_keys=True)),
}


@pytest.mark.parametrize("method", QUESTIONS)
def test_a_hull_without_keys_cannot_answer(stub: HullServiceStub, name: str, method: str) -> None:
    field, question = QUESTIONS[method]
    for each in (name, "area"):
        stub.Apply(pb.ApplyRequest(name=each, batch=batch_pb2.Batch(inserts=points(1, 2))))

    def ask() -> None:
        answer = getattr(stub, method)(question(name))
        if method == "ReadEntities":
            list(answer)

    code, info, _ = refusal(ask)
    assert (code, info.reason, dict(info.metadata)) == (FAILED, "HULL_UNSUITABLE", {"field": field, "value": name})


def test_a_hull_without_keys_has_no_names(stub: HullServiceStub, name: str) -> None:
    """A client may ask for them without knowing what the hull is."""
    stub.Apply(pb.ApplyRequest(name=name, batch=batch_pb2.Batch(inserts=points(1, 2))))
    answer = stub.GetHull(pb.GetHullRequest(name=name, include_keys=True, encoding=COORDINATES))
    assert (list(answer.vertices.coordinates), answer.HasField("vertex_keys")) == ([1, 2], False)


def test_a_limit_refuses_new_keys_and_not_moves(stub: HullServiceStub, name: str) -> None:
    config = hull_pb2.HullConfig(identity=STRINGS, max_points=4)
    stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
    apply(stub, name, puts(SQUARE))
    assert apply(stub, name, puts(dict.fromkeys(SQUARE, (1, 1)))) == {"moved": 4}
    exchange = puts({"a": (0, 0), "e": (9, 9)})
    exchange.removes.CopyFrom(keys("b"))
    assert apply(stub, name, exchange) == {"inserted": 1, "moved": 1, "deleted": 1}
    code, info, _ = refusal(lambda: apply(stub, name, puts({"a": (5, 5), "f": (6, 6)})))
    assert (code, dict(info.metadata)) == (grpc.StatusCode.RESOURCE_EXHAUSTED, {"limit": "max_points", "value": "4"})
    assert apply(stub, name, puts({"a": (5, 5), "f": (6, 6)}, condition=3)) == {"moved": 1, "skipped": 1}


def test_the_later_event_time_wins(stub: HullServiceStub, name: str) -> None:
    config = hull_pb2.HullConfig(identity=STRINGS, ordering=hull_pb2.ORDERING_EVENT_TIME)
    stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
    code, info, _ = refusal(lambda: apply(stub, name, puts({"a": (0, 0)})))
    assert (code, dict(info.metadata)) == (INVALID, {"field": "batch.puts.times", "value": "empty"})
    apply(stub, name, puts({"a": (0, 0), "b": (1, 0)}, at=[10 * SECOND, -5]))
    assert apply(stub, name, puts({"a": (7, 7), "b": (2, 0)}, at=[10 * SECOND - 1, -5])) == {"moved": 1, "stale": 1}
    found = stub.GetPositions(pb.GetPositionsRequest(name=name, keys=keys("a", "b", "c"), encoding=COORDINATES))
    assert list(found.positions.coordinates[:4]) == [0, 0, 2, 0]
    assert [each.ToMicroseconds() for each in found.times.timestamps] == [10 * SECOND, -5, 0]
