"""Alarms against exact integers: after each of many batches, every rule is decided from the positions by hand.

    python tests/robustness/alarms/alarm_rationals.py [--batches 100000] [--seed 0]

Keys of three hulls move on a small grid, whose measures come again and again, and now and then a last bit beside it:
the bounds of the rules are attained, and missed by one bit. Alarms are about area, diameter, width, counts, distances,
vertices in areas and keys that are vertices, with and without hysteresis; a batch may go to two hulls at once.
"""

import argparse
import math
import random
import sys
import time
from collections import Counter
from collections.abc import Callable
from fractions import Fraction
from itertools import combinations, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

sys.path += [str(Path(__file__).parents[2] / "support")]

from live_engine import LIMITS

from dynhull_server.state.alarms.rule import AlarmRule, marked
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.core import Core
from dynhull_server.state.events import Commit, Committed, Compute, Computed
from dynhull_server.state.fences.events.block import AppendEvents
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.records import EventType
from dynhull_server.state.fences.model.requests import CreateFence
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import Birth, CreateHull, WriteBatch, WriteTogether

HULLS, KEYS, GRID = ("a", "b", "c"), 6, 3
SCALES = 1.0, 3.0, 2.0**-400, 2.0**300
LIFE = 500  # batches with one scale, at most
LAST_BIT = 0.2  # of the moves end beside a point of the grid
CREATED = Birth("uid", 0.0)

Corner = tuple[int, int]


class Measured(NamedTuple):
    """A measure, or its square, compared with bounds as a rational number."""

    above: int
    below: int = 1

    def sign(self, bound: int, *, squared: bool) -> int:
        """The sign of the measure less a bound."""
        least = (bound * bound if squared else bound) * self.below
        return (self.above > least) - (self.above < least)


class Rule(NamedTuple):
    """A rule of an alarm: `when` and `clear` with their bounds in units of the scale, and the measure of a hull."""

    hull: str
    when: str
    clear: str
    bounds: tuple[float, float]
    squared: bool
    measure: Callable[["World", str], Measured | None]


class World:
    """The positions of the keys of hulls, as multiples of the least step between doubles of a scale."""

    def __init__(self, scale: float) -> None:
        self.unit = Fraction(2) ** (math.frexp(scale)[1] - 60)
        self.positions: dict[str, dict[int, Corner]] = {hull: {} for hull in HULLS}
        self._corners: dict[str, list[Corner]] = {}

    def whole(self, value: float) -> int:
        found = Fraction(value) / self.unit
        assert found.denominator == 1
        return found.numerator

    def put(self, hull: str, keys: np.ndarray, points: np.ndarray) -> None:
        for key, (x, y) in zip(keys.tolist(), points.tolist(), strict=True):
            self.positions[hull][key] = self.whole(x), self.whole(y)
        self._corners.pop(hull, None)

    def corners(self, hull: str) -> list[Corner]:
        """The vertices of a hull, counter-clockwise (Andrew 1979)."""
        if hull not in self._corners:
            points = sorted(set(self.positions[hull].values()))
            chains = [chain(points), chain(points[::-1])]
            self._corners[hull] = points if len(points) < 3 else chains[0][:-1] + chains[1][:-1]
        return self._corners[hull]


def chain(points: list[Corner]) -> list[Corner]:
    found: list[Corner] = []
    for p in points:
        while len(found) > 1 and turn(found[-2], found[-1], p) <= 0:
            found.pop()
        found.append(p)
    return found


def turn(a: Corner, b: Corner, c: Corner) -> int:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def square(a: Corner, b: Corner) -> int:
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2


def edges(corners: list[Corner]) -> list[tuple[Corner, Corner]]:
    return list(pairwise([*corners, *corners[:1]])) if len(corners) > 1 else [(corners[0], corners[0])]


def area(world: World, hull: str) -> Measured:
    corners = world.corners(hull)
    return Measured(sum(a[0] * b[1] - b[0] * a[1] for a, b in pairwise([*corners, *corners[:1]])), 2)


def diameter(world: World, hull: str) -> Measured:
    return Measured(max((square(a, b) for a, b in combinations(world.corners(hull), 2)), default=0))


def width(world: World, hull: str) -> Measured:
    corners = world.corners(hull)
    if len(corners) < 3:
        return Measured(0)
    found = [Measured(max(turn(a, b, p) for p in corners) ** 2, square(a, b)) for a, b in edges(corners)]
    return min(found, key=lambda each: Fraction(*each))


def count(world: World, hull: str) -> Measured:
    return Measured(len(world.positions[hull]))


def vertices(world: World, hull: str) -> Measured:
    return Measured(len(world.corners(hull)))


def holds(corners: list[Corner], p: Corner) -> bool:
    """Whether a convex polygon, segment or point has a point."""
    if len(corners) < 3:
        a, b = corners[0], corners[-1]
        return turn(a, b, p) == 0 and min(a, b) <= p <= max(a, b)
    return all(turn(a, b, p) >= 0 for a, b in edges(corners))


def to_edge(p: Corner, a: Corner, b: Corner) -> Measured:
    """The square of the distance from a point to a segment."""
    length, along = square(a, b), (p[0] - a[0]) * (b[0] - a[0]) + (p[1] - a[1]) * (b[1] - a[1])
    if along <= 0:
        return Measured(square(a, p))
    return Measured(square(b, p)) if along >= length else Measured(turn(a, b, p) ** 2, length)


def cross(one: list[Corner], other: list[Corner]) -> bool:
    """Whether edges of two hulls cross, or a corner of one is in the other."""
    if any(holds(other, p) for p in one) or any(holds(one, p) for p in other):
        return True
    return any(
        turn(a, b, c) * turn(a, b, d) < 0 and turn(c, d, a) * turn(c, d, b) < 0
        for a, b in edges(one)
        for c, d in edges(other)
    )


def near(other: str) -> Callable[[World, str], Measured | None]:
    def measure(world: World, hull: str) -> Measured | None:
        one, two = world.corners(hull), world.corners(other)
        if not (one and two):
            return None  # infinitely far
        if cross(one, two):
            return Measured(0)
        found = [to_edge(p, a, b) for c, ring in ((one, two), (two, one)) for p in c for a, b in edges(ring)]
        return min(found, key=lambda each: Fraction(*each))

    return measure


def inside(area_of: Callable[[World], Callable[[Corner], bool] | None]) -> Callable[[World, str], Measured]:
    def measure(world: World, hull: str) -> Measured:
        has = area_of(world)
        return Measured(0 if has is None else sum(map(has, world.corners(hull))))

    return measure


def is_vertex(key: int) -> Callable[[World, str], Measured]:
    return lambda world, hull: Measured(int(world.positions[hull].get(key) in world.corners(hull)))


def rules(scale: float) -> list[Rule]:
    """Rules whose bounds many hulls of the grid attain."""
    found = []
    bounds: dict[str, tuple[Callable[..., Measured], float, float, bool]] = {
        "area": (area, 9 * scale * scale, 4 * scale * scale, False),
        "diameter": (diameter, 5 * scale, 4 * scale, True),
        "width": (width, 3 * scale, 2 * scale, True),
    }
    for name, (measure, bound, wider, squared) in bounds.items():
        if not 0 < wider < bound < float("inf"):
            continue  # of the smallest scale areas have no doubles
        for hull, op, off in (("a", ">", "<="), ("b", ">=", "<"), ("c", "<=", ">"), ("c", "<", ">=")):
            found.append(
                Rule(hull, f"{name} {op} {bound!r}", f"{name} {off} {bound!r}", (bound, bound), squared, measure)
            )
        found.append(Rule("a", f"{name} >= {bound!r}", f"{name} <= {wider!r}", (bound, wider), squared, measure))
        found.append(Rule("b", f"{name} <= {wider!r}", f"{name} > {bound!r}", (wider, bound), squared, measure))
    for distance in (0.0, scale, 5 * scale):
        when = f"near b {distance!r}" if distance else "near b"
        found.append(Rule("a", when, f"not {when}", (distance, distance), True, near("b")))
    found.append(Rule("c", f"near b {scale!r}", f"not near b {2 * scale!r}", (scale, 2 * scale), True, near("b")))
    return found


def counted(scale: float) -> list[Rule]:
    """Rules whose measures are numbers."""
    ring = [(-2, -1), (1, -1), (1, 2)]
    corners = [(x * scale, y * scale) for x, y in ring]
    polygon = f"polygon({', '.join(f'{x!r} {y!r}' for x, y in corners)})"
    circle = f"circle({scale!r}, {0.0!r}, {2 * scale!r})"

    def in_polygon(world: World) -> Callable[[Corner], bool]:
        whole = [(world.whole(x), world.whole(y)) for x, y in corners]
        return lambda p: holds(whole, p)

    def in_circle(world: World) -> Callable[[Corner], bool]:
        center, radius = (world.whole(scale), 0), world.whole(2 * scale)
        return lambda p: square(p, center) <= radius * radius

    def in_hull(world: World) -> Callable[[Corner], bool] | None:
        whole = world.corners("b")
        return (lambda p: holds(whole, p)) if whole else None

    found = [
        Rule("a", f"vertex in {polygon}", f"not vertex in {polygon}", (1, 1), False, inside(in_polygon)),
        Rule("b", f"vertex in {circle}", f"not vertex in {circle}", (1, 1), False, inside(in_circle)),
        Rule("c", "vertex in b", "not vertex in b", (1, 1), False, inside(in_hull)),
        Rule("a", "count > 4", "count < 4", (4, 4), False, count),
        Rule("a", "vertices >= 5", "vertices <= 3", (5, 3), False, vertices),
        Rule("b", "vertices < 4", "vertices >= 4", (4, 4), False, vertices),
    ]
    return found + [Rule(hull, 'not vertex "1"', 'vertex "1"', (1, 1), False, is_vertex(1)) for hull in HULLS]


def sign_of(rule: Rule, bound: float, world: World, *, numbers: bool) -> int:
    """The sign of the measure of a rule less a bound."""
    measured = rule.measure(world, rule.hull)
    if measured is None:
        return 1
    if numbers:
        return measured.sign(int(bound), squared=False)
    if rule.when.startswith("area"):
        return measured.sign(int(Fraction(bound) / world.unit**2), squared=False)
    return measured.sign(world.whole(bound), squared=rule.squared)


def verdict(text: str, sign: int) -> bool:
    """Whether a condition holds, given the sign of its measure less its bound."""
    words = text.split()
    if words[0] == "not":
        return sign > 0 if words[1] == "near" else sign < 0
    if words[0] == "near":
        return sign <= 0
    if words[0] == "vertex":
        return sign >= 0
    return {">": sign > 0, ">=": sign >= 0, "<": sign < 0, "<=": sign <= 0}[words[1]]


class Life:
    """A core whose commits succeed, its alarms, and for which of them the rules say that they are raised."""

    def __init__(self, dice: random.Random, scale: float) -> None:
        self.core, self.dice, self.scale, self.world = Core(LIMITS), dice, scale, World(scale)
        self.rules = [(each, False) for each in rules(scale)] + [(each, True) for each in counted(scale)]
        self.raised = [False] * len(self.rules)
        self.numbers: list[int] = []
        self.made: dict[int, list[bool]] = {}
        self.sequences = dict.fromkeys(HULLS, 0)
        self.events = self.attained = 0
        for hull in HULLS:
            self.step(CreateHull(self, hull, CREATED, HullSettings("int")))
        for number, (rule, _) in enumerate(self.rules):
            condition = AlarmRule(rule.when, rule.clear)
            create = CreateFence(self, marked(f"r{number}"), 0, FenceConfig(condition, "other", rule.hull), CREATED)
            self.step(create)
            self.numbers.append(create.result.number)
        self.compare()

    def answer(self, request: Any) -> None:
        """Nothing is refused."""
        assert request.error is None, request.error

    def step(self, event: Any) -> None:
        for effect in self.core.step(event):
            if isinstance(effect, Compute):
                effect.ticket.run()
                self.step(Computed(effect.ticket))
            if isinstance(effect, Commit) and effect.ticket is not None:
                for change in effect.changes:
                    if isinstance(change, AppendEvents):
                        for number, events in change.block.by_fence().items():
                            self.made.setdefault(number, []).extend(e.type is EventType.BEGIN for e in events)
                self.step(Committed(effect.ticket))

    def write(self) -> None:
        """One batch to one hull, or to two of them at once, and what the alarms make of it."""
        hulls = self.dice.sample(HULLS, 2 if self.dice.random() < 0.15 else 1)
        writes = []
        for hull in hulls:
            keys = np.array(sorted(self.dice.sample(range(KEYS), self.dice.randint(1, 3))), np.uint64)
            points = np.array([[self.dice.randint(-GRID, GRID) * self.scale for _ in "xy"] for _ in keys])
            if self.dice.random() < LAST_BIT:
                row, axis = self.dice.randrange(len(keys)), self.dice.randrange(2)
                points[row, axis] = np.nextafter(points[row, axis] or self.scale, self.dice.choice([-np.inf, np.inf]))
            self.sequences[hull] += 1
            self.world.put(hull, keys, points)
            writes.append(Write(hull, KeyedBatch("int", keys, points, keys[:0]), self.sequences[hull], len(keys)))
        self.step(WriteBatch(self, writes[0]) if len(writes) == 1 else WriteTogether(self, writes))
        self.compare()

    def compare(self) -> None:
        made, self.made = self.made, {}
        for number, (rule, numbers) in enumerate(self.rules):
            text, bound = (rule.clear, rule.bounds[1]) if self.raised[number] else (rule.when, rule.bounds[0])
            sign = sign_of(rule, bound, self.world, numbers=numbers)
            changes = verdict(text, sign)
            self.attained += sign == 0 and not numbers
            self.raised[number] ^= changes
            expected = [self.raised[number]] if changes else []
            found = made.pop(self.numbers[number], [])
            if found != expected:
                raise AssertionError(f"{rule.when}, {rule.clear} at {rule.hull}: {found}, expected {expected}")
            self.events += len(expected)
        assert not made, made


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--batches", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    begun, counts = time.monotonic(), Counter[str]()
    length = min(LIFE, -(-options.batches // len(SCALES)))
    for number, first in enumerate(range(0, options.batches, length)):
        scale = SCALES[number % len(SCALES)]
        life = Life(random.Random(f"{options.seed} {number}"), scale)
        for batch in range(min(length, options.batches - first)):
            try:
                life.write()
            except AssertionError as error:
                raise SystemExit(f"seed {options.seed}, life {number}, scale {scale}, batch {batch}: {error}") from None
        counts += Counter(events=life.events, attained=life.attained)
        done, spent = min(first + length, options.batches), time.monotonic() - begun
        print(
            f"{done} batches, {counts['events']} events, {counts['attained']} bounds attained; {spent:.0f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
