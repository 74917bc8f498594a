"""The short way of Locate beside the whole way: the same bytes, refusals and counts."""

import asyncio
import hashlib
import inspect
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import grpc
import numpy as np
import pytest
from live_engine import engine_in_memory, insert
from metrics import measured, scrape
from server_process import server_process

from dynhull_client import HullClient
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server.rpc.access import EVERYTHING, Access
from dynhull_server.rpc.calls import UnaryHandler
from dynhull_server.rpc.short_locates import MOST_KNOWN, MOST_POINTS, ShortLocates

LOCATE = "/dynhull.v1.HullService/Locate"
COUNTS = 'dynhull_calls_total{code="OK",method="Locate"}', 'dynhull_call_duration_seconds_count{method="Locate"}'
NAN, INFINITY = float("nan"), float("inf")

Answer = tuple[Any, ...]
Ask = Callable[[bytes], Answer]


def request(name: str, points: object) -> bytes:
    """A request as every client writes it."""
    packed = np.array(points, "<f8").tobytes()
    message = pb.LocateRequest(name=name, points={"packed": packed})
    data: bytes = message.SerializeToString()
    return data


def in_another_order(data: bytes) -> bytes:
    """The same request with its name at the end, which no short way reads."""
    message = pb.LocateRequest.FromString(data)
    name = pb.LocateRequest(name=message.name).SerializeToString()
    message.ClearField("name")
    rest: bytes = message.SerializeToString()
    return rest + name


@pytest.fixture
def ask(channel: grpc.Channel) -> Ask:
    """The bytes of an answer, or all of a refusal."""
    call: Any = channel.unary_unary(LOCATE)

    def answer(data: bytes) -> Answer:
        try:
            return "OK", call(data)
        except grpc.RpcError as error:
            return error.code(), error.details(), error.trailing_metadata()

    return answer


def same(ask: Ask, data: bytes) -> Answer:
    """The answer both ways, several times: the first one learns, and the others know."""
    whole = ask(in_another_order(data))
    for _ in range(3):
        assert ask(data) == whole
    return whole


def test_equal_at_each_revision(ask: Ask, client: HullClient, hull: str) -> None:
    random = np.random.default_rng(1)
    corners = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0]]
    steps = [None, *corners, *random.normal(size=(300, 2)).tolist()]
    for revision, step in enumerate(steps):
        if step is not None:
            client.apply(hull, insert=[step])
        if revision > 6 and revision not in (127, 128, 129, 300):
            continue
        for count in range(MOST_POINTS + 2):
            points = np.concatenate((random.uniform(-1, 5, size=(count, 2)), [[2.0, 0.0], [-0.0, 4.0]]))[:count]
            code, data = same(ask, request(hull, points))
            response = pb.LocateResponse.FromString(data)
            assert (code, response.revision, len(response.sides)) == ("OK", revision, count)
    inside, corner, edge, outside = [1.0, 1.0], [4.0, 4.0], [2.0, 0.0], [99.0, 0.0]
    client.apply(hull, delete=steps[5:])
    _, data = same(ask, request(hull, [inside, corner, edge, outside]))
    assert np.frombuffer(pb.LocateResponse.FromString(data).sides, np.int8).tolist() == [1, 0, 0, -1]


@pytest.mark.parametrize("point", [[NAN, 0.0], [0.0, INFINITY], [0.0, -INFINITY]])
def test_equal_refusals_of_points(ask: Ask, hull: str, point: list[float]) -> None:
    assert same(ask, request(hull, [point]))[0] == grpc.StatusCode.INVALID_ARGUMENT


@pytest.mark.parametrize("name", ["", "a b", "ä", "no-such-hull", "x" * 127, "x" * 128, "x" * 201])
def test_equal_refusals_of_names(ask: Ask, name: str) -> None:
    code = same(ask, request(name, [[0.0, 0.0]]))[0]
    assert code in (grpc.StatusCode.INVALID_ARGUMENT, grpc.StatusCode.NOT_FOUND)


@pytest.mark.parametrize("cut", range(1, 12))
def test_refuses_what_is_no_message(ask: Ask, hull: str, cut: int) -> None:
    data = request(hull, [[0.0, 0.0]])
    assert ask(data) == ("OK", pb.LocateResponse(sides=b"\xff").SerializeToString())
    assert ask(data[:-cut])[0] == grpc.StatusCode.INVALID_ARGUMENT


def test_equal_with_other_fields(ask: Ask, client: HullClient, hull: str) -> None:
    client.apply(hull, insert=[[0, 0], [9, 0], [0, 9], [1, 1], [2, 1], [1, 2]])
    data = request(hull, [[0.5, 0.5]])
    plain = same(ask, data)
    assert ask(data + pb.LocateRequest(layer=2).SerializeToString()) != plain
    assert ask(data + pb.LocateRequest(min_revision=1).SerializeToString()) == plain
    doubled = data + request("", [[50.0, 50.0]])  # of a field that comes twice, the last one counts
    assert ask(doubled) == ask(request(hull, [[50.0, 50.0]])) != plain


def test_another_hull_of_the_name(ask: Ask, client: HullClient, hull: str) -> None:
    data = request(hull, [[1.0, 1.0]])
    client.apply(hull, insert=[[0, 0], [9, 0], [0, 9]])
    inside = same(ask, data)
    client.delete_hull(hull)
    assert same(ask, data)[0] == grpc.StatusCode.NOT_FOUND
    client.create_hull(hull, keyed="str")
    assert same(ask, data) != inside
    client.put(hull, ["a", "b", "c"], [[0, 0], [9, 0], [0, 9]])
    assert same(ask, data) == inside
    client.delete_hull(hull)
    client.create_hull(hull, geographic=True)
    client.apply(hull, insert=[[0, 0], [9, 0], [0, 9]])
    assert same(ask, data) == inside
    assert same(ask, request(hull, [[999.0, 1.0]]))[0] == grpc.StatusCode.INVALID_ARGUMENT


def test_equal_counts_of_calls() -> None:
    ways: dict[str, Callable[[bytes], bytes]] = {"short": lambda data: data, "whole": in_another_order}
    counted: dict[str, float] = {}
    with measured("--create-on-write") as (server, metrics), grpc.insecure_channel(server.address) as channel:
        with HullClient(server.address) as client:
            client.apply("a", insert=[[0, 0], [9, 0], [0, 9]])
        call: Any = channel.unary_unary(LOCATE)
        for way, written in ways.items():
            before = scrape(metrics)
            for _ in range(5):
                call(written(request("a", [[1.0, 1.0]])))
            now = scrape(metrics)
            counted[way] = sum(now[each] - before.get(each, 0) for each in now if each.startswith(COUNTS))
    assert counted == {"short": 10, "whole": 10}


def test_equal_with_tokens(tmp_path: Path) -> None:
    def entry(token: str, read: list[str], write: list[str]) -> str:
        return f'[[token]]\nsha256 = "{hashlib.sha256(token.encode()).hexdigest()}"\nread = {read}\nwrite = {write}\n'

    tokens = tmp_path / "tokens.toml"
    tokens.write_text(entry("root", [""], [""]) + entry("fleet", ["fleet/"], []))
    options = "--tokens", str(tokens), "--create-on-write", "--log-level", "error"
    with server_process(*options) as server, grpc.insecure_channel(server.address) as channel:
        with HullClient(server.address, token="root") as client:
            for name in ("fleet/a", "plane"):
                client.apply(name, insert=[[0, 0], [9, 0], [0, 9]])
        call: Any = channel.unary_unary(LOCATE)

        def ask(token: str, data: bytes) -> Answer:
            try:
                return "OK", call(data, metadata=(("authorization", f"Bearer {token}"),))
            except grpc.RpcError as error:
                return error.code(), error.details(), error.trailing_metadata()

        expected = {
            ("root", "plane"): "OK",
            ("root", "fleet/a"): "OK",
            ("fleet", "fleet/a"): "OK",
            ("fleet", "plane"): grpc.StatusCode.PERMISSION_DENIED,
            ("fleet", "none"): grpc.StatusCode.PERMISSION_DENIED,
            ("wrong", "plane"): grpc.StatusCode.UNAUTHENTICATED,
        }
        for _ in range(2):
            for (token, name), code in expected.items():
                found = same(partial(ask, token), request(name, [[1.0, 1.0]]))
                assert found[0] == code


def test_which_way() -> None:
    """What is small goes the short way, and so many hulls of any names do not fill the memory."""

    async def check() -> None:
        async with engine_in_memory() as engine:
            await insert(engine, "a", np.array([[0.0, 0.0], [9.0, 0.0], [0.0, 9.0]]))
            short, nobody = ShortLocates(engine.hulls), Access(("b",), ())
            for count in range(1, MOST_POINTS + 1):
                data = request("a", [[1.0, 1.0]] * count)
                assert short.answer(data, nobody) is None
                answer = short.answer(data, EVERYTHING)
                assert answer == pb.LocateResponse(revision=1, sides=b"\1" * count).SerializeToString()
                assert short.answer(data, nobody) is None
                assert short.answer(in_another_order(data), EVERYTHING) is None
            for points in ([], [[1.0, 1.0]] * (MOST_POINTS + 1)):
                assert short.answer(request("a", points), EVERYTHING) is None
            known = len(short)
            for number in range(MOST_KNOWN):
                assert short.answer(request(f"no-{number}", [[1.0, 1.0]]), EVERYTHING) is None
            assert len(short) == known == MOST_POINTS

    asyncio.run(check())


def test_grpc_need_not_ask_what_a_handler_is() -> None:
    """Of each handler of one response it asks twice a call whether it is awaitable, and then more if it is not."""

    async def handle(request: object, _: object) -> object:
        return request

    handler = UnaryHandler(handle)
    assert inspect.isawaitable(handler)
    assert asyncio.run(handler("request", None)) == "request"  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="has to be called"):
        handler.__await__()
