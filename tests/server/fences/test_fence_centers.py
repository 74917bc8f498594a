"""A fence and the centre that it gives its hull are committed together, or not at all."""

import asyncio
from pathlib import Path

import numpy as np
import pytest
from failing_commits import engine_on

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.errors import FenceNotFoundError, NotStoredError
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.records import HullSettings

WRONG, RIGHT = (FenceConfig(CircleArea(lon, 50.0, 5e4), "hull", "fleet") for lon in (100.0, 10.0))


async def put(engine: Engine) -> None:
    batch = KeyedBatch("str", PackedKeys.pack(["a"]), np.array([[10.0, 50.0]]), PackedKeys.pack([]))
    await engine.hulls.apply(Write("fleet", batch, engine.driver.time()), create=False)


@pytest.mark.parametrize("fault", ["refused", "before", "after"])
def test_a_fence_whose_commit_fails_gives_a_centre_if_it_is_there(tmp_path: Path, fault: str) -> None:
    async def life() -> None:
        async with engine_on(tmp_path) as (engine, storage):
            hull = await engine.hulls.create("fleet", HullSettings("str", frame="geographic"))
            storage.fault = fault
            if fault != "after":
                with pytest.raises(NotStoredError):
                    await engine.fences.create("fence", WRONG)
                assert (hull.counts.revision, hull.counts.center) == (0, None)
                with pytest.raises(FenceNotFoundError):
                    engine.fences.get("fence")
            await engine.fences.create("fence", RIGHT)
            assert (hull.counts.revision, hull.counts.center) == (1, (10, 50))
            await put(engine)
        async with engine_on(tmp_path) as (engine, _):
            assert engine.hulls.get("fleet").counts.center == (10, 50)
            assert engine.fences.get("fence").fence.inside == 1

    asyncio.run(life())
