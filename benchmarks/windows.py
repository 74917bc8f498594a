"""What a window costs: add and expire, against DynamicHull.apply of the same inserts and deletes in the same run.

    python benchmarks/windows.py [--sizes 1e5 1e6] [--batches 64 8192 65536] [--updates 2e6]
    DYNHULL_KERNEL=python python benchmarks/windows.py --sizes 1e4 --batches 64 --updates 2e4

Uniform points in a window of n points. Times grow by one from point to point; "1 % late": one in a hundred is up to
half a window late; "any order": all are up to a tenth of a window late. Window and hull take turns, and so does who
goes first. Processor time; the ratio is the median over the batches' pairs.
"""

import argparse
import statistics
import time

import numpy as np

import dynhull
from dynhull import DynamicHull, WindowHull

FILL = 8192  # points a batch while the window fills
TOGETHER = 4096  # points whose batches are timed as one, at least: the clock's own steps are coarse
DELAYS = {"in order": (0.0, 0.0), "1 % late": (0.01, 0.5), "any order": (1.0, 0.1)}  # share, of the window's length


def delayed(count: int, n: int, share: float, longest: float, random: np.random.Generator) -> np.ndarray:
    times = np.arange(count, dtype=float)
    late = random.random(count) < share
    times[late] -= random.random(late.sum()) * longest * n
    return times


def clocked(work) -> float:
    began = time.thread_time()
    work()
    return time.thread_time() - began


def pairs(n: int, size: int, updates: int, share: float, longest: float) -> list[tuple[float, float]]:
    """Seconds of the window and of the hull, for one batch."""
    random = np.random.default_rng(0)
    count = n + max(updates // 2, 3 * max(size, TOGETHER)) // size * size
    rows, times = random.random((count, 2)), delayed(count, n, share, longest, random)
    window, hull = WindowHull(max_age=float(n)), DynamicHull()
    for i in range(0, n, FILL):
        part = slice(i, min(i + FILL, n))
        window.add(rows[part], times[part])
        hull.insert_many(rows[part])
    ops = np.repeat(np.array([1, -1], np.int8), size)
    results = []
    for turn, i in enumerate(range(n, count, size)):
        fresh, moments = rows[i : i + size], times[i : i + size]
        both = np.concatenate([fresh, rows[i - n : i - n + size]])
        works = [lambda f=fresh, m=moments: window.add(f, m), lambda b=both: hull.apply(ops, b)]
        order = (0, 1) if turn % 2 == 0 else (1, 0)
        seconds = {who: clocked(works[who]) for who in order}
        results.append((seconds[0], seconds[1]))
    group = max(1, TOGETHER // size)
    groups = [results[i : i + group] for i in range(group, len(results) - group + 1, group)]  # the first ones allocate
    return [(sum(window for window, _ in each) / group, sum(hull for _, hull in each) / group) for each in groups]


def main() -> None:
    dynhull.set_threads(1)  # the clock counts one
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", default=["1e5", "1e6"])
    parser.add_argument("--batches", nargs="+", type=int, default=[64, 8192, 65536])
    parser.add_argument("--times", nargs="+", default=list(DELAYS), choices=DELAYS)
    parser.add_argument("--updates", default="2e6", help="inserts and deletes for each row of the table")
    arguments = parser.parse_args()
    print(f"dynhull {dynhull.KERNEL}\n")
    print("| times | n | batch | window, ns an update | hull, ns an update | ratio |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for kind in arguments.times:
        share, longest = DELAYS[kind]
        for n in map(int, map(float, arguments.sizes)):
            for size in arguments.batches:
                results = pairs(n, size, int(float(arguments.updates)), share, longest)
                ratio = statistics.median(window / hull for window, hull in results)
                figures = " | ".join(
                    f"{statistics.median(of) / size / 2 * 1e9:.0f}" for of in zip(*results, strict=True)
                )
                print(f"| {kind} | {n:,} | {size:,} | {figures} | {ratio:.2f} |", flush=True)


if __name__ == "__main__":
    main()
