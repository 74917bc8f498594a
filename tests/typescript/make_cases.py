"""Writes clients/typescript/test/cases.json, for every language.

`hulls`: questions to copies of hulls, with the exact answers. `values`: batches of a hull with integers as keys
and with event times: numbers at the ends of what doubles and integers of 64 bits can be.

Run it from the root of the project: python tests/typescript/make_cases.py
"""

import json
from pathlib import Path
from random import Random

import numpy as np

from dynhull import DynamicHull

CASES = Path(__file__).parents[2] / "clients" / "typescript" / "test" / "cases.json"
TINY, HUGE = 5e-324, 1.7976931348623157e308
NOW = 1_700_000_000_000_000  # microseconds


def shapes(dice: Random) -> list[list[tuple[float, float]]]:
    """Points of hulls: none, one, few, many, on a line, at both ends of what doubles can be."""
    found: list[list[tuple[float, float]]] = [
        [],
        [(1.5, -2.5)],
        [(0.0, 0.0), (4.0, 3.0)],
        [(2.0, -1.0), (2.0, 5.0)],
        [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0)],
        [(0.0, 0.0), (0.0, 2.0), (3.0, 2.0), (3.0, 0.0)],
        [(TINY, TINY), (3 * TINY, TINY), (2 * TINY, 4 * TINY)],
        [(-HUGE, -HUGE), (HUGE, -HUGE), (0.0, HUGE)],
        [(TINY, 0.0), (HUGE, TINY), (1.0, HUGE), (-1e-300, 1e300)],
        [(0.1, 0.1), (0.2, 0.2), (0.3, 0.3), (0.30000000000000004, 0.1)],
    ]
    for size in (3, 5, 8, 20, 100):
        for scale in (1.0, 1e-310, 1e200, 2.0**-30):
            found += [[(dice.uniform(-1, 1) * scale, dice.uniform(-1, 1) * scale) for _ in range(size)]]
    found.append([(float(x), float(x * x)) for x in range(-20, 21)])
    return found


def near(dice: Random, vertices: list[list[float]]) -> list[list[float]]:
    """Points on and beside edges and vertices, some units in the last place away."""
    found = []
    for index, (ax, ay) in enumerate(vertices):
        bx, by = vertices[(index + 1) % len(vertices)]
        part = dice.random()
        x, y = ax * (1 - part) + bx * part, ay * (1 - part) + by * part
        for _ in range(dice.randrange(4)):
            x = float(np.nextafter(x, dice.choice((-np.inf, np.inf))))
            y = float(np.nextafter(y, dice.choice((-np.inf, np.inf))))
        found += [[x, y], [ax, ay], [float(np.nextafter(ax, bx)), ay]]
    return [point for point in found if np.isfinite(point).all()][:60]


def case(dice: Random, points: list[tuple[float, float]]) -> dict[str, object]:
    hull = DynamicHull(np.array(points, float).reshape(-1, 2))
    vertices = hull.vertices().tolist()
    asked = [*near(dice, vertices), [0.0, 0.0], [-0.0, 1.0], [HUGE, TINY], [-HUGE, HUGE], [1e-320, -1e-320]]
    asked += [[dice.uniform(-2, 2), dice.uniform(-2, 2)] for _ in range(5)]
    directions = [[1.0, 0.0], [0.0, -1.0], [-1.0, 0.0], [TINY, HUGE], [-0.3, 0.7], [3.0, -4.0]]
    finite = [None if not np.isfinite(each) else each for each in hull.distance(asked).tolist()]
    tangents = [None if np.isnan(pair).any() else pair.tolist() for pair in hull.tangents(asked)]
    return {
        "vertices": vertices,
        "area": hull.area if np.isfinite(hull.area) else None,
        "points": asked,
        "sides": hull.locate(asked).tolist(),
        "distances": finite,
        "tangents": tangents,
        "directions": directions,
        "support": hull.support(directions).tolist() if vertices else [],
    }


def values() -> dict[str, object]:
    """Keys beside 2**53 and 2**64, sequences up to 2**63, microseconds, zeros with signs, subnormal doubles."""
    keys = [0, 1, 2**53 - 1, 2**53, 2**53 + 1, 2**63 - 1, 2**63, 2**64 - 2, 2**64 - 1]
    numbers = [0.0, -0.0, TINY, -TINY, 1e-310, 0.1 + 0.2, 2.0**53 + 2, HUGE, -HUGE]
    times = [-1, 1, 1_700_000_000_000_001, 1_700_000_000_999_999, 8_999_999_999_999_999]
    steps: list[dict[str, object]] = []
    for step, sequence in enumerate([1, 2**53 - 1, 2**53 + 1, 2**63 - 2, 2**63 - 1]):
        points = [[numbers[(row + step) % 9], numbers[(2 * row + step) % 9]] for row in range(len(keys))]
        steps.append({"sequence": sequence, "keys": keys, "points": points, "times": [times[step]] * len(keys)})
    return {"keys": [*keys, 2**53 + 3], "batches": steps}


class Gathered:
    """Batches of a writer by their rule: a run of rows joins the batch before it as a whole, or begins another one."""

    def __init__(self, coalesces: bool) -> None:
        self.count = 0
        self._coalesces = coalesces
        self._only: str | None = None
        self._latest: dict[str, int] = {}

    def add(self, keys: list[str], times: list[int], only: str | None) -> int:
        """The number of the batch with the last of the rows."""
        coalesces, runs = self._coalesces and only != "absent", [dict[str, int]()]
        for key, time in zip(keys, times, strict=True):
            if key in runs[-1] and not (coalesces and runs[-1][key] <= time):
                runs.append({})
            runs[-1][key] = time
        for run in runs:
            again = [key for key in run if key in self._latest]
            if (
                not self.count
                or only != self._only
                or not all(coalesces and self._latest[key] <= run[key] for key in again)
            ):
                self.count += 1
                self._latest = {}
            self._only = only
            self._latest |= run
        return self.count


def writers(dice: Random) -> list[dict[str, object]]:
    """Calls of writers that gather all, the revision of the batch with the last row of each, and what is kept."""
    found: list[dict[str, object]] = []
    for place in range(8):
        coalesce, timed = ("last", None)[place % 2], place % 4 < 2
        gathered, kept, latest = Gathered(coalesce == "last"), dict[str, list[float]](), dict[str, int]()
        calls, revisions = list[dict[str, object]](), list[int]()
        for step in range(12):
            keys = [dice.choice("abcdef") for _ in range(dice.randrange(1, 5))]
            points = [[float(step), float(row)] for row in range(len(keys))]
            times = [NOW + 1000 * step + dice.randrange(-1500, 1500) if timed else NOW for _ in keys]
            only = None if timed else dice.choice((None, None, None, "absent", "present"))
            for key, point, time in zip(keys, points, times, strict=True):
                if time >= latest.get(key, time) and (only is None or (only == "present") == (key in kept)):
                    kept[key], latest[key] = point, time
            calls.append({"keys": keys, "points": points, "times": times if timed else None, "only": only})
            revisions.append(gathered.add(keys, times, only))
        ordering = "event_time" if timed else "arrival"
        case = {"coalesce": coalesce, "ordering": ordering, "calls": calls, "revisions": revisions}
        found.append(case | {"kept": dict(sorted(kept.items()))})
    return found


def main() -> None:
    dice = Random(41)
    cases = {
        "writers": writers(Random(42)),
        "values": values(),
        "hulls": [case(dice, points) for points in shapes(dice)],
    }
    CASES.write_text(
        json.dumps(cases, allow_nan=False, separators=(",", ":")).replace('{"vertices"', '\n{"vertices"') + "\n"
    )


if __name__ == "__main__":
    main()
