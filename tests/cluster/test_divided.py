"""A hull over shards, in real processes: the answers of one hull, whichever worker is killed."""

import fcntl
import os
import shutil
import signal
import sqlite3
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, suppress
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cases import ALL_CASES, slow, with_all_cases
from cluster import descendants, processes
from command_line import dynhull
from pacing import pause
from patience import PATIENCE, wait_until
from postgresql import query
from server_process import Server, server_process

from dynhull_client import (
    Batch,
    DynhullError,
    HullClient,
    HullCopy,
    HullNotFoundError,
    HullUnsuitableError,
    InvalidRequestError,
    KeyMissingError,
    Prefix,
    Quarantine,
    UnavailableError,
)
from dynhull_server.storage.sqlite import copies

WORKERS = ("--workers", "2", "--gateways", "1")
SHAPES = {"process": (), "workers": WORKERS, "cluster": ("--cluster", "--partitions", "4")}
KINDS: dict[str, dict[str, Any]] = {
    "points": {},
    "strings": {"keyed": "str"},
    "integers by event time": {"keyed": "int", "ordering": "event_time"},
    "window by event time": {"max_age": 30, "clock": "data"},
    "keyed window": {"keyed": "str", "max_age": 30, "clock": "data"},
}
SHARDS = 3
SOME_KINDS = [
    kind if kind in ("points", "keyed window") else pytest.param(kind, marks=with_all_cases) for kind in KINDS
]
LIVES = 6 if ALL_CASES else 3
START = 1_700_000_000


@pytest.fixture(
    scope="module",
    params=["process", pytest.param("workers", marks=slow), pytest.param("cluster", marks=with_all_cases)],
)
def server(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    options = SHAPES[request.param]
    if request.param != "cluster":
        with server_process(*options, "--data", str(tmp_path_factory.mktemp("data"))) as server:
            yield server
        return
    url = request.getfixturevalue("postgres").new_database()
    with server_process(*options, "--journal", url) as server, server_process(*options, "--journal", url):
        wait_until(lambda: query(url, "SELECT count(DISTINCT worker) FROM owners WHERE address <> ''") == [(2,)])
        yield server


@pytest.fixture
def client(server: Server) -> Iterator[HullClient]:
    with HullClient(server.address) as client:
        yield client


# One hull


class Batches:
    """Random batches, some of which are refused."""

    def __init__(self, settings: dict[str, Any], seed: int) -> None:
        self._draw = np.random.default_rng(seed)
        self._settings = settings
        self._time = START

    def apply(self, client: HullClient, name: str, batch: dict[str, Any]) -> Any:
        try:
            return client.put(name, **batch) if "keys" in batch else client.apply(name, **batch)
        except DynhullError as error:
            return type(error), str(error)

    def next(self) -> dict[str, Any]:
        draw = self._draw
        self._time += int(draw.choice([0, 1, 10]))
        count = int(draw.integers(1, 12))
        points = draw.integers(-5, 6, (count, 2)).astype(float)
        batch: dict[str, Any] = {}
        if "max_age" in self._settings or "ordering" in self._settings:
            batch["times"] = (self._time + draw.integers(-40, 5, count)) * 1_000_000
        if "keyed" in self._settings:
            keys = draw.choice(60, count, replace=False)
            batch["keys"] = [f"k{key}" for key in keys] if self._settings["keyed"] == "str" else keys.astype(np.uint64)
            batch["points"] = points
        else:
            batch["insert"] = points
            if draw.random() < 0.5:
                batch["delete"] = draw.integers(-5, 6, (int(draw.integers(1, 3)), 2)).astype(float)
                batch["missing"] = str(draw.choice(["raise", "count"]))
        return batch


@pytest.mark.parametrize("kind", KINDS)
def test_a_hull_over_shards_is_one_hull(client: HullClient, name: str, kind: str) -> None:
    settings = KINDS[kind]
    one, many = f"{name}-one", f"{name}-many"
    client.create_hull(one, **settings)
    assert client.create_hull(many, shards=SHARDS, **settings).shards == SHARDS
    batches = Batches(settings, seed=len(kind))
    refused = 0
    for _ in range(40 if ALL_CASES else 20):
        batch = batches.next()
        expected, found = (batches.apply(client, each, batch) for each in (one, many))
        if isinstance(expected, tuple):
            refused += 1
            assert found == expected
        else:
            assert told(found) == told(expected)
    assert refused or "keyed" in settings
    hull, other = client.get_hull(one), client.get_hull(many)
    np.testing.assert_array_equal(other.vertices, hull.vertices)
    assert other.vertex_keys == hull.vertex_keys
    for attribute in ("revision", "points", "clock", "keyed", "window"):
        assert getattr(other.info, attribute) == getattr(hull.info, attribute)
    assert other.info.distinct == (0 if hull.info.keyed else hull.info.distinct)
    check_reads(client, one, many, hull.info.keyed)


def told(applied: Any) -> Any:
    """What a batch has done, but whether the hull has changed: of keys, only their names at vertices may have."""
    return [getattr(applied, each) for each in ("revision", "inserted", "deleted", "missing", "points", "moved")], [
        getattr(applied, each) for each in ("stale", "late", "skipped", "clamped", "clock", "duplicate")
    ]


def check_reads(client: HullClient, one: str, many: str, keyed: str | None) -> None:
    places = np.array([(x, y) for x in range(-6, 7) for y in range(-6, 7)], float)

    def same(ask: Any, *fields: str) -> None:
        expected, found = ask(one), ask(many)
        for field in ("revision", *fields):
            np.testing.assert_array_equal(getattr(found, field), getattr(expected, field))

    same(lambda name: client.count(name, places), "counts")
    same(lambda name: client.locate(name, places), "sides")
    same(lambda name: client.distance(name, places), "distances")
    same(lambda name: client.sample_points(name, 5), "points")
    same(lambda name: client.sample_points(name, 1000), "points")
    same(lambda name: client.support(name, places[:20]), "vertices")
    same(lambda name: client.get_measures(name), "area")
    verification = client.verify(many)
    assert verification.equal
    assert verification.points == client.get_hull(many).info.points
    if keyed is None:
        return
    keys = [f"k{key}" for key in range(60)] if keyed == "str" else np.arange(60, dtype=np.uint64)
    same(lambda name: client.positions(name, keys), "positions", "present", "times")
    same(lambda name: client.locate(name, keys=keys), "sides")
    same(lambda name: client.entities(name), "points", "times")
    assert list(client.entities(many).keys) == list(client.entities(one).keys)
    same(lambda name: client.sample_points(name, 5, keys=True), "points")


def test_points_leave_by_the_clock_of_the_server(client: HullClient, name: str) -> None:
    client.create_hull(name, shards=SHARDS, max_age=0.3)
    client.apply(name, insert=np.eye(2) * 7)
    watch = client.watch(name)
    wait_until(lambda: client.get_hull(name).info.points == 0)
    assert client.get_hull(name).revision == 2
    assert next(iter(watch)).revision <= 2
    watch.close()


def test_watches_see_what_happens_and_go_on_after_a_revision(client: HullClient, name: str) -> None:
    client.create_hull(name, shards=SHARDS)
    client.apply(name, insert=[[0, 0], [9, 0], [0, 9]])
    copy = HullCopy()
    with client.watch(name, copy=copy) as watch:
        events = iter(watch)
        assert len(next(events).vertices) == 3
        client.apply(name, insert=[[9, 9]])
        change = next(events)
        assert (change.revision, change.added.tolist()) == (2, [[9, 9]])
    client.apply(name, insert=[[20, 20]])
    assert copy.revision == 2
    with client.watch(name, copy=copy) as watch:
        assert (next(iter(watch)).revision, len(copy.vertices)) == (3, 4)


def test_numbered_batches_are_applied_once_and_a_refused_one_stops_its_stream(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", shards=SHARDS)
    for _ in range(2):
        applied = client.put(name, ["a"], [[1, 2]], producer="ship", sequence=1)
    assert (applied.duplicate, client.last_sequence(name, "ship")) == (True, 1)
    written: list[Any] = []
    with pytest.raises(KeyMissingError, match="remove row 0 is nobody"):
        put_and_remove_nobody(client, name, written)
    assert [each.exception(PATIENCE) for each in written] == [None] * 20
    assert client.get_hull(name).revision == 21


def put_and_remove_nobody(client: HullClient, name: str, written: list[Any]) -> None:
    with client.writer(name, batch_points=1, missing="raise", stop_on_error=True) as writer:
        written += [writer.put(keys=[f"k{i}"], points=[[i, i * i]]) for i in range(20)]
        written[-1].result(PATIENCE)
        writer.remove(["nobody"])


# What is refused


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"geographic": True}, "is geographic, so it cannot be divided"),
        ({"max_points": 5}, "has a window by number, so it cannot be divided"),
        ({"keyed": "str", "quarantine": Quarantine(max_growth=2.0)}, "has a quarantine, so it cannot be divided"),
    ],
)
def test_what_cannot_be_divided_is_refused(client: HullClient, name: str, settings: dict[str, Any], words: str) -> None:
    with pytest.raises(HullUnsuitableError, match=words):
        client.create_hull(name, shards=2, **settings)
    assert list(client.list_hulls(name)) == []


def test_questions_that_no_shard_can_answer_are_refused(client: HullClient, name: str) -> None:
    whole, divided = f"{name}/whole", f"{name}/divided"
    client.create_hull(whole, keyed="str")
    client.create_hull(divided, keyed="str", shards=2)
    client.put(divided, ["a"], [[0, 0]])
    batch = Batch(keys=["b"], points=[[0, 0]])
    refused = {
        "only its outermost layer": lambda: client.layers(divided, 2),
        "what lies below a vertex": lambda: client.influence(divided),
        "so it has no quarantine": lambda: client.set_quarantine(divided, Quarantine(max_speed=1.0)),
        "which no fence compares": lambda: client.create_fence(f"{name}/fence", [[0, 0], [1, 0], [0, 1]], divided),
        "compared with itself only": lambda: client.locate(whole, keys=["a"], keys_of=divided),
        "no batch is over it and other hulls": lambda: client.transfer({divided: batch, whole: batch}),
    }
    for words, ask in refused.items():
        with pytest.raises(HullUnsuitableError, match=words):
            ask()
    assert client.get_hull(divided).revision == 1


def test_the_feed_of_a_prefix_names_what_it_leaves_out_and_goes_on(client: HullClient, name: str) -> None:
    whole, divided = f"{name}/whole", f"{name}/divided"
    client.create_hull(whole)
    client.create_hull(divided, shards=2)

    def write(x: int) -> None:
        for each in (divided, whole):
            client.apply(each, insert=[[x, x]])

    write(1)
    with client.feed(prefix=f"{name}/", after=0) as feed:
        told = (each for each in feed if each.type in ("batch", "lost"))
        assert sorted((each.type, each.hull, each.revision) for each in islice(told, 2)) == [
            ("batch", whole, 1),
            ("lost", divided, 1),
        ]
        write(2)
        found = sorted(islice(told, 2), key=lambda each: each.type)
    assert [(each.type, each.hull, each.revision) for each in found] == [("batch", whole, 2), ("lost", divided, 2)]
    assert (found[1].first, found[1].last) == (2, 2)
    with client.feed(prefix=f"{name}/", after=found[0].after) as feed:
        client.apply(whole, insert=[[3, 3]])
        batch = next(each for each in feed if each.type == "batch")
        assert (batch.hull, batch.revision) == (whole, 3)
    with pytest.raises(HullUnsuitableError, match="is divided among shards, and has no feed"):
        next(iter(client.feed(divided)))


def test_of_a_hull_over_shards_only_the_present_can_be_read(client: HullClient, name: str) -> None:
    client.create_hull(name, shards=2)
    for x in range(3):
        client.apply(name, insert=[[x, x]])
    found = client.history(name)
    assert (found.first_revision, found.last_revision) == (3, 3)
    assert found.first_time == found.last_time is not None


# Faults


def rows_of(data: Path, sql: str) -> list[Any]:
    """What a statement finds in the databases of all workers."""
    found: list[Any] = []
    for database in sorted(data.glob("**/dynhull.db")):
        with closing(sqlite3.connect(database)) as connection:
            found += connection.execute(sql).fetchall()
    return found


def test_killed_workers_lose_and_double_nothing(tmp_path: Path) -> None:
    options = (*WORKERS, "--data", str(tmp_path), "--snapshot-points", "100")
    with (
        server_process(*options, complaints="is started again") as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", shards=SHARDS)
        points = np.random.default_rng(3).normal(size=(600, 2))
        with client.writer("fleet", batch_points=1) as writer:
            written: list[Any] = []
            for i, point in enumerate(points):
                written.append(writer.put(point[np.newaxis]))
                if i in (150, 300, 450):
                    written[i - 50].result(PATIENCE)
                    os.kill(processes(server.process.pid)[f"worker-{i // 150 % 2}"], signal.SIGKILL)
        info = client.get_hull("fleet").info
        assert info.points == info.revision == 600
        assert client.verify("fleet").equal
        assert client.count("fleet", points).counts.tolist() == [1] * 600
    with server_process(*options) as server, HullClient(server.address) as client:
        assert client.get_hull("fleet").info == info
        np.testing.assert_array_equal(client.sample_points("fleet", 1000).points, points[np.lexsort(points.T[::-1])])
        client.apply("fleet", insert=[[9, 9]])
        assert client.verify("fleet").equal


@with_all_cases
@pytest.mark.one_process("the rows of one database are counted")
def test_logs_of_shards_do_not_grow_for_ever(tmp_path: Path) -> None:
    with (
        server_process("--data", str(tmp_path), "--snapshot-points", "20") as server,
        HullClient(server.address) as client,
    ):
        client.create_hull("fleet", keyed="int", shards=2)

        def few() -> bool:
            for _ in range(20):
                client.put("fleet", np.arange(10, dtype=np.uint64), np.random.default_rng(0).normal(size=(10, 2)))
            (batches,), (snapshots,) = rows_of(
                tmp_path, "SELECT count(*) FROM batches UNION ALL SELECT count(*) FROM snapshots"
            )
            return snapshots >= 4 and batches < client.get_hull("fleet").revision

        wait_until(few)
        revision = client.get_hull("fleet").revision
    with server_process("--data", str(tmp_path)) as server, HullClient(server.address) as client:
        assert client.get_hull("fleet").revision == revision
        assert client.verify("fleet").equal


def test_a_shard_that_is_away_is_named_and_all_goes_on_when_it_is_back(tmp_path: Path) -> None:
    """Worker 1 cannot start while somebody else holds the lock of its folder. Calls for its own hulls wait for it."""
    with (
        server_process(*WORKERS, "--data", str(tmp_path), complaints="is started again") as server,
        HullClient(server.address, retries=0) as client,
        HullClient(server.address) as patient,
        ThreadPoolExecutor() as pool,
    ):
        client.create_hull("north/a", shards=2)  # of worker 0
        client.apply("north/a", insert=np.random.default_rng(1).normal(size=(50, 2)))
        before = client.get_hull("north/a")
        client.create_hull("fleet/a")  # of worker 1
        with (tmp_path / "worker-1" / "dynhull.lock").open("a") as lock:
            os.kill(server.process.pid, signal.SIGSTOP)  # it starts no other worker before the lock is taken
            os.kill(processes(server.process.pid)["worker-1"], signal.SIGKILL)
            fcntl.flock(lock, fcntl.LOCK_EX)
            os.kill(server.process.pid, signal.SIGCONT)
            reading = pool.submit(patient.get_hull, "fleet/a")
            asked = [
                pool.submit(client.apply, "north/a", insert=[[7, 7]]),
                pool.submit(client.count, "north/a", [[7, 7]]),
            ]
            for each in asked:
                with pytest.raises(UnavailableError, match="shard 1 of hull 'north/a' is away"):
                    each.result()
            np.testing.assert_array_equal(client.get_hull("north/a").vertices, before.vertices)
            assert client.locate("north/a", [[99, 99]]).sides.tolist() == [-1]
            assert not reading.done()
        assert reading.result().revision == 0
        wait_until(lambda: applied(client))
        info = client.get_hull("north/a").info
        assert (info.points, info.revision) == (51, 2)
        assert client.verify("north/a").equal


def applied(client: HullClient) -> bool:
    try:
        client.apply("north/a", insert=[[7, 7]], producer="ship", sequence=1)
    except UnavailableError:
        return False
    return True


def test_the_shards_of_a_deleted_hull_are_deleted_and_a_new_one_is_empty(tmp_path: Path) -> None:
    with server_process(*WORKERS, "--data", str(tmp_path)) as server, HullClient(server.address) as client:
        client.create_hull("fleet", shards=2)
        client.apply("fleet", insert=np.eye(2))
        assert len(rows_of(tmp_path, "SELECT name FROM hulls")) == 3
        client.delete_hull("fleet")
        client.create_hull("fleet", shards=2)
        assert client.get_hull("fleet").info.points == 0
        client.apply("fleet", insert=[[3, 4]])
        wait_until(lambda: len(rows_of(tmp_path, "SELECT name FROM hulls")) == 3)
        assert client.sample_points("fleet", 9).points.tolist() == [[3, 4]]
        assert client.verify("fleet").equal


@pytest.mark.parametrize("options", [pytest.param((), marks=with_all_cases), WORKERS], ids=["process", "workers"])
def test_shards_of_a_deleted_hull_do_not_prevent_a_start(tmp_path: Path, options: tuple[str, ...]) -> None:
    """Killed with shards of both, the deleted hull and the new one of its name."""
    with server_process(*options, "--data", str(tmp_path), killed=True) as server, HullClient(server.address) as client:
        for point in ([1.0, 2.0], [3.0, 4.0]):
            client.create_hull("fleet", shards=2)
            client.apply("fleet", insert=[point])
            if point[0] == 1:
                client.delete_hull("fleet")
        assert len(rows_of(tmp_path, "SELECT name FROM hulls")) == 5
        server.process.kill()
        server.process.wait(PATIENCE)
    with server_process(*options, "--data", str(tmp_path)) as server, HullClient(server.address) as client:
        assert client.sample_points("fleet", 9).points.tolist() == [[3, 4]]
        wait_until(lambda: len(rows_of(tmp_path, "SELECT name FROM hulls")) == 3)


# Other numbers of shards


@pytest.mark.parametrize("kind", KINDS)
def test_a_hull_with_other_shards_is_the_same_hull(client: HullClient, name: str, kind: str) -> None:
    settings = KINDS[kind]
    one, many = f"{name}-one", f"{name}-many"
    client.create_hull(one, **settings)
    client.create_hull(many, shards=SHARDS, **settings)
    batches = Batches(settings, seed=len(kind))
    changed = 0
    for turn in range(24):
        batch = batches.next()
        expected, found = (batches.apply(client, each, batch) for each in (one, many))
        if isinstance(expected, tuple):
            assert found == expected
        if turn % 6 == 5:
            before = client.get_hull(many)
            info = client.reshard(many, (1, 5, 2, 2)[turn // 6])
            changed += info.shards != before.info.shards
            assert (info.revision, info.shards) == (client.get_hull(one).revision + changed, (1, 5, 2, 2)[turn // 6])
            assert client.get_hull(many).info == info
            np.testing.assert_array_equal(client.get_hull(many).vertices, before.vertices)
    assert changed == 3
    for _ in range(changed):  # so that the revisions are the same
        empty = {"keys": [], "points": np.empty((0, 2))} if "keyed" in settings else {"insert": np.empty((0, 2))}
        if "max_age" in settings or "ordering" in settings:
            empty["times"] = np.empty(0, np.int64)
        batches.apply(client, one, empty)
    hull, other = client.get_hull(one), client.get_hull(many)
    np.testing.assert_array_equal(other.vertices, hull.vertices)
    assert other.vertex_keys == hull.vertex_keys
    for attribute in ("revision", "points", "clock", "keyed", "window"):
        assert getattr(other.info, attribute) == getattr(hull.info, attribute)
    check_reads(client, one, many, hull.info.keyed)


def test_keys_leave_at_their_deadlines_also_from_other_shards(client: HullClient, name: str) -> None:
    client.create_hull(name, keyed="str", shards=2)
    client.put(name, ["stays"], [[0, 0]])
    begun, ttl = time.monotonic(), 2.0
    client.put(name, [f"k{i}" for i in range(20)], np.random.default_rng(1).normal(size=(20, 2)), ttl=ttl)
    client.reshard(name, 5)
    points = client.get_hull(name).info.points
    assert points == 21 or time.monotonic() > begun + ttl
    wait_until(lambda: client.get_hull(name).info.points == 1)
    assert list(client.entities(name).keys) == ["stays"]


def test_other_shards_are_refused_where_they_cannot_be(client: HullClient, name: str) -> None:
    client.create_hull(name)
    with pytest.raises(HullUnsuitableError, match="is not divided among shards"):
        client.reshard(name, 2)
    with pytest.raises(HullNotFoundError):
        client.reshard(f"{name}-nobody", 2)
    client.create_hull(f"{name}-many", shards=2)
    with pytest.raises(InvalidRequestError, match="shards is 1025: must be at most 1024"):
        client.reshard(f"{name}-many", 1025)
    with pytest.raises(ValueError, match="shards must be at least 1"):
        client.reshard(f"{name}-many", 0)
    assert client.get_hull(f"{name}-many").info.shards == 2


def test_writers_and_watches_go_on_beside_other_shards(client: HullClient, name: str) -> None:
    client.create_hull(name, shards=2)
    copy, seen = HullCopy(), list[Any]()
    with Marks(client, name) as marks, client.watch(name, copy=copy) as watch:
        thread = threading.Thread(target=lambda: seen.extend(watch))
        thread.start()
        for shards in (5, 1, 3):
            wait_until(lambda before=marks.acknowledged: marks.acknowledged > before + 20)
            assert client.reshard(name, shards).shards == shards
        marks.stop()
        revision = client.get_hull(name).revision
        assert revision == marks.acknowledged + 3
        wait_until(lambda: copy.revision == revision)
    thread.join()
    np.testing.assert_array_equal(copy.vertices, client.get_hull(name).vertices)
    assert in_order(client.sample_points(name, 10**6).points) == in_order(Marks.points(marks.acknowledged))
    assert client.verify(name).equal


@slow
def test_kills_leave_the_old_shards_or_the_new_ones(tmp_path: Path) -> None:
    """Workers are killed at any moment while the shards change, again and again; then the whole server."""
    options = (*WORKERS, "--data", str(tmp_path), "--snapshot-points", "100")
    draw = np.random.default_rng(5)
    points = draw.normal(size=(20_000, 2))
    asked = 0
    with (
        server_process(*options, complaints="is started again") as server,
        HullClient(server.address, retries=50, timeout=PATIENCE) as client,
    ):
        client.create_hull("fleet", shards=2)
        client.apply("fleet", insert=points)
        for kill in range(LIVES):
            done = threading.Event()

            def change(done: threading.Event = done, shards: int = 3 + kill % 3) -> None:
                while client.get_hull("fleet").info.shards != shards:
                    divide(client, shards)
                done.set()

            thread = threading.Thread(target=change)
            thread.start()
            pause(draw.uniform(0, 0.15))
            os.kill(processes(server.process.pid)[f"worker-{kill % 2}"], signal.SIGKILL)
            assert done.wait(PATIENCE)
            thread.join()
            asked += 1
            assert client.get_hull("fleet").info.points == len(points)
            assert client.verify("fleet").equal
        info = client.get_hull("fleet").info
        assert info.revision == 1 + asked
        wait_until(lambda: len(rows_of(tmp_path, "SELECT name FROM hulls")) == 1 + client.get_hull("fleet").info.shards)
    with server_process(*options) as server, HullClient(server.address) as client:
        assert client.get_hull("fleet").info == info
        assert in_order(client.sample_points("fleet", 10**6).points) == in_order(points)
        client.apply("fleet", delete=points[:5])
        assert client.verify("fleet").equal


@slow
@pytest.mark.parametrize("options", [(), pytest.param(WORKERS, marks=with_all_cases)], ids=["process", "workers"])
def test_a_server_that_is_killed_has_the_old_shards_or_the_new_ones(tmp_path: Path, options: tuple[str, ...]) -> None:
    points = np.random.default_rng(5).normal(size=(20_000, 2))
    for life in range(LIVES):
        with (
            server_process(*options, "--data", str(tmp_path), killed=True, torn=life > 0) as server,
            HullClient(server.address, retries=0) as client,
        ):
            if not life:
                client.create_hull("fleet", shards=2)
                client.apply("fleet", insert=points)
            info = client.get_hull("fleet").info
            assert info.points == len(points)
            assert info.shards in {2, *range(3, 3 + life)}
            assert client.verify("fleet").equal
            thread = threading.Thread(target=divide, args=(client, 3 + life))
            thread.start()
            pause(0.02 * life)
            for each in [*descendants(server.process.pid), server.process.pid]:
                os.kill(each, signal.SIGKILL)
            server.process.wait(PATIENCE)
            thread.join()
    with server_process(*options, "--data", str(tmp_path), torn=True) as server, HullClient(server.address) as client:
        assert in_order(client.sample_points("fleet", 10**6).points) == in_order(points)
        assert client.verify("fleet").equal
        shards = client.get_hull("fleet").info.shards
        wait_until(lambda: len(rows_of(tmp_path, "SELECT name FROM hulls")) == 1 + shards)
    assert dynhull("check", tmp_path).exit_code == 0
    file = tmp_path / "points.csv"
    assert dynhull("export", "fleet", file, "--data", tmp_path).exit_code == 0
    assert in_order(np.loadtxt(file, delimiter=",", skiprows=1)) == in_order(points)


def divide(client: HullClient, shards: int) -> None:
    with suppress(DynhullError):
        client.reshard("fleet", shards)


# Copies


class Marks:
    """Batches of one point each, by revision: what a copy must have of them follows from its revision."""

    def __init__(self, client: HullClient, name: str) -> None:
        self._client = client
        self._name = name
        self.acknowledged = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._write)

    @staticmethod
    def points(revision: int) -> np.ndarray:
        """The points at a revision: every third batch has replaced the point of the one before it."""
        numbers = np.arange(1, revision + 1)
        left = numbers[(numbers % 3 != 2) | (numbers == revision)]
        return np.column_stack([left, left * left % 1009]).astype(float)

    def _write(self) -> None:
        while not self._stop.is_set():
            number = self.acknowledged + 1
            point, before = ([[each, each * each % 1009]] for each in (number, number - 1))
            gone = before if number % 3 == 0 else None
            self._client.apply(self._name, insert=point, delete=gone, producer="ship", sequence=number)
            self.acknowledged = number

    def __enter__(self) -> "Marks":
        self._thread.start()
        return self

    def stop(self) -> None:
        """End with the batch that is under way."""
        self._stop.set()
        self._thread.join()

    def __exit__(self, *_: object) -> None:
        self.stop()


def in_order(points: np.ndarray) -> list[list[float]]:
    return sorted(points.tolist())


# Of worker 0 and of worker 1: where the root of one is, the other has a shard.
HERDS = "north/a", "cows/a"


@slow
@pytest.mark.parametrize("options", [pytest.param((), marks=with_all_cases), WORKERS], ids=["process", "workers"])
def test_copies_beside_writes_are_of_one_revision(
    tmp_path: Path, options: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """On a machine so busy that some time passes between the moments of the parts."""
    read = copies.format_of
    monkeypatch.setattr(copies, "format_of", lambda *given: (pause(0.02), read(*given))[1])
    data, made = tmp_path / "data", [tmp_path / f"copy{i}" for i in range(LIVES)]
    spans = []
    with (
        server_process(*options, "--data", str(data), "--snapshot-points", "10") as server,
        HullClient(server.address) as client,
    ):
        for name in HERDS:
            client.create_hull(name, shards=SHARDS)
        with Marks(client, HERDS[0]) as one, Marks(client, HERDS[1]) as other:
            for copy in made:
                wait_until(lambda: min(one.acknowledged, other.acknowledged) > 40 * (len(spans) + 1))
                before = [each.acknowledged for each in (one, other)]
                done = dynhull("backup", copy, "--data", data)
                assert done.exit_code == 0, done.stderr
                spans.append([*zip(before, [each.acknowledged + 1 for each in (one, other)], strict=True)])
            file = tmp_path / "points.csv"
            done = dynhull("export", HERDS[0], file, "--data", data)
            assert done.exit_code == 0, done.stderr
            assert in_order(np.loadtxt(file, delimiter=",", skiprows=1)) == in_order(
                Marks.points(int(done.stdout.split()[-1]))
            )
    for copy, span in zip(made, spans, strict=True):
        assert dynhull("check", copy).exit_code == 0
        for name, (least, most) in zip(HERDS, span, strict=True):
            file = tmp_path / f"{copy.name}.csv"
            done = dynhull("export", name, file, "--data", copy)
            revision = int(done.stdout.split()[-1])
            assert least <= revision <= most
            assert in_order(np.loadtxt(file, delimiter=",", skiprows=1)) == in_order(Marks.points(revision))
    new = tmp_path / "new"
    done = dynhull("restore", made[-1], "--data", new)
    assert done.exit_code == 0, done.stderr
    with server_process(*options, "--data", str(new)) as server, HullClient(server.address) as client:
        for name, (least, most) in zip(HERDS, spans[-1], strict=True):
            info = client.get_hull(name).info
            assert least <= info.revision <= most
            points = Marks.points(info.revision)
            assert in_order(client.sample_points(name, 10**6).points) == in_order(points)
            assert client.verify(name).equal
            again = client.apply(name, insert=[[0, 0]], producer="ship", sequence=info.revision + 1)
            assert again.points == len(points) + 1


def test_a_shard_of_another_moment_is_not_restored(tmp_path: Path) -> None:
    data, old = tmp_path / "data", tmp_path / "old"
    for _ in range(2):
        with server_process(*WORKERS, "--data", str(data)) as server, HullClient(server.address) as client:
            client.create_hull("north/a", shards=2, exist_ok=True)  # of worker 0
            client.apply("north/a", insert=np.random.default_rng(1).normal(size=(50, 2)))
        if not old.exists():
            shutil.copytree(data / "worker-1", old)
    checked = dynhull("check", data)
    assert checked.exit_code == 0
    assert all(
        words in checked.stdout for words in ("worker-0: 1 hull, 1 shard, all", "worker-1: 0 hulls, 1 shard, all")
    )
    shutil.rmtree(data / "worker-1")
    shutil.copytree(old, data / "worker-1")
    for done in (dynhull("check", data), dynhull("backup", tmp_path / "copy", "--data", data)):
        assert done.exit_code != 0
        assert "shard 1 of hull 'north/a' is at step 1, not 2" in done.stderr
    assert not (tmp_path / "copy").exists()


@pytest.mark.parametrize("kind", SOME_KINDS)
def test_an_export_has_the_rows_of_one_hull(tmp_path: Path, kind: str) -> None:
    data, settings = tmp_path / "data", KINDS[kind]
    with server_process(*WORKERS, "--data", str(data)) as server, HullClient(server.address) as client:
        client.create_hull("h/one", **settings)
        client.create_hull("h/many", shards=SHARDS, **settings)
        client.create_hull("h/none", shards=SHARDS, **settings)
        batches = Batches(settings, seed=7)
        for _ in range(20):
            batch = batches.next()
            for name in ("h/one", "h/many"):
                batches.apply(client, name, batch)
        exported = []
        for name in ("one", "many", "none"):
            file = tmp_path / f"{name}.csv"
            done = dynhull("export", f"h/{name}", file, "--data", data)
            assert done.exit_code == 0, done.stderr
            header, *rows = file.read_text().splitlines()
            exported.append((header, rows if "keyed" in settings else sorted(rows)))
    one, many, none = exported
    assert many == one
    assert one[1]
    assert none == (one[0], [])


def test_what_is_about_the_past_is_refused_by_name(client: HullClient) -> None:
    client.create_hull("past/big", keyed="str", shards=SHARDS)
    client.put("past/big", ["a", "b"], [(0, 0), (1, 1)])
    square = [[0, 0], [1, 0], [1, 1]]
    for call in (
        lambda: client.at("past/big", 0),
        lambda: list(client.replay("past/big")),
        lambda: client.track("past/big", ["a"]),
        lambda: next(client.feed("past/big", after=0)),
        lambda: next(client.feed("past/big", consumer="c")),
        lambda: client.ack_feed("past/big", consumer="c", after=0),
        lambda: client.erase_history("past/big", ["z"]),
        lambda: client.set_history("past/big", "1d"),
        lambda: list(client.fence_events_between(square, "past/big")),
        lambda: list(client.fence_events_between(square, Prefix("past/"))),
    ):
        with pytest.raises(HullUnsuitableError, match="'past/big' is divided among shards"):
            call()
    assert list(client.list_feed_consumers("past/big")) == []
    client.delete_hull("past/big")
