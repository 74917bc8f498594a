"""The client against a real server: arrays in, arrays out, errors of the right class at the right place."""

import threading
from collections.abc import Iterator

import grpc
import numpy as np
import pytest
from patience import PATIENCE
from proxy import proxy
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import (
    Applied,
    DeadlineError,
    DynhullError,
    HullClient,
    HullCopy,
    HullExistsError,
    HullNotFoundError,
    InvalidRequestError,
    LimitExceededError,
    PointMissingError,
    Progress,
    Snapshot,
    UnavailableError,
)

SQUARE = [[0, 0], [4, 0], [5, 2], [4, 4], [2, 3], [0, 4], [1, 2], [2, 1]]
CORNERS = [[0, 0], [4, 0], [5, 2], [4, 4], [0, 4]]


@pytest.fixture
def client(address: str, connect: type[HullClient]) -> Iterator[HullClient]:
    with connect(address) as client:
        yield client


@pytest.fixture
def hull(client: HullClient, name: str) -> str:
    client.create_hull(name)
    return name


@pytest.mark.parametrize(
    ("given", "address"),
    [
        ("example.org", "example.org:50051"),
        ("https://example.org/", "example.org:50051"),
        ("grpcs://example.org:443", "example.org:443"),
        ("::1", "[::1]:50051"),
        ("[::1]", "[::1]:50051"),
        ("http://[fe80::1%eth0]:7", "[fe80::1%eth0]:7"),
        ("unix:/run/dynhull.sock", "unix:/run/dynhull.sock"),
        ("dns:///example.org:7", "dns:///example.org:7"),
    ],
)
def test_addresses_as_people_write_them(connect: type[HullClient], given: str, address: str) -> None:
    with connect(given) as client:
        assert client.address == address


def test_an_address_may_ask_for_encryption(address: str, connect: type[HullClient]) -> None:
    with connect(f"http://{address}") as client:
        list(client.list_hulls())
    with connect(f"https://{address}", timeout=PATIENCE) as client, pytest.raises(UnavailableError):
        list(client.list_hulls())


@pytest.mark.parametrize("address", ["127.0.0.1:abc", "ftp://a", "", "a b"])
def test_bad_addresses_are_refused(connect: type[HullClient], address: str) -> None:
    with pytest.raises(ValueError, match=f"address {address!r}.* Write HOST or HOST:PORT"):
        connect(address)


def test_an_address_is_a_string(connect: type[HullClient]) -> None:
    with pytest.raises(TypeError, match="address is None: must be a string"):
        connect(None)  # type: ignore[arg-type]


def test_a_hull_from_creation_to_deletion(client: HullClient, name: str) -> None:
    info = client.create_hull(name)
    assert (info.name, info.revision, info.points, info.distinct) == (name, 0, 0, 0)
    assert client.apply(name, insert=SQUARE) == Applied(1, 8, 0, 0, True, 8)
    hull = client.get_hull(name)
    assert hull.vertices.dtype == np.float64
    assert hull.vertices.tolist() == CORNERS
    assert (hull.revision, hull.info.points, hull.info.created) == (1, 8, info.created)
    expected = DynamicHull(SQUARE)
    assert (hull.measures.area, hull.measures.perimeter) == (expected.area, expected.perimeter)
    assert (hull.measures.centroid, hull.measures.bounds) == (expected.centroid, expected.bounds)
    located = client.locate(name, [[1, 1], [0, 2], [9, 9]])
    assert (located.revision, located.sides.dtype, located.sides.tolist()) == (1, np.int8, [1, 0, -1])
    verification = client.verify(name)
    assert verification.equal
    assert verification.difference is None
    assert [each.closed for each in verification.rounds] == [False, False, True]
    client.delete_hull(name)
    with pytest.raises(HullNotFoundError):
        client.get_hull(name)


def test_a_hull_may_exist_already(client: HullClient, name: str) -> None:
    assert client.create_hull(name, exist_ok=True).revision == 0
    client.apply(name, insert=SQUARE)
    info = client.create_hull(name, exist_ok=True)
    assert (info.name, info.revision, info.points) == (name, 1, 8)
    with pytest.raises(HullExistsError):
        client.create_hull(name)
    with pytest.raises(InvalidRequestError):
        client.create_hull("a b", exist_ok=True)


def test_waiting_for_a_hull(address: str, connect: type[HullClient], name: str) -> None:
    with proxy(address) as way, connect(way.address) as waiting, HullClient(address) as client:
        with pytest.raises(DeadlineError, match=f"not within 0.2 s: .*{name}"):
            waiting.wait_for_hull(name, timeout=0.2)
        way.flowing.clear()
        with pytest.raises(DeadlineError, match=f"not within 0.2 s: no server has said whether hull '{name}' exists"):
            waiting.wait_for_hull(name, timeout=0.2)
        way.flowing.set()
        way.server = "127.0.0.1:1"
        way.cut()
        found = []
        thread = threading.Thread(target=lambda: found.append(waiting.wait_for_hull(name, min_revision=2)))
        thread.start()
        way.server = address
        client.create_hull(name)
        client.apply(name, insert=SQUARE)
        client.apply(name, delete=SQUARE[:1])
        thread.join()
        assert [(info.revision, info.points) for info in found] == [(2, 7)]


def test_points_without_a_name_are_an_error_that_says_what_to_write(client: HullClient, hull: str) -> None:
    with pytest.raises(TypeError, match=rf"write apply\('{hull}', insert=points\) or apply\('{hull}', delete=points\)"):
        client.apply(hull, SQUARE)
    assert client.get_hull(hull).revision == 0


def test_moves_and_counted_deletes(client: HullClient, hull: str) -> None:
    client.apply(hull, insert=SQUARE)
    move = (np.array([[5, 2]]), np.array([[7, 2]], np.float32))
    assert client.apply(hull, move=move) == Applied(2, 1, 1, 0, True, 8)
    assert client.apply(hull, delete=[[9, 9], [2, 1]], missing="count") == Applied(3, 0, 1, 1, False, 7)


def test_lists_fetch_all_pages(client: HullClient, name: str) -> None:
    names = [f"{name}/{i:03}" for i in range(205)]
    for each in names:
        client.create_hull(each)
    assert [info.name for info in client.list_hulls(f"{name}/")] == names
    assert list(client.list_hulls(f"{name}/no")) == []


def test_ingest(client: HullClient, hull: str) -> None:
    points = np.random.default_rng(1).normal(size=(100, 20, 2))
    with client.ingest(hull) as stream:
        for batch in points:
            stream.apply(insert=batch)
        stream.apply(delete=points[0], move=(points[1], points[2]))
    assert stream.summary.batches == 101
    assert (stream.summary.inserted, stream.summary.deleted, stream.summary.missing) == (2020, 40, 0)
    assert (stream.summary.revision, stream.summary.points) == (101, 1980)
    expected = DynamicHull(np.concatenate((points[2], *points[2:])))
    assert client.get_hull(hull).vertices.tolist() == expected.vertices().tolist()


def test_an_ingest_of_nothing_changes_nothing(client: HullClient, hull: str) -> None:
    with client.ingest(hull) as stream:
        assert stream.summary is None
    assert (stream.summary.batches, stream.summary.revision) == (0, 0)


def test_the_next_apply_raises_the_servers_error(client: HullClient, hull: str) -> None:
    def apply_for_ever() -> None:
        with client.ingest(hull) as stream:
            stream.apply(insert=SQUARE)
            stream.apply(delete=[[4, 0], [8, 8]])
            while True:
                stream.apply(insert=SQUARE)

    with pytest.raises(PointMissingError) as caught:
        apply_for_ever()
    error = caught.value
    assert (error.field, error.row, error.value, error.batch) == ("batch.deletes", 1, "(8.0, 8.0)", 1)
    assert client.get_hull(hull).revision == 1


def test_leaving_an_ingest_raises_the_servers_error(client: HullClient, hull: str) -> None:
    stream = client.ingest(hull)
    with pytest.raises(PointMissingError), stream:
        stream.apply(delete=[[8, 8]])
    assert stream.summary is None
    with pytest.raises(HullNotFoundError), client.ingest("nobody"):
        pass


def test_leaving_with_an_exception_cancels_an_ingest(client: HullClient, hull: str) -> None:
    stream = client.ingest(hull)

    def fail_half_way() -> None:
        with stream:
            stream.apply(insert=SQUARE)
            client.get_hull(hull, min_revision=1)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail_half_way()
    assert stream.summary is None
    assert client.get_hull(hull).info.points == 8


def test_an_ingest_is_used_once_and_inside_its_context(client: HullClient, hull: str) -> None:
    stream = client.ingest(hull)
    with pytest.raises(RuntimeError, match="context"):
        stream.apply(insert=SQUARE)
    with stream:
        stream.apply(insert=SQUARE)
    with pytest.raises(RuntimeError, match="left"):
        stream.apply(insert=SQUARE)
    with pytest.raises(RuntimeError, match="once"), stream:
        pass


def test_a_bad_array_is_refused_before_it_is_sent(client: HullClient, hull: str) -> None:
    with pytest.raises(ValueError, match="insert row 1"):
        client.apply(hull, insert=[[0, 0], [np.nan, 0]])
    with pytest.raises(TypeError, match="delete row 0"):
        client.apply(hull, delete=[["a", "b"]])
    with pytest.raises(ValueError, match="1 origins and 2 destinations"):
        client.apply(hull, move=([[0, 0]], [[0, 0], [1, 1]]))
    with pytest.raises(ValueError, match="missing"):
        client.apply(hull, missing="perhaps")
    with client.ingest(hull) as stream:
        with pytest.raises(ValueError, match="insert must have shape"):
            stream.apply(insert=[1, 2])
        stream.apply(insert=[[1, 2]])
    assert client.get_hull(hull).revision == 1


def test_errors_are_typed_and_say_what_is_at_fault(client: HullClient, hull: str) -> None:
    with pytest.raises(HullExistsError, match=hull) as exists:
        client.create_hull(hull)
    assert exists.value.code == grpc.StatusCode.ALREADY_EXISTS
    with pytest.raises(InvalidRequestError) as invalid:
        client.create_hull("a b")
    assert isinstance(invalid.value, ValueError)
    assert (invalid.value.field, invalid.value.row, invalid.value.value) == ("name", None, "a b")
    with pytest.raises(PointMissingError) as missing:
        client.apply(hull, delete=[[1, 2]])
    assert (missing.value.reason, missing.value.row) == ("POINT_MISSING", 0)
    with pytest.raises(DeadlineError):
        client.get_hull(hull, min_revision=5, timeout=0.1)
    with pytest.raises(HullNotFoundError):
        next(client.watch("nobody"))
    errors = (exists, invalid, missing)
    assert all(isinstance(each.value, DynhullError) for each in errors)


def test_limits_and_a_server_that_goes_away(connect: type[HullClient]) -> None:
    limits = ("--max-hulls", "1", "--max-message-bytes", "4096")
    with server_process(*limits) as server, connect(server.address) as client:
        client.create_hull("a/one")
        with pytest.raises(LimitExceededError) as hulls:
            client.create_hull("a/two")
        assert (hulls.value.reason, hulls.value.value) == ("LIMIT_EXCEEDED", "1")
        with pytest.raises(LimitExceededError, match="4096"):
            client.apply("a/one", insert=np.zeros((4096, 2)))
        watch = client.watch("a/one", reconnect=False)
        assert isinstance(next(watch), Snapshot)
        server.process.terminate()
        with pytest.raises(UnavailableError, match="shutting down"):
            list(watch)
        server.process.wait()
        with pytest.raises(UnavailableError):
            client.get_hull("a/one")
        with pytest.raises(DeadlineError), connect(server.address, wait_for_ready=True, timeout=0.1) as patient:
            patient.get_hull("a/one")


def test_a_copy_follows_its_hull(client: HullClient, hull: str) -> None:
    copy = HullCopy()
    with client.watch(hull) as watch, client.ingest(hull) as stream:
        for revision, batch in enumerate(np.random.default_rng(2).normal(size=(50, 4, 2)), start=1):
            stream.apply(insert=batch)
            copy.follow(watch, revision)
            live = client.get_hull(hull, min_revision=revision)
            assert copy.revision == live.revision == revision
            assert copy.vertices.tolist() == live.vertices.tolist()
            assert copy.points == live.info.points


def test_a_watch_is_closed_by_another_thread(client: HullClient, hull: str) -> None:
    watch = client.watch(hull, progress_interval=0.001)
    events = []
    quiet = threading.Event()

    def follow() -> None:
        for event in watch:
            events.append(event)
            if isinstance(event, Progress):
                quiet.set()

    follower = threading.Thread(target=follow)
    follower.start()
    quiet.wait()
    watch.close()
    follower.join()
    assert isinstance(events[0], Snapshot)


def test_threads_share_a_client(client: HullClient, hull: str) -> None:
    def write(column: int) -> None:
        for row in range(50):
            client.apply(hull, insert=[[column, row]])

    writers = [threading.Thread(target=write, args=(column,)) for column in range(4)]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    live = client.get_hull(hull)
    assert (live.revision, live.info.points) == (200, 200)
    assert live.vertices.tolist() == [[0, 0], [3, 0], [3, 49], [0, 49]]


def test_reads_and_numbered_writes_are_tried_again(address: str, connect: type[HullClient], name: str) -> None:
    with proxy(address) as way, connect(way.address, retries=5) as client:
        client.create_hull(name)
        for call in (
            lambda: client.get_hull(name).revision,
            lambda: client.apply(name, insert=[[1, 2]], producer="p", sequence=1).revision,
        ):
            way.refusals = 1
            way.cut()
            assert call() in (0, 1)
            assert not way.refusals
        way.server = "127.0.0.1:1"
        way.cut()
        with pytest.raises(UnavailableError):
            client.apply(name, insert=[[3, 4]])
    with connect(address) as client:
        assert client.get_hull(name).revision == 1


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda client: client.get_hull("a", min_revision=-1), "min_revision must be at least 0, got -1"),
        (lambda client: client.get_hull("a", timeout=-1), "timeout must be at least 0, got -1"),
        (lambda client: client.get_hull("a", timeout=float("nan")), "timeout must be at least 0, got nan"),
        (lambda client: list(client.list_hulls(timeout=-0.5)), "timeout must be at least 0, got -0.5"),
        (lambda client: client.watch("a", min_revision=-2), "min_revision must be at least 0, got -2"),
        (lambda client: client.apply("a", producer="p", sequence=-3), "sequence must be at least 0, got -3"),
    ],
)
def test_a_number_that_no_call_can_have(client: HullClient, ask, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ask(client)


def test_what_no_connection_can_have(connect: type[HullClient]) -> None:
    with pytest.raises(ValueError, match="timeout must be at least 0, got -1"):
        connect("127.0.0.1:1", timeout=-1)
    for token in ("a\nb", "ä", "a b"):
        with pytest.raises(ValueError, match="token must consist of printable ASCII characters without") as caught:
            connect("127.0.0.1:1", token=token)
        assert token not in str(caught.value)


def test_a_revision_that_does_not_come(client: HullClient, hull: str) -> None:
    with pytest.raises(DeadlineError, match=f"longer than 0.1 s; hull '{hull}' may not have reached revision 7"):
        client.get_hull(hull, min_revision=7, timeout=0.1)


def test_clients_with_other_tokens_share_a_connection(connect: type[HullClient], address: str, name: str) -> None:
    with connect(address) as client:
        other = client.with_token("another")
        other.create_hull(name)
        assert client.get_hull(name).revision == 0
        with pytest.raises(ValueError, match="printable ASCII"):
            client.with_token("a b")
    with pytest.raises(DynhullError, match="closed"):
        other.get_hull(name)
