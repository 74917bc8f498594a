"""Hulls over shards whose root fails, whenever that is: another one follows, and requests are answered."""

import asyncio
import threading
from functools import partial

import numpy as np
import pytest
from live_engine import engine_in_memory, insert
from patience import PATIENCE

from dynhull_cluster.divisions.divisions import ServedDivisions
from dynhull_cluster.divisions.root_thread import RootThread
from dynhull_server.settings import Settings
from dynhull_server.state.records import HullSettings

HULL = HullSettings(shards=3)
POINTS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def test_a_root_fails_before_its_beginning_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    """The event loop takes both turns of the thread before the task that has begun the root goes on."""
    roots = 0

    async def begin(thread: RootThread, known: int) -> Exception | None:
        nonlocal roots
        roots += 1
        begun, may_fail = thread._call(partial(thread._make_root, known)), threading.Event()

        def without_memory() -> None:
            may_fail.wait(PATIENCE)
            raise MemoryError

        if roots == 1:
            failed = thread._call(without_memory)
            await asyncio.to_thread(begun.result, PATIENCE)  # it needs the event loop
            may_fail.set()
            failed.result(PATIENCE)  # without giving way to others
        return await asyncio.wrap_future(begun)

    async def written() -> None:
        divisions = ServedDivisions(Settings(in_memory=True))
        async with asyncio.timeout(PATIENCE), engine_in_memory(divisions=divisions) as engine:
            await engine.hulls.create("fleet", HULL)
            await insert(engine, "fleet", POINTS)
            assert engine.hulls.get("fleet").counts.points == len(POINTS)

    monkeypatch.setattr(RootThread, "begin", begin)
    asyncio.run(written())
    assert roots == 2
