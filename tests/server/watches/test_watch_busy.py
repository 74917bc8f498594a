"""A hull that is busy, as with a long batch, delays nobody who watches others beside it."""

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import aclosing, asynccontextmanager, contextmanager

import numpy as np
import pytest
from live_engine import engine_in_memory, insert
from patience import until

from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1 import points_pb2
from dynhull_server.engine import watch_many as module
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.positions import Position, decode_position
from dynhull_server.engine.roster import Roster, RosterLimits
from dynhull_server.engine.rosters import Choice
from dynhull_server.engine.watch_many import ManyPart, Picture, watch_many
from dynhull_server.rpc.many import HullStates

ENCODING = points_pb2.POINT_ENCODING_PACKED
FOR_EVER = 10**6  # rows of a read that runs beside the event loop
NAMES = "fleet/busy", "fleet/other"
NO_LIMITS = RosterLimits(10**9, 10**9)
POINT = np.array([[1.0, 2.0]])


@contextmanager
def watched(engine: Engine) -> Iterator[Roster]:
    """The roster of those who watch the hulls."""
    states = HullStates(engine.hulls, ENCODING, outline=False, most=0)
    with engine.hulls.rosters.use("summaries", Choice("fleet/"), lambda: Roster(states, NO_LIMITS)) as roster:
        yield roster


@asynccontextmanager
async def fleet() -> AsyncIterator[tuple[Engine, Roster]]:
    """Two hulls, and the roster of those who watch them."""
    async with engine_in_memory() as engine:
        for name in NAMES:
            await insert(engine, name, POINT)
        with watched(engine) as roster:
            yield engine, roster


@asynccontextmanager
async def occupied(engine: Engine) -> AsyncIterator[threading.Event]:
    """Let nobody else read or change one of the hulls until the event is set."""
    begun, free = threading.Event(), threading.Event()

    def hold(_: object) -> None:
        begun.set()
        free.wait()

    held = asyncio.create_task(engine.hulls.get("fleet/busy").read(hold, FOR_EVER))
    try:
        await until(begun.is_set)
        yield free
    finally:
        free.set()
        await held


async def seen(parts: AsyncIterator[ManyPart], name: str) -> int:
    """The next revision of a hull; no picture is complete before."""
    async for part in parts:
        assert part.picture is not Picture.COMPLETE
        for hull in pb.WatchManyResponse.FromString(part.states).hulls:
            if hull.name == name:
                return hull.revision
    raise AssertionError("the watch has ended")


async def marked(parts: AsyncIterator[ManyPart]) -> Position:
    """The next position."""
    async for part in parts:
        if part.position:
            return decode_position(part.position)
    raise AssertionError("the watch has ended")


def test_changes_of_others_come_and_the_position_waits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "MARK_SECONDS", 0.01)

    async def main() -> None:
        async with fleet() as (engine, roster), aclosing(watch_many(roster, None, 0.001)) as parts:
            await marked(parts)
            await insert(engine, "fleet/busy", POINT + 1)
            async with occupied(engine) as free:
                for revision in (2, 3):
                    await insert(engine, "fleet/other", POINT + revision)
                    assert await seen(parts, "fleet/other") == revision
                position = await marked(parts)
                free.set()
                assert await seen(parts, "fleet/busy") == 2
            async with aclosing(watch_many(roster, position, 0.001)) as resumed:
                assert await seen(resumed, "fleet/busy") == 2  # and not that it is unchanged

    asyncio.run(main())


def test_a_picture_is_complete_when_it_has_the_busy_one() -> None:
    async def main() -> None:
        async with fleet() as (engine, roster), aclosing(watch_many(roster, None, 0.001)) as parts:
            async with occupied(engine) as free:
                assert await seen(parts, "fleet/other") == 1
                await insert(engine, "fleet/other", POINT + 1)
                assert await seen(parts, "fleet/other") == 2
                free.set()
                assert await seen(parts, "fleet/busy") == 1
            assert (await anext(parts)).picture is Picture.COMPLETE

    asyncio.run(main())


def test_those_who_leave_leave_nothing() -> None:
    async def main() -> None:
        async with engine_in_memory() as engine:
            for name in NAMES:
                await insert(engine, name, POINT)
            async with occupied(engine):
                before = asyncio.all_tasks()
                with watched(engine) as roster:
                    async with aclosing(watch_many(roster, None, 0.001)) as parts:
                        assert await seen(parts, "fleet/other") == 1
                    assert asyncio.all_tasks() != before  # one waits for the other hull
                await until(lambda: asyncio.all_tasks() == before)

    asyncio.run(main())
