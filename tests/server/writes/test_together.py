"""One batch to each of several hulls: all of them are applied, or none."""

import random
import threading
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from google.protobuf.timestamp_pb2 import Timestamp
from patience import PATIENCE
from refusal import refusal
from server_process import server_process

from dynhull_client import HullClient
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

# How often a point travels while readers look: an even number, so that it comes back.
TRAVELS = 60
INVALID, FAILED = grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.FAILED_PRECONDITION


def points(*xy: float) -> points_pb2.Points:
    return points_pb2.Points(coordinates=xy)


def together(*parts: tuple[str, batch_pb2.Batch], producer: str = "", sequence: int = 0) -> pb.ApplyTogetherRequest:
    batches = [pb.HullBatch(name=name, batch=batch) for name, batch in parts]
    return pb.ApplyTogetherRequest(batches=batches, producer=producer, sequence=sequence)


def insert(*xy: float) -> batch_pb2.Batch:
    return batch_pb2.Batch(inserts=points(*xy))


def delete(*xy: float) -> batch_pb2.Batch:
    return batch_pb2.Batch(deletes=points(*xy))


@pytest.fixture(scope="module", params=["memory", "durable"])
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    options = [] if request.param == "memory" else ["--data", str(tmp_path_factory.mktemp("together"))]
    with server_process(*options) as process:
        yield process.address


@pytest.fixture
def address(server: str) -> str:
    """Of a server whose commits are immediate, and of one whose commits take time."""
    return server


@pytest.fixture
def fleet(stub: HullServiceStub, name: str) -> list[str]:
    """The names of three hulls: the first has the points (0, 0) and (9, 9), the second room for four points."""
    names = [f"{name}/{letter}" for letter in "abc"]
    for each, most in zip(names, (0, 4, 0), strict=True):
        stub.CreateHull(pb.CreateHullRequest(name=each, config={"max_points": most}))
    stub.Apply(pb.ApplyRequest(name=names[0], batch=insert(0, 0, 9, 9)))
    return names


def counts(stub: HullServiceStub, names: list[str]) -> list[tuple[int, int]]:
    hulls = [stub.GetHull(pb.GetHullRequest(name=name)).hull for name in names]
    return [(hull.revision, hull.point_count) for hull in hulls]


def test_each_hull_gets_its_batch_as_one_revision(stub: HullServiceStub, fleet: list[str]) -> None:
    a, b, c = fleet
    many = insert(*range(2000))  # enough to be applied beside the event loop
    answer = stub.ApplyTogether(together((c, many), (a, delete(9, 9)), (b, insert(9, 9))))
    results = [(each.revision, each.inserted, each.deleted, each.point_count) for each in answer.results]
    assert results == [(1, 1000, 0, 1000), (2, 0, 1, 1), (1, 1, 0, 1)]
    assert counts(stub, fleet) == [(2, 1), (1, 1), (1, 1000)]
    assert stub.Count(pb.CountRequest(name=b, points=points(9, 9))).counts == [1]


# What is refused: the batches, and the code, reason and metadata of the refusal.
REFUSED = {
    "one hull": (["a"], INVALID, "INVALID_FIELD", {"field": "batches", "value": "1 batches"}),
    "seventeen hulls": (["a"] * 17, INVALID, "INVALID_FIELD", {"field": "batches", "value": "17 batches"}),
    "a hull twice": (["a", "b", "a"], INVALID, "INVALID_FIELD", {"field": "batches[2].name", "value": "{a}"}),
    "a name that no hull has": (["a", "d%"], INVALID, "INVALID_FIELD", {"field": "batches[1].name"}),
    "a missing hull": (["a", "b", "d"], grpc.StatusCode.NOT_FOUND, "HULL_NOT_FOUND", {"value": "{d}", "batch": "2"}),
    "no batch": (
        ["a", ("b", None)],
        INVALID,
        "INVALID_FIELD",
        {"field": "batches[1].batch", "value": ""},
    ),
    "a point that is not finite": (
        ["a", ("b", insert(1, 1, float("nan"), 0))],
        INVALID,
        "INVALID_FIELD",
        {"field": "batches[1].batch.inserts", "row": "1", "value": "(nan, 0.0)", "batch": "1"},
    ),
    "a missing point": (
        ["b", ("a", delete(9, 9, 0, 0, 9, 9)), "c"],
        FAILED,
        "POINT_MISSING",
        {"field": "batches[1].batch.deletes", "row": "2", "value": "(9.0, 9.0)", "batch": "1"},
    ),
    "a missing origin, last": (
        ["b", ("a", batch_pb2.Batch(moves={"origins": points(0, 0, 5, 5), "destinations": points(1, 1, 2, 2)}))],
        FAILED,
        "POINT_MISSING",
        {"field": "batches[1].batch.moves.origins", "row": "1", "value": "(5.0, 5.0)", "batch": "1"},
    ),
    "too many points": (
        ["a", ("b", insert(*range(10)))],
        grpc.StatusCode.RESOURCE_EXHAUSTED,
        "LIMIT_EXCEEDED",
        {"limit": "max_points", "value": "4", "batch": "1"},
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_refused_batch_leaves_all_hulls_as_they_were(stub: HullServiceStub, fleet: list[str], case: str) -> None:
    parts, code, reason, metadata = REFUSED[case]
    names = dict(zip("abc", fleet, strict=True)) | {"d": fleet[0] + "-missing", "d%": "%"}
    request = pb.ApplyTogetherRequest()
    for part in parts:
        letter, batch = (part, insert(7, 7)) if isinstance(part, str) else part
        request.batches.add(name=names[letter], batch=batch)
    before = counts(stub, fleet)
    refused, info, _ = refusal(lambda: stub.ApplyTogether(request))
    assert (refused, info.reason) == (code, reason)
    assert dict(info.metadata).items() >= {key: value.format(**names) for key, value in metadata.items()}.items()
    assert counts(stub, fleet) == before


@pytest.fixture
def fleets(stub: HullServiceStub, name: str) -> list[str]:
    """The names of two hulls of vehicles, the first with one; the second forgets them by their event times."""
    names = [f"{name}/{each}" for each in ("here", "there")]
    window = hull_pb2.Window(max_age=Duration(seconds=60), clock=hull_pb2.CLOCK_DATA)
    for each, settings in zip(names, ({}, {"window": window}), strict=True):
        config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_STRING_KEYS, **settings)
        stub.CreateHull(pb.CreateHullRequest(name=each, config=config))
    stub.Apply(pb.ApplyRequest(name=names[0], batch=put("van")))
    return names


def put(*keys: str, at: int = 1_000) -> batch_pb2.Batch:
    places = [float(i) for i in range(2 * len(keys))]
    times = points_pb2.Times(timestamps=[Timestamp(seconds=at)] * len(keys))
    return batch_pb2.Batch(puts=batch_pb2.Puts(keys=named(*keys), points=points(*places), times=times))


def remove(*keys: str) -> batch_pb2.Batch:
    return batch_pb2.Batch(removes=named(*keys), missing_keys=batch_pb2.MISSING_KEY_POLICY_REFUSE)


def named(*keys: str) -> points_pb2.Keys:
    return points_pb2.Keys(strings=keys)


def present(stub: HullServiceStub, name: str, *keys: str) -> list[bool]:
    answer = stub.GetPositions(pb.GetPositionsRequest(name=name, keys=named(*keys)))
    return [bool(byte) for byte in answer.present]


def test_a_key_that_leaves_one_hull_for_another_is_in_exactly_one(stub: HullServiceStub, fleets: list[str]) -> None:
    here, there = fleets
    answer = stub.ApplyTogether(together((here, remove("van")), (there, put("van"))))
    assert [(each.inserted, each.deleted) for each in answer.results] == [(0, 1), (1, 0)]
    assert [present(stub, name, "van") for name in fleets] == [[False], [True]]
    before = counts(stub, fleets)
    batches = {
        "the key is missing": ((there, put("car")), (here, remove("van"))),
        "a later time expires what stays, if nothing is refused": (
            (there, put("car", at=2_000)),
            (here, remove("van")),
        ),
        "a key twice": ((here, put("car")), (there, put("car", "bus", "car"))),
        "a batch of points": ((there, put("car")), (here, insert(1, 1))),
    }
    said = {case: refusal(lambda parts=parts: stub.ApplyTogether(together(*parts))) for case, parts in batches.items()}
    assert [info.reason for _, info, _ in said.values()] == ["KEY_MISSING"] * 2 + ["KEY_REPEATED", "HULL_UNSUITABLE"]
    assert [info.metadata["batch"] for _, info, _ in said.values()] == ["1"] * 4
    assert said["the key is missing"][1].metadata["field"] == "batches[1].batch.removes"
    twice = said["a key twice"][1].metadata
    assert (twice["field"], twice["row"], twice["first_row"]) == ("batches[1].batch.puts.keys", "2", "0")
    assert twice["first_field"] == "batches[1].batch.puts.keys"
    assert counts(stub, fleets) == before
    assert [present(stub, name, "van", "car") for name in fleets] == [[False, False], [True, False]]


def test_points_that_leave_at_the_time_of_a_batch_do_so_before_it(stub: HullServiceStub, fleets: list[str]) -> None:
    here, there = fleets
    stub.ApplyTogether(together((here, put("bus")), (there, put("old"))))
    answer = stub.ApplyTogether(together((here, remove("bus")), (there, put("bus", at=1_060))))
    assert [(each.revision, each.point_count) for each in answer.results] == [(3, 1), (3, 1)]
    assert answer.results[1].clock_time.seconds == 1_060
    assert present(stub, there, "old", "bus") == [False, True]


def test_points_that_a_batch_inserts_and_deletes_leave_no_trace(stub: HullServiceStub, fleet: list[str]) -> None:
    a, b, _ = fleet
    both = batch_pb2.Batch(inserts=points(5, 5, 6, 6), deletes=points(5, 5, 0, 0))
    lenient = batch_pb2.Batch(deletes=points(8, 8), missing_points=batch_pb2.MISSING_POINT_POLICY_COUNT)
    answer = stub.ApplyTogether(together((a, both), (b, lenient)))
    assert [(each.point_count, each.missing) for each in answer.results] == [(2, 0), (0, 1)]


def test_numbered_batches_are_applied_once_in_every_hull(stub: HullServiceStub, fleet: list[str]) -> None:
    a, b, _ = fleet
    parts = (a, insert(1, 1)), (b, insert(2, 2))
    for _ in range(2):
        for sequence in (1, 2):
            stub.ApplyTogether(together(*parts, producer="p", sequence=sequence))
    after = counts(stub, fleet)
    assert after[:2] == [(3, 4), (2, 2)]
    answer = stub.ApplyTogether(together(*parts, producer="p", sequence=2))
    assert [each.duplicate for each in answer.results] == [True, True]

    _, info, _ = refusal(lambda: stub.ApplyTogether(together(*parts, producer="p", sequence=4)))
    assert (info.reason, info.metadata["expected"], info.metadata["batch"]) == ("SEQUENCE_GAP", "3", "0")
    stub.Apply(pb.ApplyRequest(name=a, batch=insert(3, 3), producer="p", sequence=3))
    code, info, details = refusal(lambda: stub.ApplyTogether(together(*parts, producer="p", sequence=3)))
    assert (code, info.reason, info.metadata["expected"]) == (FAILED, "SEQUENCE_GAP", "4")
    words = details[0].violations[0].description
    assert f"has been applied to '{a}', which expects 4, but not to '{b}'" in words
    assert counts(stub, fleet)[1] == after[1]


def test_no_reader_sees_one_hull_without_the_other(address: str, stub: HullServiceStub, fleet: list[str]) -> None:
    """A point travels between two hulls, whose revisions grow together: later reads, and reads of both, show that."""
    _, b, c = fleet
    stub.ApplyTogether(together((b, insert(1, 1)), (c, insert(2, 2, 5, 5))))
    ended = threading.Event()

    def read(first: str, second: str) -> int:
        reads = 0
        with grpc.insecure_channel(address) as channel:
            reader = HullServiceStub(channel)
            while not ended.is_set():
                (earlier, _), (later, _) = counts(reader, [first, second])
                assert later >= earlier, f"{second} was behind {first}"
                both = reader.Separate(pb.SeparateRequest(name=first, other_name=second))
                assert both.revision == both.other_revision
                reads += 1
        return reads

    with (
        HullClient(address) as client,
        ThreadPoolExecutor() as threads,
        client.watch(b) as of_b,
        client.watch(c) as of_c,
    ):
        readers = [threads.submit(read, b, c), threads.submit(read, c, b)]
        for i in range(1, TRAVELS + 1):
            source, target = (c, b) if i % 2 else (b, c)
            answer = stub.ApplyTogether(together((source, delete(5, 5)), (target, insert(5, 5))))
            assert [each.revision for each in answer.results] == [i + 1, i + 1]
        ended.set()
        assert all(reader.result(PATIENCE) for reader in readers)
        for watch in (of_b, of_c):
            while next(watch).revision <= TRAVELS:
                pass
    assert counts(stub, [b, c]) == [(TRAVELS + 1, 1), (TRAVELS + 1, 2)]


def test_calls_that_name_hulls_in_any_order_all_end(address: str, stub: HullServiceStub, fleet: list[str]) -> None:
    draw = random.Random(11)
    applied = dict.fromkeys(fleet, 0)
    calls = []
    with grpc.insecure_channel(address) as channel:
        other = HullServiceStub(channel)
        for i in range(300):
            names = draw.sample(fleet, draw.choice((1, 2, 2, 3)))
            for name in names:
                applied[name] += 1
            near = batch_pb2.Batch(inserts=points(i, i), deletes=points(i, i))
            sender = draw.choice((stub, other))
            if len(names) == 1:
                calls.append(sender.Apply.future(pb.ApplyRequest(name=names[0], batch=near)))
            else:
                calls.append(sender.ApplyTogether.future(together(*((name, near) for name in names))))
        for call in calls:
            call.result(PATIENCE)
    revisions = [revision for revision, _ in counts(stub, fleet)]
    assert revisions == [applied[fleet[0]] + 1, applied[fleet[1]], applied[fleet[2]]]


def test_a_killed_server_has_all_of_it_or_none(tmp_path: Path) -> None:
    options = "--data", str(tmp_path)
    with server_process(*options, killed=True) as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        for name in "ab":
            stub.CreateHull(pb.CreateHullRequest(name=name))
        numbered = together(("a", insert(0, 0)), ("b", insert(0, 0)), producer="p", sequence=1)
        stub.ApplyTogether(numbered)
        calls = [stub.ApplyTogether.future(together(("a", insert(i, 0)), ("b", insert(i, i)))) for i in range(400)]
        acknowledged = calls[40].result(PATIENCE).results[0].revision
        server.process.kill()
        server.process.wait(PATIENCE)
        for call in calls:
            call.exception(PATIENCE)
    with server_process(*options, torn=True) as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        of_a, of_b = counts(stub, ["a", "b"])
        assert of_a == of_b
        assert of_a[0] >= acknowledged
        assert [each.duplicate for each in stub.ApplyTogether(numbered).results] == [True, True]
        assert counts(stub, ["a", "b"]) == [of_a, of_b]
