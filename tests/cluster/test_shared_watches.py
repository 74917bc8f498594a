"""Many watches of a hull at a gateway: the worker has one, and each watcher gets exactly what it would get alone."""

import threading
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import grpc
import numpy as np
import pytest
from cases import slow
from one_gateway import Place, entries

from dynhull import DynamicHull
from dynhull_client import HullClient, HullCopy, HullNotFoundError, UnauthenticatedError
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

if TYPE_CHECKING:
    from collections.abc import Sequence

CORNERS = [[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]]
BATCHES = 40


class Watcher:
    """A watch that a thread reads until it has seen a revision.

    Attributes:
        seen: what its copy holds at each revision that it has seen.
    """

    def __init__(self, client: HullClient, name: str, last: int, **options: Any) -> None:
        self.seen: dict[int, tuple[list[list[float]], Sequence[object] | None]] = {}
        self._copy = HullCopy()
        self._watch = client.watch(name, copy=self._copy, reconnect=False, **options)
        next(self._watch)
        self._note()
        self._thread = threading.Thread(target=self._read, args=(last,))
        self._thread.start()

    def _note(self) -> None:
        self.seen[self._copy.revision] = self._copy.vertices.tolist(), self._copy.vertex_keys

    def _read(self, last: int) -> None:
        for _ in self._watch:
            self._note()
            if self._copy.revision >= last:
                return

    def wait(self) -> None:
        self._thread.join()

    def leave(self) -> None:
        self._watch.close()


@pytest.mark.parametrize("key", [None, "str", "int"])
def test_everybody_sees_the_same_hull_at_the_same_revision(place: Place, client: HullClient, key: str | None) -> None:
    """Those that are limited skip revisions: the gateway makes the changes between those that they see."""
    name, random = f"a-{key}", np.random.default_rng(1)
    keys = {None: None, "str": [f"k{i}" for i in range(30)], "int": list(range(30))}[key]
    client.create_hull(name, keyed=key)
    options: list[dict[str, Any]] = [{"max_rate": rate, "keys": key is not None} for rate in (0, 0, 0, 60, 60, 25, 25)]
    watchers = [Watcher(client, name, BATCHES, **each) for each in options]
    place.wait_for(3)  # one for each rate
    before = place.costs()[1]
    held: list[tuple[float, float]] = []
    places: dict[object, tuple[float, float]] = {}
    truth = [([], {})]
    for _ in range(BATCHES):
        points = [tuple(point) for point in random.integers(0, 50, (10, 2)).astype(float).tolist()]
        if keys is None:
            client.apply(name, insert=points)
            held += points
        else:
            chosen = [keys[i] for i in random.permutation(30)[:10]]
            client.put(name, chosen, points)
            places.update(zip(chosen, points, strict=True))
            held = list(places.values())
        truth.append((DynamicHull(held).vertices().tolist(), dict(places)))
    for each in watchers:
        each.wait()
    assert place.costs() == (3, before)
    for each in watchers:
        each.leave()
        assert BATCHES in each.seen
        for revision, (vertices, names) in each.seen.items():
            expected, where = truth[revision]
            assert vertices == expected
            assert key is None or [list(where[each]) for each in names] == vertices
    assert min(len(each.seen) for each in watchers) < BATCHES


@slow
def test_a_watcher_that_does_not_read_holds_nobody(place: Place, client: HullClient) -> None:
    """It gets the changes since the event that it was sent last as one."""
    last, x = 120, np.arange(2500.0)
    client.create_hull("slow")
    with grpc.insecure_channel(place.address, [("grpc.http2.bdp_probe", 0)]) as channel:
        request, metadata = pb.WatchRequest(name="slow"), [("authorization", "Bearer one")]
        slow = HullServiceStub(channel).Watch(request, metadata=metadata)
        assert next(slow).revision == 0
        fast = Watcher(client, "slow", last)
        place.wait_for(1)
        for i in range(last):  # events of 40 kB and more
            client.apply("slow", insert=np.column_stack([x, x * (x - 2500) - i]))
        fast.wait()
        fast.leave()
        events = [next(slow)]
        while events[-1].revision < last:
            events.append(next(slow))
        slow.cancel()
    assert len(events) < last
    held = np.empty((0, 2))
    for event in events:
        held = edited(held, event.change)
    assert held.tolist() == fast.seen[last][0]


def edited(held: np.ndarray, change: pb.HullChange) -> np.ndarray:
    """The vertices after a change, as its documentation says."""
    kept = np.delete(held, change.removed_indices, axis=0) if len(change.removed_indices) else held
    rows = iter(np.roll(kept, -change.rotation, axis=0))
    added = dict(zip(change.added_indices, np.frombuffer(change.added.packed).reshape(-1, 2), strict=True))
    return np.array([added[i] if i in added else next(rows) for i in range(len(kept) + len(added))])


def test_a_watch_is_resumed_from_the_feed(place: Place, client: HullClient) -> None:
    client.create_hull("resumed")
    client.apply("resumed", insert=CORNERS)
    copy = HullCopy()
    with client.watch("resumed", copy=copy) as watch:
        next(watch)
        place.wait_for(1)
        before = place.costs()
        copies = [copy.copy() for _ in range(5)]
        with ExitStack() as opened:
            watches = [opened.enter_context(client.watch("resumed", copy=each)) for each in copies]
            client.apply("resumed", insert=[[30, -30]])
            assert {next(each).revision for each in (watch, *watches)} == {2}
            assert place.costs() == before
        assert all(np.array_equal(each.vertices, client.get_hull("resumed").vertices) for each in copies)


def test_a_deleted_hull_ends_every_watch(client: HullClient) -> None:
    client.create_hull("gone")
    watches = [client.watch("gone") for _ in range(5)]
    for each in watches:
        next(each)
    client.delete_hull("gone")
    client.create_hull("gone")
    client.apply("gone", insert=CORNERS)
    with client.watch("gone") as new:
        assert next(new).points == 4
    for each in watches:
        with pytest.raises(HullNotFoundError):
            list(each)


def test_a_token_that_is_taken_away_ends_its_watches_alone(place: Place, client: HullClient) -> None:
    client.create_hull("tokens")
    with HullClient(place.address, token="two") as other:
        theirs, ours = other.watch("tokens"), client.watch("tokens")
        next(theirs)
        next(ours)
        place.wait_for(1)
        place.tokens.write_text(entries("one"))
        with pytest.raises(UnauthenticatedError):
            next(theirs)
        client.apply("tokens", insert=CORNERS)
        assert next(ours).revision == 1
        ours.close()
    place.tokens.write_text(entries("one", "two"))
