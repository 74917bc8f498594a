"""Random lives of the reference in Python, every operation checked against a model in whole numbers.

    python tests/support/lives.py [--operations N] [--jobs J] [seed ...]

Without seeds, new ones until N operations are checked. A life that fails says its seed: give it to live it again.
"""

import argparse
import os
import sys
import time
import traceback
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, as_completed
from itertools import count, pairwise
from random import Random, SystemRandom

import numpy as np
from hulls import PythonHull
from inputs import CIRCLE, EXTREME

from dynhull import MissingPointError
from dynhull._tree import HullTree

LIVES_A_TASK = 20
TASKS_AHEAD = 4
SECONDS_A_LINE = 5
BAD = [(float("nan"), ValueError), (float("inf"), ValueError), ("x", TypeError), (None, TypeError)]


def hull_of_leaves(size):
    """A kind of hull: small leaves split and rotate all the time, middling ones merge too."""
    tree = type(f"TreeOfLeaves{size}", (HullTree,), {"LEAF": size})
    return type(f"HullOfLeaves{size}", (PythonHull,), {"__slots__": (), "_tree_type": tree})


HULLS = [hull_of_leaves(size) for size in (4, 8, 8, HullTree.LEAF)]


def pool(random):
    """The points of a life in lexicographic order: few enough to come again, of one kind that hull code gets wrong."""
    size = random.choices([6, 12, 20, 40, 120], [6, 8, 4, 3, 1])[0]
    signed = [sign * value for value in EXTREME for sign in (1, -1)]
    kinds = {
        "grid": lambda: (float(random.randrange(4)), float(random.randrange(4))),
        "columns": lambda: (float(random.randrange(3)), random.random()),
        "line": lambda: (i := random.randrange(-20, 20), 3.0 * i),
        "nearly a line": lambda: (x := random.random(), x + random.randrange(-2, 3) * 2.0**-53),
        "ulps": lambda: tuple(0.5 + random.randrange(-4, 5) * 2.0**-53 for _ in "xy"),
        "circle": lambda: random.choice(CIRCLE),
        "parabola": lambda: (x := float(random.randrange(-99, 99)), x * x),
        "square": lambda: (random.random(), random.random()),
        "huge": lambda: (random.uniform(-1, 1) * 1.7e308, random.uniform(-1, 1) * 1.7e308),
        "tiny": lambda: (random.randrange(-5, 5) * 5e-324, random.randrange(-5, 5) * 5e-324),
        "extreme": lambda: (random.choice(signed), random.choice(signed)),
        "mixed": lambda: (random.choice(signed), random.gauss(0, 1)),
    }
    kind = random.choice(list(kinds))
    drawn = [kinds[kind]() for _ in range(size)]
    return kind, sorted({(float(x) + 0.0, float(y) + 0.0) for x, y in drawn})


class Model:
    """A multiset of numbers of points of a pool, and their hull by the monotone chain on integers."""

    def __init__(self, points):
        ratios = [[value.as_integer_ratio() for value in point] for point in points]
        scale = max(denominator for ratio in ratios for _, denominator in ratio)
        self.whole = [tuple(a * (scale // b) for a, b in ratio) for ratio in ratios]
        self.copies = Counter()

    def turn(self, i, j, k):
        (ax, ay), (bx, by), (cx, cy) = self.whole[i], self.whole[j], self.whole[k]
        det = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        return (det > 0) - (det < 0)

    def present(self):
        return sorted(self.copies)

    def hull(self):
        def chain(numbers):
            kept = []
            for k in numbers:
                while len(kept) > 1 and self.turn(kept[-2], kept[-1], k) <= 0:
                    kept.pop()
                kept.append(k)
            return kept

        numbers = self.present()
        if len(numbers) < 2:
            return numbers
        return chain(numbers)[:-1] + chain(numbers[::-1])[:-1]

    def where(self, corners, k):
        if len(corners) < 3:
            on_line = corners and self.turn(corners[0], corners[-1], k) == 0
            return 0 if on_line and min(corners) <= k <= max(corners) else -1
        return min(self.turn(i, j, k) for i, j in pairwise([*corners, corners[0]]))

    def farthest(self, corners, direction):
        dx, dy = direction
        return min(corners, key=lambda k: (-(dx * self.whole[k][0] + dy * self.whole[k][1]), k))

    def tangents(self, corners, k):
        """The left and the right one, of two on a ray the farther; None where the point is not outside."""
        if not corners or self.where(corners, k) >= 0:
            return None
        found = []
        for side in (1, -1):
            on_ray = [c for c in corners if all(side * self.turn(k, c, other) <= 0 for other in corners)]
            # Farther from a point outside: farther from it in lexicographic order too.
            found.append(max(on_ray, key=lambda c: abs(c - k)))
        return found


class Life:
    """One hull from its first point to its last, and the model of it."""

    def __init__(self, seed):
        self.random = Random(seed)
        self.kind, self.points = pool(self.random)
        self.model = Model(self.points)
        self.number = {point: k for k, point in enumerate(self.points)}
        self.hull = self.random.choice(HULLS)()
        self.corners = []
        self.operations = 0

    def live(self):
        """Run some dozens of operations; returns their number."""
        updates = [self.insert] * 5 + [self.delete] * 3 + [self.delete_vertex] * 2 + [self.batch] * 3
        rare = [self.delete_missing, self.refuse, self.copy, self.rebuild, self.clear]
        queries = [self.locate, self.support, self.tangents, self.count]
        for _ in range(self.random.randrange(20, 80)):
            self.random.choice(
                updates if self.random.random() < 0.7 else queries if self.random.random() < 0.8 else rare
            )()
            self.operations += 1
        return self.operations

    def rows(self, numbers):
        return [self.points[k] for k in numbers]

    def any_number(self):
        return self.random.randrange(len(self.points))

    def some_numbers(self, most):
        return [self.any_number() for _ in range(self.random.randrange(most))]

    def check_update(self, changed, changes):
        """Compare the hull with the model and check its invariants; `changes` is their number before the update."""
        before, self.corners = self.corners, self.model.hull()
        assert changed == (before != self.corners), f"changed is {changed}"
        assert self.hull.changes == changes + changed, "changes is off"
        assert list(map(tuple, self.hull.vertices().tolist())) == self.rows(self.corners), "vertices are off"
        expected = [p for k in self.model.present() for p in [self.points[k]] * self.model.copies[k]]
        assert list(map(tuple, self.hull.points().tolist())) == expected, "points are off"
        assert (len(self.hull), self.hull.distinct) == (len(expected), len(self.model.copies)), "a count is off"
        self.hull.check()

    def insert(self):
        k, changes = self.any_number(), self.hull.changes
        changed = self.hull.insert(*self.points[k])
        self.model.copies[k] += 1
        self.check_update(changed, changes)

    def take(self, k):
        changes = self.hull.changes
        changed = self.hull.delete(*self.points[k])
        self.model.copies -= Counter([k])
        self.check_update(changed, changes)

    def delete(self):
        self.take(self.random.choice(self.model.present())) if self.model.copies else self.insert()

    def delete_vertex(self):
        self.take(self.random.choice(self.corners)) if self.corners else self.insert()

    def delete_missing(self):
        k, changes = self.any_number(), self.hull.changes
        if not self.model.copies[k]:
            self.expect(MissingPointError, self.hull.delete, *self.points[k])
        self.check_update(False, changes)

    def batch(self):
        """As a set: what is inserted comes first."""
        numbers = self.some_numbers(self.random.choice([4, 12, 60]))
        mood = self.random.choice([0.0, 0.5, 1.0])
        ops = [1 if self.random.random() < mood else -1 for _ in numbers]
        after = self.model.copies + Counter(k for k, op in zip(numbers, ops, strict=True) if op > 0)
        missing = []
        for row, (k, op) in enumerate(zip(numbers, ops, strict=True)):
            if op < 0 and after[k]:
                after[k] -= 1
            elif op < 0:
                missing.append(row)
        changes, rows = self.hull.changes, np.array(self.rows(numbers)).reshape(-1, 2)
        ignore = self.random.random() < 0.5
        if missing and not ignore:
            error = self.expect(MissingPointError, self.hull.apply, ops, rows)
            assert (error.row, error.point) == (missing[0], self.points[numbers[missing[0]]]), "another row is missing"
        else:
            applied = self.hull.apply(ops, rows, missing="ignore" if ignore else "raise")
            assert applied == len(numbers) - len(missing), "a batch miscounts its rows"
            self.model.copies = +after
        self.check_update(self.hull.changes > changes, changes)

    def refuse(self):
        bad, error = self.random.choice(BAD)
        rows, changes = self.rows(self.some_numbers(5)), self.hull.changes
        self.expect(error, self.hull.insert_many, [*rows, (0.0, bad)])
        self.expect(error, self.hull.insert, bad, 0.0)
        self.check_update(False, changes)

    def copy(self):
        changes = self.hull.changes
        old, self.hull = self.hull, self.hull.copy()
        old.clear()
        self.check_update(False, changes)

    def rebuild(self):
        rows = self.hull.points()
        order = list(range(len(rows)))
        self.random.shuffle(order)
        self.hull = type(self.hull)(rows[order])
        self.check_update(False, self.hull.changes)

    def clear(self):
        changes = self.hull.changes
        self.hull.clear()
        self.model.copies.clear()
        self.check_update(bool(self.corners), changes)

    def locate(self):
        numbers = self.some_numbers(8) + self.corners[:2]
        expected = [self.model.where(self.corners, k) for k in numbers]
        assert self.hull.locate(self.rows(numbers)).tolist() == expected, f"locate of {self.rows(numbers)}"

    def count(self):
        k = self.any_number()
        assert self.hull.count(*self.points[k]) == self.model.copies.get(k, 0), f"count of {self.points[k]}"

    def support(self):
        if not self.corners:
            self.expect(ValueError, self.hull.support, [[1, 0]])
            return
        ways = [(self.random.randrange(-3, 4), self.random.randrange(-3, 4)) for _ in range(6)]
        ways = [way for way in ways if any(way)]
        expected = self.rows(self.model.farthest(self.corners, way) for way in ways)
        assert list(map(tuple, self.hull.support(ways).tolist())) == expected, f"support in {ways}"

    def tangents(self):
        numbers = self.some_numbers(6)
        for k, pair in zip(numbers, self.hull.tangents(self.rows(numbers)).tolist(), strict=True):
            expected = self.model.tangents(self.corners, k)
            found = None if np.isnan(pair).all() else [self.number[tuple(corner)] for corner in pair]
            assert found == expected, f"tangents from {self.points[k]}"

    @staticmethod
    def expect(error, action, *arguments):
        try:
            action(*arguments)
        except error as raised:
            return raised
        raise AssertionError(f"no {error.__name__} was raised")


def survive(seeds):
    """The number of operations in all these lives, and the first failure or None."""
    operations = 0
    for seed in seeds:
        life = Life(seed)
        try:
            operations += life.live()
        except Exception:
            what = f"{life.kind}, {type(life.hull).__name__}, operation {life.operations}"
            return operations + life.operations, f"seed {seed} ({what}):\n{traceback.format_exc()}"
    return operations, None


def main(words):
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--operations", type=int, default=10_000)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("seeds", nargs="*", type=int)
    chosen = parser.parse_args(words)
    if chosen.seeds:
        operations, failure = survive(chosen.seeds)
        print(failure or f"{operations:,} operations checked")
        return 1 if failure else 0
    first = SystemRandom().randrange(10**12)
    operations = lives = 0
    start = said = time.monotonic()
    starts = count(first, LIVES_A_TASK)
    with ProcessPoolExecutor(chosen.jobs) as workers:

        def begin():
            seed = next(starts)
            return workers.submit(survive, range(seed, seed + LIVES_A_TASK))

        waiting = {begin() for _ in range(chosen.jobs * TASKS_AHEAD)}
        while operations < chosen.operations:
            done = next(as_completed(waiting))
            waiting.remove(done)
            more, failure = done.result()
            operations, lives = operations + more, lives + LIVES_A_TASK
            if failure:
                print(f"{failure}\nagain: python {sys.argv[0]} SEED")
                return 1
            waiting.add(begin())
            if time.monotonic() - said > SECONDS_A_LINE:
                said = time.monotonic()
                print(
                    f"{operations:,} operations, {lives:,} lives, seeds from {first}, {said - start:.0f} s", flush=True
                )
        workers.shutdown(cancel_futures=True)
    print(f"{operations:,} operations checked in {lives:,} lives of the reference, seeds from {first}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
