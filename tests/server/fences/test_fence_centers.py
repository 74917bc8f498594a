"""A fence and the centre that it gives its hulls are committed together, or not at all."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
from failing_commits import engine_on

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.errors import FenceNotFoundError, HullNotFoundError, NotStoredError
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, SubjectKind
from dynhull_server.state.records import HullSettings

KINDS: tuple[SubjectKind, SubjectKind] = "hull", "prefix"
SHIPS = HullSettings("str", frame="geographic")


async def put(engine: Engine, name: str = "fleet") -> None:
    batch = KeyedBatch("str", PackedKeys.pack(["a"]), np.array([[10.0, 50.0]]), PackedKeys.pack([]))
    await engine.hulls.apply(Write(name, batch, engine.driver.time()), create=False)


@pytest.mark.parametrize("fault", ["refused", "before", "after"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_fence_whose_commit_fails_gives_a_centre_if_it_is_there(
    tmp_path: Path, kind: SubjectKind, fault: str
) -> None:
    wrong, right = (FenceConfig(CircleArea(lon, 50.0, 5e4), kind, "fleet") for lon in (100.0, 10.0))

    async def life() -> None:
        async with engine_on(tmp_path) as (engine, storage):
            hull = await engine.hulls.create("fleet", SHIPS)
            storage.fault = fault
            if fault != "after":
                with pytest.raises(NotStoredError):
                    await engine.fences.create("fence", wrong)
                assert (hull.counts.revision, hull.counts.center) == (0, None)
                with pytest.raises(FenceNotFoundError):
                    engine.fences.get("fence")
            await engine.fences.create("fence", right)
            assert (hull.counts.revision, hull.counts.center) == (1, (10, 50))
            await put(engine)
        async with engine_on(tmp_path) as (engine, _):
            assert engine.hulls.get("fleet").counts.center == (10, 50)
            assert engine.fences.get("fence").fence.inside == 1

    asyncio.run(life())


@pytest.mark.parametrize("fault", ["refused", "before", "after"])
def test_a_hull_whose_commit_fails_begins_with_the_centre_of_the_fence_if_it_is_there(
    tmp_path: Path, fault: str
) -> None:
    async def life() -> None:
        async with engine_on(tmp_path) as (engine, storage):
            await engine.fences.create("fence", FenceConfig(CircleArea(10.0, 50.0, 5e4), "prefix", "fleet/"))
            storage.fault = fault
            if fault != "after":
                with pytest.raises(NotStoredError):
                    await engine.hulls.create("fleet/a", SHIPS)
                with pytest.raises(HullNotFoundError):
                    await put(engine, "fleet/a")
            hull = await engine.hulls.create("fleet/a", SHIPS)
            assert (hull.counts.revision, hull.counts.center) == (0, (10, 50))
            storage.fault = fault
            if fault != "after":
                with pytest.raises(NotStoredError):
                    await put(engine, "fleet/a")
                assert engine.fences.get("fence").fence.inside == 0
            await put(engine, "fleet/a")
            assert engine.fences.get("fence").fence.inside == 1
        async with engine_on(tmp_path) as (engine, _):
            assert engine.hulls.get("fleet/a").counts.center == (10, 50)
            assert engine.fences.get("fence").fence.inside == 1

    asyncio.run(life())
