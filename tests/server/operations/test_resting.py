"""Keyed hulls that nobody uses take less memory, and answer as before."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull import KeyedHull, _kernel
from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.resting import Resting
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.hull_state import PUT_AWAY_POINTS
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.sqlite.storage import SQLiteStorage

if _kernel is None:
    pytest.skip("the implementation in Python holds keys in one way", allow_module_level=True)

SIZES = {"small": 100, "limit": PUT_AWAY_POINTS, "large": PUT_AWAY_POINTS + 1, "empty": 0}


@asynccontextmanager
async def served(folder: Path) -> AsyncIterator[Engine]:
    machine = Machine()
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(replace(LIMITS, max_hulls=100), SQLiteStorage(folder), supervisor, machine)
    await engine.start(lambda *_: None)
    yield engine
    await supervisor.stop()
    await engine.close()


def keys(size: int) -> PackedKeys:
    return PackedKeys.pack([f"vehicle-{number}" for number in range(size)])


def places(size: int) -> np.ndarray:
    return np.random.default_rng(size).random((size, 2))


async def put(engine: Engine, name: str, names: PackedKeys, points: np.ndarray) -> None:
    batch = KeyedBatch("str", names, points, PackedKeys.pack([]))
    await engine.hulls.apply(Write(name, batch, engine.driver.time()), create=False)


async def fill(engine: Engine) -> None:
    for name, size in SIZES.items():
        await engine.hulls.create(name, HullSettings("str"))
        if size:
            await put(engine, name, keys(size), places(size))


def at_rest(engine: Engine) -> set[str]:
    """Asked of their memory, which uses none of them: a tree of points has leaves."""
    hulls = {name: hull.state.hull for name, hull in engine.driver.core.hulls.items()}
    return {
        name for name, hull in hulls.items() if hull._tree.memory[1] <= 17 * SIZES[name] + len(keys(SIZES[name]).data)
    }


def test_from_the_start_until_they_are_used(tmp_path: Path) -> None:
    asyncio.run(_started(tmp_path))


async def _started(tmp_path: Path) -> None:
    async with served(tmp_path) as engine:
        await fill(engine)
    async with served(tmp_path) as engine:
        assert at_rest(engine) == {"small", "limit", "empty"}
        live = engine.hulls.get("small")
        assert live.counts.points == 100
        assert at_rest(engine) == {"small", "limit", "empty"}, "the counts are known"
        vertices = await live.read(lambda state: state.vertices(), rows=1)
        assert at_rest(engine) == {"small", "limit", "empty"}, "the vertices too"
        expected = KeyedHull.from_entities(keys(100), places(100))
        assert vertices[1].tolist() == expected.vertices().tolist()
        _, named = await live.read(lambda state: state.vertex_keys(), rows=1)
        assert named.tolist() == expected.vertex_keys()
        assert at_rest(engine) == {"limit", "empty"}


def test_when_two_rounds_have_found_them_unused(tmp_path: Path) -> None:
    asyncio.run(_looked_at(tmp_path))


async def _looked_at(tmp_path: Path) -> None:
    async with served(tmp_path) as engine:
        await fill(engine)
        resting = Resting(lambda: engine.driver.core.hulls.values())
        assert at_rest(engine) == {"empty"}
        await resting.round()
        assert at_rest(engine) == {"empty"}
        await resting.round()
        assert at_rest(engine) == {"small", "limit", "empty"}
        await put(engine, "small", PackedKeys.pack(["vehicle-3", "far"]), np.array([[0.5, 0.5], [9, 9]]))
        assert engine.hulls.get("small").counts.points == 101
        await resting.round()
        assert at_rest(engine) == {"limit", "empty"}, "it has been used since the last round"
        await engine.hulls.delete("limit")
        await resting.round()
        engine.hulls.get("small")._hull.state.hull.check()
    async with served(tmp_path) as engine:
        expected = KeyedHull.from_entities(keys(100), places(100))
        expected.put_many(["vehicle-3", "far"], [[0.5, 0.5], [9, 9]])
        assert engine.driver.core.hulls["small"].state.hull == expected
