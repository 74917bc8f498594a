"""What time makes of alarms counts when it was due, whoever looks when."""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock, Machine
from dynhull_server.state.alarms.rule import AlarmRule
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.records import EventType, FenceEvent
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.memory import MemoryStorage

SECOND = 1_000_000
BEGIN = 1_800_000_000.0
ALARMS = {
    "wide": FenceConfig(AlarmRule("width > 3", "width <= 3", 5 * SECOND), "prefix", "f"),
    "quiet": FenceConfig(AlarmRule("silent 4s", ""), "prefix", "f"),
}


class SetClock(Clock):
    """It stands still until a test moves it."""

    def __init__(self) -> None:
        self.seconds = self.begun = BEGIN

    def wall(self) -> float:
        return self.seconds

    def monotonic(self) -> float:
        return self.seconds


async def square(engine: Engine, hull: str, side: float) -> None:
    points = np.array([[0, 0], [side, 0], [side, side], [0, side]], float)
    batch = KeyedBatch("str", PackedKeys.pack(["a", "b", "c", "d"]), points, PackedKeys.pack([]))
    await engine.hulls.apply(Write(hull, batch, engine.driver.time()), create=False)


async def life(storage: MemoryStorage, clock: SetClock, steps: Callable[[Engine], Awaitable[None]]) -> None:
    machine = Machine(clock)
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(LIMITS, storage, supervisor, machine)
    await engine.start(lambda *_: None)
    await steps(engine)
    await supervisor.stop()
    await engine.close()


def test_silence_is_counted_from_the_last_batch() -> None:
    """Not from what else names the hull; and after a start with a clock that was set back, from there."""
    storage, quiet = MemoryStorage(), ALARMS["quiet"]

    async def at(engine: Engine, name: str, clock: SetClock) -> list[float]:
        await square(engine, "other", 1)  # before it comes what time has made
        return [event.time / SECOND - clock.begun for event in await engine.alarms.get(name).events(0, 100)]

    async def before(engine: Engine) -> None:
        for hull in ("f1", "other"):
            await engine.hulls.create(hull, HullSettings("str"))
        clock.seconds += 3600
        await square(engine, "f1", 1)
        clock.seconds += 3
        await engine.alarms.create("wide", ALARMS["wide"])
        await asyncio.gather(square(engine, "f1", 2), engine.alarms.create("first", quiet))
        clock.seconds += 2
        await engine.alarms.create("second", quiet)
        clock.seconds += 3
        assert await at(engine, "first", clock) == await at(engine, "second", clock) == [3607]
        for name in ("first", "second"):  # otherwise the server's clock would go on from their events
            await engine.alarms.delete(name)
        await square(engine, "f1", 1)
        await engine.alarms.create("kept", quiet)

    async def after(engine: Engine) -> None:
        clock.seconds += 1
        await engine.alarms.create("new", quiet)
        clock.seconds += 5
        assert await at(engine, "kept", clock) == [4]
        assert await at(engine, "new", clock) == [5]

    for steps in (before, after):
        clock = SetClock()
        asyncio.run(life(storage, clock, steps))


def test_batches_that_arrive_after_it_was_due_come_after_it() -> None:
    """Nobody looks in between: the clock stands still, and then is later."""

    clock = SetClock()
    found: dict[str, list[FenceEvent]] = {}

    async def steps(engine: Engine) -> None:
        for hull in ("f1", "f2"):
            await engine.hulls.create(hull, HullSettings("str"))
        for name, config in ALARMS.items():
            await engine.alarms.create(name, config)
        for seconds, hull, side in [(1, "f1", 4), (2, "f2", 4), (3.5, "f1", 4), (1, "f1", 1), (2, "f2", 1)]:
            clock.seconds += seconds
            await square(engine, hull, side)
        found.update({name: await engine.alarms.get(name).events(0, 100) for name in ALARMS})

    asyncio.run(life(MemoryStorage(), clock, steps))
    told = {
        name: [(event.type, event.hull, (event.time - BEGIN * SECOND) / SECOND) for event in events]
        for name, events in found.items()
    }
    raised, cleared = EventType.BEGIN, EventType.CEASE
    assert told["wide"] == [(raised, "f1", 6.0), (cleared, "f1", 7.5), (raised, "f2", 8.0), (cleared, "f2", 9.5)]
    assert told["quiet"] == [(raised, "f1", 5.0), (cleared, "f1", 6.5), (raised, "f2", 7.0), (cleared, "f2", 9.5)]
    assert [event.distance for event in found["quiet"][::2]] == [4.0, 4.0]
