"""The background scrub finds a wrong hull, and does not compare a revision twice."""

import asyncio

import grpc
import numpy as np
import pytest
from forgetful import FORGETFUL
from grpc_health.v1 import health_pb2, health_pb2_grpc
from live_engine import engine_in_memory, insert
from patience import wait_until
from server_process import server_process

from dynhull import DynamicHull
from dynhull_client import HullClient
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.live_hull import LiveHull
from dynhull_server.engine.scrub import Scrub
from dynhull_server.engine.verification import LARGE, Verification
from dynhull_server.state.hull_state import HullState


class Liar(DynamicHull):
    """A hull with a fault: it leaves out a vertex."""

    def vertices(self) -> np.ndarray:
        return super().vertices()[1:]


async def rounds(engine: Engine, number: int) -> list[tuple[str, Verification]]:
    """The comparisons that `number` rounds of a scrub make."""
    seen: list[tuple[str, Verification]] = []

    def compared(hull: LiveHull, outcome: Verification) -> None:
        seen.append((hull.name, outcome))

    scrub = Scrub(engine.driver, engine.hulls, engine.fences, 1.0, compared, lambda *_: None)
    for _ in range(number):
        await scrub.round()
    return seen


def test_a_wrong_hull_is_found() -> None:
    async def run() -> None:
        async with engine_in_memory() as engine:
            random = np.random.default_rng(8)
            for name in ("good", "large", "wrong"):
                await insert(engine, name, random.normal(size=(LARGE if name == "large" else 50, 2)))

            def lie(state: HullState) -> None:
                state.hull = Liar(state.hull.points())
                state._vertices_as_of = -1

            await engine.hulls.get("wrong").read(lie)
            outcomes = dict(await rounds(engine, 1))
        assert outcomes["good"].difference is None
        assert outcomes["large"].difference is None
        assert outcomes["large"].points == LARGE
        assert outcomes["large"].rounds[-1].closed
        assert outcomes["wrong"].difference.index == 0

    asyncio.run(run())


def test_a_hull_that_is_as_it_was_is_left_out() -> None:
    async def run() -> None:
        async with engine_in_memory() as engine:
            for name in ("a", "b"):
                await insert(engine, name, np.ones((1, 2)))
            seen = await rounds(engine, 3)
        assert [name for name, _ in seen] == ["a", "b"]

    asyncio.run(run())


@pytest.mark.one_process("faults are put into the process that is started")
def test_health_tells_of_a_wrong_hull_until_the_server_ends() -> None:
    complaint = "differs from Chan's algorithm"
    with (
        server_process("--scrub-pause", "0.1", wrap=FORGETFUL, complaints=complaint) as server,
        grpc.insecure_channel(server.address) as channel,
        HullClient(server.address) as client,
    ):
        check = health_pb2_grpc.HealthStub(channel).Check

        def status(service: str) -> int:
            return check(health_pb2.HealthCheckRequest(service=service)).status

        assert status("dynhull.v1.scrub") == health_pb2.HealthCheckResponse.SERVING
        client.create_hull("a")
        client.apply("a", insert=[[0, 0], [4, 0], [2, 3]])
        wait_until(lambda: status("dynhull.v1.scrub") == health_pb2.HealthCheckResponse.NOT_SERVING)
        # One wrong hull is no reason to take all the others from everybody.
        assert status("dynhull.v1.HullService") == health_pb2.HealthCheckResponse.SERVING
        assert not client.verify("a").equal
