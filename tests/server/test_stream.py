"""Many batches in one call, acknowledged in order; numbered ones applied exactly once."""

from collections.abc import Iterator
from queue import SimpleQueue

import grpc
import numpy as np
import pytest
from proxy import proxy
from refusal import refusal
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import HullClient, HullNotFoundError, PointMissingError, SequenceGapError
from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub


def points(xy: object) -> points_pb2.Points:
    return points_pb2.Points(packed=np.asarray(xy, "<f8").tobytes())


def insert(xy: object) -> batch_pb2.Batch:
    return batch_pb2.Batch(inserts=points(xy))


def delete(xy: object) -> batch_pb2.Batch:
    return batch_pb2.Batch(deletes=points(xy))


def test_each_batch_is_acknowledged_in_order(stub: HullServiceStub, hull: str) -> None:
    """Small batches are applied at once and large ones in a thread; the order is that of the messages."""
    sizes = [1, 5000, 1, 1, 3000, 2, 64, 65, 1] * 5
    random = np.random.default_rng(3)
    batches = [random.normal(size=(size, 2)) for size in sizes]
    requests = [pb.StreamRequest(name=hull), *(pb.StreamRequest(batch=insert(xy)) for xy in batches)]
    acknowledged = [response.result for response in stub.Stream(iter(requests))]
    assert [each.revision for each in acknowledged] == list(range(1, len(sizes) + 1))
    assert [each.inserted for each in acknowledged] == sizes
    assert [each.point_count for each in acknowledged] == np.cumsum(sizes).tolist()
    vertices = np.frombuffer(stub.GetHull(pb.GetHullRequest(name=hull)).vertices.packed).reshape(-1, 2)
    assert vertices.tolist() == DynamicHull(np.concatenate(batches)).vertices().tolist()


def test_an_acknowledgement_does_not_wait_for_the_next_batch(stub: HullServiceStub, hull: str) -> None:
    turns: SimpleQueue[int] = SimpleQueue()

    def requests() -> Iterator[pb.StreamRequest]:
        yield pb.StreamRequest(name=hull)
        for i in iter(turns.get, 20):
            yield pb.StreamRequest(batch=insert([[i, i * i]]))

    responses = stub.Stream(requests())
    for i in range(20):
        turns.put(i)
        assert next(responses).result.revision == i + 1
    turns.put(20)
    assert list(responses) == []


def test_a_refused_batch_ends_the_stream_after_the_acknowledgements_before_it(stub: HullServiceStub, hull: str) -> None:
    batches = [insert([[1, 2]]), insert(np.ones((1000, 2))), delete([[1, 2], [8, 8]]), insert([[3, 4]])]
    responses = stub.Stream(pb.StreamRequest(name=hull, batch=batch) for batch in batches)
    acknowledged = []

    def take() -> None:
        acknowledged.extend(response.result.revision for response in responses)

    code, info, _ = refusal(take)
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "POINT_MISSING")
    assert dict(info.metadata) == {"field": "batch.deletes", "row": "1", "value": "(8.0, 8.0)", "batch": "2"}
    assert acknowledged == [1, 2]
    after = stub.GetHull(pb.GetHullRequest(name=hull)).hull
    assert (after.revision, after.point_count) == (2, 1001)


def test_one_call_writes_to_one_hull_for_one_producer(stub: HullServiceStub, hull: str) -> None:
    def fields(*requests: pb.StreamRequest) -> tuple[str, str]:
        _, info, _ = refusal(lambda: list(stub.Stream(iter(requests))))
        assert info.reason == "INVALID_FIELD"
        return info.metadata["field"], info.metadata["value"]

    one = insert([[1, 2]])
    assert fields() == ("name", "")
    assert fields(pb.StreamRequest(name=hull), pb.StreamRequest(name="another", batch=one)) == ("name", "another")
    assert fields(pb.StreamRequest(name=hull), pb.StreamRequest(producer="p", batch=one)) == ("producer", "p")
    assert fields(pb.StreamRequest(name=hull, producer="p q", batch=one)) == ("producer", "p q")
    assert fields(pb.StreamRequest(name=hull, batch=one, sequence=1)) == ("sequence", "1")
    assert fields(pb.StreamRequest(name=hull, batch=one, producer="p")) == ("sequence", "0")
    assert fields(pb.StreamRequest(name=hull, producer="p", sequence=1)) == ("sequence", "1")
    assert stub.GetHull(pb.GetHullRequest(name=hull)).hull.revision == 0


def test_a_batch_sent_again_is_acknowledged_and_not_applied(address: str, hull: str) -> None:
    with HullClient(address) as client:
        assert client.last_sequence(hull, "p") == 0
        first = client.apply(hull, insert=[[0, 0]], producer="p", sequence=1)
        again = client.apply(hull, insert=[[0, 0]], producer="p", sequence=1)
        assert (first.revision, first.inserted, first.duplicate) == (1, 1, False)
        assert (again.revision, again.inserted, again.duplicate, again.points) == (1, 0, True, 1)
        client.apply(hull, insert=[[0, 0]], producer="q", sequence=1)
        assert client.get_hull(hull).info.points == 2
        assert (client.last_sequence(hull, "p"), client.last_sequence(hull, "nobody")) == (1, 0)


def test_a_gap_is_refused_with_the_number_expected(address: str, hull: str) -> None:
    with HullClient(address) as client:
        with pytest.raises(SequenceGapError) as caught:
            client.apply(hull, insert=[[0, 0]], producer="p", sequence=2)
        assert caught.value.expected == 1
        client.apply(hull, insert=[[0, 0]], producer="p", sequence=1)
        with pytest.raises(PointMissingError):
            client.apply(hull, delete=[[5, 5]], producer="p", sequence=2)
        with pytest.raises(SequenceGapError) as caught:
            client.apply(hull, insert=[[0, 0]], producer="p", sequence=3)
        assert caught.value.expected == 2
        assert client.apply(hull, insert=[[1, 1]], producer="p", sequence=2).revision == 2


def test_an_ingest_counts_duplicates(stub: HullServiceStub, hull: str) -> None:
    def requests(first: int, last: int) -> Iterator[pb.IngestRequest]:
        for sequence in range(first, last):
            yield pb.IngestRequest(name=hull, producer="p", sequence=sequence, batch=insert([[sequence, 0]]))

    assert stub.Ingest(requests(1, 6)).batches == 5
    again = stub.Ingest(requests(3, 9))
    assert (again.batches, again.duplicates, again.inserted, again.point_count) == (3, 3, 3, 8)


@pytest.mark.parametrize("seed", range(3))
def test_exactly_once_over_broken_connections(address: str, name: str, seed: int) -> None:
    """The connection is cut at random; the writer sends again every batch that was not acknowledged."""
    random = np.random.default_rng(seed)
    total = 400
    batches = [random.normal(size=(random.integers(1, 200), 2)) for _ in range(total)]
    acknowledged = 0
    with HullClient(address) as direct, proxy(address) as way:
        direct.create_hull(name)
        while acknowledged < total:
            with grpc.insecure_channel(way.address) as channel:
                requests = (
                    pb.StreamRequest(name=name, producer="p", sequence=i + 1, batch=insert(batches[i]))
                    for i in range(acknowledged, total)
                )
                cut_at = acknowledged + int(random.integers(1, 100))
                try:
                    for response in HullServiceStub(channel).Stream(requests, wait_for_ready=True):
                        assert response.sequence == acknowledged + 1
                        acknowledged += 1
                        if acknowledged == cut_at:
                            way.cut()
                except grpc.RpcError as error:
                    assert error.code() == grpc.StatusCode.UNAVAILABLE  # noqa: PT017  # the last one ends in peace
        live = direct.get_hull(name)
        everything = np.concatenate(batches)
        assert (live.revision, live.info.points) == (total, len(everything))
        assert live.vertices.tolist() == DynamicHull(everything).vertices().tolist()
        assert direct.count(name, everything).counts.tolist() == [1] * len(everything)


def test_a_write_creates_the_hull_where_the_server_allows_it() -> None:
    with server_process("--create-on-write") as server, HullClient(server.address) as client:
        assert client.apply("a", insert=[[1, 2]]).revision == 1
        with client.ingest("b") as stream:
            stream.apply(insert=[[1, 2]])
        with pytest.raises(PointMissingError):
            client.apply("c", delete=[[1, 2]])
        with pytest.raises(HullNotFoundError):
            client.get_hull("d")
        assert [info.name for info in client.list_hulls()] == ["a", "b"]


def test_a_full_hull_and_producers_without_room() -> None:
    options = ("--max-points", "3", "--max-producers", "1", "--max-streams", "1")
    with server_process(*options) as server, grpc.insecure_channel(server.address) as channel:
        stub = HullServiceStub(channel)
        stub.CreateHull(pb.CreateHullRequest(name="a"))
        stub.CreateHull(pb.CreateHullRequest(name="small", config={"max_points": 1}))

        def limit(name: str, batch: batch_pb2.Batch, **numbered: object) -> tuple[str, str]:
            code, info, details = refusal(lambda: stub.Apply(pb.ApplyRequest(name=name, batch=batch, **numbered)))
            assert (code, info.reason) == (grpc.StatusCode.RESOURCE_EXHAUSTED, "LIMIT_EXCEEDED")
            assert details[0].violations[0].subject == info.metadata["limit"]
            return info.metadata["limit"], info.metadata["value"]

        assert limit("a", insert(np.ones((4, 2)))) == ("max_points", "3")
        assert limit("small", insert(np.ones((2, 2)))) == ("max_points", "1")
        stub.Apply(pb.ApplyRequest(name="a", batch=insert(np.ones((3, 2))), producer="p", sequence=1))
        moved = batch_pb2.Batch(inserts=points([[2, 2]]), deletes=points([[1, 1]]))
        stub.Apply(pb.ApplyRequest(name="a", batch=moved))
        assert limit("a", insert([[0, 0]]), producer="q", sequence=1) == ("max_producers", "1")
        watch = stub.Watch(pb.WatchRequest(name="a"))
        next(watch)
        _, info, _ = refusal(lambda: list(stub.Watch(pb.WatchRequest(name="a"))))
        assert dict(info.metadata) == {"limit": "max_streams", "value": "1"}
        watch.cancel()
        assert stub.GetHull(pb.GetHullRequest(name="a")).hull.point_count == 3
