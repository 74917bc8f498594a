"""Hulls over shards whose process goes on without them, as when their partition moves: nothing of them is left."""

import asyncio

import numpy as np
import pytest
from cases import slow
from live_engine import engine_in_memory, insert
from patience import PATIENCE

from dynhull_cluster.divisions.divisions import ServedDivisions
from dynhull_server.settings import Settings
from dynhull_server.state.records import HullSettings

HULL = HullSettings(shards=3)
POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


async def left_when_closed(turns: int) -> list[str]:
    """Close the engine some turns of the event loop after a hull has begun. Returns the tasks that are left."""
    async with (
        asyncio.timeout(PATIENCE),
        engine_in_memory(divisions=ServedDivisions(Settings(in_memory=True))) as engine,
    ):
        await engine.hulls.create("fleet", HULL)
        writing = asyncio.create_task(insert(engine, "fleet", POINTS))
        for _ in range(turns):
            await asyncio.sleep(0)
    await asyncio.gather(writing, return_exceptions=True)
    await asyncio.sleep(0)
    return [str(each.get_coro()) for each in asyncio.all_tasks() - {asyncio.current_task()}]


@slow
@pytest.mark.every(8)
@pytest.mark.parametrize("first", range(0, 16, 2))
def test_whenever_it_is_closed_nothing_goes_on(first: int) -> None:
    for turns in range(first, 400, 16):
        assert asyncio.run(left_when_closed(turns)) == [], f"closed after {turns} turns"
