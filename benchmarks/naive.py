"""Textbook hulls with rounded signs, on published inputs that break them.

    python benchmarks/naive.py [--orders 2000] [--out docs/images/naive.png]

Four algorithms as they are usually written, with the orientation test in plain floating point. Each runs on every order
of the points, or on --orders random ones where there are more than six points. A result is wrong when its vertices are
not those of the exact hull; `misses by` is the distance of the farthest point left outside, as a share of the extent.
"""

import argparse
import random
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import permutations, product
from math import atan2, dist
from pathlib import Path

import numpy as np

import dynhull

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from killers import PUBLISHED

Point = tuple[float, float]
EVERY_ORDER = 6  # points
BLUE, ORANGE, RED, GREY = "#0072B2", "#E69F00", "#D55E00", "#999999"


class NoHullError(Exception):
    """The algorithm does not end, or reaches a state that is impossible with exact signs."""


def rounded_turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def wrapping(points: Sequence[Point]) -> list[Point]:
    start = min(points)
    hull = [start]
    while len(hull) <= len(points):
        best = None
        for p in points:
            if p != hull[-1] and (best is None or rounded_turn(hull[-1], best, p) < 0):
                best = p
        if best == start:
            return hull
        hull.append(best)
    raise NoHullError("more steps than points")


def graham(points: Sequence[Point]) -> list[Point]:
    pivot = min(points)
    others = [p for p in points if p != pivot]
    others.sort(key=lambda p: (atan2(p[1] - pivot[1], p[0] - pivot[0]), dist(p, pivot)))
    return left_turns([pivot, *others])


def chain(points: Sequence[Point]) -> list[Point]:
    order = sorted(points)
    return left_turns(order)[:-1] + left_turns(order[::-1])[:-1]


def left_turns(order: Sequence[Point]) -> list[Point]:
    stack: list[Point] = []
    for p in order:
        while len(stack) > 1 and rounded_turn(stack[-2], stack[-1], p) <= 0:
            stack.pop()
        stack.append(p)
    return stack


def incremental(points: Sequence[Point]) -> list[Point]:
    a, b, *others = points
    third = next((p for p in others if rounded_turn(a, b, p) != 0), None)
    if third is None:
        return [min(points), max(points)]
    hull = [a, b, third] if rounded_turn(a, b, third) > 0 else [b, a, third]
    for p in others:
        visible = [rounded_turn(q, r, p) < 0 for q, r in zip(hull, hull[1:] + hull[:1], strict=True)]
        if all(visible):
            raise NoHullError("a point sees every edge")
        if any(visible):
            first = next(i for i, seen in enumerate(visible) if seen and not visible[i - 1])
            hull, visible = hull[first:] + hull[:first], visible[first:] + visible[:first]
            hull = [hull[0], p, *hull[visible.index(False) :]]
    return hull


ALGORITHMS: tuple[Callable[[Sequence[Point]], list[Point]], ...] = (wrapping, graham, chain, incremental)


def orders(points: Sequence[Point], most: int) -> Iterator[tuple[Point, ...]]:
    if len(points) <= EVERY_ORDER:
        yield from permutations(points)
    else:
        shuffle = random.Random(0)
        yield from (tuple(shuffle.sample(points, len(points))) for _ in range(most))


def extent(points: Sequence[Point]) -> float:
    return max(dist(p, q) for p, q in product(points, points))


def missed(hull: Sequence[Point], points: Sequence[Point]) -> float:
    """The distance from the hull of the vertices found to the farthest point outside of it."""
    return float(dynhull.DynamicHull(hull).distance(points).max())


@dataclass
class Outcome:
    runs: int = 0
    wrong: int = 0
    none: int = 0
    worst: float = 0.0  # share of the extent
    order: tuple[Point, ...] = ()


def outcome(algorithm: Callable[[Sequence[Point]], list[Point]], points: Sequence[Point], most: int) -> Outcome:
    exact = set(map(tuple, dynhull.convex_hull(points).tolist()))
    size = extent(points)
    result = Outcome()
    for order in orders(points, most):
        result.runs += 1
        try:
            hull = algorithm(order)
        except NoHullError:
            result.none += 1
            continue
        if set(hull) != exact:
            result.wrong += 1
            share = missed(hull, points) / size
            if share > result.worst:
                result.worst, result.order = share, order
    return result


def draw(path: Path, most: int) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt
    from matplotlib.colors import ListedColormap

    figure, (signs, *hulls) = plt.subplots(1, 3, figsize=(14, 4.8), dpi=110, layout="constrained")
    steps = 0.5 + np.arange(256) * 2.0**-53
    grid = np.stack(np.meshgrid(steps, steps), axis=-1)
    rounded = np.sign(rounded_turn(np.moveaxis(grid, -1, 0), (12.0, 12.0), (24.0, 24.0)))
    exact = dynhull.orient2d(grid, (12, 12), (24, 24))
    signs.imshow(rounded, origin="lower", cmap=ListedColormap([ORANGE, "#FFFFFF", BLUE]), vmin=-1, vmax=1)
    signs.plot([0, 255], [0, 255], color="k", lw=1)
    wrong = np.mean(rounded != exact)
    signs.set_title(f"(0.5, 0.5) + (i, j) / 2⁵³ beside a line:\n{wrong:.0%} of the rounded signs are wrong")
    signs.set(xlabel="i", ylabel="j")
    for axes, algorithm, name, free_corner in (
        (hulls[0], wrapping, "A2, visible", "upper left"),
        (hulls[1], incremental, "A1: outside, sees no edge", "lower right"),
    ):
        worst = outcome(algorithm, PUBLISHED[name], most)
        found = np.array(algorithm(worst.order))
        corners = dynhull.convex_hull(worst.order)
        axes.fill(*corners.T, color=BLUE, alpha=0.15)
        axes.plot(*np.concatenate([corners, corners[:1]]).T, color=BLUE, label="exact hull")
        axes.plot(*np.concatenate([found, found[:1]]).T, "--", color=RED, label=f"{algorithm.__name__}, rounded signs")
        axes.plot(*np.array(worst.order).T, "o", color="k", ms=4)
        axes.set_title(f"“{name}”:\nmisses a point by {worst.worst:.0%} of the extent")
        axes.set_aspect("equal")
        axes.legend(loc=free_corner)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description="Textbook hulls with rounded signs, on published inputs.")
    parser.add_argument("--orders", type=int, default=2000, help="random orders of more than six points (default 2000)")
    parser.add_argument("--out", type=Path, help="draw three failures")
    options = parser.parse_args()
    print(f"{'input':44}{'algorithm':12}{'runs':>6}{'wrong':>7}{'no hull':>9}  misses by")
    for name, points in PUBLISHED.items():
        for algorithm in ALGORITHMS:
            found = outcome(algorithm, points, options.orders)
            counts = f"{found.runs:>6}{found.wrong:>7}{found.none:>9}"
            print(f"{name:44}{algorithm.__name__:12}{counts}{found.worst:>11.2g}")
    if options.out:
        draw(options.out, options.orders)


if __name__ == "__main__":
    main()
