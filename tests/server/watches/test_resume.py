"""A watch that is cut off and resumed: the watcher holds exactly the hull of each revision."""

import threading
from dataclasses import dataclass

import grpc
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from proxy import proxy
from refusal import refusal
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import Change, DynhullError, HullClient, HullCopy, RevisionForgottenError, Sketch, Snapshot
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

BATCHES = 120
NAMES = iter(f"resume/{i}" for i in range(1_000_000))


@dataclass(frozen=True)
class Manner:
    """How a watcher watches."""

    max_rate: float
    batches_between: int
    events_to_a_connection: int
    severed: bool


MANNERS = st.builds(
    Manner,
    max_rate=st.sampled_from([0.0, 500.0, 50.0]),
    batches_between=st.integers(0, 40),
    events_to_a_connection=st.integers(1, 30),
    severed=st.booleans(),
)


class Writer:
    """Writes random batches, and records the hull of every revision."""

    def __init__(self, client: HullClient, name: str, seed: int) -> None:
        self._client = client
        self._name = name
        self._random = np.random.default_rng(seed)
        self._moved = threading.Condition()
        self.revision = 0
        self.hulls = {0: np.empty((0, 2))}

    def write(self) -> None:
        reference, present = DynamicHull(), np.empty((0, 2))
        with self._client.ingest(self._name) as stream:
            for revision in range(1, BATCHES + 1):
                fresh = np.round(self._random.normal(scale=4, size=(self._random.integers(0, 6), 2)))
                leaving = self._random.permutation(len(present))[: self._random.integers(0, 6)]
                reference.insert_many(fresh)
                reference.delete_many(present[leaving])
                self.hulls[revision] = reference.vertices()
                stream.apply(insert=fresh, delete=present[leaving])
                present = np.concatenate((np.delete(present, leaving, axis=0), fresh))
                with self._moved:
                    self.revision = revision
                    self._moved.notify_all()

    def reached(self, revision: int) -> None:
        with self._moved:
            self._moved.wait_for(lambda: self.revision >= min(revision, BATCHES))


def follow(address: str, name: str, manner: Manner, writer: Writer) -> int:
    """Watch to the end; returns the number of connections that resumed without a snapshot."""
    copy, resumed = HullCopy(), 0
    with proxy(address) as way:
        while copy.revision < BATCHES:
            resume = copy if copy.uid else None
            with (
                HullClient(way.address, wait_for_ready=True) as client,
                client.watch(name, max_rate=manner.max_rate, resume=resume, reconnect=False) as watch,
            ):
                try:
                    for taken in range(manner.events_to_a_connection):
                        writer.reached(copy.revision + manner.batches_between)
                        event = next(watch)
                        assert event.revision >= copy.revision
                        resumed += taken == 0 and resume is not None and not isinstance(event, Snapshot)
                        copy.update(event)
                        assert copy.vertices.tolist() == writer.hulls[copy.revision].tolist()
                        if copy.revision >= BATCHES:
                            break
                    if manner.severed:
                        way.cut()
                        next(watch)
                except DynhullError as error:
                    assert error.code == grpc.StatusCode.UNAVAILABLE  # noqa: PT017  # it need not come
    return resumed


@settings(max_examples=6, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.lists(MANNERS, min_size=2, max_size=4), st.integers(0, 2**32))
def test_whatever_the_watcher_its_copy_is_exact(address: str, manners: list[Manner], seed: int) -> None:
    name = next(NAMES)
    failures: list[BaseException] = []

    def watch(manner: Manner, writer: Writer) -> None:
        try:
            follow(address, name, manner, writer)
        except BaseException as failure:
            failures.append(failure)

    with HullClient(address) as client:
        client.create_hull(name)
        writer = Writer(client, name, seed)
        threads = [threading.Thread(target=watch, args=(manner, writer)) for manner in manners]
        threads.append(threading.Thread(target=writer.write))
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        client.delete_hull(name)
    if failures:
        raise failures[0]


def test_a_resumed_watch_begins_with_what_has_changed(address: str, name: str) -> None:
    with HullClient(address) as client:
        uid = client.create_hull(name).uid
        client.apply(name, insert=[[0, 0], [4, 0], [0, 4]])
        copy = HullCopy()
        with client.watch(name) as watch:
            copy.update(next(watch))
        assert (copy.uid, copy.revision) == (uid, 1)
        with client.watch(name, resume=copy) as watch:
            client.apply(name, insert=[[1, 1]])
            client.apply(name, insert=[[4, 4]])
            copy.follow(watch, 3)
        assert copy.vertices.tolist() == [[0, 0], [4, 0], [4, 4], [0, 4]]
        client.apply(name, delete=[[4, 4]])
        with client.watch(name, resume=copy) as watch:
            event = next(watch)
        assert isinstance(event, Change)
        assert (event.removed.tolist(), event.added.tolist()) == ([[4, 4]], [])


def test_what_a_reader_was_told_can_be_gone_on_from(address: str, name: str) -> None:
    with HullClient(address) as client:
        client.create_hull(name)
        client.apply(name, insert=[[0, 0], [4, 0]])
        hull = client.get_hull(name)
        copy = HullCopy()
        copy.update(Snapshot(hull.revision, hull.info.points, hull.vertices, None, hull.info.uid))
        client.apply(name, insert=[[0, 4]])
        with client.watch(name, resume=copy) as watch:
            event = next(watch)
        assert isinstance(event, Change)
        copy.update(event)
        assert copy.vertices.tolist() == [[0, 0], [4, 0], [0, 4]]


@pytest.mark.whole_hull("its server keeps no batches")
def test_what_watches_resume_from_is_bounded() -> None:
    with server_process("--resume-bytes", "2000") as server, HullClient(server.address) as client:
        client.create_hull("a")
        copy = HullCopy()
        with client.watch("a") as watch:
            copy.update(next(watch))
        for i in range(20):
            client.apply("a", insert=[[i, i * i]])
            client.get_hull("a")
        with pytest.raises(RevisionForgottenError) as caught:
            next(client.watch("a", resume=copy, reconnect=False))
        oldest = caught.value.oldest
        assert 10 < oldest <= 20
        copy.revision, copy.vertices = oldest, np.array([[i, i * i] for i in range(oldest)])
        with client.watch("a", resume=copy) as watch:
            copy.follow(watch, 20)
        assert copy.vertices.tolist() == client.get_hull("a").vertices.tolist()


def test_another_hull_of_the_name_is_not_gone_on_with(address: str, stub: HullServiceStub, name: str) -> None:
    with HullClient(address) as client:
        copy = HullCopy()
        client.create_hull(name)
        with client.watch(name) as watch:
            copy.update(next(watch))
        client.delete_hull(name)
        uid = client.create_hull(name).uid
        request = pb.WatchRequest(name=name, resume={"uid": copy.uid, "revision": 0})
        code, info, _ = refusal(lambda: list(stub.Watch(request)))
        assert (code, info.reason) == (grpc.StatusCode.OUT_OF_RANGE, "HULL_REPLACED")
        assert info.metadata["uid"] == uid
        request.resume.uid, request.resume.revision = uid, 1
        code, info, _ = refusal(lambda: list(stub.Watch(request)))
        assert (code, info.reason) == (grpc.StatusCode.OUT_OF_RANGE, "REVISION_FORGOTTEN")
        expected = {"field": "resume.revision", "value": "1", "oldest": "0", "newest": "0"}
        assert dict(info.metadata) == expected


def test_a_sketch_is_the_extreme_vertices(address: str, name: str) -> None:
    directions = np.random.default_rng(4).normal(size=(16, 2))
    reference = DynamicHull()
    with HullClient(address) as client:
        client.create_hull(name)
        with client.watch(name, directions=directions, measures=True) as watch:
            event = next(watch)
            assert isinstance(event, Sketch)
            assert event.vertices.tolist() == []
            for batch in np.random.default_rng(5).normal(size=(50, 3, 2)):
                applied = client.apply(name, insert=batch)
                reference.insert_many(batch)
                while event.revision < applied.revision:
                    event = next(watch)
                if isinstance(event, Sketch):
                    held = event.vertices
                    assert event.measures.area == reference.area
                assert held.tolist() == reference.support(directions).tolist()
