"""A replay of the past: its pace, what it combines, and what ends it. An engine without a server around it."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import aclosing, asynccontextmanager

import numpy as np
import pytest
from cases import one_of, slow
from hypothesis import given
from hypothesis import strategies as st
from live_engine import engine_in_memory, insert

from dynhull_server.engine.engine import Engine
from dynhull_server.engine.replay import Pace, ReplayedHull, replay
from dynhull_server.engine.views import Event, FewView, Progress, Snapshot, VerticesView
from dynhull_server.state.errors import (
    HullNotFoundError,
    LimitExceededError,
    NotStoredError,
    RevisionForgottenError,
)
from dynhull_server.storage.memory import MemoryStorage
from dynhull_server.storage.past import Erasure
from dynhull_server.storage.port import DamagedError

BATCHES = 12
NAME = "fleet/a"
AT_ONCE = Pace(0.0, 0, 0.0, None)
INSTANT = Pace(1e6, 0, 0.0, None)  # the day that follows is over before it is asked for
NEVER = Pace(1e-6, 0, 0.0, None)


@asynccontextmanager
async def written() -> AsyncIterator[tuple[Engine, list[int]]]:
    """An engine with a hull that grows with each batch but every third, and the time of each of its commits."""
    async with engine_in_memory() as engine:
        times = []
        for number in range(BATCHES):
            await insert(engine, NAME, np.array([[0.1, 0.1] if number % 3 == 2 else [number, number**2]], np.float64))
            stamp = engine.hulls.get(NAME).committed
            assert stamp is not None
            times.append(stamp.time)
        yield engine, times


async def played(engine: Engine, pace: Pace, first: int = 0, *, few: bool = False, **options: bool) -> list[Event]:
    live = engine.hulls.get(NAME)
    hull = await engine.hulls.replayed(live, first, live.counts.revision)
    return [event async for event in events_of(hull, pace, few=few, **options)]


def events_of(
    hull: ReplayedHull, pace: Pace, *, few: bool = False, resumed: bool = False, outline_only: bool = False
) -> AsyncIterator[Event]:
    view = FewView(hull, 3, vertices=False, keys=False, layer=1) if few else VerticesView(hull)
    origin = None if hull.committed is None else hull.committed.time
    return replay(hull, view, pace, origin=origin, resumed=resumed, outline_only=outline_only)


def revisions(events: list[Event]) -> list[int]:
    return [event.counts.revision for event in events]


def test_it_ends_when_keys_are_erased_that_it_may_have():
    async def life() -> None:
        async with written() as (engine, _):
            live = engine.hulls.get(NAME)
            events = events_of(await engine.hulls.replayed(live, 0, live.counts.revision), AT_ONCE)
            await anext(events)
            erased = (Erasure(1, 5, 0, 1, 1),)
            with pytest.MonkeyPatch.context() as patch:
                patch.setattr(MemoryStorage, "erasures", lambda *_: erased)
                with pytest.raises(NotStoredError, match="erased"):
                    async for _ in events:
                        pass
                assert len(await played(engine, AT_ONCE)) == BATCHES + 1

    asyncio.run(life())


def test_each_revision_is_an_event_or_each_that_changes_the_outline():
    async def life() -> None:
        async with written() as (engine, _):
            assert revisions(await played(engine, AT_ONCE)) == list(range(BATCHES + 1))
            assert revisions(await played(engine, AT_ONCE, 5)) == list(range(5, BATCHES + 1))
            assert revisions(await played(engine, AT_ONCE, 5, resumed=True)) == list(range(6, BATCHES + 1))
            seen = await played(engine, AT_ONCE, few=True)
            assert [event.counts.points for event in seen] == list(range(BATCHES + 1))
            changes = [event for event in await played(engine, AT_ONCE) if not isinstance(event, Progress)]
            assert revisions(await played(engine, AT_ONCE, outline_only=True)) == revisions(changes)
            assert len(changes) < BATCHES

    asyncio.run(life())


def test_what_is_due_at_once_is_one_event():
    async def life() -> None:
        async with written() as (engine, _):
            events = await played(engine, INSTANT)
            assert len(events) < BATCHES  # the first pause may end between two commits
            assert revisions(events)[-1] == BATCHES
            whole = await engine.hulls.get(NAME).vertices()
            hull = await engine.hulls.replayed(engine.hulls.get(NAME), BATCHES, BATCHES)
            (last,) = [event async for event in events_of(hull, INSTANT)]
            assert isinstance(last, Snapshot)
            assert np.array_equal(last.vertices, whole[1])

    asyncio.run(life())


@slow
@given(st.integers(1, 30_000))
@one_of(3)
def test_events_are_a_span_of_the_past_apart(every: int):
    async def life() -> None:
        async with written() as (engine, times):
            cells: dict[int, int] = {}  # by the end of each span, the last revision committed by then
            for revision, time in enumerate(times[1:], 2):
                cells[-((times[0] - time) // every)] = revision
            found = revisions(await played(engine, Pace(0.0, every, 0.0, None), 1))
            assert found == [1, *cells.values()]

    asyncio.run(life())


def test_a_replay_takes_the_time_that_its_speed_says():
    async def life() -> None:
        async with written() as (engine, times):
            span = (times[-1] - times[0]) / 1e6
            loop = asyncio.get_running_loop()
            begun = loop.time()
            events = await played(engine, Pace(2.0, 0, 0.0, None), 1)
            assert loop.time() - begun >= span / 2
            assert revisions(events)[-1] == BATCHES
            begun = loop.time()
            assert len(await played(engine, Pace(0.0, 0, 0.001, None))) == BATCHES + 1
            assert loop.time() - begun >= BATCHES * 0.001

    asyncio.run(life())


def test_a_reader_that_waits_gets_progress_and_the_end_of_the_hull():
    async def life() -> None:
        async with written() as (engine, _):
            live = engine.hulls.get(NAME)
            hull = await engine.hulls.replayed(live, 3, BATCHES)
            async with aclosing(events_of(hull, Pace(1e-6, 0, 0.0, 0.001))) as events:
                assert isinstance(await anext(events), Snapshot)
                assert revisions([await anext(events), await anext(events)]) == [3, 3]
            for name, pace in ((NAME, NEVER), (NAME, AT_ONCE)):
                hull = await engine.hulls.replayed(engine.hulls.get(name), 3, BATCHES)
                async with aclosing(events_of(hull, pace)) as events:
                    await anext(events)
                    coming = asyncio.ensure_future(anext(events)) if pace is NEVER else None
                    await asyncio.sleep(0)
                    await engine.hulls.delete(name)
                    await insert(engine, name, np.ones((BATCHES, 2)))  # another one of that name
                    with pytest.raises(HullNotFoundError):
                        await (anext(events) if coming is None else coming)
                for number in range(BATCHES):
                    await insert(engine, name, np.full((1, 2), float(number)))

    asyncio.run(life())


@pytest.mark.parametrize("dropped", [True, False])
def test_a_hole_ends_it_and_says_what_is_missing(dropped: bool, monkeypatch: pytest.MonkeyPatch):
    async def life() -> None:
        async with written() as (engine, _):
            storage = engine.hulls.pasts._past
            hull = await engine.hulls.replayed(engine.hulls.get(NAME), 3, BATCHES)
            whole = storage.batches

            def batches(number: int, after: int, until: int) -> list:
                if after >= 5:
                    raise DamagedError("revisions 6 to 8 cannot be read: a file is missing")
                return whole(number, after, min(until, 5))

            monkeypatch.setattr(storage, "batches", batches)
            if dropped:
                oldest = type(storage.oldest_moment(1))(9, None)
                monkeypatch.setattr(storage, "oldest_moment", lambda *_, **__: oldest)
            error, said = (
                (RevisionForgottenError, "revision 6 .* the oldest is 9")
                if dropped
                else (
                    NotStoredError,
                    "revisions 6 to 8",
                )
            )
            events = events_of(hull, AT_ONCE)
            assert revisions([await anext(events) for _ in range(3)]) == [3, 4, 5]
            with pytest.raises(error, match=said):
                await anext(events)

    asyncio.run(life())


def test_a_hull_that_grows_beyond_the_limit_ends_it(monkeypatch: pytest.MonkeyPatch):
    async def life() -> None:
        async with written() as (engine, _):
            monkeypatch.setattr(engine.hulls.pasts, "_max_rows", 7)
            hull = await engine.hulls.replayed(engine.hulls.get(NAME), 1, BATCHES)
            with pytest.raises(LimitExceededError, match="max_past_rows"):
                assert [event async for event in events_of(hull, AT_ONCE)]
            assert hull.counts.points == 7

    asyncio.run(life())
