"""What alarms cost batches: counted, not timed."""

from collections import Counter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from live_engine import LIMITS

import dynhull
from dynhull.keys import PackedKeys
from dynhull.measure import LastVertices, _comparison
from dynhull_server.state.alarms import watched
from dynhull_server.state.alarms.conditions import condition_of
from dynhull_server.state.alarms.rule import AlarmRule, marked
from dynhull_server.state.alarms.values import EXACT
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.core import Core
from dynhull_server.state.events import Arrived, Commit, Committed, Event
from dynhull_server.state.fences.events.block import AppendEvents
from dynhull_server.state.fences.index.line import MEASURED
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.requests import CreateFence
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import Birth, CreateHull, WriteBatch

if TYPE_CHECKING:
    from collections.abc import Callable

HULLS = [f"fleet/{number}" for number in range(4)]
BATCHES = 20
CREATED = Birth("uid", 0.0)
CORNERS = {"a": (0, 0), "b": (4, 0), "c": (4, 3), "d": (0, 3)}


def moved(hull: str, places: dict[str, tuple[float, float]]) -> WriteBatch:
    batch = KeyedBatch(
        "str", PackedKeys.pack(list(places)), np.array(list(places.values()), float), PackedKeys.pack([])
    )
    return WriteBatch(None, Write(hull, batch, 1))


def step(core: Core, event: Event) -> None:
    for effect in core.step(event):
        if isinstance(effect, Commit) and effect.ticket is not None:
            step(core, Committed(effect.ticket))


def counted(monkeypatch: pytest.MonkeyPatch, counts: "Counter[str]", where: Any, name: str) -> None:
    function: Callable[..., Any] = getattr(where, name)

    def count(*args: Any, **options: Any) -> Any:
        counts[name] += 1
        return function(*args, **options)

    monkeypatch.setattr(where, name, count)


def takes_counted(monkeypatch: pytest.MonkeyPatch, counts: "Counter[str]") -> None:
    """Count what takes vertices where nothing has happened, and how often it is asked."""
    taker = LastVertices.taker

    def make(*args: Any) -> "Callable[[], bool]":
        take = taker(*args)
        counts["takers"] += 1

        def taking() -> bool:
            counts["takes"] += 1
            return take()

        return taking

    monkeypatch.setattr(LastVertices, "taker", make)


@pytest.mark.parametrize("prefix", [False, True])
@pytest.mark.parametrize("measure", ["area", "diameter", "width", "perimeter", "vertices"])
def test_a_batch_that_leaves_the_outline_costs_nothing(
    monkeypatch: pytest.MonkeyPatch, measure: str, *, prefix: bool
) -> None:
    core, counts = Core(LIMITS), Counter[str]()
    for hull in HULLS:
        step(core, CreateHull(None, hull, CREATED, HullSettings("str")))
        step(core, moved(hull, CORNERS | {"inside": (1, 1)}))
    rule = AlarmRule(f"{measure} > 1000", f"{measure} <= 1000")
    for kind, subjects in [("prefix", "fleet/")] if prefix else [("other", hull) for hull in HULLS]:
        step(core, CreateFence(None, marked(subjects), 1, FenceConfig(rule, kind, subjects), CREATED))
    takes_counted(monkeypatch, counts)
    counted(monkeypatch, counts, watched, "holds")
    counted(monkeypatch, counts, watched, "compare")
    counted(monkeypatch, counts, watched.Watched, "touched")
    counted(monkeypatch, counts, _comparison, "_sign")
    for number in range(BATCHES):
        for hull in HULLS:
            step(core, moved(hull, {"inside": (1 + number / BATCHES, 1)}))
            step(core, Arrived([moved(hull, {"inside": (2, 1)}), moved(hull, {"inside": (1, 2)})]))
    assert counts == {}
    for number in range(BATCHES):
        step(core, moved(HULLS[0], {"c": (4, 4 + number)}))
    exactly = 0 if dynhull.KERNEL == "cpp" or measure not in ("diameter", "width") else BATCHES
    looks = Counter(takers=1, takes=BATCHES) if measure in EXACT else Counter(touched=BATCHES, holds=BATCHES)
    assert counts == looks + Counter(_sign=exactly)
    step(core, moved(HULLS[0], {"e": (2, -1)}))
    line = core.line(HULLS[0])
    assert line is not None
    assert line.weight(HULLS[0]) == MEASURED * 5  # of the vertices as they are now
    step(core, moved(HULLS[0], {"e": (2, 1)}))
    for hull in HULLS:
        assert core.get(hull).counts.revision == 1 + 3 * BATCHES + (BATCHES + 2 if hull == HULLS[0] else 0)


@pytest.mark.parametrize("when", ["area > 1000", "near fleet/1 1", "vertex in circle(900, 900, 1)"])
def test_a_batch_in_memory_is_applied_as_without_alarms(monkeypatch: pytest.MonkeyPatch, when: str) -> None:
    core, counts = Core(LIMITS, immediate=True, keeps=False), Counter[str]()
    for number, hull in enumerate(HULLS):
        step(core, CreateHull(None, hull, CREATED, HullSettings("str")))
        places = {key: (x + 100 * number, y) for key, (x, y) in CORNERS.items()}
        step(core, moved(hull, places | {"inside": (1 + 100 * number, 1)}))
    rule = AlarmRule(when, str(condition_of(when).opposite))
    step(core, CreateFence(None, marked("rule"), 1, FenceConfig(rule, "other", HULLS[0]), CREATED))
    counted(monkeypatch, counts, Core, "_new_trip")
    counted(monkeypatch, counts, watched.Watched, "touched")
    for number in range(BATCHES):
        step(core, moved(HULLS[0], {"inside": (1 + number / BATCHES, 1)}))
        step(core, moved(HULLS[2], {"c": (204, 4 + number)}))
    assert counts == {}
    for number in range(BATCHES):
        step(core, moved(HULLS[0], {"c": (4, 4 + number)}))
    assert counts == Counter(touched=BATCHES)
    step(core, moved(HULLS[0], {"c": (900, 900), "d": (101, 1)}))
    assert counts["_new_trip"] == 1
    assert core.fence(marked("rule")).last == 1


@pytest.mark.parametrize("keeps", [False, True])
def test_batches_that_are_applied_at_once_make_the_same_events(*, keeps: bool) -> None:
    """As on a server in memory, whose commits are carried out within a step."""
    random, made = np.random.default_rng(7), []
    sides = random.uniform(1, 5, (BATCHES, len(HULLS))).tolist()
    for immediate in (False, True):
        core, events = Core(LIMITS, immediate=immediate, keeps=keeps), []

        def take(event: Event, core: Core = core, events: list[Any] = events) -> None:
            for effect in core.step(event):
                if isinstance(effect, Commit):
                    blocks = [each.block.by_fence() for each in effect.changes if isinstance(each, AppendEvents)]
                    events += [(number, each) for block in blocks for number, found in block.items() for each in found]
                    if effect.ticket is not None:
                        take(Committed(effect.ticket))

        for hull in HULLS:
            take(CreateHull(None, hull, CREATED, HullSettings("str")))
        for when, clear in (("area > 9", "area < 6"), ("width > 2", "width <= 2"), ("count > 4", "count <= 4")):
            rule = FenceConfig(AlarmRule(when, clear), "prefix", "fleet/")
            take(CreateFence(None, marked(when.split()[0]), 1, rule, CREATED))
        for number, each in enumerate(sides):
            for hull, side in zip(HULLS, each, strict=True):
                take(moved(hull, {key: (x * side / 4, y * side / 3) for key, (x, y) in CORNERS.items()}))
                take(moved(hull, {f"inside {number % 2}": (0.5, 0.5)}))
        made.append(events)
        assert core.get(HULLS[0]).counts.revision == 2 * BATCHES
        assert not core.busy
        core.check()
    assert len(made[0]) > 3 * len(HULLS)
    assert made[0] == made[1]
