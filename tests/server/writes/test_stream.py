"""Many batches in one call, acknowledged in order; numbered ones applied exactly once."""

from collections.abc import Iterable, Iterator
from itertools import repeat
from pathlib import Path
from queue import SimpleQueue

import grpc
import numpy as np
import pytest
from proxy import proxy
from refusal import refusal
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import Batch, HullClient, HullNotFoundError, PointMissingError, SequenceGapError
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


@pytest.mark.parametrize("rows", [1, 20_000], ids=["small", "decoded in a thread"])
def test_a_batch_that_cannot_be_decoded_is_refused_in_its_turn(stub: HullServiceStub, hull: str, rows: int) -> None:
    """Not where its number has already been applied: it is a duplicate, whatever it holds now."""

    def requests(*batches: tuple[int, object]) -> Iterator[pb.StreamRequest]:
        for sequence, xy in batches:
            yield pb.StreamRequest(name=hull, producer="p", sequence=sequence, batch=insert(xy))

    many, wrong = np.ones((rows, 2)), np.full((rows, 2), np.nan)
    responses = [*stub.Stream(requests((1, many), (2, [[3, 4]]), (1, wrong), (2, many), (3, [[5, 6]])))]
    assert [each.result.duplicate for each in responses] == [False, False, True, True, False]
    acknowledged = []

    def take() -> None:
        acknowledged.extend(each.sequence for each in stub.Stream(requests((4, many), (5, wrong), (6, many))))

    _, info, _ = refusal(take)
    assert (info.reason, info.metadata["field"], info.metadata["row"]) == ("INVALID_FIELD", "batch.inserts", "0")
    assert acknowledged == [4]


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


def several(*batches: batch_pb2.Batch, sequences: Iterable[int] = repeat(0)) -> pb.StreamRequest:
    numbered = [pb.NumberedBatch(batch=each, sequence=number) for each, number in zip(batches, sequences, strict=False)]
    return pb.StreamRequest(batches=numbered)


def test_a_message_has_several_batches_and_a_response_several_results(stub: HullServiceStub, hull: str) -> None:
    """Small and large batches in any mixture of messages; each is a revision of its own, in order."""
    sizes = [1, 5000, 1, 1, 3000, 2, 64, 65, 1] * 5
    random = np.random.default_rng(3)
    batches = [random.normal(size=(size, 2)) for size in sizes]
    requests = [pb.StreamRequest(name=hull, accept_results=True)]
    at = 0
    while at < len(batches):
        of_message = batches[at : at + int(random.integers(1, 12))]
        single = len(of_message) == 1
        requests.append(pb.StreamRequest(batch=insert(of_message[0])) if single else several(*map(insert, of_message)))
        at += len(of_message)
    first, *responses = stub.Stream(iter(requests))
    assert (first.max_batches, first.max_message_bytes) == (256, 64 * 2**20)
    assert not first.results
    assert not first.HasField("result")
    assert not any(each.HasField("result") or each.max_batches for each in responses)
    acknowledged = [each.result for response in responses for each in response.results]
    assert [each.revision for each in acknowledged] == list(range(1, len(sizes) + 1))
    assert [each.inserted for each in acknowledged] == sizes
    assert [each.point_count for each in acknowledged] == np.cumsum(sizes).tolist()
    vertices = np.frombuffer(stub.GetHull(pb.GetHullRequest(name=hull)).vertices.packed).reshape(-1, 2)
    assert vertices.tolist() == DynamicHull(np.concatenate(batches)).vertices().tolist()


@pytest.mark.whole_hull("batches of one hull are answered together")
def test_many_batches_share_responses(stub: HullServiceStub, hull: str) -> None:
    requests = [pb.StreamRequest(name=hull, producer="p", accept_results=True)]
    requests.append(several(*[insert([[i, i * i]]) for i in range(200)], sequences=range(1, 201)))
    _, *responses = stub.Stream(iter(requests))
    assert [each.sequence for response in responses for each in response.results] == list(range(1, 201))
    assert len(responses) == 1  # they have arrived together, and are committed together


@pytest.mark.parametrize("refused", [0, 2, 4])
def test_a_refused_batch_of_a_message_ends_the_stream_after_those_before_it(
    stub: HullServiceStub, hull: str, refused: int
) -> None:
    batches = [insert([[i, i * i]]) for i in range(5)]
    batches[refused] = delete([[8, 8]])
    requests = [pb.StreamRequest(name=hull, producer="p", accept_results=True)]
    requests += [several(*batches, sequences=range(1, 6)), several(insert([[9, 9]]), sequences=[6])]
    acknowledged: list[int] = []

    def take() -> None:
        for response in stub.Stream(iter(requests)):
            acknowledged.extend(each.sequence for each in response.results)

    code, info, _ = refusal(take)
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "POINT_MISSING")
    assert info.metadata["batch"] == str(refused)
    assert acknowledged == list(range(1, refused + 1))
    after = stub.GetHull(pb.GetHullRequest(name=hull)).hull
    assert (after.revision, after.point_count) == (refused, refused)
    assert stub.GetProducer(pb.GetProducerRequest(name=hull, producer="p")).last_sequence == refused


def test_batches_before_an_invalid_one_of_a_message_are_applied(stub: HullServiceStub, hull: str) -> None:
    requests = [pb.StreamRequest(name=hull, producer="p", accept_results=True)]
    requests.append(several(*[insert([[i, i * i]]) for i in range(4)], sequences=[1, 2, 0, 3]))
    acknowledged: list[int] = []

    def take() -> None:
        for response in stub.Stream(iter(requests)):
            acknowledged.extend(each.sequence for each in response.results)

    _, info, _ = refusal(take)
    assert dict(info.metadata) == {"field": "sequence", "value": "0", "batch": "2"}
    assert acknowledged == [1, 2]
    assert stub.GetHull(pb.GetHullRequest(name=hull)).hull.revision == 2


def test_messages_with_several_batches_that_are_refused(stub: HullServiceStub, hull: str) -> None:
    def fields(*requests: pb.StreamRequest) -> tuple[str, str]:
        _, info, _ = refusal(lambda: list(stub.Stream(iter(requests))))
        assert info.reason == "INVALID_FIELD"
        return info.metadata["field"], info.metadata["value"]

    one, first = insert([[1, 2]]), pb.StreamRequest(name=hull, accept_results=True)
    both = several(one, one)
    both.batch.CopyFrom(one)
    assert fields(pb.StreamRequest(name=hull), several(one)) == ("batches", "1 batches")
    assert fields(first, several(*[one] * 257)) == ("batches", "257 batches")
    assert fields(first, both) == ("batches", "2 batches")
    assert fields(first, several(one, sequences=[1])) == ("sequence", "1")
    assert fields(pb.StreamRequest(name=hull, may_skip=True)) == ("may_skip", "True")
    follows = pb.StreamRequest(name=hull, producer="p", batch=one, sequence=5, after_sequence=4)
    assert fields(follows) == ("after_sequence", "4")
    follows.may_skip, follows.after_sequence = True, 5
    assert fields(follows) == ("after_sequence", "5")
    numbered = pb.StreamRequest(name=hull, producer="p")
    assert fields(numbered, pb.StreamRequest(batch=one, sequence=5, may_skip=True)) == ("may_skip", "True")
    assert stub.GetHull(pb.GetHullRequest(name=hull)).hull.revision == 0


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


def test_numbers_that_may_skip(address: str, hull: str) -> None:
    """As the offsets of a log: any greater number is new, any other one a duplicate, whatever way it takes."""
    with HullClient(address) as client, grpc.insecure_channel(address) as channel:
        stub = HullServiceStub(channel)

        def apply(sequence: int) -> tuple[int, bool]:
            applied = client.apply(hull, insert=[[sequence, 0]], producer="t/0", sequence=sequence, may_skip=True)
            return applied.revision, applied.duplicate

        assert [apply(number) for number in (7, 7, 3, 8, 100)] == [
            (1, False), (1, True), (1, True), (2, False), (3, False),
        ]  # fmt: skip
        requests = [
            pb.StreamRequest(name=hull, producer="t/0", accept_results=True, may_skip=True),
            several(*[insert([[number, 0]]) for number in (99, 101, 105)], sequences=(99, 101, 105)),
        ]
        results = [each for response in stub.Stream(iter(requests)) for each in response.results]
        assert [(each.sequence, each.result.duplicate) for each in results] == [(99, True), (101, False), (105, False)]
        ingested = [(110, 0), (109, 1), (111, 2)]
        summary = stub.Ingest(
            pb.IngestRequest(
                name=hull, producer="t/0", sequence=number, batch=insert([[number, 0]]), may_skip=not place
            )
            for number, place in ingested
        )
        assert (summary.batches, summary.duplicates) == (2, 1)
        assert client.last_sequence(hull, "t/0") == 111
        with pytest.raises(SequenceGapError) as caught:  # only where a request says so
            client.apply(hull, insert=[[0, 0]], producer="t/0", sequence=113)
        assert caught.value.expected == 112
        assert client.get_hull(hull).revision == 7


def test_a_reader_of_a_log_that_was_replaced_neither_doubles_nor_loses(address: str, hull: str) -> None:
    """Its last batch arrives after the new reader has asked where to continue: the new one has to ask again."""

    def apply(after: int, sequence: int) -> bool:
        points = insert([[number, 0] for number in range(after + 1, sequence + 1)])
        request = pb.ApplyRequest(
            name=hull, batch=points, producer="t/0", sequence=sequence, may_skip=True, after_sequence=after
        )
        return stub.Apply(request).result.duplicate

    def replaced(client: HullClient) -> None:
        with client.writer(hull, producer="t/0", may_skip=True, batch_points=1) as new:
            assert new.sequence == 5
            assert apply(5, 9) is False  # of the old reader
            new.put([[6, 0], [7, 0], [8, 0], [9, 0], [10, 0]], sequence=10)

    with HullClient(address) as client, grpc.insecure_channel(address) as channel:
        stub = HullServiceStub(channel)
        assert apply(0, 5) is False
        with pytest.raises(SequenceGapError) as caught:
            replaced(client)
        assert caught.value.expected == 10
        assert apply(5, 9) is True
        with client.writer(hull, producer="t/0", may_skip=True, batch_points=1) as again:
            again.put([[10, 0]], sequence=10)
        assert client.get_hull(hull).info.points == 10


def test_what_follows_a_refused_batch_follows_the_one_before_it(address: str, hull: str) -> None:
    with HullClient(address) as client, client.writer(hull, producer="t/0", may_skip=True, batch_points=1) as writer:
        outcomes = [
            writer.put([[0, 0]], sequence=2),
            writer.put(delete=[[5, 5]], sequence=4),
            writer.put([[1, 0]], sequence=6),
            writer.put(delete=[[5, 5]], sequence=7),
        ]
        with pytest.raises(PointMissingError):
            writer.flush()
        writer.put([[2, 0]], sequence=9)
        writer.flush()
        assert [each.exception(30) is None for each in outcomes] == [True, False, True, False]
        assert writer.sequence == 9


@pytest.mark.whole_hull("batches over several hulls")
def test_numbers_that_may_skip_are_counted_in_each_of_several_hulls(address: str, hull: str) -> None:
    with HullClient(address) as client:
        other = f"{hull}-other"
        client.create_hull(other)

        def transfer(sequence: int) -> list[bool]:
            batches = {name: Batch(insert=[[sequence, 0]]) for name in (hull, other)}
            applied = client.transfer(batches, producer="t/0", sequence=sequence, may_skip=True)
            return [each.duplicate for each in applied.values()]

        assert [transfer(number) for number in (5, 5, 4, 9)] == [[False] * 2, [True] * 2, [True] * 2, [False] * 2]
        assert (client.last_sequence(hull, "t/0"), client.last_sequence(other, "t/0")) == (9, 9)


@pytest.mark.whole_hull("it compares the settings of the hull")
@pytest.mark.parametrize("durability", ["sync", "none"])
def test_numbers_that_may_skip_outlive_the_server(tmp_path: Path, durability: str) -> None:
    """From the journal and from a snapshot."""
    data = ("--data", str(tmp_path), "--durability", durability, "--snapshot-points", "10")
    for life in range(3):
        with server_process(*data) as server, HullClient(server.address) as client:
            client.create_hull("a", exist_ok=True)
            assert client.last_sequence("a", "t/0") == 1000 * life
            for number in (1000 * life, 1000 * life + 7, 1000 * life + 1000):
                if number:
                    client.apply("a", insert=np.ones((20, 2)), producer="t/0", sequence=number, may_skip=True)
            assert client.get_hull("a").revision == 2 * (life + 1)


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
