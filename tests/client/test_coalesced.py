"""The writer puts batches that wait into one message, where the server says that it takes several."""

import threading
from collections.abc import Iterator
from concurrent import futures

import grpc
import numpy as np
import pytest
from server_process import server_process

from dynhull_client import HullClient, KeyMissingError, PointMissingError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.batch_pb2 import BatchResult
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceServicer, add_HullServiceServicer_to_server


class Recorder(HullServiceServicer):
    """Acknowledges all batches after `gate` is open. An old one does not know messages with several."""

    def __init__(self, most: int | None, most_bytes: int) -> None:
        self.most, self.most_bytes = most, most_bytes
        self.gate = threading.Event()
        self.messages: list[pb.StreamRequest] = []

    def GetProducer(self, *_: object) -> pb.GetProducerResponse:  # noqa: N802
        return pb.GetProducerResponse()

    def Stream(self, requests: Iterator[pb.StreamRequest], _: object) -> Iterator[pb.StreamResponse]:  # noqa: N802
        assert next(requests).accept_results
        if self.most is not None:
            yield pb.StreamResponse(max_batches=self.most, max_message_bytes=self.most_bytes)
        for number, message in enumerate(requests, start=1):
            self.messages.append(message)
            if number > 1:
                assert self.gate.wait(60)
            sequences = [each.sequence for each in message.batches] or [message.sequence]
            results = [pb.NumberedResult(sequence=each, result=BatchResult(revision=each)) for each in sequences]
            if self.most is None:
                yield pb.StreamResponse(sequence=results[0].sequence, result=results[0].result)
            else:
                yield pb.StreamResponse(results=results)

    @property
    def sizes(self) -> list[int]:
        return [len(each.batches) or 1 for each in self.messages]

    @property
    def sequences(self) -> list[int]:
        every = [[each.sequence for each in message.batches] or [message.sequence] for message in self.messages]
        return [sequence for of_message in every for sequence in of_message]


def written(connect: type[HullClient], recorder: Recorder, batches: int, **options: object) -> list[int]:
    """Write one point a batch: the first alone, the others before the server answers again. Returns the revisions."""
    server = grpc.server(futures.ThreadPoolExecutor(4))
    add_HullServiceServicer_to_server(recorder, server)
    address = f"127.0.0.1:{server.add_insecure_port('127.0.0.1:0')}"
    server.start()
    try:
        with connect(address) as client, client.writer("a", batch_points=1, **options) as writer:
            first = writer.put(insert=[[0, 0]])
            writer.flush()
            outcomes = [writer.put(insert=[[i, i]]) for i in range(1, batches)]
            recorder.gate.set()
            writer.flush()
            return [first.result().revision, *(each.result().revision for each in outcomes)]
    finally:
        server.stop(None).wait()


def test_batches_that_wait_share_a_message(connect: type[HullClient]) -> None:
    recorder = Recorder(8, 2**20)
    assert written(connect, recorder, 100, in_flight=200) == list(range(1, 101))
    assert recorder.sequences == list(range(1, 101))
    assert max(recorder.sizes) == 8
    assert len(recorder.messages) < 30


def test_no_more_batches_are_sent_ahead_than_asked_for(connect: type[HullClient]) -> None:
    recorder = Recorder(100, 2**20)
    assert written(connect, recorder, 5, in_flight=4) == list(range(1, 6))
    assert max(recorder.sizes) <= 4


def test_a_message_has_no_more_bytes_than_the_server_takes(connect: type[HullClient]) -> None:
    recorder = Recorder(100, 200)
    assert written(connect, recorder, 50, in_flight=100) == list(range(1, 51))
    assert max(message.ByteSize() for message in recorder.messages) <= 200
    assert max(recorder.sizes) > 1


def test_an_old_server_gets_one_batch_a_message(connect: type[HullClient]) -> None:
    recorder = Recorder(None, 0)
    assert written(connect, recorder, 50, in_flight=100) == list(range(1, 51))
    assert recorder.sizes == [1] * 50


@pytest.mark.parametrize("in_flight", [1, 8, 300])
def test_every_batch_has_its_own_revision_and_refusal(
    address: str, connect: type[HullClient], name: str, in_flight: int
) -> None:
    with connect(address) as client:
        client.create_hull(name, keyed="int")
        with client.writer(name, batch_points=1, in_flight=in_flight, missing="raise") as writer:
            outcomes = [
                writer.remove([10_000 + i]) if i % 100 == 50 else writer.put(keys=[i], points=[[i, i * i]])
                for i in range(300)
            ]
            with pytest.raises(KeyMissingError):
                writer.flush()
        good = [outcome.result() for outcome in outcomes if outcome.exception() is None]
        assert [i for i, outcome in enumerate(outcomes) if outcome.exception() is not None] == [50, 150, 250]
        assert [each.revision for each in good] == list(range(1, 298))
        assert [each.inserted for each in good] == [1] * 297
        assert client.get_hull(name).info.points == 297


def test_the_caller_may_number_what_it_puts(address: str, connect: type[HullClient], name: str) -> None:
    """As a consumer of a log does: after a restart it goes on after the writer's sequence, wherever that is."""
    offsets = [3, 4, 5, 9, 20, 21, 22, 23, 50]
    with connect(address) as client:
        client.create_hull(name)
        for last in (3, 9):
            with client.writer(name, producer="flights/0", may_skip=True, batch_points=2, in_flight=2) as writer:
                begin = offsets.index(writer.sequence) + 1 if writer.sequence else 0
                outcomes = [writer.put(insert=[[each, each * each]], sequence=each) for each in offsets[begin:last]]
                writer.flush()
                assert not any(outcome.result().duplicate for outcome in outcomes)
                assert writer.sequence == client.last_sequence(name, "flights/0") == offsets[last - 1]
        there = np.array([[each, each * each] for each in offsets])
        assert client.count(name, there).counts.tolist() == [1] * len(offsets)


def test_a_refused_batch_leaves_a_gap_in_numbers_that_may_skip(
    address: str, connect: type[HullClient], name: str
) -> None:
    with connect(address) as client:
        client.create_hull(name)
        with client.writer(name, producer="t/0", may_skip=True, batch_points=1) as writer:
            outcomes = [
                writer.put(delete=[[-1, 0]], sequence=each)
                if each == 30
                else writer.put(insert=[[each, 0]], sequence=each)
                for each in range(10, 60, 10)
            ]
            with pytest.raises(PointMissingError):
                writer.flush()
            assert [outcome.exception() is None for outcome in outcomes] == [True, True, False, True, True]
            assert writer.sequence == 50
        assert client.last_sequence(name, "t/0") == 50


def test_numbers_that_a_writer_refuses(address: str, connect: type[HullClient], name: str) -> None:
    with connect(address) as client:
        client.create_hull(name, keyed="int")
        with pytest.raises(ValueError, match="needs a producer"):
            client.writer(name, may_skip=True)
        with (
            client.writer(name) as plain,
            pytest.raises(ValueError, match="with may_skip=True, and only then"),
        ):
            plain.put(keys=[1], points=[[1, 1]], sequence=4)
        with client.writer(name, producer="t/0", may_skip=True) as writer:
            writer.put(keys=[1], points=[[1, 1]], sequence=7)
            for bad, said in ((None, "only then"), (0, "from 1 to"), (2**63, "from 1 to"), (7, "before, 7, got 7")):
                with pytest.raises(ValueError, match=said):
                    writer.put(keys=[2], points=[[2, 2]], sequence=bad)
            with pytest.raises(ValueError, match="one batch"):
                writer.put(keys=[2, 2], points=[[2, 2], [3, 3]], sequence=8)
            writer.flush()
            with pytest.raises(ValueError, match="before, 7, got 6"):
                writer.put(keys=[2], points=[[2, 2]], sequence=6)
        assert client.get_hull(name).info.points == 1


def test_many_batches_of_one_point_over_a_killed_server(tmp_path, connect: type[HullClient]) -> None:
    """Messages of many batches, and the server killed while some are under way: each batch once."""
    data = ("--data", str(tmp_path))
    points = np.array([[i, i * i] for i in range(2000)], float)
    with server_process(*data, killed=True) as first, connect(first.address, retries=0) as client:
        client.create_hull("a")
        writer = client.writer("a", producer="p", batch_points=1, in_flight=500, patience=0)
        outcomes = []
        with pytest.raises(Exception):  # noqa: B017, PT011, PT012  # it ends wherever it is
            for i, point in enumerate(points):
                if i == len(points) // 2:
                    first.process.kill()
                outcomes.append(writer.put(insert=[point]))
            writer.close()
    acknowledged = sum(
        outcome.done() and not outcome.cancelled() and outcome.exception() is None for outcome in outcomes
    )
    with server_process(*data, torn=True) as second, connect(second.address) as client:
        last = client.last_sequence("a", "p")
        assert acknowledged <= last <= len(outcomes)
        with client.writer("a", producer="p", batch_points=1, in_flight=500) as writer:
            for point in points[last:]:
                writer.put(insert=[point])
        assert client.get_hull("a").revision == len(points)
        assert client.count("a", points).counts.tolist() == [1] * len(points)
