"""Fences against exact integers: random requests, commits that fail, servers that are killed; every event is compared.

    python tests/robustness/fences/fence_torture.py [--steps 1000000] [--seed 0]

The core of the server runs on a storage in memory. Hulls, fences and subjects change at random, keys expire, callers
go away; a commit fails, or its outcome is unknown; the core is thrown away, and another one reads the storage. After
each commit the stored events are compared with those that follow, in exact integers, from the committed positions.
"""

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

sys.path += [str(Path(__file__).parent), str(Path(__file__).parents[2] / "support")]

from world import FENCES, HULLS, KEYED, TICK, Chance, World

from dynhull_server.state.core import Core
from dynhull_server.state.events import (
    Commit,
    Committed,
    Compute,
    Computed,
    Examine,
    Examined,
    Failed,
    Gone,
    Reply,
    Retry,
    Tick,
)
from dynhull_server.state.fences.events.order import EventOrder, subjects_of
from dynhull_server.state.fences.index.subjects import Subjects
from dynhull_server.state.fences.model.fence import Fence
from dynhull_server.state.fences.model.records import Cause, EventType, FenceEvent
from dynhull_server.state.fences.recovery.sides import sides_of, wrong_sides
from dynhull_server.state.fences.trip import definition
from dynhull_server.state.fences.trip.leg import members
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import NO_TIME, HullSettings
from dynhull_server.state.requests import Birth, CreateHull
from dynhull_server.storage.memory import MemoryStorage

LIMITS = Limits(max_hulls=99, max_points=10**6, max_producers=9, max_producers_per_caller=9, resume_bytes=10**5)
# Subjects inside of the fences of a trip after which it creates no more: few, as there are few subjects.
definition.MOST_INSIDE = 5
# Steps with one seed.
LIFE = 500
# What the model does not know of an event.
UNKNOWN = {"inside": ()}


class Torture:
    """One sequence of lives of a server."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.storage = MemoryStorage()
        self.storage.immediate = False
        self.storage.open(lambda *_: None)
        self.world = World()
        self.chance = Chance(self.rng, self.world, rules=True)
        self.time = 10**15
        self.counts: Counter[str] = Counter()
        self.checked: dict[str, tuple[str, int]] = {}
        self.start()
        for name in sorted(self.world.there):
            settings = HullSettings("str" if name in KEYED else "multiset")
            self.dispatch(CreateHull(self, name, Birth(name, 1.0), settings))
            self.finish(fault=False)

    def start(self) -> None:
        """A new core on the storage."""
        contents = self.storage.open(lambda *_: None)
        self.core = Core(LIMITS, contents.next_number, keeps=True)
        for row in contents.hulls:
            kept = self.storage.read(row.number)
            self.core.restore(row, HullState(LIMITS, row.settings, kept, 0.0), 0)
        self.core.restore_fences(self.storage.read_fences([row.number for row in contents.fences]))
        self.commits: list[Commit] = []
        self.computing: list[Any] = []
        self.waiting: list[Any] = []

    def answer(self, request: Any) -> None:
        """Nobody waits for answers here."""

    def dispatch(self, event: Any) -> None:
        for effect in self.core.step(event):
            torn = getattr(effect, "ticket", None)
            assert not getattr(torn, "torn", False), "a batch was applied in part"  # memory suffices here
            match effect:
                case Commit():
                    self.commits.append(effect)
                case Compute():
                    self.computing.append(effect.ticket)
                case Examine():
                    self.examine(effect)
                case Retry():
                    raise AssertionError(f"examined again: {effect.reason}")
                case Reply():
                    for request in effect.requests:
                        if request in self.waiting:
                            self.waiting.remove(request)
        if not self.core.busy:
            self.counts["checked"] += 1
            self.core.check()
            self.verify()

    def verify(self) -> None:
        """The server's own recomputation finds nothing wrong."""
        for name in self.core.hulls:
            line = self.core.line(name)
            if line is not None:
                assert not list(wrong_sides(sides_of(name, line.comparing(name)))), name
        name = self.rng.choice(FENCES)
        fence = self.core.fences.get(name)
        if fence is not None:
            order = EventOrder(name)
            order.take(self.storage.read_events(fence.number, 0, 10**9))
            assert not order.finish(subjects_of(members(fence)), fence.last, fence.consumers.values()), name
            self.counts["verified"] += 1

    def examine(self, effect: Examine) -> None:
        states = [
            None if self.storage.row(number) is None else load(self.storage.read(number))
            for number, load in effect.hulls
        ]
        fences = self.storage.read_fences(effect.fences)
        restored = None if effect.restore is None else effect.restore(states, fences)
        self.counts["examined"] += 1
        self.later = partial(self.dispatch, Examined(effect.ticket, states, fences, restored))
        self.later()

    def finish(self, *, fault: bool = True) -> None:
        """Carry out one effect that is under way."""
        if self.computing and (not self.commits or self.rng.random() < 0.5):
            trip = self.computing.pop(self.rng.randrange(len(self.computing)))
            trip.run()
            self.dispatch(Computed(trip))
            return
        if not self.commits:
            return
        commit = self.commits.pop(0)
        chance = self.rng.random() if fault else 1.0
        if chance < 0.04:
            self.counts["not committed"] += 1
            self.dispatch(Failed(commit.ticket, OSError("not committed"), unknown=False))
        elif chance < 0.08:
            self.counts["unknown, not committed"] += 1
            self.dispatch(Failed(commit.ticket, OSError("unknown"), unknown=True))
        elif chance < 0.12:
            self.counts["unknown, committed"] += 1
            self.keep(commit)
            self.dispatch(Failed(commit.ticket, OSError("unknown"), unknown=True))
        else:
            self.keep(commit)
            self.dispatch(Committed(commit.ticket))

    def keep(self, commit: Commit) -> None:
        self.storage.commit(commit.changes)
        for request in commit.ticket.requests:
            if request.error is None:
                self.world.committed(request)
        self.counts["commits"] += 1
        made = Counter(type(request).__name__ for request in commit.ticket.requests if request.error is None)
        self.counts.update({f"{name} together": 1 for name in ("CreateFence", "DeleteFence") if made[name] > 1})
        self.counts["left for later"] += bool(getattr(commit.ticket, "left", ()))
        self.compare()

    def kill(self) -> None:
        """The end of a server, and the next one."""
        self.counts["kills"] += 1
        for commit in self.commits[: self.rng.randrange(3)]:
            self.keep(commit)
        self.start()
        self.compare_inside()

    def step(self) -> None:
        """One thing that happens."""
        rng = self.rng
        dice = rng.random()
        if dice < 0.4:
            self.finish()
        elif dice < 0.8:
            self.ask(self.chance.batch(rng.choice(HULLS), self.time, self))
        elif dice < 0.88:
            self.ask(self.chance.together(self.time, self))
        elif dice < 0.93:
            self.ask(self.chance.of_fences(self.time, self))
        elif dice < 0.96:
            for request in self.chance.burst(self.time, self):
                self.ask(request)
        elif dice < 0.97:
            self.ask(self.chance.of_guest(self.time, self))
        elif dice < 0.985:
            self.time += TICK
            self.dispatch(Tick(self.time / 10**6, self.time, self))
        elif dice < 0.995 and self.waiting:
            self.dispatch(Gone(rng.choice(self.waiting)))
        elif dice < 0.998:
            self.time += rng.choice([TICK // 3, TICK])
        else:
            self.kill()

    def ask(self, request: Any) -> None:
        request.rows = self.rng.choice([1, 1, 1, 5000])  # the latter run in a thread
        self.waiting.append(request)
        self.dispatch(request)

    # Comparison

    def compare(self) -> None:
        """The events that were stored since the last comparison are those of the model."""
        rows = {row.name: row for row in self.storage.open(lambda *_: None).fences}
        assert rows.keys() == self.world.fences.keys(), (rows.keys(), self.world.fences.keys())
        for name, fence in self.world.fences.items():
            row = rows[name]
            uid, last = self.checked.get(name, ("", 0))
            last = last if uid == row.uid else 0
            stored = self.storage.read_events(row.number, last, 10**9)
            expected, fence.events = fence.events, []
            assert len(stored) == len(expected), (name, fence.config, stored, expected)
            for one, other in zip(stored, expected, strict=True):
                self.counts[one.type.name] += 1
                self.counts["delayed"] += one.type is not EventType.DWELL and one.first_time != NO_TIME
                assert same(one, other), (name, fence.config, one, other)
            self.checked[name] = row.uid, fence.last
            if self.counts["commits"] % 50 == 0:
                (kept,) = self.storage.read_fences([row.number])
                assert {key: each.acknowledged for key, each in kept.consumers.items()} == fence.consumers

    def compare_inside(self) -> None:
        """A new core knows who is inside, as the model does."""
        for name in FENCES:
            model, fence = self.world.fences.get(name), self.core.fences.get(name)
            assert (model is None) == (fence is None), name
            if model is not None and fence is not None:
                found = subjects_in(fence, fence.keys_inside)
                assert found == model.inside, (name, model)
                found = subjects_in(fence, partial(index_inside, fence.number))
                assert found == model.beyond, (name, model)
                delays = dict(fence.delays.all()) if fence.delays is not None else {}
                assert delays.keys() == model.delays.keys(), (name, model)
                assert fence.inside == len(model.inside) + model.near


def index_inside(number: int, subjects: Subjects) -> Iterable[str]:
    return subjects.index.inside(number)


def subjects_in(fence: Fence, keys: Callable[[Subjects], Iterable[str]]) -> set[tuple[str, str]]:
    return {(hull, key) for hull, subjects in fence.subjects.items() for key in keys(subjects)}


def same(stored: FenceEvent, expected: FenceEvent) -> bool:
    """Whether two events are equal but for what the model does not know, and for the area among the causes."""
    assert stored.causes or stored.type is EventType.CLOSED, stored
    mask = ~Cause.AREA
    if stored.type in (EventType.BEGIN, EventType.CEASE) and not expected.causes:
        mask = ~(Cause.AREA | Cause.MOVED)
    if stored.type in (EventType.BEGIN, EventType.CEASE):
        stored = stored._replace(distance=None)
    one, other = (each._replace(causes=int(each.causes & mask), **UNKNOWN) for each in (stored, expected))
    return one == other


def run(steps: int, seed: int) -> Counter[str]:
    """That many steps; AssertionError at the first event that is missing, wrong or too many."""
    torture = Torture(seed)
    for number in range(steps):
        try:
            torture.step()
        except Exception:
            print(f"seed {seed}, step {number}")
            raise
    torture.counts["steps"] = steps
    return torture.counts


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    begun = time.monotonic()
    counts: Counter[str] = Counter()
    seed = arguments.seed
    while counts["steps"] < arguments.steps:
        counts += run(min(LIFE, arguments.steps - counts["steps"]), seed)
        seed += 1
        print(f"{counts['steps']} steps, {time.monotonic() - begun:.0f} s: {dict(counts)}", flush=True)


if __name__ == "__main__":
    main()
