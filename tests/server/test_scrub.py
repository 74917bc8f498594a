"""The background scrub finds a hull that is wrong, and leaves alone what it has seen."""

import asyncio
from itertools import count

import numpy as np

from dynhull import DynamicHull
from dynhull_server.engine.batch import Batch
from dynhull_server.engine.hulls import Engine
from dynhull_server.engine.limits import Limits
from dynhull_server.engine.live_hull import Config, LiveHull
from dynhull_server.engine.scrub import scrub
from dynhull_server.engine.verification import LARGE, Verification
from dynhull_server.engine.writer import Write

LIMITS = Limits(max_hulls=10, max_points=10**9, max_producers=10, history_bytes=10**6)
NONE = np.empty((0, 2))


class Liar(DynamicHull):
    """A hull with a fault: it leaves out a vertex."""

    def vertices(self) -> np.ndarray:
        return super().vertices()[1:]


async def insert(hull: LiveHull, points: np.ndarray) -> None:
    await hull.apply(Write(lambda: Batch(points, NONE, NONE, NONE, False), len(points)))


async def rounds(engine: Engine, number: int) -> list[tuple[str, Verification]]:
    """What so many rounds of a scrub compare."""
    seen: list[tuple[str, Verification]] = []
    done = asyncio.Event()
    finished = count(1)

    def finish() -> None:
        if next(finished) == number:
            done.set()

    task = asyncio.create_task(scrub(engine, 1.0, 0.0, lambda hull, outcome: seen.append((hull.name, outcome)), finish))
    await done.wait()
    task.cancel()
    return seen


def test_a_wrong_hull_is_found() -> None:
    async def run() -> None:
        engine = Engine(LIMITS)
        random = np.random.default_rng(8)
        for name in ("good", "large", "wrong"):
            await insert(await engine.create(name, Config()), random.normal(size=(LARGE if name == "large" else 50, 2)))
        wrong = engine.get("wrong")
        wrong._hull = Liar(wrong._hull.points())
        wrong._vertices_as_of = -1
        outcomes = dict(await rounds(engine, 1))
        assert outcomes["good"].difference is None
        assert outcomes["large"].difference is None
        assert outcomes["large"].points == LARGE
        assert outcomes["large"].rounds[-1].closed
        assert outcomes["wrong"].difference.index == 0
        engine.close()

    asyncio.run(run())


def test_a_hull_that_is_as_it_was_is_left_out() -> None:
    async def run() -> None:
        engine = Engine(LIMITS)
        for name in ("a", "b"):
            await insert(await engine.create(name, Config()), np.ones((1, 2)))
        seen = await rounds(engine, 3)
        assert [name for name, _ in seen] == ["a", "b"]
        engine.close()

    asyncio.run(run())
