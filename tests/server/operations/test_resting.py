"""Keyed hulls that nobody uses take less memory, and answer as before."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from threading import Barrier
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull import KeyedHull
from dynhull._implementation import kernel
from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.resting import Resting
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state import dormant as dormant_hulls
from dynhull_server.state.batch import Applied, KeyedBatch, Write
from dynhull_server.state.errors import SequenceGapError
from dynhull_server.state.hull_state import PUT_AWAY_POINTS, HullState
from dynhull_server.state.records import HullSettings, QuarantineRules, Window
from dynhull_server.storage.sqlite.storage import SQLiteStorage

if kernel is None:
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


NOBODY = PackedKeys.pack([])


def dormant(engine: Engine) -> set[str]:
    """The hulls whose state has not been made."""
    return {name for name, hull in engine.driver.core.hulls.items() if hull._dormant is not None}


async def write(engine: Engine, name: str, batch: KeyedBatch, **numbered: Any) -> Applied:
    return await engine.hulls.apply(Write(name, batch, engine.driver.time(), **numbered), create=False)


async def fill_each_kind(engine: Engine) -> None:
    kinds = {
        "plain": HullSettings("str"),
        "numbered": HullSettings("str"),
        "of integers": HullSettings("int"),
        "dated": HullSettings("str", by_event_time=True),
        "in a window": HullSettings("str", window=Window(max_age=10**12)),
        "with deadlines": HullSettings("str"),
        "on the globe": HullSettings("str", frame="geographic"),
        "with rules": HullSettings("str", quarantine=QuarantineRules(max_speed=1.0)),
        "without keys": HullSettings(),
    }
    for name, settings in kinds.items():
        await engine.hulls.create(name, settings)
    for name in ("plain", "numbered", "on the globe", "with rules"):
        await write(engine, name, KeyedBatch("str", keys(100), places(100), NOBODY), **numbered(name, 1))
        await write(engine, name, KeyedBatch("str", keys(50), places(100)[50:], keys(60)[55:]), **numbered(name, 2))
    await write(
        engine, "of integers", KeyedBatch("int", np.arange(5, dtype=np.uint64), places(5), np.empty(0, np.uint64))
    )
    dates = np.arange(100) + engine.driver.time() - 1000
    for name in ("dated", "in a window"):
        await write(engine, name, KeyedBatch("str", keys(100), places(100), NOBODY, times=dates))
    await write(engine, "with deadlines", KeyedBatch("str", keys(100), places(100), NOBODY, ttl=10**12))


def numbered(name: str, sequence: int) -> dict[str, Any]:
    return {"producer": "writer", "sequence": sequence} if name == "numbered" else {}


def shown(engine: Engine) -> dict[str, Any]:
    """What is known of each hull, and what its state says of it."""
    found = {}
    for name, hull in engine.driver.core.hulls.items():
        committed = hull.committed if hull.counts.revision else None
        counts, size = hull.counts, hull.vertex_count
        known = replace(counts, outlined=0), committed, hull.next_due  # outlined then, or later
        state = hull.state
        assert (state.counts, state.vertex_count, state.next_due) == (counts, size, known[2])
        contents = state.contents.stored()
        held = None if contents.keys is None else list(contents.keys)
        columns = [None if each is None else each.tolist() for each in (contents.times, contents.deadlines)]
        found[name] = *known, held, contents.points.tolist(), *columns, state.vertices().tolist()
    return found


def test_a_state_is_made_when_it_is_needed(tmp_path: Path) -> None:
    asyncio.run(_made_when_needed(tmp_path))


async def _made_when_needed(tmp_path: Path) -> None:
    simple = {"plain", "numbered", "of integers"}
    async with served(tmp_path) as engine:
        await fill_each_kind(engine)
        before = shown(engine)
        assert dormant(engine) == set()
    async with served(tmp_path) as engine:
        assert dormant(engine) == simple
        await Resting(lambda: engine.driver.core.hulls.values()).round()
        assert engine.driver.core.latest_time is not None
        assert [engine.hulls.get(name).counts.points for name in sorted(simple)] == [95, 5, 95]
        assert dormant(engine) == simple, "nobody has asked for their points"
        now = shown(engine)
        assert [name for name in before if now[name] != before[name]] == []
        assert dormant(engine) == set()


def test_an_error_of_its_state_is_told_as_that(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def failing(*_: Any) -> None:
        raise AttributeError("an array has no rows")

    async def asked() -> None:
        async with served(tmp_path) as engine:
            await fill(engine)
            hull = engine.driver.core.hulls["small"]
            with monkeypatch.context() as wrong:
                wrong.setattr(HullState, "next_due", property(failing))
                with pytest.raises(AttributeError, match="an array has no rows"):
                    assert hull.next_due is None
        async with served(tmp_path) as engine:
            assert dormant(engine)
            hull = engine.driver.core.hulls["small"]
            with monkeypatch.context() as wrong:
                wrong.setattr(dormant_hulls.Dormant, "wake", failing)
                with pytest.raises(AttributeError, match="an array has no rows"):
                    assert hull.state.counts
            assert hull.state.counts.points == 100

    asyncio.run(asked())


def test_what_wakes_a_hull_finds_all_of_it(tmp_path: Path) -> None:
    asyncio.run(_woken(tmp_path))


async def _woken(tmp_path: Path) -> None:
    async with served(tmp_path) as engine:
        await fill_each_kind(engine)
        vertices = engine.driver.core.hulls["plain"].state.vertices()
    async with served(tmp_path) as engine:
        again = await write(
            engine, "numbered", KeyedBatch("str", keys(50), places(50), NOBODY), **numbered("numbered", 2)
        )
        assert again.duplicate, "the number is known"
        with pytest.raises(SequenceGapError):
            await write(engine, "numbered", KeyedBatch("str", keys(1), places(1), NOBODY), **numbered("numbered", 4))
        moved = await write(engine, "plain", KeyedBatch("str", keys(1), np.array([[9.0, 9.0]]), NOBODY))
        assert (moved.revision, moved.points, moved.hull_changed) == (3, 95, True)
        state = engine.driver.core.hulls["plain"].state
        assert state.vertices().tolist() != vertices.tolist()
        assert state.earlier_vertices(2).tolist() == vertices.tolist(), "whoever resumes there gets the difference"
        await engine.hulls.delete("of integers")
        assert dormant(engine) == set(), "nor is one that was deleted"
        await engine.hulls.create("of integers", HullSettings("str"))
        await write(engine, "of integers", KeyedBatch("str", keys(3), places(3), NOBODY))
        engine.driver.core.check()
        before = shown(engine)
    async with served(tmp_path) as engine:
        now = shown(engine)
        assert [name for name in before if now[name] != before[name]] == []


def test_threads_that_wake_a_hull_at_once_have_the_same(tmp_path: Path) -> None:
    asyncio.run(_at_once(tmp_path))


async def _at_once(tmp_path: Path) -> None:
    async with served(tmp_path) as engine:
        await fill_each_kind(engine)
    async with served(tmp_path) as engine:
        hull, together = engine.driver.core.hulls["plain"], Barrier(4)

        def wake() -> HullState:
            together.wait(60)
            return hull.state

        states = await asyncio.gather(*(asyncio.to_thread(wake) for _ in range(4)))
        assert all(state is states[0] for state in states)


def test_without_memory_it_stays_as_it_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asyncio.run(_without_memory(tmp_path, monkeypatch))


async def _without_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    async with served(tmp_path) as engine:
        await fill_each_kind(engine)
        before = shown(engine)

    def refuse(*_: Any) -> None:
        raise MemoryError

    async with served(tmp_path) as engine:
        with monkeypatch.context() as patch:
            patch.setattr(dormant_hulls, "HullState", refuse)
            with pytest.raises(MemoryError):
                await engine.hulls.get("plain").read(lambda state: state.vertices(), rows=1)
        assert "plain" in dormant(engine)
        now = shown(engine)
        assert [name for name in before if now[name] != before[name]] == []
