"""Hulls in pages, for clients that receive no more than 4 MiB a message: every page is of the revision of the first."""

import asyncio
from collections.abc import Iterator
from pathlib import Path

import grpc
import numpy as np
import pytest
from cases import slow
from live_engine import engine_in_memory, insert
from refusal import refusal
from server_process import server_process

from dynhull_client import HullClient
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.engine.live_hull import LiveHull
from dynhull_server.engine.steps import at_once
from dynhull_server.engine.threads import Clock
from dynhull_server.rpc import vertex_pages
from dynhull_server.rpc.vertex_pages import VertexPages, page_token
from dynhull_server.state.errors import PagesForgottenError

COORDINATES = points_pb2.POINT_ENCODING_COORDINATES
MINUTE = 60.0


def parabola(vertices: int) -> np.ndarray:
    """Points that are all vertices of their hull, in the order in which it has them."""
    x = np.arange(vertices, dtype=float)
    return np.column_stack([x, x * x])


def pages(stub: HullServiceStub, name: str, size: int, **options: object) -> Iterator[pb.GetHullResponse]:
    token = ""
    while True:
        request = pb.GetHullRequest(name=name, vertex_page_size=size, vertex_page_token=token, **options)
        page = stub.GetHull(request)
        yield page
        token = page.next_vertex_page_token
        if not token:
            return


def xy(points: points_pb2.Points) -> np.ndarray:
    flat = np.frombuffer(points.packed) if points.packed else np.array(points.coordinates)
    return flat.reshape(-1, 2)


@slow
def test_a_plain_client_reads_a_hull_beyond_its_largest_message(
    client: HullClient, stub: HullServiceStub, hull: str
) -> None:
    vertices = parabola(270_000)
    client.apply(hull, insert=vertices)
    with pytest.raises(grpc.RpcError, match="larger than max"):
        stub.GetHull(pb.GetHullRequest(name=hull))
    read = []
    for page in pages(stub, hull, 2**31 - 1):
        read.append(page)
        client.apply(hull, insert=[[135_000.0, 1e12 + len(read)]])  # a new vertex
    assert len(read) == 2
    assert {page.hull.revision for page in read} == {1}
    assert {page.hull.point_count for page in read} == {len(vertices)}
    assert [page.HasField("measures") for page in read] == [True, False]
    np.testing.assert_array_equal(np.concatenate([xy(page.vertices) for page in read]), vertices)
    assert len(client.get_hull(hull).vertices) == len(vertices) + 1  # the SDK reads any size at once


@pytest.mark.parametrize("keyed", [None, "str", "int"])
@pytest.mark.parametrize("encoding", [points_pb2.POINT_ENCODING_PACKED, COORDINATES])
def test_pages_are_the_hull_in_parts(
    client: HullClient, stub: HullServiceStub, name: str, keyed: str | None, encoding: int
) -> None:
    client.create_hull(name, keyed=keyed)
    vertices = parabola(7)
    keys = {"str": ["a", "é", "ccc", "d", "ee", "f", "g"], "int": [9, 2**64 - 1, 3, 4, 5, 6, 7]}.get(str(keyed))
    if keys is None:
        client.apply(name, insert=vertices)
    else:
        client.put(name, keys, vertices)
    whole = stub.GetHull(pb.GetHullRequest(name=name, include_keys=True, encoding=encoding))
    read = list(pages(stub, name, 3, include_keys=True, encoding=encoding))
    assert [len(xy(page.vertices)) for page in read] == [3, 3, 1]
    np.testing.assert_array_equal(np.concatenate([xy(page.vertices) for page in read]), xy(whole.vertices))
    joined = whole.vertex_keys.__class__()
    for page in read:
        joined.MergeFrom(page.vertex_keys)
        joined.lengths, joined.text, joined.packed_integers = (
            b"".join(getattr(each.vertex_keys, field) for each in read)
            for field in ("lengths", "text", "packed_integers")
        )
    assert joined == whole.vertex_keys
    assert read[0].measures == whole.measures
    for size in (7, 100):
        (only,) = pages(stub, name, size, include_keys=True, encoding=encoding)
        assert only == whole


def test_pages_and_parts_with_the_longest_keys_are_received(
    client: HullClient, stub: HullServiceStub, name: str
) -> None:
    client.create_hull(name, keyed="str")
    keys = [f"{row:0255}" for row in range(20_000)]
    client.put(name, keys, parabola(len(keys)))
    for encoding in (points_pb2.POINT_ENCODING_PACKED, COORDINATES):
        read = pages(stub, name, len(keys), include_keys=True, encoding=encoding)
        named = [len(page.vertex_keys.lengths) or len(page.vertex_keys.strings) for page in read]
        assert len(named) > 1
        assert sum(named) == len(keys)
        parts = stub.ReadEntities(pb.ReadEntitiesRequest(name=name, encoding=encoding))
        assert sum(len(xy(part.positions)) for part in parts) == len(keys)


def test_keys_of_later_pages_are_those_of_the_first(client: HullClient, stub: HullServiceStub, name: str) -> None:
    client.create_hull(name, keyed="int")
    client.put(name, range(4), parabola(4))
    read = []
    for page in pages(stub, name, 2, include_keys=True, encoding=COORDINATES):
        read.append(page)
        client.remove(name, keys=range(4))
    assert [list(page.vertex_keys.integers) for page in read] == [[0, 1], [2, 3]]


def test_a_layer_and_the_reads_of_a_query_have_pages(client: HullClient, stub: HullServiceStub, hull: str) -> None:
    square = np.array([[0.0, 0.0], [9.0, 0.0], [9.0, 9.0], [0.0, 9.0]])
    inner = square / 3 + 3
    client.apply(hull, insert=np.concatenate([square, inner]))
    found = np.concatenate([xy(page.vertices) for page in pages(stub, hull, 3, layer=2)])
    np.testing.assert_array_equal(found, inner)
    request = pb.GetHullRequest(name=hull, vertex_page_size=3)
    first = stub.GetHull(request)
    request.vertex_page_token = first.next_vertex_page_token
    (response,) = stub.Query(iter([pb.QueryRequest(reads=[pb.Read(get_hull=request)])]))
    np.testing.assert_array_equal(xy(response.answers[0].get_hull.vertices), square[3:])


def test_a_hull_over_shards_has_pages(tmp_path: Path) -> None:
    with (
        server_process("--data", str(tmp_path)) as server,
        HullClient(server.address) as client,
        grpc.insecure_channel(server.address) as channel,
    ):
        client.create_hull("a", shards=2)
        client.apply("a", insert=parabola(9))
        found = []
        for page in pages(HullServiceStub(channel), "a", 4):
            found.append(xy(page.vertices))
            client.apply("a", delete=found[-1])
    np.testing.assert_array_equal(np.concatenate(found), parabola(9))


def test_wrong_pages_are_refused(client: HullClient, stub: HullServiceStub, hull: str) -> None:
    client.apply(hull, insert=parabola(5))
    token = stub.GetHull(pb.GetHullRequest(name=hull, vertex_page_size=2)).next_vertex_page_token
    for fields, field in (
        ({"vertex_page_size": -1}, "vertex_page_size"),
        ({"vertex_page_token": token}, "vertex_page_size"),
        ({"vertex_page_size": 1, "vertex_page_token": "nonsense"}, "vertex_page_token"),
        ({"vertex_page_size": 1, "vertex_page_token": "a:1:²"}, "vertex_page_token"),
    ):
        code, info, _ = refusal(lambda fields=fields: stub.GetHull(pb.GetHullRequest(name=hull, **fields)))
        assert code is grpc.StatusCode.INVALID_ARGUMENT
        assert (info.reason, info.metadata["field"]) == ("INVALID_FIELD", field)
    assert not list(pages(stub, hull, 2))[-1].next_vertex_page_token
    beyond = token.rpartition(":")[0] + f":{10**19}"
    rest = stub.GetHull(pb.GetHullRequest(name=hull, vertex_page_size=2, vertex_page_token=beyond))
    assert (len(rest.vertices.packed), rest.next_vertex_page_token) == (0, "")


def forgotten(stub: HullServiceStub, name: str, token: str) -> bool:
    """Whether the page of a token is refused, for want of its revision."""
    request = pb.GetHullRequest(name=name, vertex_page_size=2, vertex_page_token=token)
    code, info, _ = refusal(lambda: stub.GetHull(request))
    return code is grpc.StatusCode.OUT_OF_RANGE and info.reason == "REVISION_FORGOTTEN"


def test_pages_of_a_hull_made_again_are_refused(client: HullClient, stub: HullServiceStub, hull: str) -> None:
    client.apply(hull, insert=parabola(5))
    token = stub.GetHull(pb.GetHullRequest(name=hull, vertex_page_size=2)).next_vertex_page_token
    client.delete_hull(hull)
    client.create_hull(hull)
    client.apply(hull, insert=parabola(5))
    assert forgotten(stub, hull, token)
    of_another_server = "f" * 16 + ":1:2"
    assert forgotten(stub, hull, of_another_server)


class HandClock(Clock):
    """Its time passes when a test says so."""

    now = 0.0

    def monotonic(self) -> float:
        return self.now


async def first_page(pages: VertexPages, hull: LiveHull) -> pb.GetHullRequest:
    """Read a page of two vertices; returns the request for the next one."""
    found, _ = await pages.read(hull, pb.GetHullRequest(name="a", vertex_page_size=2), lambda _: at_once)
    token = page_token(hull.uid, found.counts.revision, 2)
    return pb.GetHullRequest(name="a", vertex_page_size=2, vertex_page_token=token)


def test_pages_are_kept_for_a_minute_after_the_last() -> None:
    async def check() -> None:
        clock = HandClock()
        pages = VertexPages(clock)
        async with engine_in_memory() as engine:
            await insert(engine, "a", parabola(9))
            hull = engine.hulls.get("a")
            following = await first_page(pages, hull)
            await insert(engine, "a", np.array([[3.0, 100.0]]))
            for _ in range(3):
                clock.now += 0.9 * MINUTE
                found, _ = await pages.read(hull, following, lambda _: at_once)
                assert found.counts.revision == 1
            clock.now += 1.1 * MINUTE
            with pytest.raises(PagesForgottenError):
                await pages.read(hull, following, lambda _: at_once)

    asyncio.run(check())


def test_what_is_kept_for_pages_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a MiB of vertices, those of the last revisions are kept."""
    monkeypatch.setattr(vertex_pages, "KEPT_BYTES", 2**20)

    async def check() -> None:
        pages, following = VertexPages(Clock()), []
        async with engine_in_memory() as engine:
            await insert(engine, "a", parabola(2**13))
            hull = engine.hulls.get("a")
            for row in range(9):  # 128 KiB each
                following.append(await first_page(pages, hull))
                await insert(engine, "a", np.array([[1.0, row + 2.0]]))
            with pytest.raises(PagesForgottenError):
                await pages.read(hull, following[0], lambda _: at_once)
            found, _ = await pages.read(hull, following[-1], lambda _: at_once)
            assert found.counts.revision == len(following)

    asyncio.run(check())
