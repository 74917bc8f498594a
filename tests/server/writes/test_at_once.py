"""Small batches in memory that are applied without a request: as with one, and only where nothing else goes on."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull.keys import PackedKeys
from dynhull_server.state.alarms.rule import AlarmRule, marked
from dynhull_server.state.batch import NO_POINTS, Applied, Batch, KeyedBatch, Write
from dynhull_server.state.contents.multiset import Multiset
from dynhull_server.state.core import SMALL, Core
from dynhull_server.state.errors import PointMissingError, SequenceGapError
from dynhull_server.state.events import Commit, Committed, Compute, Effect, Event, Examine, Gone, Reply, Stopping
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.requests import CreateFence
from dynhull_server.state.hull import Hull
from dynhull_server.state.records import DEFAULT, HullSettings, Window
from dynhull_server.state.requests import Birth, CreateHull, DeleteHull, Stream, WriteBatch

NAME = "hull"
CREATED = Birth("uid", 0.0)
ONE: Batch = Batch(np.array([[1.0, 2.0]]), NO_POINTS, 0, False)


def serving(settings: HullSettings = DEFAULT, *, keeps: bool = False) -> tuple[Core, Stream]:
    core = Core(LIMITS, immediate=True, keeps=keeps)
    core.step(CreateHull(None, NAME, CREATED, settings))
    return core, Stream(NAME, core.get(NAME))


def answered(core: Core, event: Event) -> list[Effect]:
    """The effects of an event, of which the last one is the answer."""
    effects = core.step(event)
    assert isinstance(effects[-1], Reply)
    return effects


def stored(hull: Hull) -> list[Any]:
    contents = hull.state.contents.stored()
    columns = contents.points, contents.keys, contents.times, contents.deadlines
    return [None if column is None else np.array(column).tolist() for column in columns]


def points(random: np.random.Generator, number: int) -> Batch:
    xy = random.integers(0, 9, (number % 4, 2)).astype(float)
    missing = random.integers(0, 9, (number % 3, 2)).astype(float)
    return Batch(xy, missing, 0, True)


def keyed(random: np.random.Generator, number: int) -> KeyedBatch:
    keys = PackedKeys.pack([f"k{key}" for key in random.choice(9, number % 4, replace=False)])
    removes = PackedKeys.pack([f"r{number % 5}"] if number % 3 else [])
    return KeyedBatch("str", keys, random.integers(0, 9, (len(keys), 2)).astype(float), removes)


KINDS: list[tuple[HullSettings, Callable[[np.random.Generator, int], Any]]] = [
    (DEFAULT, points),
    (HullSettings("str"), keyed),
    (HullSettings(window=Window(max_points=20)), points),
]


@pytest.mark.parametrize(("settings", "make"), KINDS)
@pytest.mark.parametrize("producer", ["", "p"])
@pytest.mark.parametrize("keeps", [False, True])
def test_as_with_a_request(settings: HullSettings, make: Any, producer: str, *, keeps: bool) -> None:
    random = np.random.default_rng(11)
    (core, stream), (other, its_stream) = serving(settings, keeps=keeps), serving(settings, keeps=keeps)
    for number in range(200):
        again = number % 7 == 3
        sequence = (number if again else number + 1) if producer else 0
        write = Write(
            NAME, make(random, number), 1000 + number, 3, producer, sequence, "owner", may_skip=bool(producer)
        )
        found = core.write_at_once(stream, write)
        assert found is not None
        request = WriteBatch(None, write, None, its_stream)
        effects = answered(other, request)
        assert request.error is None
        hull, applied, changes = found
        assert (hull, applied) == (core.get(NAME), request.result)
        committed = [change for effect in effects if isinstance(effect, Commit) for change in effect.changes]
        assert (repr(changes), bool(changes)) == (repr(committed), keeps and not applied.duplicate)
        assert request.result.duplicate == (again and bool(producer))
        mine, theirs = core.get(NAME), other.get(NAME)
        assert (mine.counts, mine.due) == (theirs.counts, theirs.due)
        assert mine.counts is mine.state.counts
        assert stored(mine) == stored(theirs)


def test_points_as_with_a_request() -> None:
    random = np.random.default_rng(13)
    (core, stream), (other, its_stream) = serving(), serving()
    for number in range(200):
        batch = points(random, number)
        request = WriteBatch(None, Write(NAME, batch, 1000 + number, 3), None, its_stream)
        answered(other, request)
        assert request.error is None
        mine, theirs = core.get(NAME), other.get(NAME)
        assert core.apply_points(stream, batch) == (mine, request.result, [])
        assert mine.counts == theirs.counts
        assert mine.counts is mine.state.counts
        assert not mine.state.torn
        assert (stored(mine), mine.state.vertices().tolist()) == (stored(theirs), theirs.state.vertices().tolist())


@pytest.mark.parametrize(
    ("settings", "keeps"),
    [
        (DEFAULT, True),
        (HullSettings("str"), False),
        (HullSettings(window=Window(max_points=20)), False),
        (HullSettings(frame="geographic"), False),
    ],
)
def test_points_of_which_more_follows_take_more(settings: HullSettings, *, keeps: bool) -> None:
    core, stream = serving(settings, keeps=keeps)
    counts = core.get(NAME).counts
    assert core.apply_points(stream, ONE) is None
    assert core.get(NAME).state.counts is counts
    assert not core.get(NAME).state.torn


def test_points_beyond_the_limit_take_a_request() -> None:
    core, stream = serving(HullSettings(max_points=2))
    two = Batch(np.array([[1.0, 2.0], [3.0, 4.0]]), NO_POINTS, 0, False)
    assert core.apply_points(stream, two) is not None
    assert core.apply_points(stream, ONE) is None
    assert core.get(NAME).counts.points == len(core.get(NAME).state.hull) == 2


def ended(core: Core, stream: Stream) -> None:
    core.step(Gone(stream))


def replaced(core: Core, _: Stream) -> None:
    answered(core, DeleteHull(None, NAME))
    answered(core, CreateHull(None, NAME, CREATED))


def deleted(core: Core, _: Stream) -> None:
    answered(core, DeleteHull(None, NAME))


def stopping(core: Core, _: Stream) -> None:
    core.step(Stopping())


def busy(core: Core, _: Stream) -> None:
    many = Batch(np.zeros((2 * SMALL, 2)), NO_POINTS, 0, False)
    (effect,) = core.step(WriteBatch(None, Write(NAME, many, 1, 10 * SMALL)))
    assert isinstance(effect, Compute)


def watched(core: Core, _: Stream) -> None:
    rule = AlarmRule("area > 1", "area <= 1")
    answered(core, CreateFence(None, marked("rule"), 1, FenceConfig(rule, "other", NAME), CREATED))


@pytest.mark.parametrize("what", [ended, replaced, deleted, stopping, busy, watched])
def test_only_where_nothing_goes_on(what: Callable[[Core, Stream], None]) -> None:
    core, stream = serving()
    assert core.write_at_once(stream, Write(NAME, ONE, 1, 1)) is not None
    what(core, stream)
    before = core.hulls[NAME].state.counts if NAME in core.hulls else None
    assert core.write_at_once(stream, Write(NAME, ONE, 1, 1)) is None
    assert core.apply_points(stream, ONE) is None
    assert (core.hulls[NAME].state.counts if NAME in core.hulls else None) is before


def test_large_batches_and_commits_that_take_time_need_a_request() -> None:
    core, stream = serving()
    assert core.write_at_once(stream, Write(NAME, ONE, 1, SMALL)) is not None
    assert core.write_at_once(stream, Write(NAME, ONE, 1, SMALL + 1)) is None
    assert core.write_at_once(Stream(NAME), Write(NAME, ONE, 1, 1)) is None  # it may have to create the hull
    assert core.apply_points(stream, Batch(np.zeros((SMALL, 2)), NO_POINTS, 0, False)) is not None
    assert core.apply_points(stream, Batch(np.zeros((SMALL, 2)), np.zeros((1, 2)), 0, False)) is None
    assert core.apply_points(Stream(NAME), ONE) is None
    waits = Core(LIMITS)
    for effect in waits.step(CreateHull(None, NAME, CREATED)):
        assert isinstance(effect, Commit)
        assert effect.ticket is not None
        waits.step(Committed(effect.ticket))
    assert waits.write_at_once(Stream(NAME, waits.get(NAME)), Write(NAME, ONE, 1, 1)) is None
    assert waits.apply_points(Stream(NAME, waits.get(NAME)), ONE) is None


@pytest.mark.parametrize(
    ("write", "refusal"),
    [
        (Write(NAME, Batch(NO_POINTS, np.array([[5.0, 5.0]]), 0, False), 1, 1), PointMissingError),
        (Write(NAME, ONE, 1, 1, "p", 3, "owner"), SequenceGapError),
        (Write(NAME, ValueError("invalid"), 1, 1), ValueError),
    ],
)
def test_what_is_refused_takes_a_request(write: Write, refusal: type[Exception]) -> None:
    core, stream = serving()
    counts = core.get(NAME).counts
    assert core.write_at_once(stream, write) is None
    if write.producer == "" and isinstance(write.content, Batch):
        assert core.apply_points(stream, write.content) is None
    request = WriteBatch(None, write, None, stream)
    answered(core, request)
    assert (type(request.error), stream.stopped) == (refusal, True)
    assert core.get(NAME).counts is counts


@pytest.mark.parametrize("points_alone", [False, True])
def test_memory_that_runs_out_in_the_middle(monkeypatch: pytest.MonkeyPatch, *, points_alone: bool) -> None:
    """A part of the batch may be in memory: what comes after it does not apply it again, and the hull is examined."""
    core, stream = serving()
    counts = core.get(NAME).counts
    applied = []

    def run_out(_: Multiset, batch: Batch, __: int) -> Applied:
        applied.append(batch)
        raise MemoryError

    monkeypatch.setattr(Multiset, "apply", run_out)
    write = Write(NAME, ONE, 1, 1)
    if points_alone:
        assert core.apply_points(stream, ONE) is None
    assert core.write_at_once(stream, write) is None
    request = WriteBatch(None, write, None, stream)
    reply, examine = core.step(request)
    assert isinstance(reply, Reply)
    assert isinstance(examine, Examine)
    assert (len(applied), reply.requests, stream.stopped) == (1, [request], True)
    assert request.error is not None
    hull: Hull = core.get(NAME)
    assert hull.counts is counts
    assert core.write_at_once(stream, write) is None
