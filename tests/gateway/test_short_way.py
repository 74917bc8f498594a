"""What is answered the short way, small changes and locates, is answered as by the routes that describe it."""

from concurrent.futures import ThreadPoolExecutor
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gateway_process import Answer, Gateway, gateway_process
from server_process import server_process

from dynhull import DynamicHull

SHORT, ROUTE = "application/json", "application/json; charset=utf-8"  # the short way takes the first alone
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
POINT = '{"points": [[1, 1]'

BODIES = [
    '{"points": []}',
    POINT + ", [4, 2], [9, 9], [-0.0, 0.0]]}",
    '{"points": [[5e-324, 1], [1e308, -1e308]]}',
    '\ufeff{"points": [[1, 1]]}',
    POINT + '], "keys": null}',
    POINT + '], "keys": ["a"]}',
    POINT + '], "keys_of": "other"}',
    POINT + '], "layer": 2}',
    POINT + ", [1, null]]}",
    POINT + ", [1]]}",
    POINT + ", [1, 1e999]]}",
    POINT + ", [9007199254740993, 1]]}",
    POINT + ', [1, "2"]]}',
    '{"points": {"x": 1}}',
    "[[1, 1]]",
    "{}",
    "null",
    "",
    '{"points": [[1, 1]',
]


def both(gateway: Gateway, path: str, body: str, **headers: str) -> list[Answer]:
    return [gateway.post(path, body.encode(), kind, **headers) for kind in (SHORT, ROUTE)]


@pytest.mark.parametrize("body", BODIES)
@pytest.mark.parametrize("hull", ["there", "away"])
def test_a_locate_is_answered_as_by_its_route(gateway: Gateway, name: str, body: str, hull: str) -> None:
    gateway.post("/hulls", {"name": f"{name}/there"})
    gateway.post(f"/hulls/{name}%2Fthere/points", SQUARE)
    short, route = both(gateway, f"/hulls/{name}%2F{hull}/locate", body)
    assert (short.status, short.body) == (route.status, route.body)
    assert short.headers["Content-Type"] == route.headers["Content-Type"]


def test_a_change_is_refused_as_by_its_route(gateway: Gateway, name: str) -> None:
    gateway.post("/hulls", {"name": name, "keyed": "str"})
    at = f"/hulls/{name}/points"
    for body in ("[[1, 1]]", '{"keys": ["a", "a"], "points": [[1, 1], [2, 2]]}', '{"keys": [1], "points": [[1, 1]]}'):
        short, route = both(gateway, at, body)
        assert (short.status, short.body) == (route.status, route.body)
        assert short.status >= 400
    assert gateway.get(f"/hulls/{name}").json["info"]["revision"] == 0


@pytest.mark.parametrize(("first", "second", "status"), [("Basic x", "Bearer y", 401), ("Bearer y", "Basic x", 404)])
def test_of_two_tokens_the_first_counts(gateway: Gateway, name: str, first: str, second: str, status: int) -> None:
    tokens = {"Authorization": first, "authorization": second}
    short, route = both(gateway, f"/hulls/{name}/locate", POINT + "]}", **tokens)
    assert (short.status, short.body) == (route.status, route.body)
    assert short.status == status


def test_many_locates_at_once_have_their_own_answers(gateway: Gateway, name: str) -> None:
    """Also beside some that are refused."""
    gateway.post("/hulls", {"name": name})
    gateway.post(f"/hulls/{name}/points", SQUARE)
    points = np.random.default_rng(5).integers(-2, 7, (400, 3, 2)).tolist()
    tree = DynamicHull(SQUARE)

    def ask(turn: int) -> tuple[int, Any]:
        if turn % 7 == 3:
            return gateway.post(f"/hulls/{name}-away/locate", {"points": points[turn]}).status, None
        answer = gateway.post(f"/hulls/{name}/locate", {"points": points[turn]})
        return answer.status, answer.json["sides"]

    with ThreadPoolExecutor(32) as pool:
        answers = list(pool.map(ask, range(400)))
    for turn, (status, sides) in enumerate(answers):
        expected = (404, None) if turn % 7 == 3 else (200, tree.locate(points[turn]).tolist())
        assert (status, sides) == expected


def test_who_was_told_of_a_change_locates_with_it(gateway: Gateway, name: str) -> None:
    """Gathered with others or not: a caller's own change is in what it asks afterwards."""
    gateway.post("/hulls", {"name": name})
    gateway.post(f"/hulls/{name}/points", SQUARE)

    def grow(number: int) -> list[int]:
        corner = [5 + number, 5 + number]
        gateway.post(f"/hulls/{name}/points", [corner])
        return gateway.post(f"/hulls/{name}/locate", {"points": [corner, [-1, -1]]}).json["sides"]

    with ThreadPoolExecutor(16) as pool:
        for own, outside in pool.map(grow, range(64)):
            assert own >= 0, "inside, or on the boundary"
            assert outside == -1


def test_each_caller_asks_with_its_own_token(tmp_path: Path) -> None:
    tokens = tmp_path / "tokens.toml"
    rights = {"reader": 'read = [""]\nwrite = []', "writer": 'read = [""]\nwrite = [""]', "stranger": 'read = ["b"]'}
    digests = {name: sha256(name.encode()).hexdigest() for name in rights}
    tokens.write_text("".join(f'[[token]]\nsha256 = "{digests[name]}"\n{each}\n' for name, each in rights.items()))
    with (
        server_process("--tokens", str(tokens), "--log-level", "error") as server,
        gateway_process(server.address) as gateway,
        ThreadPoolExecutor(24) as pool,
    ):
        assert gateway.post("/hulls", {"name": "a"}, Authorization="Bearer writer").status == 201

        def ask(turn: int) -> tuple[str, int, int]:
            who = ("Bearer reader", "bearer  writer", "Bearer stranger", "Bearer nobody", "Basic x", "")[turn % 6]
            given = {"Authorization": who} if who else {}
            located = gateway.post("/hulls/a/locate", {"points": [[turn, 1]]}, **given)
            return who, gateway.post("/hulls/a/points", [[turn, 1]], **given).status, located.status

        answered = set(pool.map(ask, range(180)))
        inserted = gateway.get("/hulls/a", Authorization="Bearer reader").json["info"]["points"]
    refused = {(who, 401, 401) for who in ("Bearer nobody", "Basic x", "")}
    assert answered == refused | {
        ("Bearer reader", 403, 200),
        ("bearer  writer", 200, 200),
        ("Bearer stranger", 403, 403),
    }
    assert inserted == 30
