"""A watcher holds exactly the hull of the revision that the event names."""

import threading

import grpc
import numpy as np
import pytest
from google.protobuf.duration_pb2 import Duration
from hypothesis import given
from inputs import points

from dynhull import DynamicHull
from dynhull_client import Change, HullClient, HullCopy, Snapshot
from dynhull_client._messages import decode_event
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.engine.difference import difference
from dynhull_server.engine.views import Change as EngineChange
from dynhull_server.rpc.encode import encode_event
from dynhull_server.state.hull_state import Counts

COUNTS = Counts(2, 0, 0)


@given(points(12), points(12))
def test_a_change_makes_the_new_hull_of_the_old(old: list[tuple[float, float]], new: list[tuple[float, float]]) -> None:
    before, after = DynamicHull(old).vertices(), DynamicHull(old[: len(old) // 2] + new).vertices()
    event = EngineChange(COUNTS, before, after, difference(before, after))
    copy = HullCopy()
    copy.update(Snapshot(1, 0, before, None))
    copy.update(decode_event(encode_event(event, points_pb2.POINT_ENCODING_PACKED)))
    assert copy.vertices.tolist() == after.tolist()
    assert copy.revision == 2


@pytest.mark.parametrize("max_rate", [0.0, 200.0], ids=["all", "conflated"])
def test_every_event_makes_the_exact_hull(address: str, name: str, max_rate: float) -> None:
    random = np.random.default_rng(20)
    batches = 300
    hulls = {0: np.empty((0, 2))}
    reference = DynamicHull()
    present = np.empty((0, 2))
    copy = HullCopy()
    seen = 0
    with HullClient(address) as client:
        client.create_hull(name)

        def write() -> None:
            nonlocal present
            with client.ingest(name) as stream:
                for revision in range(1, batches + 1):
                    fresh = np.round(random.normal(scale=4, size=(random.integers(0, 6), 2)))
                    leaving = random.permutation(len(present))[: random.integers(0, 6)]
                    reference.insert_many(fresh)
                    reference.delete_many(present[leaving])
                    hulls[revision] = reference.vertices()
                    stream.apply(insert=fresh, delete=present[leaving])
                    present = np.concatenate((np.delete(present, leaving, axis=0), fresh))

        with client.watch(name, max_rate=max_rate) as watch:
            writer = threading.Thread(target=write)
            writer.start()
            while copy.revision < batches:
                event = next(watch)
                assert event.revision >= copy.revision
                copy.update(event)
                assert copy.vertices.tolist() == hulls[copy.revision].tolist()
                seen += 1
            writer.join()
        assert copy.points == len(present)
    assert 2 <= seen <= batches + 1


def test_removed_and_added_stand_in_boundary_order(address: str, name: str) -> None:
    with HullClient(address) as client:
        client.create_hull(name)
        client.apply(name, insert=[[0, 0], [4, 0], [4, 4], [0, 4]])
        with client.watch(name, measures=True) as watch:
            snapshot = next(watch)
            assert snapshot.measures.area == 16
            client.apply(name, delete=[[0, 0], [4, 4]], insert=[[5, 5], [-1, 5], [2, 2]])
            change = next(watch)
    assert isinstance(change, Change)
    assert change.removed.tolist() == [[0, 0], [4, 4], [0, 4]]
    assert change.removed_rows.tolist() == [0, 2, 3]
    assert change.added.tolist() == [[-1, 5], [5, 5]]
    assert change.added_rows.tolist() == [0, 2]
    assert change.measures.bounds == (-1, 0, 5, 5)


def test_coordinates_instead_of_bytes(stub: HullServiceStub, hull: str) -> None:
    watch = stub.Watch(pb.WatchRequest(name=hull, encoding=points_pb2.POINT_ENCODING_COORDINATES))
    assert next(watch).HasField("snapshot")
    stub.Apply(pb.ApplyRequest(name=hull, batch={"inserts": {"coordinates": [1, 2]}}))
    assert list(next(watch).change.added.coordinates) == [1, 2]
    watch.cancel()


def test_progress_where_the_hull_stays(stub: HullServiceStub, hull: str) -> None:
    inserts = {"coordinates": [0, 0, 4, 0, 0, 4]}
    stub.Apply(pb.ApplyRequest(name=hull, batch={"inserts": inserts}))
    watch = stub.Watch(pb.WatchRequest(name=hull))
    assert next(watch).HasField("snapshot")
    stub.Apply(pb.ApplyRequest(name=hull, batch={"inserts": inserts}))
    event = next(watch)
    assert event.HasField("progress")
    assert (event.revision, event.point_count) == (2, 6)
    watch.cancel()


def test_progress_while_quiet(stub: HullServiceStub, hull: str) -> None:
    watch = stub.Watch(pb.WatchRequest(name=hull, progress_interval=Duration(nanos=1_000_000)))
    assert next(watch).HasField("snapshot")
    for _ in range(3):
        event = next(watch)
        assert event.HasField("progress")
        assert event.revision == 0
    watch.cancel()


def test_a_deleted_hull_ends_its_watches(stub: HullServiceStub, hull: str) -> None:
    watch = stub.Watch(pb.WatchRequest(name=hull))
    next(watch)
    stub.DeleteHull(pb.DeleteHullRequest(name=hull))
    with pytest.raises(grpc.RpcError) as caught:
        next(watch)
    assert caught.value.code() == grpc.StatusCode.NOT_FOUND
