"""Quotas of watches of many hulls: how many a caller has, of how many hulls each, and how large their states are."""

from collections.abc import Iterator
from contextlib import ExitStack

import pytest
from metrics import measured, scrape
from patience import wait_until

from dynhull_client import HullClient, LimitExceededError, ManyWatch

CURVE = [[float(x), float(x * x)] for x in range(400)]  # 6,400 bytes of vertices
QUOTAS = ("--max-many-watches-per-caller", "2", "--max-watched-hulls", "4", "--max-watched-bytes", "5000")


@pytest.fixture(scope="module", params=[(), ("--workers", "2", "--gateways", "1")], ids=["process", "workers"])
def server(request: pytest.FixtureRequest) -> Iterator[tuple[HullClient, str]]:
    """A client, and the address of the metrics."""
    with measured(*QUOTAS, *request.param) as (server, metrics), HullClient(server.address) as client:
        yield client, metrics


def refused(watch: ManyWatch) -> str:
    """The limit that ends a watch, which the message names, too."""
    with pytest.raises(LimitExceededError) as refusal, watch:
        list(watch)
    assert refusal.value.metadata["limit"] in str(refusal.value)
    return refusal.value.metadata["limit"]


def test_watches_of_a_caller(server: tuple[HullClient, str], name: str) -> None:
    client, metrics = server
    counted = 'dynhull_limit_refusals_total{limit="max_many_watches_per_caller"}'
    before = scrape(metrics).get(counted, 0)
    with ExitStack() as held:
        for _ in range(2):
            next(held.enter_context(client.watch_many(f"{name}/")))
        assert refused(client.watch_many(f"{name}/")) == "max_many_watches_per_caller"
        assert scrape(metrics)[counted] == before + 1

    def begins() -> bool:
        try:
            with client.watch_many(f"{name}/") as watch:
                return next(watch).kind == "complete"
        except LimitExceededError:  # the server has not heard of the end of the others
            return False

    wait_until(begins)


def test_hulls_of_a_watch(server: tuple[HullClient, str], name: str) -> None:
    client, _ = server
    for part in "abcd":
        client.create_hull(f"{name}/{part}")
    with client.watch_many(f"{name}/") as watch:
        assert {next(watch).kind for _ in range(5)} == {"state", "complete"}
        client.create_hull(f"{name}/e")
        assert refused(watch) == "max_watched_hulls"
    assert refused(client.watch_many(f"{name}/")) == "max_watched_hulls"
    assert refused(client.watch_many(names=list("vwxyz"))) == "max_watched_hulls"
    client.delete_hull(f"{name}/a")
    with client.watch_many(f"{name}/") as watch:
        assert {next(watch).kind for _ in range(5)} == {"state", "complete"}


def test_bytes_of_a_watch(server: tuple[HullClient, str], name: str) -> None:
    client, _ = server
    client.create_hull(name)
    client.apply(name, insert=CURVE)
    assert refused(client.watch_many(name, contents="outline")) == "max_watched_bytes"
    for options in ({}, {"contents": "outline", "max_vertices": 20}):
        with client.watch_many(name, **options) as watch:
            assert next(watch).vertex_count == 400
            client.apply(name, insert=CURVE[:1])
            assert next(change for change in watch if change.kind == "state").vertex_count == 400
