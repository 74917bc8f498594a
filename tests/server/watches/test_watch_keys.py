"""A watcher that asks for keys knows whom each vertex belongs to, and every watcher hears what made a revision."""

import struct
from itertools import accumulate, pairwise

import grpc
import numpy as np
import pytest
from google.protobuf.duration_pb2 import Duration
from hypothesis import given
from hypothesis import strategies as st
from refusal import refusal

from dynhull import KeyedHull
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.engine.difference import difference
from dynhull_server.engine.views import Change
from dynhull_server.rpc.encode import encode_event
from dynhull_server.state.hull_state import Counts

Key = str | int
Place = tuple[float, float]

IDENTITIES = {"str": hull_pb2.IDENTITY_STRING_KEYS, "int": hull_pb2.IDENTITY_INTEGER_KEYS}
GRID = st.tuples(st.integers(0, 3), st.integers(0, 3))


def encode_keys(keys: list[Key]) -> points_pb2.Keys:
    if keys and isinstance(keys[0], int):
        return points_pb2.Keys(integers=keys)
    return points_pb2.Keys(strings=keys)


def decode_keys(keys: points_pb2.Keys) -> list[Key]:
    """From either encoding."""
    ends = [0, *accumulate(keys.lengths)]
    strings = [keys.text[first:last].decode() for first, last in pairwise(ends)]
    integers = [number for (number,) in struct.iter_unpack("<Q", keys.packed_integers)]
    return [*strings, *integers, *keys.strings, *keys.integers]


def decode_points(points: points_pb2.Points) -> list[Place]:
    flat = points.coordinates or np.frombuffer(points.packed).tolist()
    return list(zip(flat[::2], flat[1::2], strict=True))


class Copy:
    """What a client makes of the events, as the contract says."""

    def __init__(self) -> None:
        self.revision = -1
        self.vertices: list[Place] = []
        self.keys: list[Key] = []

    def update(self, event: pb.WatchResponse) -> None:
        self.revision = event.revision
        if event.HasField("snapshot"):
            self.vertices = decode_points(event.snapshot.vertices)
            self.keys = decode_keys(event.snapshot.vertex_keys)
        elif event.HasField("change"):
            change = event.change
            self.vertices = self._edited(self.vertices, change, decode_points(change.added))
            self.keys = self._edited(self.keys, change, decode_keys(change.added_keys))
            for index, key in zip(change.renamed_indices, decode_keys(change.renamed_keys), strict=True):
                self.keys[index] = key
        assert len(self.keys) == len(self.vertices)

    @staticmethod
    def _edited(old: list, change: pb.HullChange, added: list) -> list:
        removed = set(change.removed_indices)
        left = [each for i, each in enumerate(old) if i not in removed]
        new = left[change.rotation :] + left[: change.rotation]
        for index, each in zip(change.added_indices, added, strict=True):
            new.insert(index, each)
        return new


def places(hull: KeyedHull) -> list[Place]:
    return list(map(tuple, hull.vertices().tolist()))


@given(st.lists(st.tuples(GRID, GRID), max_size=12), st.integers(0, 12))
def test_a_change_names_all_that_is_new(moves: list[tuple[Place, Place]], stay: int) -> None:
    before, after = KeyedHull("int"), KeyedHull("int")
    keys = list(range(len(moves)))
    before.put_many(keys, [old for old, _ in moves] or np.empty((0, 2)))
    after.put_many(keys[stay:], [new for _, new in moves[stay:]] or np.empty((0, 2)))
    after.put_many(keys[:stay], [old for old, _ in moves[:stay]] or np.empty((0, 2)))
    old, new = (np.array(each.vertex_keys(), np.uint64) for each in (before, after))
    edit = difference(before.vertices(), after.vertices(), old, new)
    event = Change(Counts(2, 0, 0), before.vertices()[edit.removed], after.vertices(), edit, new)
    copy = Copy()
    copy.vertices, copy.keys = places(before), before.vertex_keys()
    copy.update(encode_event(event, points_pb2.POINT_ENCODING_PACKED))
    assert (copy.vertices, copy.keys) == (places(after), after.vertex_keys())
    renamed = {i for i, place in enumerate(places(after)) if place in places(before)}
    renamed &= {i for i, key in enumerate(after.vertex_keys()) if before.keys_at([places(after)[i]]) != [key]}
    assert set(edit.renamed.tolist()) == renamed


def put(name: str, keys: list[Key], xy: list[Place], removes: list[Key] = ()) -> pb.ApplyRequest:
    flat = [float(each) for place in xy for each in place]
    puts = batch_pb2.Puts(keys=encode_keys(keys), points=points_pb2.Points(coordinates=flat))
    return pb.ApplyRequest(name=name, batch=batch_pb2.Batch(puts=puts, removes=encode_keys(list(removes))))


@pytest.fixture(params=["str", "int"])
def keyed(request: pytest.FixtureRequest, stub: HullServiceStub, name: str) -> tuple[str, list[Key]]:
    """The name of a keyed hull, and eight keys of its type in ascending order."""
    config = hull_pb2.HullConfig(identity=IDENTITIES[request.param])
    stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
    numbers = [*range(6), 2**63, 2**64 - 1]
    return name, [f"k{n:020}" for n in numbers] if request.param == "str" else numbers


@pytest.mark.parametrize("encoding", [points_pb2.POINT_ENCODING_PACKED, points_pb2.POINT_ENCODING_COORDINATES])
def test_what_a_watcher_holds_has_the_keys_of_its_revision(
    stub: HullServiceStub, keyed: tuple[str, list[Key]], encoding: points_pb2.PointEncoding
) -> None:
    """Keys meet at a few places and part again, so that vertices stay and change their keys."""
    name, keys = keyed
    random = np.random.default_rng(4)
    reference = KeyedHull("str" if isinstance(keys[0], str) else "int")
    states = {0: ([], [])}
    copy = Copy()
    watch = stub.Watch(pb.WatchRequest(name=name, encoding=encoding, include_keys=True))
    copy.update(next(watch))
    for revision in range(1, 81):
        chosen = random.permutation(8)[: random.integers(1, 4)]
        moved, left = [keys[i] for i in chosen[:2]], [keys[i] for i in chosen[2:]]
        xy = random.integers(0, 3, (len(moved), 2)).astype(float)
        stub.Apply(put(name, moved, xy.tolist(), left))
        reference.put_many(moved, xy)
        reference.remove_many(left, missing="ignore")
        states[revision] = places(reference), reference.vertex_keys()
        if revision % 3 == 0:  # otherwise the watcher gets several revisions at once
            while copy.revision < revision:
                copy.update(next(watch))
                assert (copy.vertices, copy.keys) == states[copy.revision]
    watch.cancel()
    assert len({tuple(held) for _, held in states.values()}) > 20


def test_a_key_that_changes_where_the_vertex_stays(stub: HullServiceStub, keyed: tuple[str, list[Key]]) -> None:
    name, keys = keyed
    corners = [(0, 0), (4, 0), (4, 4), (0, 4)]
    stub.Apply(put(name, keys[2:6], corners))
    watch = stub.Watch(pb.WatchRequest(name=name, include_keys=True))
    plain = stub.Watch(pb.WatchRequest(name=name))
    snapshot = next(watch).snapshot
    assert decode_keys(snapshot.vertex_keys) == keys[2:6]
    assert next(plain).snapshot.vertex_keys == points_pb2.Keys()

    stub.Apply(
        put(name, [keys[0], keys[7]], [(4, 4), (0, 0)])
    )  # the first is less than the key there, the other is not
    change = next(watch).change
    assert (change.removed.packed, change.added.packed) == (b"", b"")
    assert (list(change.renamed_indices), decode_keys(change.renamed_keys)) == ([2], [keys[0]])
    assert next(plain).HasField("progress")

    stub.Apply(put(name, [keys[1]], [(1, 1)]))
    assert next(watch).HasField("progress")
    assert next(plain).HasField("progress")
    stub.Apply(put(name, [keys[1]], [(9, 2)], [keys[0]]))
    change = next(watch).change
    assert (decode_points(change.added), decode_keys(change.added_keys)) == ([(9, 2)], [keys[1]])
    assert decode_keys(change.renamed_keys) == [keys[4]]

    resume = pb.WatchResume(uid=snapshot.uid, revision=1)
    resumed = next(stub.Watch(pb.WatchRequest(name=name, resume=resume, include_keys=True))).change
    assert decode_keys(resumed.added_keys) == [keys[1]]
    assert list(resumed.renamed_indices) == [0, 1, 3, 4]
    assert decode_keys(resumed.renamed_keys) == [keys[2], keys[3], keys[4], keys[5]]
    at_once = pb.WatchResume(uid=snapshot.uid, revision=4)
    resumed = next(stub.Watch(pb.WatchRequest(name=name, resume=at_once, include_keys=True))).change
    assert (list(resumed.added_indices), len(resumed.renamed_indices)) == ([], 5)
    for each in (watch, plain):
        each.cancel()


def test_a_sketch_names_its_vertices(stub: HullServiceStub, keyed: tuple[str, list[Key]]) -> None:
    name, keys = keyed
    directions = points_pb2.Points(coordinates=[1, 0, 0, 1])
    watch = stub.Watch(pb.WatchRequest(name=name, directions=directions, include_keys=True))
    assert decode_keys(next(watch).sketch.keys) == []
    stub.Apply(put(name, keys[:3], [(0, 0), (4, 0), (0, 4)]))
    sketch = next(watch).sketch
    assert (decode_points(sketch.vertices), decode_keys(sketch.keys)) == ([(4, 0), (0, 4)], [keys[1], keys[2]])
    stub.Apply(put(name, [keys[0]], [(4, 0)]))
    assert decode_keys(next(watch).sketch.keys) == [keys[0], keys[2]]
    watch.cancel()


def test_a_hull_without_keys_has_none_to_send(stub: HullServiceStub, hull: str) -> None:
    code, info, _ = refusal(lambda: next(stub.Watch(pb.WatchRequest(name=hull, include_keys=True))))
    assert (code, info.reason) == (grpc.StatusCode.FAILED_PRECONDITION, "HULL_UNSUITABLE")


def test_events_say_what_made_them_and_when(stub: HullServiceStub, hull: str, name: str) -> None:
    watch = stub.Watch(pb.WatchRequest(name=hull))
    event = next(watch)
    assert (event.cause, event.HasField("clock_time")) == (batch_pb2.CAUSE_UNSPECIFIED, False)
    stub.Apply(pb.ApplyRequest(name=hull, batch={"inserts": {"coordinates": [1, 2]}}))
    event = next(watch)
    assert (event.cause, event.HasField("clock_time")) == (batch_pb2.CAUSE_BATCH, False)
    watch.cancel()

    window = hull_pb2.Window(max_age=Duration(nanos=200_000_000))
    config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_STRING_KEYS, window=window)
    stub.CreateHull(pb.CreateHullRequest(name=name + "-window", config=config))
    watch = stub.Watch(pb.WatchRequest(name=name + "-window", include_keys=True))
    next(watch)
    answer = stub.Apply(put(name + "-window", ["a"], [(1, 2)])).result
    causes = {}
    while 2 not in causes:  # the first event is of either revision
        event = next(watch)
        causes[event.revision] = event.cause
    assert causes[2] == batch_pb2.CAUSE_EXPIRY
    assert causes.get(1, batch_pb2.CAUSE_BATCH) == batch_pb2.CAUSE_BATCH
    assert event.clock_time.ToMicroseconds() >= answer.clock_time.ToMicroseconds() + 200_000
    assert event.point_count == 0
    watch.cancel()
