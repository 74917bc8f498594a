"""Bad requests: the status, its details, and that nothing has changed."""

import math
import struct
from collections.abc import Callable, Iterator
from itertools import chain

import grpc
import pytest
from google.protobuf.duration_pb2 import Duration
from refusal import refusal
from server_process import server_process

from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

INVALID = grpc.StatusCode.INVALID_ARGUMENT
NAN_ROW = points_pb2.Points(coordinates=[0, 0, 1, math.nan])
INFINITE_ROW = points_pb2.Points(packed=struct.pack("<4d", 0, 0, -math.inf, 1))
ONE = points_pb2.Points(coordinates=[1, 2])
TWO = points_pb2.Points(coordinates=[1, 2, 3, 4])
FAR_AWAY = points_pb2.Points(coordinates=[8, 8, 9, 9])


def apply(**parts: object) -> Callable[[str], pb.ApplyRequest]:
    return lambda hull: pb.ApplyRequest(name=hull, batch=batch_pb2.Batch(**parts))


INVALID_REQUESTS = {
    "no name": ("CreateHull", lambda _: pb.CreateHullRequest(), "name", None, ""),
    "a blank in a name": ("CreateHull", lambda _: pb.CreateHullRequest(name="a b"), "name", None, "a b"),
    "a newline after a name": ("CreateHull", lambda _: pb.CreateHullRequest(name="a\n"), "name", None, "a\n"),
    "a letter of no alphabet": ("DeleteHull", lambda _: pb.DeleteHullRequest(name="ä"), "name", None, "ä"),
    "a long name": (
        "GetHull",
        lambda _: pb.GetHullRequest(name="a" * 100_000),
        "name",
        None,
        "a" * 120 + "... (100000 characters)",
    ),
    "an identity of the future": (
        "CreateHull",
        lambda hull: pb.CreateHullRequest(name=hull, config=hull_pb2.HullConfig(identity=77)),
        "config.identity",
        None,
        "77",
    ),
    "more points than can be counted": (
        "CreateHull",
        lambda hull: pb.CreateHullRequest(name=hull, config=hull_pb2.HullConfig(max_points=2**63)),
        "config.max_points",
        None,
        str(2**63),
    ),
    "a prefix no name has": ("ListHulls", lambda _: pb.ListHullsRequest(prefix="%"), "prefix", None, "%"),
    "a negative page": ("ListHulls", lambda _: pb.ListHullsRequest(page_size=-1), "page_size", None, "-1"),
    "a token of another prefix": (
        "ListHulls",
        lambda _: pb.ListHullsRequest(prefix="a", page_token="b"),
        "page_token",
        None,
        "b",
    ),
    "no batch": ("Apply", lambda hull: pb.ApplyRequest(name=hull), "batch", None, ""),
    "NaN inserted": ("Apply", apply(inserts=NAN_ROW), "batch.inserts", 1, "(1.0, nan)"),
    "infinity deleted": ("Apply", apply(deletes=INFINITE_ROW), "batch.deletes", 1, "(-inf, 1.0)"),
    "NaN moved": (
        "Apply",
        apply(inserts=ONE, moves=batch_pb2.Moves(origins=TWO, destinations=NAN_ROW)),
        "batch.moves.destinations",
        1,
        "(1.0, nan)",
    ),
    "moves to nowhere": (
        "Apply",
        apply(inserts=ONE, moves=batch_pb2.Moves(origins=TWO, destinations=ONE)),
        "batch.moves.destinations",
        None,
        "1 points",
    ),
    "odd bytes": (
        "Apply",
        apply(inserts=points_pb2.Points(packed=bytes(17))),
        "batch.inserts.packed",
        None,
        "17 bytes",
    ),
    "odd coordinates": (
        "Apply",
        apply(inserts=points_pb2.Points(coordinates=[1, 2, 3])),
        "batch.inserts.coordinates",
        None,
        "3 coordinates",
    ),
    "both encodings": (
        "Apply",
        apply(inserts=points_pb2.Points(coordinates=[1, 2], packed=bytes(16))),
        "batch.inserts",
        None,
        "packed and coordinates",
    ),
    "a policy of the future": ("Apply", apply(inserts=ONE, missing_points=9), "batch.missing_points", None, "9"),
    "NaN located": ("Locate", lambda hull: pb.LocateRequest(name=hull, points=NAN_ROW), "points", 1, "(1.0, nan)"),
    "an encoding of the future": (
        "GetHull",
        lambda hull: pb.GetHullRequest(name=hull, encoding=5),
        "encoding",
        None,
        "5",
    ),
    "an encoding of the future, verified": (
        "Verify",
        lambda hull: pb.VerifyRequest(name=hull, encoding=5),
        "encoding",
        None,
        "5",
    ),
    "no other name": ("Separate", lambda hull: pb.SeparateRequest(name=hull), "other_name", None, ""),
    "an energy that is none": (
        "PhaseDiagram",
        lambda hull: pb.PhaseDiagramRequest(name=hull, entries=NAN_ROW),
        "entries",
        1,
        "(1.0, nan)",
    ),
    "a composition beyond 1": (
        "PhaseDiagram",
        lambda hull: pb.PhaseDiagramRequest(name=hull, entries=points_pb2.Points(coordinates=[1, 2, 3, 4])),
        "entries",
        1,
        "(3.0, 4.0)",
    ),
    "a risk of nothing": (
        "Frontier",
        lambda hull: pb.FrontierRequest(name=hull, points=points_pb2.Points(coordinates=[1, 2, -0.0, 4])),
        "points",
        1,
        "(0.0, 4.0)",
    ),
    "an infinite rate": (
        "Frontier",
        lambda hull: pb.FrontierRequest(name=hull, rates=[0, math.inf]),
        "rates",
        1,
        "inf",
    ),
    "a rate that is none": (
        "Watch",
        lambda hull: pb.WatchRequest(name=hull, max_events_per_second=math.nan),
        "max_events_per_second",
        None,
        "nan",
    ),
    "a rate that never sends": (
        "Watch",
        lambda hull: pb.WatchRequest(name=hull, max_events_per_second=5e-324),
        "max_events_per_second",
        None,
        "5e-324",
    ),
    "a sketch to be resumed": (
        "Watch",
        lambda hull: pb.WatchRequest(name=hull, directions=ONE, resume={"uid": "a"}),
        "resume",
        None,
        "resume and directions",
    ),
    "a state of no hull": (
        "Watch",
        lambda hull: pb.WatchRequest(name=hull, resume={"revision": 1}),
        "resume.uid",
        None,
        "",
    ),
    "a progress interval of nothing": (
        "Watch",
        lambda hull: pb.WatchRequest(name=hull, progress_interval=Duration()),
        "progress_interval",
        None,
        "0.0 s",
    ),
}


@pytest.mark.parametrize("case", INVALID_REQUESTS)
def test_invalid_arguments_are_named(stub: HullServiceStub, hull: str, case: str) -> None:
    method, request, field, row, value = INVALID_REQUESTS[case]
    code, info, details = refusal(lambda: finish(getattr(stub, method)(request(hull))))
    assert (code, info.reason) == (INVALID, "INVALID_FIELD")
    expected = {"field": field, "value": value} | ({} if row is None else {"row": str(row)})
    assert dict(info.metadata) == expected
    (violation,) = details[0].field_violations
    assert violation.field == (field if row is None else f"{field}[{row}]")
    after = stub.GetHull(pb.GetHullRequest(name=hull)).hull
    assert (after.revision, after.point_count) == (0, 0)


@pytest.mark.parametrize(("name", "shown"), [("", "''"), ("a b", "'a b'"), ("ü", "'ü'"), ("a%", "a%")])
def test_a_name_in_a_message_cannot_be_misread(stub: HullServiceStub, name: str, shown: str) -> None:
    with pytest.raises(grpc.RpcError) as refused:
        stub.CreateHull(pb.CreateHullRequest(name=name))
    assert refused.value.details() == (
        f'name is {shown}: a hull\'s name is 1 to 200 of the letters a to z and A to Z, digits and "._-/"'
    )


def finish(response: object) -> object:
    """A unary response, or the list of a stream's responses."""
    return list(response) if isinstance(response, Iterator) else response


NAMED = {
    "DeleteHull": pb.DeleteHullRequest,
    "Apply": lambda name: pb.ApplyRequest(name=name, batch=batch_pb2.Batch(inserts=ONE)),
    "Ingest": lambda name: iter([pb.IngestRequest(name=name)]),
    "Locate": pb.LocateRequest,
    "GetHull": pb.GetHullRequest,
    "Watch": pb.WatchRequest,
    "Verify": pb.VerifyRequest,
}


@pytest.mark.parametrize("method", NAMED)
def test_no_such_hull(stub: HullServiceStub, name: str, method: str) -> None:
    make = NAMED[method]
    request = make(name=name)
    code, info, details = refusal(lambda: finish(getattr(stub, method)(request)))
    assert (code, info.reason) == (grpc.StatusCode.NOT_FOUND, "HULL_NOT_FOUND")
    assert details[0].resource_name == name


def test_a_hull_that_is_no_phase_diagram(stub: HullServiceStub, hull: str) -> None:
    stub.Apply(pb.ApplyRequest(name=hull, batch=batch_pb2.Batch(inserts=TWO)))
    code, info, details = refusal(lambda: stub.PhaseDiagram(pb.PhaseDiagramRequest(name=hull)))
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "HULL_UNSUITABLE")
    assert dict(info.metadata) == {"value": hull, "point": "(3.0, 4.0)"}
    assert details[0].violations[0].subject == hull


def test_a_hull_exists_already(stub: HullServiceStub, hull: str) -> None:
    code, info, details = refusal(lambda: stub.CreateHull(pb.CreateHullRequest(name=hull)))
    assert (code, info.reason) == (grpc.StatusCode.ALREADY_EXISTS, "HULL_EXISTS")
    assert details[0].resource_name == hull


MISSING_POINTS = {
    "not there": (
        batch_pb2.Batch(inserts=TWO, deletes=points_pb2.Points(coordinates=[3, 4, 5, 6])),
        "batch.deletes",
        "(5.0, 6.0)",
    ),
    "not often enough": (
        batch_pb2.Batch(deletes=points_pb2.Points(coordinates=[1, 2, 1, 2])),
        "batch.deletes",
        "(1.0, 2.0)",
    ),
    "moved": (
        batch_pb2.Batch(moves=batch_pb2.Moves(origins=TWO, destinations=FAR_AWAY)),
        "batch.moves.origins",
        "(3.0, 4.0)",
    ),
}


@pytest.mark.parametrize("case", MISSING_POINTS)
def test_a_missing_point_refuses_the_whole_batch(stub: HullServiceStub, hull: str, case: str) -> None:
    batch, field, value = MISSING_POINTS[case]
    stub.Apply(pb.ApplyRequest(name=hull, batch=batch_pb2.Batch(inserts=ONE)))
    code, info, details = refusal(lambda: stub.Apply(pb.ApplyRequest(name=hull, batch=batch)))
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "POINT_MISSING")
    assert dict(info.metadata) == {"field": field, "row": "1", "value": value}
    assert details[0].violations[0].subject == f"{field}[1]"
    after = stub.GetHull(pb.GetHullRequest(name=hull))
    assert (after.hull.revision, after.hull.point_count) == (1, 1)


def test_a_refused_batch_ends_an_ingest_and_the_ones_before_stay(stub: HullServiceStub, hull: str) -> None:
    good = pb.IngestRequest(name=hull, batch=batch_pb2.Batch(inserts=ONE))
    bad = pb.IngestRequest(name=hull, batch=batch_pb2.Batch(inserts=NAN_ROW))
    code, info, _ = refusal(lambda: stub.Ingest(iter([good, good, bad, good])))
    assert code == INVALID
    assert dict(info.metadata) == {"field": "batch.inserts", "row": "1", "value": "(1.0, nan)", "batch": "2"}
    after = stub.GetHull(pb.GetHullRequest(name=hull)).hull
    assert (after.revision, after.point_count) == (2, 2)


def test_an_ingest_writes_to_one_hull(stub: HullServiceStub, hull: str) -> None:
    requests = [pb.IngestRequest(name=hull), pb.IngestRequest(name="another", batch=batch_pb2.Batch(inserts=ONE))]
    code, info, _ = refusal(lambda: stub.Ingest(iter(requests)))
    assert (code, info.metadata["field"], info.metadata["value"]) == (INVALID, "name", "another")


def test_an_ingest_without_messages(stub: HullServiceStub) -> None:
    code, info, _ = refusal(lambda: stub.Ingest(iter([])))
    assert (code, info.metadata["field"]) == (INVALID, "name")


METHODS = {
    "CreateHull": "unary_unary",
    "DeleteHull": "unary_unary",
    "ListHulls": "unary_unary",
    "Apply": "unary_unary",
    "Ingest": "stream_unary",
    "Locate": "unary_unary",
    "GetHull": "unary_unary",
    "Watch": "unary_stream",
    "Verify": "unary_unary",
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("message", [b"\xff\xff", b"\x0a\x7f", b"\x0a\x02\xff\xfe"], ids=["tag", "cut off", "utf-8"])
def test_bytes_that_are_no_message(channel: grpc.Channel, method: str, message: bytes) -> None:
    kind = METHODS[method]
    call = getattr(channel, kind)(f"/dynhull.v1.HullService/{method}")
    code, info, _ = refusal(lambda: finish(call(iter([message]) if kind == "stream_unary" else message)))
    assert (code, info.reason) == (INVALID, "MALFORMED_MESSAGE")


def test_limits_are_told() -> None:
    options = ("--max-hulls", "1", "--max-message-bytes", "4096")
    with server_process(*options) as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name="a/one"))
        code, info, details = refusal(lambda: stub.CreateHull(pb.CreateHullRequest(name="a/two")))
        assert (code, info.reason) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "LIMIT_EXCEEDED")
        assert dict(info.metadata) == {"limit": "max_hulls", "value": "1"}
        assert details[0].violations[0].subject == "max_hulls"
        batch = batch_pb2.Batch(inserts=points_pb2.Points(packed=bytes(16 * 4096)))
        code, info, _ = refusal(lambda: stub.Apply(pb.ApplyRequest(name="a/one", batch=batch)))
        assert (code, info.reason) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "LIMIT_EXCEEDED")
        assert dict(info.metadata) == {"limit": "max_message_bytes", "value": "4096"}
        assert stub.GetHull(pb.GetHullRequest(name="a/one")).hull.revision == 0
        # An answer is limited like a request.
        parabola = [[x, x * x] for x in range(300)]
        for half in (parabola[:150], parabola[150:]):
            points = points_pb2.Points(packed=struct.pack("<300d", *chain.from_iterable(half)))
            stub.Apply(pb.ApplyRequest(name="a/one", batch=batch_pb2.Batch(inserts=points)))
        code, info, _ = refusal(lambda: stub.GetHull(pb.GetHullRequest(name="a/one")))
        assert (code, info.reason) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "LIMIT_EXCEEDED")
        assert dict(info.metadata) == {"limit": "max_message_bytes", "value": "4096"}
