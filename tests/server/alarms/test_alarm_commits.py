"""An alarm and the batch that raises it are committed together, or not at all."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
from failing_commits import engine_on

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.state.alarms.rule import AlarmRule
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.errors import AlarmNotFoundError, NotStoredError
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.records import HullSettings

SIZE = FenceConfig(AlarmRule("area > 3", "area <= 3"), "prefix", "fleet/")
HELD = FenceConfig(AlarmRule("area > 3", "area <= 3", 3_600_000_000), "other", "fleet/a")


async def square(engine: Engine, hull: str, side: float) -> None:
    points = np.array([[0, 0], [side, 0], [side, side], [0, side]], float)
    batch = KeyedBatch("str", PackedKeys.pack(["a", "b", "c", "d"]), points, PackedKeys.pack([]))
    await engine.hulls.apply(Write(hull, batch, engine.driver.time()), create=True)


async def standing(engine: Engine) -> tuple[int, list[str], list[str]]:
    """The last sequence of one alarm, the hulls for which it is raised, and those for which the other one waits."""
    size, held = engine.alarms.get("size"), engine.alarms.get("held")
    raised = [status.hull for status in await engine.alarms.statuses(size) if status.raised]
    assert size.fence.inside == len(raised)
    return size.fence.last, raised, [status.hull for status in await engine.alarms.statuses(held)]


@pytest.mark.parametrize("fault", ["refused", "before", "after"])
def test_a_batch_whose_commit_fails_raises_an_alarm_if_it_is_there(tmp_path: Path, fault: str) -> None:
    async def life() -> None:
        async with engine_on(tmp_path) as (engine, storage):
            await engine.hulls.create("fleet/a", HullSettings("str"))
            storage.fault = fault
            if fault != "after":
                with pytest.raises(NotStoredError):
                    await engine.alarms.create("size", SIZE)
                with pytest.raises(AlarmNotFoundError):
                    engine.alarms.get("size")
            await engine.alarms.create("size", SIZE)
            await engine.alarms.create("held", HELD)
            for hull in ("fleet/a", "fleet/b"):
                storage.fault = fault
                if fault == "after":
                    await square(engine, hull, 2)
                else:
                    with pytest.raises(NotStoredError):
                        await square(engine, hull, 2)
            done = fault == "after"
            both, one = ["fleet/a", "fleet/b"], ["fleet/a"]
            assert await standing(engine) == ((2, both, one) if done else (0, [], []))
            await square(engine, "fleet/a", 2)
            await square(engine, "fleet/b", 2)
            storage.fault = fault
            if done:
                await square(engine, "fleet/a", 1)
            else:
                with pytest.raises(NotStoredError):
                    await square(engine, "fleet/a", 1)
            expected = (3, both[1:], []) if done else (2, both, one)
            assert await standing(engine) == expected
            engine.driver.core.check()
        async with engine_on(tmp_path) as (engine, _):
            assert await standing(engine) == expected

    asyncio.run(life())


@pytest.mark.parametrize("fault", ["refused", "before", "after"])
def test_a_batch_that_was_not_committed_is_not_what_was_before(tmp_path: Path, fault: str) -> None:
    """Also where alarms had nothing to say about it."""

    async def life() -> None:
        async with engine_on(tmp_path) as (engine, storage):
            await engine.hulls.create("fleet/a", HullSettings("str"))
            await engine.alarms.create("size", SIZE)
            await square(engine, "fleet/a", 1)
            storage.fault = fault
            if fault == "after":
                await square(engine, "fleet/a", 1.5)
            else:
                with pytest.raises(NotStoredError):
                    await square(engine, "fleet/a", 1.5)
            await square(engine, "fleet/a", 2)
            (event,) = await engine.alarms.get("size").events(0, 10)
            assert event.previous == (2.25 if fault == "after" else 1.0, 3.0)
            assert (event.distance, event.subject_revision) == (4.0, 3 if fault == "after" else 2)

    asyncio.run(life())


@pytest.mark.parametrize("fault", ["refused", "before", "after"])
def test_a_batch_to_the_other_hull_raises_an_alarm_if_it_is_there(tmp_path: Path, fault: str) -> None:
    async def life() -> None:
        async with engine_on(tmp_path) as (engine, storage):
            for hull in ("fleet/a", "fleet/b"):
                await engine.hulls.create(hull, HullSettings("str"))
            await engine.alarms.create(
                "near", FenceConfig(AlarmRule("near fleet/b", "not near fleet/b"), "prefix", "f")
            )
            await square(engine, "fleet/a", 2)
            alarm = engine.alarms.get("near")
            storage.fault = fault
            if fault == "after":
                await square(engine, "fleet/b", 1)
            else:
                with pytest.raises(NotStoredError):
                    await square(engine, "fleet/b", 1)
            assert alarm.fence.inside == int(fault == "after")
            await square(engine, "fleet/b", 1)
            assert (alarm.fence.inside, alarm.fence.last) == (1, 1)
            engine.driver.core.check()

    asyncio.run(life())
