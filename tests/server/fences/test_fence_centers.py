"""A fence and the centre that it gives its hull are committed together, or not at all."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.errors import FenceNotFoundError, NotStoredError
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.port import NotCommittedError, StorageError
from dynhull_server.storage.sqlite.storage import Durability, SQLiteStorage

WRONG, RIGHT = (FenceConfig(CircleArea(lon, 50.0, 5e4), "hull", "fleet") for lon in (100.0, 10.0))


class Failing(SQLiteStorage):
    """A storage whose next commit fails: it says that nothing was kept, or does not say so, or has kept it."""

    fault = ""

    def commit(self, *args: Any) -> Any:
        fault, self.fault = self.fault, ""
        if fault == "refused":
            raise NotCommittedError("the disk is full", full=True)
        if fault == "before":
            raise StorageError("the disk does not answer")
        stamp = super().commit(*args)
        if fault == "after":
            raise OSError("the disk does not answer")
        return stamp


@asynccontextmanager
async def engine_on(folder: Path) -> AsyncIterator[tuple[Engine, Failing]]:
    machine = Machine()
    supervisor, storage = Supervisor(machine.clock, pytest.fail, pytest.fail), Failing(folder, Durability.NONE)
    engine = Engine(LIMITS, storage, supervisor, machine)
    await engine.start(lambda *_: None)
    yield engine, storage
    await supervisor.stop()
    await engine.close()


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
