"""A reader of the past who is slow: once keys are erased, nothing comes with them, though it had been read before."""

import asyncio
from contextlib import aclosing, asynccontextmanager, nullcontext

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull.keys import PackedKeys
from dynhull_server.engine import feed_many
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.positions import Standing
from dynhull_server.engine.replay import Pace, replay
from dynhull_server.engine.roster import Roster, RosterLimits
from dynhull_server.engine.rosters import Choice
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.engine.views import VerticesView
from dynhull_server.rpc.many import HullStates
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.errors import NotStoredError
from dynhull_server.state.records import FOREVER, HullSettings
from dynhull_server.storage.durability import Durability
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.sqlite.storage import SQLiteStorage

BATCHES, MANY = 40, 10**9
GONE = "gone"


@asynccontextmanager
async def served(folder):
    """An engine with two hulls, whose key GONE was in each of their batches but the last one."""
    machine = Machine()
    storage = SQLiteStorage(folder / "data", Durability.NONE, archive=Archive(folder / "history"))
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(LIMITS, storage, supervisor, machine)
    await engine.start(lambda *_: None)
    for name in ("k1", "k2"):
        await engine.hulls.create(name, HullSettings("str", history=FOREVER))
    for i in range(BATCHES):
        for name in ("k1", "k2"):
            await put(engine, name, {"other": (i, 1), **({GONE: (9 + i, 9)} if i < BATCHES - 1 else {})}, i)
    yield engine
    await supervisor.stop()
    await engine.close()


async def put(engine, name, positions, number):
    removes = PackedKeys.pack([] if GONE in positions else [GONE])
    keys, points = PackedKeys.pack(list(positions)), np.array(list(positions.values()), float)
    await engine.hulls.apply(Write(name, KeyedBatch("str", keys, points, removes), engine.driver.time()), create=False)
    assert engine.hulls.get(name).counts.revision == number + 1


async def erase(engine, name):
    found = await engine.hulls.filing.erase(engine.hulls.get(name), PackedKeys.pack([GONE]))
    assert found is not None


def test_the_feed_of_a_prefix(tmp_path, monkeypatch):
    """What was read ahead is read again, the hull beside it is sent as before, and each batch comes once, in order."""
    monkeypatch.setattr(feed_many, "BATCHES_TOGETHER", 6)

    async def life():
        async with served(tmp_path) as engine:
            states = HullStates(engine.hulls, 0, outline=False, most=0)
            make = lambda: Roster(states, RosterLimits(MANY, MANY))  # noqa: E731
            with engine.hulls.rosters.use("feeds", Choice("k"), make) as roster:
                feed = engine.hulls.feed(roster).follow(Standing(engine.hulls.standing.incarnation, 0, 0))
                async with aclosing(feed) as parts:
                    assert (await anext(parts)).there is not None
                    batches = (await anext(parts)).batches
                    before = len(batches)
                    await erase(engine, "k1")
                    while len(batches) < 2 * BATCHES:
                        batches += (await anext(parts)).batches
            return batches, before

    batches, before = asyncio.run(life())
    assert 0 < before < BATCHES
    for name in ("k1", "k2"):
        assert [each.record.revision for each in batches if each.hull.name == name] == list(range(1, BATCHES + 1))
    numbers = [each.record.committed.number for each in batches]
    assert numbers == sorted(numbers)
    for place, (hull, record, _) in enumerate(batches[:-2]):
        gone = hull.name == "k1" and place >= before
        assert list(record.rows.keys) == (["other"] if gone else ["other", GONE])


@pytest.mark.parametrize("erased", ["k1", "k2"])
def test_a_replay(tmp_path, erased):
    """That of the hull ends at once, for its reader to begin again; that of another one goes on."""

    async def life():
        async with served(tmp_path) as engine:
            hull = await engine.hulls.replayed(engine.hulls.get("k1"), 1, BATCHES)
            pace, view = Pace(0.0, 0, 0.0, None), VerticesView(hull, keys=False)
            async with aclosing(replay(hull, view, pace, origin=None, resumed=False, outline_only=False)) as events:
                for _ in range(3):
                    await anext(events)
                await erase(engine, erased)
                with pytest.raises(NotStoredError, match="erased") if erased == "k1" else nullcontext():
                    await anext(events)

    asyncio.run(life())


@pytest.mark.parametrize("thought", [0, 17])
def test_batches_that_follow_another_state_than_the_one_that_was_read_are_read_again(tmp_path, thought, monkeypatch):
    """Those after the newest state are read while that one is; it may turn out to be damaged, and an older one read."""

    async def life():
        async with served(tmp_path) as engine:
            pasts, hull = engine.hulls.pasts, engine.hulls.get("k1")._hull
            gathered, begun = pasts._past.gathered, []
            monkeypatch.setattr(pasts._past, "state_revision", lambda *_: thought)
            monkeypatch.setattr(pasts._past, "gathered", lambda *asked: begun.append(asked[1]) or gathered(*asked))
            for revision in (17, BATCHES - 1):
                async with pasts.state(hull, revision) as state:
                    assert state.counts.revision == revision
                    assert state.contents.find(PackedKeys.pack(["other", GONE])).points.tolist() == [
                        [revision - 1, 1],
                        [8 + revision, 9],
                    ]
                pasts.forget()
            return begun

    begun = asyncio.run(life())
    assert begun.count(0) == 2
    assert begun.count(17) == (thought == 17)
