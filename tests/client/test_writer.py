"""The writer: every batch is applied exactly once, after any failure of the connection or the server."""

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import numpy as np
import pytest
from cluster import descendants
from patience import PATIENCE, wait_until, waits
from proxy import proxy
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import (
    DynhullError,
    HullClient,
    HullNotFoundError,
    LimitExceededError,
    PointMissingError,
    ProducerInUseError,
    UnavailableError,
)
from dynhull_client._calls import Known
from dynhull_client._gathering import Gathering

POINTS = np.random.default_rng(3).normal(size=(400, 10, 2))


@pytest.fixture
def client(address: str, connect: type[HullClient], name: str) -> Iterator[HullClient]:
    with connect(address) as client:
        client.create_hull(name)
        yield client


def test_points_are_gathered_into_batches(client: HullClient, name: str) -> None:
    with client.writer(name, producer="p", batch_points=25, linger=60) as writer:
        outcomes = [writer.put(insert=each) for each in POINTS[:5]]
        writer.flush()
        results = [outcome.result() for outcome in outcomes]
        assert [each.revision for each in results] == [1, 1, 1, 2, 2]
        assert [each.points for each in results] == [30, 30, 30, 50, 50]
        moved = writer.put(move=(POINTS[0], POINTS[1]), delete=POINTS[2])
    assert (moved.result().inserted, moved.result().deleted) == (10, 20)
    assert writer.sequence == client.last_sequence(name, "p") == 3
    expected = DynamicHull(np.concatenate((POINTS[1], POINTS[1], POINTS[3], POINTS[4])))
    assert client.get_hull(name).vertices.tolist() == expected.vertices().tolist()


def test_points_are_sent_after_the_linger_time(client: HullClient, name: str) -> None:
    with client.writer(name, linger=0.05) as writer:
        began = time.monotonic()
        writer.put(insert=[[1, 1]])
        assert client.get_hull(name, min_revision=1).info.points == 1  # nobody has asked for it
        assert time.monotonic() - began >= 0.05


def test_points_within_the_linger_time_are_sent_together(client: HullClient, name: str) -> None:
    with client.writer(name, linger=3600) as writer:
        first = writer.put(insert=[[1, 1]])
        second = writer.put(insert=[[2, 2]])
        writer.flush()
        assert first.result() == second.result()
        assert client.get_hull(name).revision == 1


def test_a_refused_batch_is_the_only_one_that_fails(client: HullClient, name: str) -> None:
    with client.writer(name, batch_points=1) as writer:
        outcomes = [writer.put(insert=[[i, i]]) if i % 10 else writer.put(delete=[[-1, i]]) for i in range(50)]
        with pytest.raises(PointMissingError):
            writer.flush()
        failed = [i for i, outcome in enumerate(outcomes) if outcome.exception() is not None]
        assert failed == [0, 10, 20, 30, 40]
        assert outcomes[20].exception().value == "(-1.0, 20.0)"
        writer.flush()  # reported once
    assert (client.get_hull(name).revision, writer.sequence) == (45, 45)


def test_a_refused_batch_may_end_the_writer(client: HullClient, name: str) -> None:
    def write() -> None:
        with client.writer(name, batch_points=1, stop_on_error=True) as writer:
            writer.put(insert=[[1, 1]])
            bad = writer.put(delete=[[2, 2]])
            wait_until(bad.done)
            with pytest.raises(PointMissingError):
                writer.put(insert=[[3, 3]])
            assert writer.sequence == 1

    with pytest.raises(PointMissingError):
        write()
    assert client.get_hull(name).info.points == 1


def test_put_waits_while_too_much_is_under_way(connect: type[HullClient]) -> None:
    with server_process() as server, connect(server.address) as client:
        client.create_hull("a")
        with client.writer("a", batch_points=10, in_flight=4) as writer:
            processes = (server.process.pid, *descendants(server.process.pid))
            for each in processes:
                os.kill(each, signal.SIGSTOP)
            taken = []

            def put() -> None:
                for number, points in enumerate(POINTS[:9]):
                    writer.put(insert=points)
                    taken.append(number)

            putting = threading.Thread(target=put)
            putting.start()
            wait_until(lambda: len(taken) >= 4 and waits(putting))
            assert len(taken) < 9
            for each in processes:
                os.kill(each, signal.SIGCONT)
            putting.join()
        assert client.get_hull("a").info.points == 90


MANY = np.random.default_rng(4).normal(size=(800, 5, 2))


@contextmanager
def putting(writer, batches) -> Iterator[None]:
    """Put each batch, in a thread, until the context is left."""

    def put() -> None:
        for batch in batches:
            writer.put(insert=batch)

    thread = threading.Thread(target=put)
    thread.start()
    yield
    thread.join()
    writer.flush()


def acknowledged(writer, sequence: int) -> None:
    wait_until(lambda: writer.sequence >= sequence)


def test_every_batch_once_though_the_server_is_killed(tmp_path: Path, connect: type[HullClient]) -> None:
    """Three servers, one after another, on the same data; the first two are killed in the middle of batches."""
    data = ("--data", str(tmp_path))
    kills = [threading.Event(), threading.Event()]

    def batches() -> Iterator[np.ndarray]:
        for number, batch in enumerate(MANY):
            if number in (300, 600):  # a fast machine would have all of them applied before it is killed
                kills[number // 300 - 1].wait(PATIENCE)
            yield batch

    with (
        server_process(*data, killed=True) as first,
        proxy(first.address) as way,
        connect(way.address) as client,
    ):
        client.create_hull("a")
        with client.writer("a", producer="p", batch_points=5) as writer, ExitStack() as stack:
            with putting(writer, batches()):
                acknowledged(writer, 150)
                first.process.kill()
                kills[0].set()
                second = stack.enter_context(server_process(*data, killed=True, torn=True))
                way.server = second.address
                acknowledged(writer, 400)
                second.process.kill()
                kills[1].set()
                way.server = stack.enter_context(server_process(*data, torn=True)).address
            hull = client.get_hull("a")
            assert (hull.revision, writer.sequence, hull.info.points) == (800, 800, 4000)
            assert hull.vertices.tolist() == DynamicHull(MANY.reshape(-1, 2)).vertices().tolist()


def test_every_batch_once_though_the_connection_breaks(address: str, connect: type[HullClient], name: str) -> None:
    with proxy(address) as way, connect(way.address) as client:
        client.create_hull(name)
        with client.writer(name, batch_points=5) as writer:
            with putting(writer, MANY):
                for part in range(1, 8):
                    acknowledged(writer, 80 * part)
                    way.cut()
            assert writer.sequence == 800
        assert client.get_hull(name).revision == 800


def test_refused_batches_among_broken_connections(address: str, connect: type[HullClient], name: str) -> None:
    """Batches after a refused one get new numbers, while the server may have applied more than it acknowledged."""
    with proxy(address) as way, connect(way.address) as client:
        client.create_hull(name)
        with client.writer(name, batch_points=1, in_flight=16) as writer:
            outcomes = []
            for i in range(300):
                outcomes.append(writer.put(delete=[[-1, i]]) if i % 20 == 7 else writer.put(insert=[[i, i * i]]))
                if i % 45 == 44:
                    way.cut()
            with pytest.raises(PointMissingError):
                writer.flush()
        refused = [i for i, outcome in enumerate(outcomes) if outcome.exception()]
        assert refused == list(range(7, 300, 20))
        there = np.array([[i, i * i] for i in range(300)])
        assert client.count(name, there).counts.tolist() == [int(i % 20 != 7) for i in range(300)]


def test_another_writer_continues_after_the_last_acknowledged_batch(client: HullClient, name: str) -> None:
    for last in (1, 2):
        with client.writer(name, producer="p") as writer:
            assert writer.sequence == last - 1
            assert not writer.put(insert=POINTS[last]).done()
        assert writer.sequence == last
    assert client.get_hull(name).revision == 2


def test_two_writers_of_one_name_are_an_error(client: HullClient, name: str) -> None:
    first, second = (client.writer(name, producer="p") for _ in range(2))
    with first, pytest.raises(ProducerInUseError, match="'p'"), second:  # noqa: PT012  # leaving may raise it too
        first.put(insert=POINTS[0])
        first.flush()
        second.put(insert=POINTS[1])
    assert client.get_hull(name).revision == 1


def test_a_message_too_large_is_the_only_one_that_fails(connect: type[HullClient]) -> None:
    with server_process("--max-message-bytes", "4096") as server, connect(server.address) as client:
        client.create_hull("a")
        with client.writer("a", batch_points=10) as writer:
            outcomes = [writer.put(insert=np.zeros((1000 if i == 20 else 10, 2))) for i in range(40)]
            with pytest.raises(LimitExceededError, match="4096"):
                writer.flush()
            assert [i for i, outcome in enumerate(outcomes) if outcome.exception()] == [20]
        assert (client.get_hull("a").revision, writer.sequence) == (39, 39)


def test_a_writer_gives_up_a_server_that_stays_away(connect: type[HullClient]) -> None:
    with server_process(killed=True) as server, connect(server.address) as client:
        client.create_hull("a")
        with pytest.raises(UnavailableError), client.writer("a", patience=0.3) as writer:  # noqa: PT012
            for each in (server.process.pid, *descendants(server.process.pid)):
                os.kill(each, signal.SIGKILL)
            writer.put(insert=POINTS[0])
            writer.flush()


def out_of_memory(monkeypatch: pytest.MonkeyPatch, times: float) -> Callable[[], int]:
    """Have the making of the first `times` batches fail; what is returned counts those that have."""
    joined, failed = Gathering.joined, 0

    def failing(gathering: Gathering) -> object:
        nonlocal failed
        if failed < times:
            failed += 1
            raise MemoryError
        return joined(gathering)

    monkeypatch.setattr(Gathering, "joined", failing)
    return lambda: failed


def test_a_batch_that_there_was_no_memory_for_is_made_later(
    client: HullClient, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = out_of_memory(monkeypatch, 2)
    with client.writer(name, linger=0.01) as writer:
        outcome = writer.put(insert=POINTS[0])  # it is made where requests are made, and nobody is there to hear
        wait_until(outcome.done)
        assert (outcome.result().points, failed()) == (10, 2)
    failed = out_of_memory(monkeypatch, 1)
    with client.writer(name, linger=3600, batch_points=20) as writer:
        first = writer.put(insert=POINTS[1])
        with pytest.raises(MemoryError):
            writer.put(insert=POINTS[2])  # it is in the batch all the same, which was not full before
        writer.flush()
        assert (first.result().points, failed()) == (30, 1)


def test_batches_that_there_is_never_memory_for_end_a_writer(
    client: HullClient, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    failed = out_of_memory(monkeypatch, float("inf"))
    with pytest.raises(DynhullError, match="request"), client.writer(name, linger=0.01, patience=0.3) as writer:  # noqa: PT012
        wait_until(writer.put(insert=POINTS[0]).done)
        writer.flush()
    assert failed() > 1


def test_without_threads_a_writer_has_not_begun(address: str, name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with HullClient(address) as client:
        client.create_hull(name)
        writer, pipeline = client.writer(name, linger=0), client.pipeline()
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", refuse)
            with pytest.raises(RuntimeError, match="new thread"):
                writer._begin(Known(0, ""))
            with pytest.raises(RuntimeError, match="new thread"):
                pipeline.count(name, [[0, 0]])
            pipeline.flush()  # nothing is under way
        with writer, pipeline:
            assert writer.put(insert=[[0, 0]]).result(PATIENCE).points == 1
            assert pipeline.count(name, [[0, 0]]).result(PATIENCE).counts.tolist() == [1]


def test_what_a_writer_cannot_do(client: HullClient, name: str) -> None:
    with pytest.raises(HullNotFoundError), client.writer("nobody"):
        pass
    with pytest.raises(ValueError, match="batch_points must be at least 1, got 0"):
        client.writer(name, batch_points=0)
    writer = client.writer(name)
    with pytest.raises(RuntimeError, match="has not started"):
        _ = writer.sequence
    with writer:
        with pytest.raises(ValueError, match="insert row 0"):
            writer.put(insert=[[np.nan, 2]])
        writer.put(insert=[[1, 2]])
    with pytest.raises(RuntimeError, match="closed"):
        writer.put(insert=[[1, 2]])
    with pytest.raises(RuntimeError, match="closed"), writer:
        pass


def test_a_writer_without_a_context(client: HullClient, name: str) -> None:
    writer = client.writer(name, linger=60)
    outcome = writer.put(insert=[[1, 2]])
    writer.close()
    assert outcome.result().revision == writer.sequence == 1
    writer.close()
    with pytest.raises(RuntimeError, match="closed"):
        writer.put(insert=[[1, 2]])
    unused = client.writer(name)
    unused.flush()
    unused.close()
    refused = client.writer(name, batch_points=1)
    refused.put(delete=[[9, 9]])
    with pytest.raises(PointMissingError):
        refused.close()
    refused.close()
    assert client.get_hull(name).info.points == 1


def test_leaving_with_an_exception_waits_for_nothing(client: HullClient, name: str) -> None:
    writer = client.writer(name, linger=60)
    outcomes = []

    def fail_half_way() -> None:
        with writer:
            outcomes.append(writer.put(insert=POINTS[0]))
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert outcomes[0].cancelled()
    assert client.get_hull(name).revision == 0
