"""A track says where a key was at each revision: compared with what the hull answered then, batch by batch."""

import asyncio
from contextlib import aclosing
from dataclasses import dataclass, field

import numpy as np
import pytest
from live_engine import engine_in_memory

from dynhull.keys import PackedKeys
from dynhull_server.engine import entities
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.tracks import require_tracks, tracks
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.contents.keyed import Found
from dynhull_server.state.errors import HullNotFoundError, HullUnsuitableError, LimitExceededError
from dynhull_server.state.records import HullSettings, QuarantineRules, Window
from dynhull_server.state.tracks import Moves, joined
from dynhull_server.storage import memory

BATCHES = 60
NAME = "fleet/a"
SECOND = 1_000_000
NAMES = [f"key {i}" for i in range(9)]
KEYS = PackedKeys.pack(NAMES)
NO_KEYS, NO_POINTS = PackedKeys.pack([]), np.empty((0, 2))
KINDS = {
    "plain": HullSettings("str"),
    "by time": HullSettings("str", by_event_time=True),
    "recent": HullSettings("str", window=Window(max_age=5 * SECOND, clock="data")),
    "globe": HullSettings("str", frame="geographic"),
    "quarantine": HullSettings("str", quarantine=QuarantineRules(max_growth=1.5, confirmations=1)),
    "deadlines": HullSettings("str"),
}


@dataclass
class Life:
    """A hull that was written, where each key was after each revision, and when that was committed."""

    engine: Engine
    kind: str
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(5))
    seen: dict[int, np.ndarray] = field(default_factory=dict)
    times: dict[int, int] = field(default_factory=dict)

    async def write(self) -> None:
        hull = await self.engine.hulls.create(NAME, KINDS[self.kind])
        await self.look()
        for number in range(BATCHES):
            now = self.engine.driver.time()
            await self.engine.hulls.apply(Write(NAME, self.batch(number, now), now), create=False)
            if self.kind == "globe" and number % 20 == 10:
                await hull.recenter((1.0, 2.0))
            await self.look()

    def batch(self, number: int, now: int) -> KeyedBatch:
        rng = self.rng
        order = rng.permutation(len(NAMES))
        put, gone = order[: rng.integers(1, 4)], order[4 : 4 + rng.integers(0, 2)]
        points = np.round(rng.normal(size=(len(put), 2)) * (1 + 20 * (number % 7 == 3)), 3)
        keys = [PackedKeys.pack([NAMES[i] for i in some]) for some in (put, gone)]
        timed = self.kind in ("by time", "recent")
        times = (number + rng.integers(-4, 5, len(put))) * SECOND if timed else None
        condition = [None, "absent", "present"][number % 3] if self.kind == "plain" else None
        deadlines = None
        if self.kind == "deadlines" and number % 2:
            deadlines = now + rng.integers(1, 3_000, len(put))  # microseconds: some leave before a later batch
        if self.kind == "quarantine" and number % 10 == 9:
            return KeyedBatch("str", NO_KEYS, NO_POINTS, NO_KEYS, releases=KEYS)
        accuracies = rng.choice([0.0, 0.5, 3.0], len(put))
        return KeyedBatch("str", keys[0], points, keys[1], times, condition, deadlines=deadlines, accuracies=accuracies)

    async def look(self) -> None:
        """Where the keys are, at the last revision."""
        live = self.engine.hulls.get(NAME)
        counts, found = await entities.positions(live, KEYS, 0)
        self.seen[counts.revision] = np.column_stack((found.points, accuracies_of(found)))
        assert live.committed is not None
        self.times[counts.revision] = live.committed.time

    async def tracked(self, first: int, last: int, every: int = 0) -> Moves:
        live = self.engine.hulls.get(NAME)
        parts = [
            part async for part in tracks(self.engine.hulls.pasts, live, KEYS, first, last, self.times[first], every)
        ]
        return joined(parts)


def accuracies_of(found: Found) -> np.ndarray:
    return np.zeros(len(NAMES)) if found.accuracies is None else found.accuracies


def standing(moves: Moves, revision: int) -> np.ndarray:
    """Where each key is at a revision, and how exactly, as its track has it."""
    found = np.full((len(NAMES), 3), (np.nan, np.nan, 0.0))
    for row, at, point, accuracy in zip(moves.rows, moves.revisions, moves.points, moves.accuracies, strict=True):
        if at <= revision:
            found[row] = *point, accuracy
    return found


@pytest.mark.parametrize("kind", KINDS)
def test_a_track_has_each_place_of_a_key_and_when_it_left(kind: str) -> None:
    async def compare() -> None:
        async with engine_in_memory() as engine:
            life = Life(engine, kind)
            await life.write()
            last = max(life.seen)
            gone = 0
            for first in (0, sorted(life.seen)[len(life.seen) // 2]):
                moves = await life.tracked(first, last)
                assert np.array_equal(moves.revisions, np.sort(moves.revisions))
                for revision, expected in life.seen.items():
                    if revision >= first:
                        assert np.array_equal(standing(moves, revision), expected, equal_nan=True), revision
                known = {
                    revision: life.times[revision] for revision in moves.revisions.tolist() if revision in life.times
                }
                times = dict(zip(moves.revisions.tolist(), moves.times.tolist(), strict=True))
                assert {revision: times[revision] for revision in known} == known
                gone += int(np.isnan(moves.points[:, 0]).sum())
                for row in range(len(NAMES)):  # who is not there does not leave
                    left = np.isnan(moves.points[moves.rows == row, 0])
                    assert not left[:1].any()
                    assert not (left[1:] & left[:-1]).any()
            assert gone

    asyncio.run(compare())


@pytest.mark.parametrize("every", [1, 500, 5_000, 10**9])
def test_a_thinned_track_has_the_last_place_in_each_span(every: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "STEP_RECORDS", 7)  # spans go on from one step to the next

    async def compare() -> None:
        async with engine_in_memory() as engine:
            life = Life(engine, "plain")
            await life.write()
            first, last = 3, max(life.seen)
            whole = await life.tracked(first, last)
            begun = int((whole.revisions == first).sum())
            expected: dict[tuple[int, int], int] = {}
            for place in range(begun, len(whole)):
                span = -((life.times[first] - int(whole.times[place])) // every)
                expected[int(whole.rows[place]), span] = place
            thinned = await life.tracked(first, last, every)
            order = [*range(begun), *sorted(expected.values())]
            for part in ("rows", "revisions", "times", "points", "event_times", "accuracies"):
                assert np.array_equal(getattr(thinned, part), getattr(whole, part)[order], equal_nan=part == "points")

    asyncio.run(compare())


def test_what_a_track_is_refused_for_and_what_ends_it(monkeypatch: pytest.MonkeyPatch) -> None:
    async def life() -> None:
        async with engine_in_memory() as engine:
            written = Life(engine, "plain")
            await written.write()
            with pytest.raises(HullUnsuitableError, match="a window by number"):
                require_tracks(await engine.hulls.create("few", HullSettings("str", window=Window(max_points=3))))
            live, pasts = engine.hulls.get(NAME), engine.hulls.pasts
            monkeypatch.setattr(pasts, "_max_rows", 5)
            with pytest.raises(LimitExceededError, match="max_past_rows"):
                await written.tracked(0, BATCHES)
            monkeypatch.undo()
            async with aclosing(tracks(pasts, live, KEYS, 0, BATCHES, None, 0)) as parts:
                await anext(parts)
                await engine.hulls.delete(NAME)
                with pytest.raises(HullNotFoundError):
                    await anext(parts)

    asyncio.run(life())
