"""Hulls on the wire: names, pages, batches, reads."""

import struct
from collections.abc import Sequence

import numpy as np
import pytest

from dynhull import DynamicHull
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

SQUARE = [0, 0, 4, 0, 5, 2, 4, 4, 2, 3, 0, 4, 1, 2, 2, 1]
CORNERS = [0, 0, 4, 0, 5, 2, 4, 4, 0, 4]


def batch(inserts: Sequence[float] = (), deletes: Sequence[float] = (), **policy: int) -> batch_pb2.Batch:
    return batch_pb2.Batch(
        inserts=points_pb2.Points(coordinates=inserts), deletes=points_pb2.Points(coordinates=deletes), **policy
    )


def apply(stub: HullServiceStub, hull: str, batch: batch_pb2.Batch) -> batch_pb2.BatchResult:
    return stub.Apply(pb.ApplyRequest(name=hull, batch=batch)).result


def corners(stub: HullServiceStub, hull: str) -> list[float]:
    request = pb.GetHullRequest(name=hull, encoding=points_pb2.POINT_ENCODING_COORDINATES)
    return list(stub.GetHull(request).vertices.coordinates)


def test_both_encodings_say_the_same(stub: HullServiceStub, hull: str) -> None:
    packed = struct.pack(f"<{len(SQUARE)}d", *SQUARE)
    apply(stub, hull, batch_pb2.Batch(inserts=points_pb2.Points(packed=packed)))
    apply(stub, hull, batch(deletes=SQUARE))
    apply(stub, hull, batch(inserts=SQUARE))
    response = stub.GetHull(pb.GetHullRequest(name=hull))
    assert response.vertices.packed == struct.pack(f"<{len(CORNERS)}d", *CORNERS)
    assert corners(stub, hull) == CORNERS


def test_a_response_is_from_one_revision(stub: HullServiceStub, hull: str) -> None:
    apply(stub, hull, batch(inserts=[*SQUARE, 2, 1]))
    response = stub.GetHull(pb.GetHullRequest(name=hull))
    assert (response.hull.name, response.hull.revision) == (hull, 1)
    assert (response.hull.point_count, response.hull.distinct_point_count) == (9, 8)
    assert response.hull.config.identity == hull_pb2.IDENTITY_MULTISET
    assert response.hull.create_time.seconds > 0
    expected = DynamicHull(np.reshape(SQUARE, (-1, 2)))
    measures = response.measures
    assert measures.area == expected.area
    assert measures.perimeter == expected.perimeter
    assert (measures.centroid_x, measures.centroid_y) == expected.centroid
    assert (measures.min_x, measures.min_y, measures.max_x, measures.max_y) == expected.bounds


def test_what_a_batch_did(stub: HullServiceStub, hull: str) -> None:
    assert apply(stub, hull, batch(inserts=SQUARE)) == batch_pb2.BatchResult(
        revision=1, inserted=8, hull_changed=True, point_count=8
    )
    assert apply(stub, hull, batch(deletes=[2, 1], inserts=[1, 1, 1, 1])) == batch_pb2.BatchResult(
        revision=2, inserted=2, deleted=1, point_count=9
    )
    moves = batch_pb2.Moves(
        origins=points_pb2.Points(coordinates=[5, 2, 9, 9]), destinations=points_pb2.Points(coordinates=[7, 2, 1, 1])
    )
    counted = batch_pb2.Batch(moves=moves, missing_points=batch_pb2.MISSING_POINT_POLICY_COUNT)
    assert apply(stub, hull, counted) == batch_pb2.BatchResult(
        revision=3, inserted=2, deleted=1, missing=1, hull_changed=True, point_count=10
    )
    assert apply(stub, hull, batch_pb2.Batch()) == batch_pb2.BatchResult(revision=4, point_count=10)
    assert corners(stub, hull) == [0, 0, 4, 0, 7, 2, 4, 4, 0, 4]


def test_an_ingest_answers_once(stub: HullServiceStub, hull: str) -> None:
    requests = [
        pb.IngestRequest(name=hull),
        pb.IngestRequest(name=hull, batch=batch(inserts=SQUARE)),
        pb.IngestRequest(batch=batch(deletes=[2, 1, 6, 6], missing_points=batch_pb2.MISSING_POINT_POLICY_COUNT)),
    ]
    assert stub.Ingest(iter(requests)) == pb.IngestResponse(
        batches=2, revision=2, inserted=8, deleted=1, missing=1, point_count=7
    )
    assert stub.Ingest(iter(requests[:1])) == pb.IngestResponse(revision=2, point_count=7)


def test_locate(stub: HullServiceStub, hull: str) -> None:
    apply(stub, hull, batch(inserts=SQUARE))
    points = points_pb2.Points(coordinates=[1, 1, 0, 2, 4.5, 1, 4.5, 0.999])
    response = stub.Locate(pb.LocateRequest(name=hull, points=points))
    assert (response.revision, response.sides) == (1, bytes([1, 0, 0, 255]))


def test_a_read_waits_for_its_revision(stub: HullServiceStub, hull: str) -> None:
    read = stub.GetHull.future(pb.GetHullRequest(name=hull, min_revision=2))
    watch = stub.Watch(pb.WatchRequest(name=hull, min_revision=2))
    apply(stub, hull, batch(inserts=SQUARE))
    apply(stub, hull, batch(deletes=[5, 2]))
    assert read.result().hull.revision == 2
    assert next(watch).revision == 2
    watch.cancel()


def test_verify(stub: HullServiceStub, hull: str) -> None:
    apply(stub, hull, batch(inserts=SQUARE))
    response = stub.Verify(pb.VerifyRequest(name=hull))
    assert response.equal
    assert not response.HasField("first_difference")
    assert (response.revision, response.point_count, response.vertex_count) == (1, 8, 5)
    rounds = [(each.guess, each.groups, each.steps, each.cost, each.closed) for each in response.rounds]
    assert rounds == [(2, 4, 2, 8.0, False), (4, 2, 4, 16.0, False), (16, 1, 5, 32.0, True)]


def test_an_empty_hull(stub: HullServiceStub, hull: str) -> None:
    response = stub.GetHull(pb.GetHullRequest(name=hull))
    assert response.vertices == points_pb2.Points()
    assert response.measures.area == 0
    assert np.isnan(response.measures.centroid_x)
    assert stub.Verify(pb.VerifyRequest(name=hull)).equal
    assert stub.Locate(pb.LocateRequest(name=hull, points=points_pb2.Points(coordinates=[0, 0]))).sides == b"\xff"


@pytest.mark.parametrize("page_size", [0, 1, 2, 3, 5, 5000])
def test_pages(stub: HullServiceStub, name: str, page_size: int) -> None:
    names = [f"{name}{end}" for end in ("", "-", ".a", "/a", "/b/c", "0", "A", "_", "a", "aa")]
    for each in reversed(names):
        stub.CreateHull(pb.CreateHullRequest(name=each))
    request = pb.ListHullsRequest(prefix=name, page_size=page_size)
    listed = []
    while True:
        page = stub.ListHulls(request)
        assert len(page.hulls) <= (page_size or 100)
        listed += [hull.name for hull in page.hulls]
        request.page_token = page.next_page_token
        if not request.page_token:
            break
    assert listed == sorted(names)
    under = stub.ListHulls(pb.ListHullsRequest(prefix=f"{name}/"))
    assert [hull.name for hull in under.hulls] == [f"{name}/a", f"{name}/b/c"]


def test_a_deleted_hull_is_gone_and_its_name_free(stub: HullServiceStub, hull: str) -> None:
    apply(stub, hull, batch(inserts=SQUARE))
    stub.DeleteHull(pb.DeleteHullRequest(name=hull))
    assert not stub.ListHulls(pb.ListHullsRequest(prefix=hull)).hulls
    assert stub.CreateHull(pb.CreateHullRequest(name=hull)).hull.revision == 0
