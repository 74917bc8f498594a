"""Hulls on the globe: agreement with S2 on random sets, and what updates and queries cost beside those on a plane.

    python benchmarks/globe.py [--sets 10000] [--sizes 1e5 1e6] [--batch 8192]

The sets are those of tests/support/globes.py: 3 to 10,000 places in caps of metres to 80 degrees anywhere, often around
a pole or on the antimeridian; 30 places in and around each cap are located. Speed: places evenly over a cap of 40
degrees; each batch inserts as many places as it deletes. Globe and plane take turns. Processor time; the ratio is the
median over the batches.
"""

import argparse
import statistics
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np

import dynhull
from dynhull import DynamicHull, GeoHull

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from globes import agrees_with_s2, around, random_set

MOST_PLACES = 10_000
ROUNDS = 12  # batches that are timed


def disagreements(sets: int) -> int:
    rng = np.random.default_rng(0)
    found = 0
    for i in range(sets):
        center, radius, points = random_set(rng, MOST_PLACES)
        asked = around(rng, center, min(1.2 * radius, 89), 30)
        if not agrees_with_s2(GeoHull(points, center=center), asked, center):
            found += 1
            print(f"set {i}: centre {center}, {radius} degrees, {len(points)} places")
    return found


def clocked(work) -> float:
    began = time.thread_time()
    work()
    return time.thread_time() - began


def seconds(n: int, size: int) -> dict[str, list[tuple[float, float]]]:
    """Of the globe and the plane, for each batch."""
    rng = np.random.default_rng(1)
    places = around(rng, (10.0, 50.0), 40, n + ROUNDS * size)
    hulls = GeoHull(places[:n], center=(10.0, 50.0)), DynamicHull(places[:n])
    ops = np.repeat(np.array([1, -1], np.int8), size)
    result: dict[str, list[tuple[float, float]]] = {"update": [], "locate": []}
    for turn in range(ROUNDS):
        fresh, old = places[n + turn * size : n + (turn + 1) * size], places[turn * size : (turn + 1) * size]
        batch, asked = np.concatenate([fresh, old]), around(rng, (10.0, 50.0), 45, size)
        order = (0, 1) if turn % 2 == 0 else (1, 0)
        updates = {who: clocked(partial(hulls[who].apply, ops, batch)) for who in order}
        queries = {who: clocked(partial(hulls[who].locate, asked)) for who in order}
        result["update"].append((updates[0] / 2, updates[1] / 2))
        result["locate"].append((queries[0], queries[1]))
    return result


def main() -> None:
    dynhull.set_threads(1)  # the clock counts one
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sets", type=int, default=10_000)
    parser.add_argument("--sizes", nargs="*", default=["1e5", "1e6"])
    parser.add_argument("--batch", type=int, default=8192)
    arguments = parser.parse_args()
    print(f"dynhull {dynhull.KERNEL}\n")
    print("| n | | globe, ns each | plane, ns each | ratio |")
    print("| ---: | --- | ---: | ---: | ---: |")
    for n in map(int, map(float, arguments.sizes)):
        for what, pairs in seconds(n, arguments.batch).items():
            ratio = statistics.median(globe / plane for globe, plane in pairs)
            globe, plane = (statistics.median(of) / arguments.batch * 1e9 for of in zip(*pairs, strict=True))
            print(f"| {n:,} | {what} | {globe:,.0f} | {plane:,.0f} | {ratio:.2f} |", flush=True)
    if arguments.sets:
        found = disagreements(arguments.sets)
        print(f"\nS2: {found} disagreements in {arguments.sets:,} sets")
        sys.exit(found > 0)


if __name__ == "__main__":
    main()
