"""A copy of a watched hull answers as the server does, without a call."""

import copy as copies
import pickle
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inputs import points
from patience import wait_until
from proxy import proxy

from dynhull import DynamicHull
from dynhull_client import (
    Change,
    Deleted,
    HullClient,
    HullCopy,
    HullNotFoundError,
    HullUnsuitableError,
    Progress,
    Sketch,
    Snapshot,
    StaleCopyError,
)
from dynhull_client._messages import decode_event
from dynhull_proto.v1 import points_pb2
from dynhull_server.engine.difference import difference
from dynhull_server.engine.views import Change as EngineChange
from dynhull_server.rpc.encode import encode_event
from dynhull_server.state.hull_state import Counts

RNG = np.random.default_rng(23)
ROWS = RNG.uniform(-2, 2, (50, 2))
CLOCK = "dynhull_client._hull_copy.monotonic"


def snapshot(vertices: np.ndarray, revision: int = 1) -> Snapshot:
    return Snapshot(revision, len(vertices), vertices, None, "uid")


def change(old: np.ndarray, new: np.ndarray, revision: int) -> Change:
    edit = difference(old, new)
    event = EngineChange(Counts(revision, 0, 0), old[edit.removed], new, edit)
    return decode_event(encode_event(event, points_pb2.POINT_ENCODING_PACKED))


def answers(hull: DynamicHull | HullCopy, rows: np.ndarray) -> list[object]:
    """Everything that both answer."""
    different = (rows[:-1] != rows[1:]).any(axis=1)
    vectors = rows[rows.any(axis=1)]
    found = [
        hull.locate(rows),
        hull.contains(rows),
        hull.tangents(rows),
        hull.distance(rows),
        hull.intersect_lines(rows[:-1][different], rows[1:][different]),
        hull.support(vectors) if len(hull.vertices if isinstance(hull, HullCopy) else hull.vertices()) else None,
        hull.area,
        hull.perimeter,
        hull.centroid,
        hull.bounds,
        hull.diameter(),
        hull.width(),
        hull.min_box(),
        hull.min_perimeter_box(),
        hull.min_circle(),
    ]
    return [repr(each.tolist() if isinstance(each, np.ndarray) else each) for each in found]


@given(st.lists(points(12), min_size=1, max_size=5), points(8))
def test_answers_after_any_changes(states: list[list[tuple[float, float]]], rows: list[tuple[float, float]]) -> None:
    asked = np.array([(0.5, 1), (-3, 2), *rows], float)
    copy, lazy = HullCopy(), HullCopy()
    before = None
    for revision, state in enumerate(states, start=1):
        hull = DynamicHull(state)
        after = hull.vertices()
        event = snapshot(after) if before is None else change(before, after, revision)
        for each in (copy, lazy):
            each.update(event)
        assert answers(copy, asked) == answers(hull, asked)
        before = after
    assert answers(lazy, asked) == answers(copy, asked)


def test_answers_of_a_watched_hull(connect: type[HullClient], address: str, name: str) -> None:
    copy = HullCopy()
    with connect(address) as client:
        client.create_hull(name)
        reference = DynamicHull()
        with client.watch(name, copy=copy) as watch:
            next(watch)
            assert copy.locate([[0, 0]]).tolist() == [-1]
            for batch in RNG.normal(size=(30, 5, 2)):
                client.apply(name, insert=batch)
                reference.insert_many(batch)
                next(watch)
                assert copy.revision == client.get_hull(name).revision
                assert answers(copy, ROWS) == answers(reference, ROWS)


def test_a_copy_without_a_hull_does_not_answer() -> None:
    copy = HullCopy()
    with pytest.raises(HullNotFoundError, match="holds no hull"):
        copy.locate([[0, 0]])
    copy.update(Sketch(1, 3, np.zeros((1, 2)), None))
    with pytest.raises(HullNotFoundError):
        copy.distance([[0, 0]])
    copy.update(snapshot(np.empty((0, 2))))
    assert copy.distance([[0, 0]]).tolist() == [np.inf]
    with pytest.raises(ValueError, match="no extreme points"):
        copy.support([[1, 0]])
    copy.update(Deleted(1))
    with pytest.raises(HullNotFoundError):
        copy.area  # noqa: B018


def test_bad_questions_name_the_row() -> None:
    copy = HullCopy()
    copy.update(snapshot(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])))
    with pytest.raises(ValueError, match=r"row 1 is .*nan"):
        copy.locate([[0, 0], [0, np.nan]])
    with pytest.raises(ValueError, match="directions row 0"):
        copy.support([[0, 0]])


def test_a_copy_that_is_too_old_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    now = 100.0
    monkeypatch.setattr(CLOCK, lambda: now)
    copy = HullCopy(max_staleness=2.0)
    assert copy.age == np.inf
    with pytest.raises(HullNotFoundError):
        copy.locate([[0, 0]])
    copy.update(snapshot(np.zeros((1, 2))))
    now = 102.0
    assert copy.locate([[0, 0]]).tolist() == [0]
    now = 102.5
    with pytest.raises(StaleCopyError, match=r"2.5 s ago, .* of 2 s"):
        copy.locate([[0, 0]])
    with pytest.raises(TimeoutError):
        copy.area  # noqa: B018
    assert copy.vertices.tolist() == [[0, 0]]  # the attributes are what the last event said
    copy.update(Progress(7, 1))
    assert (copy.locate([[0, 0]]).tolist(), copy.revision, copy.age) == ([0], 7, 0.0)
    now = 200.0
    copy.max_staleness = None
    assert copy.locate([[0, 0]]).tolist() == [0]


@pytest.mark.parametrize("limit", [0, -1, np.nan, np.inf])
def test_a_limit_that_is_none(limit: float) -> None:
    with pytest.raises(ValueError, match="max_staleness must be positive and finite"):
        HullCopy(max_staleness=limit)


def test_progress_marks_keep_a_copy_fresh_and_a_lost_server_does_not(
    address: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By a clock that runs as the test says: what is shown is how often marks come, not how fast."""
    now = 100.0
    monkeypatch.setattr(CLOCK, lambda: now)
    copy = HullCopy(max_staleness=0.6)
    with proxy(address) as way, HullClient(address) as client, HullClient(way.address) as watching:
        client.create_hull(name)
        client.apply(name, insert=[[0, 0]])
        watch = watching.watch(name, copy=copy, outline=True)
        thread = threading.Thread(target=lambda: [None for _ in watch])
        thread.start()
        try:
            wait_until(lambda: copy.revision == 1)
            for _ in range(5):
                now += 0.5
                wait_until(lambda: copy.age == 0)  # a mark has come
                assert copy.locate([[0, 0]]).tolist() == [0]
            way.cut()
            way.server = "127.0.0.1:1"  # nobody there

            def stale() -> bool:
                nonlocal now
                now += 0.7  # marks that have been sent may still come
                try:
                    copy.locate([[0, 0]])
                except StaleCopyError:
                    return True
                return False

            wait_until(stale)
            way.server = address
            wait_until(lambda: copy.age == 0)
            assert copy.locate([[0, 0]]).tolist() == [0]
        finally:
            watch.close()
            thread.join()


def test_threads_ask_while_another_one_updates() -> None:
    """Each answer is of one revision: a square of side 1 or one of side 3."""
    sides = [np.array([[0, 0], [side, 0], [side, side], [0, side]], float) for side in (1, 3)]
    copy = HullCopy()
    copy.update(snapshot(sides[1]))
    rows = np.array([[0.5, 0.5], [2, 2], [2.5, 2.5], [2, 1], [4, 4]])
    allowed = {(1, -1, -1, -1, -1), (1, 1, 1, 1, -1)}
    wrong = []
    stop = threading.Event()

    def ask() -> None:
        while not stop.is_set():
            fixed = copy.copy()
            if tuple(copy.locate(rows).tolist()) not in allowed or fixed.area != {0: 1.0, 1: 9.0}[fixed.revision % 2]:
                wrong.append(fixed)

    threads = [threading.Thread(target=ask) for _ in range(3)]
    for each in threads:
        each.start()
    for revision in range(2, 1_000):
        new = sides[revision % 2]
        if revision % 50 == 0:
            copy.update(snapshot(new, revision))
        else:
            copy.update(change(sides[1 - revision % 2], new, revision))
    stop.set()
    for each in threads:
        each.join()
    assert not wrong
    assert copy.area == 9.0


def test_a_copy_of_a_copy_is_a_value() -> None:
    copy = HullCopy(max_staleness=1e6)
    copy.update(snapshot(np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]), 5))
    assert copy.area == 0.5
    for same in (copy.copy(), pickle.loads(pickle.dumps(copy)), copies.deepcopy(copy)):
        assert (same.revision, same.uid, same.points, same.max_staleness) == (5, "uid", 3, 1e6)
        assert same.area == 0.5
        copy.update(change(copy.vertices, np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0]]), 6))
        assert (copy.area, same.area, same.revision) == (2.0, 0.5, 5)
        copy.update(snapshot(same.vertices, 5))


def test_a_keyed_hull_names_its_vertices(address: str, name: str) -> None:
    copy = HullCopy()
    with HullClient(address) as client:
        client.create_hull(name, keyed="str")
        client.put(name, ["a", "b", "c"], [[0, 0], [2, 0], [0, 2]])
        with client.watch(name, copy=copy, keys=True, outline=True) as watch:
            next(watch)
            assert copy.contains([[1, 0.5], [2, 2]]).tolist() == [True, False]
            client.put(name, ["in"], [[0.5, 0.5]])
            client.put(name, ["d"], [[2, 2]])
            event = next(watch)
            assert (event.revision, type(event)) == (3, Change)
            assert copy.contains([[1, 0.5], [2, 2]]).tolist() == [True, True]
            assert dict(zip(copy.vertex_keys, copy.vertices.tolist(), strict=True))["d"] == [2, 2]


def test_a_geographic_hull(connect: type[HullClient], address: str, name: str) -> None:
    copy = HullCopy()
    rows = np.column_stack((RNG.uniform(-30, 40, 60), RNG.uniform(20, 70, 60)))
    with connect(address) as client:
        client.create_hull(name, geographic=True)
        with client.watch(name, copy=copy, outline=True) as watch:
            next(watch)
            assert copy.locate(rows[:2]).tolist() == [-1, -1]

            def compare() -> None:
                while copy.revision < client.get_hull(name).revision:
                    next(watch)
                assert copy.center == client.get_hull(name).info.center
                assert copy.locate(rows).tolist() == client.locate(name, rows).sides.tolist()
                assert copy.distance(rows).tolist() == client.distance(name, rows).distances.tolist()
                np.testing.assert_array_equal(copy.tangents(rows), client.tangents(name, rows).tangents)
                measured = client.get_measures(name)
                assert (copy.area, copy.perimeter, copy.diameter()) == (
                    measured.area,
                    measured.perimeter,
                    measured.diameter,
                )

            for step in range(5):
                client.apply(name, insert=[[step * 4 - 9, 40], [step, 45 + 2 * step], [5, 40 - step]])
                compare()
            client.recenter(name, center=(20, 60))
            compare()
            with pytest.raises(HullUnsuitableError, match="ask the server"):
                copy.width()
