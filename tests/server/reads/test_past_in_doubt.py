"""Who reads the past up to a time waits for a commit whose outcome is not known, and has its batch if it was kept."""

import asyncio
from contextlib import asynccontextmanager

import numpy as np
import pytest
from doubtful import PATIENCE, doubtful_engine
from patience import until

from dynhull.keys import PackedKeys
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.errors import NotStoredError, OutcomeUnknownError
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.records import EventType

AREA = CircleArea(0.0, 0.0, 5.0)
INSIDE, OUTSIDE = (1.0, 1.0), (9.0, 9.0)


@asynccontextmanager
async def served(folder, in_doubt):
    """An engine with the hulls fleet1 and other; of the number in doubt commits are so."""
    async with doubtful_engine(folder) as (engine, storage):
        for name in ("fleet1", "other"):
            await put(engine, name, "a", INSIDE)
        storage.number = in_doubt
        yield engine, storage


async def put(engine, name, key, position):
    batch = KeyedBatch("str", PackedKeys.pack([key]), np.array([position]), PackedKeys.pack([]))
    return (await engine.hulls.apply(Write(name, batch, engine.driver.time()), create=True)).revision


@asynccontextmanager
async def in_doubt(engine, storage, writing, *, kept):
    """While it is not known what has become of a batch, and others commit."""
    storage.keeps_it = kept
    task = asyncio.create_task(writing)
    assert await asyncio.to_thread(storage.looked.wait, PATIENCE)
    time = engine.driver.commit_time()
    assert await put(engine, "other", "a", INSIDE) == 2
    await until(lambda: engine.driver.commit_time() > time)
    yield time
    if kept:
        await task
    else:
        with pytest.raises(NotStoredError):
            await task


async def read(engine, storage, reading):
    """What a reader gets that began while a batch was in doubt: it comes after that is known."""
    task = asyncio.create_task(reading)
    for _ in range(5):
        await engine.driver.settled()
        await engine.driver.rebuild(int)  # what it would have read by now
    assert not task.done()
    storage.may_look.set()
    async with asyncio.timeout(PATIENCE):
        return await task


async def events(engine, kind, subjects, end):
    config = FenceConfig(AREA, kind, subjects, initial="none")
    start = None, engine.hulls.get("fleet1").committed.time
    parts = engine.past_fences.events(config, start, end)
    return [(event.hull or subjects, event.type) async for part in parts for event in part]


@pytest.mark.parametrize("kept", [True, False])
def test_a_fence_up_to_now_has_a_batch_that_was_in_doubt(tmp_path, kept):
    async def life():
        async with (
            served(tmp_path, 1) as (engine, storage),
            in_doubt(engine, storage, put(engine, "fleet1", "a", OUTSIDE), kept=kept),
        ):
            return await read(engine, storage, events(engine, "hull", "fleet1", None))

    assert asyncio.run(life()) == [("fleet1", EventType.EXIT)] * kept


@pytest.mark.parametrize("by_time", [True, False])
@pytest.mark.parametrize("kept", [True, False])
def test_a_fence_over_a_prefix_has_a_hull_whose_creation_was_in_doubt(tmp_path, kept, by_time):
    async def life():
        async with (
            served(tmp_path, 3) as (engine, storage),
            in_doubt(engine, storage, put(engine, "fleet2", "b", INSIDE), kept=kept) as time,
        ):
            end = (None, time) if by_time else None
            return await read(engine, storage, events(engine, "prefix", "fleet", end))

    assert asyncio.run(life()) == [("fleet2", EventType.ENTER)] * kept


@pytest.mark.parametrize("kept", [True, False])
def test_a_hull_as_of_a_time_is_not_ahead_of_what_it_is_now(tmp_path, kept):
    async def life():
        async with (
            served(tmp_path, 1) as (engine, storage),
            in_doubt(engine, storage, put(engine, "fleet1", "a", OUTSIDE), kept=kept) as time,
        ):
            live = engine.hulls.get("fleet1")
            reading = engine.hulls.pasts.moment(live, None, time)
            if kept:
                found = await read(engine, storage, reading)
            else:
                found = await reading  # the storage knows that there is no other one
                storage.may_look.set()
            return found.revision, live.counts.revision

    assert asyncio.run(life()) == (1 + kept, 1 + kept)


@pytest.mark.parametrize("kind", ["hull", "prefix", "moment"])
def test_who_reads_the_past_hears_that_what_is_in_doubt_cannot_be_read(tmp_path, kind):
    async def life():
        async with served(tmp_path, 1) as (engine, storage):
            storage.broken = True
            writing = asyncio.create_task(put(engine, "fleet1", "a", OUTSIDE))
            assert await asyncio.to_thread(storage.looked.wait, PATIENCE)
            time = engine.driver.commit_time()
            await until(lambda: engine.driver.commit_time() > time)
            if kind == "moment":
                reading = engine.hulls.pasts.moment(engine.hulls.get("fleet1"), None, time)
            else:
                reading = events(engine, kind, "fleet1", None)
            with pytest.raises(NotStoredError, match="the disk is away"):
                await read(engine, storage, reading)
            with pytest.raises(OutcomeUnknownError):
                await writing
            storage.broken = False

    asyncio.run(life())
