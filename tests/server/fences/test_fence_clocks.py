"""What a fence waits for while the wall clock is set back."""

import asyncio
import dataclasses

import numpy as np
import pytest
from adjustable_clock import AdjustableClock
from live_engine import LIMITS

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.records import EventType
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.memory import MemoryStorage

HOUR, WAIT = 3600, 300_000
AREA = CircleArea(0.0, 0.0, 5.0)
INSIDE, OUTSIDE = (1.0, 0.0), (9.0, 0.0)


def test_nobody_waits_longer_or_less_over_a_restart_an_hour_ago():
    """Delays and stays that have begun in one life end in the next one, as long after that as they should."""
    storage = MemoryStorage()
    rules = {
        "delays": FenceConfig(AREA, "hull", "fleet", min_dwell=WAIT),
        "counts": FenceConfig(AREA, "hull", "fleet", confirmations=2),
        "stays": FenceConfig(AREA, "hull", "fleet", dwell=WAIT, crosses=True),
    }

    async def life(ahead, *positions):
        """The events of each fence after a life in which a key has these positions, and time to wait."""
        machine = Machine(AdjustableClock(ahead))
        supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
        engine = Engine(LIMITS, storage, supervisor, machine)
        await engine.start(lambda *_: None)
        if not engine.hulls.has("fleet"):
            await engine.hulls.create("fleet", HullSettings("str"))
            for name, config in rules.items():
                await engine.fences.create(name, dataclasses.replace(config, initial="none"))
        for position in positions:
            made = KeyedBatch("str", PackedKeys.pack(["a"]), np.array([position]), PackedKeys.pack([]), ttl=None)
            await engine.hulls.apply(Write("fleet", made, engine.driver.time()), create=False)
        fences = {name: engine.fences.get(name) for name in rules}
        if not positions:
            await fences["delays"].reached(1)
            await fences["stays"].reached(2)
        found = {name: await fence.events(0, 100) for name, fence in fences.items()}
        await supervisor.stop()
        await engine.close()
        return found

    first = asyncio.run(life(HOUR, OUTSIDE, INSIDE))
    assert {name: [event.type for event in events] for name, events in first.items()} == {
        "delays": [],
        "counts": [],
        "stays": [EventType.ENTER],
    }
    second = asyncio.run(life(-HOUR))
    (entered,), (_, stayed) = second["delays"], second["stays"]
    assert (entered.type, stayed.type) == (EventType.ENTER, EventType.DWELL)
    assert WAIT <= stayed.time - first["stays"][0].time < HOUR * 1_000_000
    assert WAIT <= entered.time - entered.first_time < HOUR * 1_000_000
    third = asyncio.run(life(-2 * HOUR, INSIDE))
    (confirmed,) = third["counts"]
    assert entered.first_time <= confirmed.first_time + WAIT
    assert confirmed.first_time < stayed.time <= confirmed.time
