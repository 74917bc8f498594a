"""Crossings become the same events in C++ as in Python."""

import random
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull_server.compiled import native
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.core import Core
from dynhull_server.state.events import Arrived, Commit, Committed, Compute, Computed, Tick
from dynhull_server.state.fences.events import log
from dynhull_server.state.fences.events.block import AppendEvents
from dynhull_server.state.fences.model import tallies
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, HullArea
from dynhull_server.state.fences.model.records import Cause
from dynhull_server.state.fences.model.requests import CreateFence
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import Birth, CreateHull, WriteBatch

KEYS = 30
NO_KEYS = np.empty(0, np.uint64)
CREATED = Birth("uid", 0.0)


class Everyone:
    """Receives all answers."""

    def answer(self, request: Any) -> None:
        assert request.error is None


class Life:
    """A core whose commits succeed; it keeps the events that it commits."""

    def __init__(self) -> None:
        self.core = Core(LIMITS)
        self.made: list[Any] = []

    def step(self, event: Any) -> None:
        for effect in self.core.step(event):
            if isinstance(effect, Compute):
                effect.ticket.run()
                self.step(Computed(effect.ticket))
            if isinstance(effect, Commit) and effect.ticket is not None:
                self.made += [each.block.by_fence() for each in effect.changes if isinstance(each, AppendEvents)]
                self.step(Committed(effect.ticket))


def put(dice: random.Random, name: str, now: int) -> WriteBatch:
    keys = np.array(sorted(dice.sample(range(KEYS), dice.randrange(1, KEYS))), np.uint64)
    points = np.array([[dice.uniform(-2, 2), dice.uniform(-2, 2)] for _ in keys])
    removes = np.array(sorted(set(range(KEYS)) - set(keys.tolist()))[:3], np.uint64)
    ttl = dice.choice([None, 40])
    return WriteBatch(Everyone(), Write(name, KeyedBatch("int", keys, points, removes, ttl=ttl), now, len(keys)))


def life(seed: str) -> tuple[list[Any], list[list[int]]]:
    """The events of a life, and what is counted of its fences."""
    dice, of_seed = random.Random(seed), Life()
    for name in ("fleet/1", "fleet/2"):
        of_seed.step(CreateHull(Everyone(), name, CREATED, HullSettings("int")))
    areas = [CircleArea(x, y, 0.7) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    configs = [FenceConfig(area, "prefix", "fleet/", initial="none") for area in areas]
    configs += [FenceConfig(HullArea("fleet/1"), "hull", "fleet/2", crosses=True, initial="none")]
    configs += [FenceConfig(areas[0], "hull", "fleet/1", dwell=10, initial="none")]
    for number, config in enumerate(configs):
        of_seed.step(CreateFence(Everyone(), f"fence/{number}", 0, config, CREATED))
    for now in range(100, 1000, 30):
        name = dice.choice(["fleet/1", "fleet/2"])
        batches = [put(dice, name, now + dice.randrange(-20, 20)) for _ in range(dice.randrange(1, 4))]
        of_seed.step(Arrived(batches))
        of_seed.step(Tick(now / 1e6, now, Everyone()))
    return of_seed.made, of_seed.core.tallies.columns.tolist()


@pytest.mark.parametrize("seed", ["a", "b"])
@pytest.mark.skipif(native is None, reason="the server runs on pure Python")
def test_crossings_become_the_same_events_in_both_implementations(seed: str, monkeypatch: pytest.MonkeyPatch) -> None:
    found, counted = life(seed)
    monkeypatch.setattr(log, "native", None)
    monkeypatch.setattr(tallies, "native", None)
    again = life(seed)
    assert len(found) > 10
    causes = {event.causes for made in found for events in made.values() for event in events}
    assert causes >= {Cause.MOVED, Cause.AREA, Cause.APPEARED, Cause.REMOVED, Cause.EXPIRED}
    assert again == (found, counted)
