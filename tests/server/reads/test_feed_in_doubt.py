"""The feed of a prefix around a commit whose outcome is not known at first: it passes nothing, and waits for nobody."""

import asyncio
from contextlib import aclosing, asynccontextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from doubtful import PATIENCE, doubtful_engine
from live_engine import NONE
from patience import until

from dynhull_server.engine.positions import decode_standings
from dynhull_server.engine.roster import Roster, RosterLimits
from dynhull_server.engine.rosters import Choice
from dynhull_server.rpc.many import HullStates
from dynhull_server.state.batch import Batch, Write
from dynhull_server.state.errors import NotStoredError, OutcomeUnknownError, StoppingError

MANY = 10**9


@asynccontextmanager
async def served(folder):
    """An engine with the hulls k1 and k2, of which k2 has commits in doubt."""
    async with doubtful_engine(folder) as (engine, storage):
        for name in ("k1", "k2"):
            await put(engine, name)
        storage.number = engine.hulls.get("k2").number
        yield engine, storage


async def put(engine, name):
    write = Write(name, Batch(np.ones((1, 2)), NONE, 0, False), engine.driver.time())
    return (await engine.hulls.apply(write, create=True)).revision


@asynccontextmanager
async def fed(engine, start=None):
    """The parts of a feed of all hulls, which has begun."""
    states = HullStates(engine.hulls, 0, outline=False, most=0)
    make = lambda: Roster(states, RosterLimits(MANY, MANY))  # noqa: E731
    with engine.hulls.rosters.use("feeds", Choice("k"), make) as roster:
        async with aclosing(engine.hulls.feed(roster).follow(start)) as parts:
            assert (await anext(parts)).there is not None
            yield parts


async def take(parts, wanted):
    """So many batches: their hulls with their revisions, and the position after them."""
    found, position = [], None
    async with asyncio.timeout(PATIENCE):
        while len(found) < wanted:
            part = await anext(parts)
            found += [(each.hull.name, each.record.revision) for each in part.batches]
            position = part.position and decode_standings(part.position)[0]
    return SimpleNamespace(batches=found, position=position)


def test_a_batch_that_was_in_doubt_is_sent_without_another_commit(tmp_path):
    async def life():
        async with served(tmp_path) as (engine, storage), fed(engine) as parts:
            storage.may_look.set()
            assert await put(engine, "k2") == 2
            assert (await take(parts, 1)).batches == [("k2", 2)]

    asyncio.run(life())


@pytest.mark.parametrize("kept", [True, False])
def test_no_position_passes_a_batch_that_is_in_doubt(tmp_path, kept):
    async def life():
        async with served(tmp_path) as (engine, storage), fed(engine) as parts:
            storage.keeps_it = kept
            writing = asyncio.create_task(put(engine, "k2"))
            assert await asyncio.to_thread(storage.looked.wait, PATIENCE)
            assert await put(engine, "k1") == 2
            settled = asyncio.create_task(engine.hulls.feeds.settled())
            for _ in range(2):
                await engine.driver.settled()  # what is asked of the committing thread is answered in order
            assert not settled.done()
            reading = asyncio.create_task(take(parts, 1 + kept))
            storage.may_look.set()
            if kept:
                assert await writing == 2
            else:
                with pytest.raises(NotStoredError):
                    await writing
            async with asyncio.timeout(PATIENCE):
                assert (await settled).number == engine.driver.published.number
                got = await reading
            assert sorted(got.batches) == [("k1", 2), ("k2", 2)][: 1 + kept]
            storage.number = 0
            assert await put(engine, "k2") == 2 + kept
            async with fed(engine, got.position) as again:
                assert (await take(again, 1)).batches == [("k2", 2 + kept)]

    asyncio.run(life())


def test_who_waits_for_what_is_in_doubt_hears_that_it_cannot_be_read(tmp_path):
    async def life():
        async with served(tmp_path) as (engine, storage):
            storage.broken = True
            writing = asyncio.create_task(put(engine, "k2"))
            assert await asyncio.to_thread(storage.looked.wait, PATIENCE)
            settled = asyncio.create_task(engine.hulls.feeds.settled())
            storage.may_look.set()
            async with asyncio.timeout(PATIENCE):
                with pytest.raises(NotStoredError, match="the disk is away"):
                    await settled
            with pytest.raises(OutcomeUnknownError):
                await writing
            storage.broken = False
            await until(lambda: not engine.driver.core.undecided)
            assert (await engine.hulls.feeds.settled()).number == engine.driver.published.number
            assert engine.hulls.get("k2").counts.revision == 2

    asyncio.run(life())


def test_who_waits_for_what_is_in_doubt_hears_that_the_server_stops(tmp_path):
    async def life():
        async with served(tmp_path) as (engine, storage):
            writing = asyncio.create_task(put(engine, "k2"))
            assert await asyncio.to_thread(storage.looked.wait, PATIENCE)
            settled = asyncio.create_task(engine.hulls.feeds.settled())
            await engine.driver.settled()
            stopping = asyncio.create_task(engine.driver.stop())
            async with asyncio.timeout(PATIENCE):
                with pytest.raises(StoppingError):
                    await settled
                with pytest.raises(StoppingError):
                    await engine.hulls.feeds.settled()
                storage.may_look.set()
                await stopping
                assert await writing == 2

    asyncio.run(life())
