"""Alarms are decided as exact rationals of the points decide: also where a measure is the bound, to the last bit."""

import math
import random
from collections.abc import Iterator
from fractions import Fraction
from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS

from dynhull import convex_hull
from dynhull_server.state.alarms.rule import AlarmRule, marked
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.core import Core
from dynhull_server.state.events import Commit, Committed, Compute, Computed
from dynhull_server.state.fences.events.block import AppendEvents
from dynhull_server.state.fences.index.pair import nearness
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.records import EventType
from dynhull_server.state.fences.model.requests import CreateFence
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import Birth, CreateHull, WriteBatch

KEYS = 5
BATCHES = 150
CREATED = Birth("uid", 0.0)
Corner = tuple[Fraction, Fraction]


class Everyone:
    """Receives all answers."""

    def answer(self, request: Any) -> None:
        assert request.error is None


class Life:
    """A core whose commits succeed; it keeps whether an alarm was raised or cleared, and at which revision."""

    def __init__(self) -> None:
        self.core = Core(LIMITS)
        self.made: list[tuple[bool, int]] = []

    def step(self, event: Any) -> None:
        for effect in self.core.step(event):
            if isinstance(effect, Compute):
                effect.ticket.run()
                self.step(Computed(effect.ticket))
            if isinstance(effect, Commit) and effect.ticket is not None:
                for change in effect.changes:
                    if isinstance(change, AppendEvents):
                        (events,) = change.block.by_fence().values()
                        self.made += [(event.type is EventType.BEGIN, event.subject_revision) for event in events]
                self.step(Committed(effect.ticket))


def squared(measure: str, corners: list[Corner]) -> Fraction:
    """The area, or the square of another measure."""
    sides = list(pairwise([*corners, corners[0]])) if corners else []
    if measure == "area":
        return sum((ax * by - bx * ay for (ax, ay), (bx, by) in sides), Fraction(0)) / 2
    if measure == "diameter":
        return max(
            ((ax - bx) ** 2 + (ay - by) ** 2 for (ax, ay), (bx, by) in combinations(corners, 2)), default=Fraction(0)
        )
    if len(corners) < 3:
        return Fraction(0)
    heights = (
        (max((bx - ax) * (y - ay) - (by - ay) * (x - ax) for x, y in corners) ** 2, (bx - ax) ** 2 + (by - ay) ** 2)
        for (ax, ay), (bx, by) in sides
    )
    return min(height / length for height, length in heights)


def batches(dice: random.Random, scale: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Moves on a small grid, whose measures come again and again, and now and then a last bit beside it."""
    for _ in range(BATCHES):
        keys = np.array(sorted(dice.sample(range(KEYS), dice.randrange(1, 3))), np.uint64)
        points = np.array([[dice.randint(-2, 2) * scale, dice.randint(-2, 2) * scale] for _ in keys])
        if dice.random() < 0.3:
            points[0, 0] = np.nextafter(points[0, 0], dice.choice([-9, 9]))
        yield keys, points


@pytest.mark.every(5)
@pytest.mark.parametrize("measure", ["area", "diameter", "width"])
@pytest.mark.parametrize(("op", "scale"), [(">", 1.0), (">=", 0.5), ("<", 2.0**-400), ("<=", 3.0)])
def test_events_are_those_of_exact_rationals(measure: str, op: str, scale: float) -> None:
    dice = random.Random(f"{measure} {op}")
    # Attained by many hulls of the grid: a square of 2 by 2, the side of 4, and the height of a triangle.
    bound = {"area": 4 * scale * scale, "diameter": 4 * scale, "width": 2 * scale}[measure]
    exact = Fraction(bound) if measure == "area" else Fraction(bound) ** 2
    rule = AlarmRule(f"{measure} {op} {bound!r}", str(AlarmRule(f"{measure} {op} {bound!r}", "").raises.opposite))
    life, positions, expected, attained = Life(), {}, [], 0
    life.step(CreateHull(Everyone(), "fleet", CREATED, HullSettings("int")))
    life.step(CreateFence(Everyone(), marked("size"), 0, FenceConfig(rule, "other", "fleet"), CREATED))
    raised = op.startswith("<")
    expected = [(True, 0)] if raised else []
    for revision, (keys, points) in enumerate(batches(dice, scale), start=1):
        life.step(
            WriteBatch(Everyone(), Write("fleet", KeyedBatch("int", keys, points, keys[:0]), revision, len(keys)))
        )
        positions.update(zip(keys.tolist(), points.tolist(), strict=True))
        corners = [(Fraction(x), Fraction(y)) for x, y in convex_hull(np.array(list(positions.values()))).tolist()]
        value = squared(measure, corners)
        attained += value == exact
        holds = {">": value > exact, ">=": value >= exact, "<": value < exact, "<=": value <= exact}[op]
        if holds != raised:
            raised = holds
            expected.append((raised, revision))
    assert life.made == expected
    assert len(expected) > 3
    assert attained > 0


def apart(one: list[Corner], other: list[Corner]) -> Fraction:
    """The square of the distance of two convex polygons, points or segments, which do not intersect."""
    return min(square_to(p, a, b) for p, ring in pairs(one, other) for a, b in pairwise([*ring, ring[0]]))


def pairs(one: list[Corner], other: list[Corner]) -> list[tuple[Corner, list[Corner]]]:
    return [(p, other) for p in one] + [(p, one) for p in other]


def square_to(p: Corner, a: Corner, b: Corner) -> Fraction:
    (dx, dy), (px, py) = (b[0] - a[0], b[1] - a[1]), (p[0] - a[0], p[1] - a[1])
    length = dx * dx + dy * dy
    share = min(max((px * dx + py * dy) / length, Fraction(0)), Fraction(1)) if length else Fraction(0)
    return (px - share * dx) ** 2 + (py - share * dy) ** 2


@pytest.mark.parametrize("scale", [1.0, 3.0, 2.0**-400, 2.0**400])
def test_distances_are_those_of_exact_rationals(scale: float) -> None:
    """Two hulls on either side of an axis, one of which moves at a time."""
    dice = random.Random(f"near {scale}")
    bound = 2 * scale
    rule = AlarmRule(f"near b {bound!r}", f"not near b {bound!r}")
    life, positions, expected, attained, raised = Life(), {"a": {}, "b": {}}, [], 0, False
    for hull in positions:
        life.step(CreateHull(Everyone(), hull, CREATED, HullSettings("int")))
    life.step(CreateFence(Everyone(), marked("size"), 0, FenceConfig(rule, "other", "a"), CREATED))
    revisions = {"a": 0, "b": 0}
    for keys, points in batches(dice, scale):
        hull = dice.choice("ab")
        points[:, 0] = np.abs(points[:, 0]) * (1 if hull == "a" else -1) + (0 if hull == "a" else -scale)
        keys, points = keys[:1] % 2, points[:1]
        revisions[hull] += 1
        write = Write(hull, KeyedBatch("int", keys, points, keys[:0]), revisions[hull], len(keys))
        life.step(WriteBatch(Everyone(), write))
        positions[hull].update(zip(keys.tolist(), points.tolist(), strict=True))
        if not (positions["a"] and positions["b"]):
            continue
        one, other = (
            [(Fraction(x), Fraction(y)) for x, y in convex_hull(np.array(list(each.values()))).tolist()]
            for each in positions.values()
        )
        square = apart(one, other)
        attained += square == Fraction(bound) ** 2
        if (square <= Fraction(bound) ** 2) != raised:
            raised = not raised
            expected.append((raised, revisions["a"]))
    assert life.made == expected
    assert len(expected) > 3
    assert attained > 0


@pytest.mark.parametrize("turned", [((1, 0), (0, 1)), ((3, -4), (4, 3))])
def test_a_distance_of_large_hulls_is_decided_exactly(turned: tuple[tuple[int, int], ...]) -> None:
    """Two thousand corners, of which a thousand face the other hull nearly flat: 7 apart in the middle, or 35."""
    x = np.arange(-500.0, 501.0)
    upper = convex_hull(np.vstack([np.column_stack([x, -x * x / 2**20]), [[-500, -5], [500, -5]]]))
    lower = convex_hull([0, 7] - upper)
    one, other = (convex_hull(each @ np.array(turned, np.float64).T) for each in (upper, lower))
    distance = 7.0 * math.hypot(*turned[0])
    limits = math.nextafter(distance, 0), distance, math.nextafter(distance, math.inf)
    assert [nearness(one, other, limit, None)[0] for limit in limits] == [False, True, True]
    assert [nearness(other, one, limit, None)[0] for limit in limits] == [False, True, True]


def test_distances_are_decided_as_fractions_decide() -> None:
    """Of random hulls with few and with many corners, by the rounded distance and its neighbours."""
    dice = np.random.default_rng(1)
    decided = set()
    for _ in range(60):
        points = dice.integers(-4, 5, (2, int(dice.integers(1, 12)), 2)) * float(10.0 ** dice.integers(-3, 3))
        one, other = convex_hull(points[0]), convex_hull(points[1] + np.abs(points).max() * dice.integers(-4, 5, 2))
        corners = [[(Fraction(x), Fraction(y)) for x, y in each.tolist()] for each in (one, other)]
        near, distance = nearness(one, other, 0.0, None)
        if near:
            continue
        square = apart(*corners)
        for limit in (math.nextafter(distance, 0), distance, math.nextafter(distance, math.inf)):
            expected = square <= Fraction(limit) ** 2
            assert nearness(one, other, limit, None)[0] == expected
            decided.add((expected, square == Fraction(limit) ** 2))
    assert decided >= {(True, True), (True, False), (False, False)}
