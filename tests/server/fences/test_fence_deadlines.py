"""What time makes of fences counts when it was due, whoever looks when: so the past decides as the present did."""

import asyncio
import random
from contextlib import asynccontextmanager

import numpy as np
import pytest
from live_engine import LIMITS
from patience import until

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock, Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, HullArea
from dynhull_server.state.fences.model.records import EventType
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.memory import MemoryStorage

SECOND = 1_000_000
AREA = CircleArea(0.0, 0.0, 5.0)
RULES = {
    "dwell": {"dwell": 5 * SECOND},
    "min_dwell": {"min_dwell": 3 * SECOND},
    "both": {"dwell": 5 * SECOND, "min_dwell": 2 * SECOND, "confirmations": 2, "crosses": True},
    "expected": {"expected": ("k0", "k1", "k2", "nobody"), "expected_within": 4 * SECOND, "dwell": 3 * SECOND},
    "by a time": {"expected": ("k0", "nobody", "k5"), "expected_by": "08:00:30 UTC", "min_dwell": 2 * SECOND},
}
CONFIGS = {
    **{name: FenceConfig(AREA, "hull", "fleet", **rules) for name, rules in RULES.items()},
    **{f"{name} of a hull": FenceConfig(HullArea("zone"), "hull", "fleet", **rules) for name, rules in RULES.items()},
}
KEYS = [f"k{number}" for number in range(8)]


class SetClock(Clock):
    """It stands still until a test moves it."""

    def __init__(self):
        self.seconds = 1_800_000_000.0  # eight o'clock in UTC

    def wall(self):
        return self.seconds

    def monotonic(self):
        return self.seconds


@asynccontextmanager
async def served():
    """An engine, and its clock."""
    machine = Machine(SetClock())
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(LIMITS, MemoryStorage(), supervisor, machine)
    await engine.start(lambda *_: None)
    for name in ("fleet", "zone"):
        await engine.hulls.create(name, HullSettings("str"))
    yield engine, machine.clock
    await supervisor.stop()
    await engine.close()


async def put(engine, name, positions, ttl=None):
    keys, points = PackedKeys.pack(list(positions)), np.array(list(positions.values()), float)
    batch = KeyedBatch("str", keys, points, PackedKeys.pack([]), ttl=ttl)
    await engine.hulls.apply(Write(name, batch, engine.driver.time()), create=False)


def test_who_leaves_after_it_is_due_and_before_somebody_looks():
    async def life():
        async with served() as (engine, clock):
            await engine.fences.create("fence", CONFIGS["dwell"])
            begun = engine.driver.time()
            await put(engine, "fleet", {"a": (1, 0), "b": (2, 0)})
            for seconds, x in ((4, 3), (3, 9)):
                clock.seconds += seconds
                await put(engine, "fleet", {"a": (x, 0)})
            return begun, await engine.fences.get("fence").events(0, 100)

    begun, (_, *events) = asyncio.run(life())
    assert [(event.type, event.key, event.time - begun, event.position) for event in events] == [
        (EventType.ENTER, "a", 0, (1.0, 0.0)),
        (EventType.ENTER, "b", 0, (2.0, 0.0)),
        (EventType.DWELL, "a", 5 * SECOND, (3.0, 0.0)),
        (EventType.DWELL, "b", 5 * SECOND, (2.0, 0.0)),
        (EventType.EXIT, "a", 7 * SECOND, (9.0, 0.0)),
    ]


@pytest.mark.every(3)
@pytest.mark.parametrize("seed", range(3))
def test_the_past_makes_what_time_has_made(seed):
    """Field by field, with all times."""
    rng = random.Random(seed)

    async def life():
        async with served() as (engine, clock):
            await put(engine, "zone", {"south": (-6, -6), "east": (6, -6), "north": (0, 6)})
            await put(engine, "fleet", {key: (rng.randint(-8, 8), 0) for key in KEYS})
            for name, config in CONFIGS.items():
                await engine.fences.create(name, config)
            start = engine.driver.time()
            clock.seconds += 1
            for _ in range(40):
                clock.seconds += rng.choice([0, 0.5, 1, 2, 3, 6])
                if rng.random() < 0.2:
                    await put(engine, "zone", {"north": (rng.randint(-9, 9), rng.randint(0, 9))})
                else:
                    chosen = rng.sample(KEYS, rng.randint(1, 3))
                    ttl = rng.choice([None, None, 4 * SECOND])
                    await put(engine, "fleet", {key: (rng.randint(-8, 8), rng.randint(-4, 4)) for key in chosen}, ttl)
            await until(lambda: not engine.driver.core.busy)  # a commit under way would seem to hang
            clock.seconds += 60
            await until(lambda: not engine.driver.core.expiring(engine.driver.time()))
            made = {}
            for name, config in CONFIGS.items():
                live = await engine.fences.get(name).events(0, 1000)
                parts = engine.past_fences.events(config, (None, start), None)
                made[name] = live, [event async for part in parts for event in part]
            return made

    made = asyncio.run(life())
    for name, (live, past) in made.items():
        assert past == live, name
    kinds = {event.type for live, _ in made.values() for event in live}
    assert {EventType.DWELL, EventType.ENTER, EventType.EXIT, EventType.MISSING, EventType.ARRIVED} <= kinds
