"""What time makes of alarms counts when it was due, whoever looks when."""

import asyncio

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
        self.seconds = BEGIN

    def wall(self) -> float:
        return self.seconds

    def monotonic(self) -> float:
        return self.seconds


async def square(engine: Engine, hull: str, side: float) -> None:
    points = np.array([[0, 0], [side, 0], [side, side], [0, side]], float)
    batch = KeyedBatch("str", PackedKeys.pack(["a", "b", "c", "d"]), points, PackedKeys.pack([]))
    await engine.hulls.apply(Write(hull, batch, engine.driver.time()), create=False)


def test_batches_that_arrive_after_it_was_due_come_after_it() -> None:
    """Nobody looks in between: the clock stands still, and then is later."""

    async def life() -> dict[str, list[FenceEvent]]:
        machine = Machine(SetClock())
        supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
        engine = Engine(LIMITS, MemoryStorage(), supervisor, machine)
        await engine.start(lambda *_: None)
        for hull in ("f1", "f2"):
            await engine.hulls.create(hull, HullSettings("str"))
        for name, config in ALARMS.items():
            await engine.alarms.create(name, config)
        for seconds, hull, side in [(1, "f1", 4), (2, "f2", 4), (3.5, "f1", 4), (1, "f1", 1), (2, "f2", 1)]:
            machine.clock.seconds += seconds
            await square(engine, hull, side)
        found = {name: await engine.alarms.get(name).events(0, 100) for name in ALARMS}
        await supervisor.stop()
        await engine.close()
        return found

    found = asyncio.run(life())
    told = {
        name: [(event.type, event.hull, (event.time - BEGIN * SECOND) / SECOND) for event in events]
        for name, events in found.items()
    }
    raised, cleared = EventType.BEGIN, EventType.CEASE
    assert told["wide"] == [(raised, "f1", 6.0), (cleared, "f1", 7.5), (raised, "f2", 8.0), (cleared, "f2", 9.5)]
    assert told["quiet"] == [(raised, "f1", 5.0), (cleared, "f1", 6.5), (raised, "f2", 7.0), (cleared, "f2", 9.5)]
    assert [event.distance for event in found["quiet"][::2]] == [4.0, 4.0]
