"""The pure-Python tree against sortedcontainers in one run: delete the oldest point, insert a new one.

    python benchmarks/tree.py [--size 100000] [--updates 10000] [--repeat 5]

`SortedList` of the same tuples keeps order and no hull; it is the floor for a Python structure of this kind.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
from sortedcontainers import SortedList

from dynhull._tree import HullTree

Point = tuple[float, float]


def per_update(delete: Callable[[Point], object], insert: Callable[[Point], object], old: list, new: list) -> float:
    """Microseconds of processor time for one delete and one insert."""
    start = time.process_time()
    for gone, come in zip(old, new, strict=True):
        delete(gone)
        insert(come)
    return (time.process_time() - start) / len(old) * 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description="HullTree against SortedList: a window of points moves on.")
    parser.add_argument("--size", type=int, default=100_000, help="points in the window (default 100,000)")
    parser.add_argument("--updates", type=int, default=10_000, help="updates a repetition (default 10,000)")
    parser.add_argument("--repeat", type=int, default=5, help="repetitions; medians are printed (default 5)")
    parser.add_argument("--leaf", type=int, nargs="+", default=[32, HullTree.LEAF, 128], help="leaf sizes to try")
    options = parser.parse_args()
    xy = np.random.default_rng(0).random((options.size + options.repeat * options.updates, 2))
    points = list(map(tuple, xy.tolist()))
    trees = {leaf: type("Tree", (HullTree,), {"LEAF": leaf})(xy[: options.size]) for leaf in options.leaf}
    ordered = SortedList(points[: options.size])
    times: dict[str, list[float]] = {}
    for repetition in range(options.repeat):
        first = repetition * options.updates
        old = points[first : first + options.updates]
        new = points[first + options.size : first + options.size + options.updates]
        times.setdefault("SortedList", []).append(per_update(ordered.remove, ordered.add, old, new))
        for leaf, hull in trees.items():
            name = f"HullTree, leaves of {leaf}"
            update = per_update(lambda p, h=hull: h.delete(*p), lambda p, h=hull: h.insert(*p), old, new)
            times.setdefault(name, []).append(update)
    floor = statistics.median(times["SortedList"])
    print(f"n = {options.size:,}, uniform; delete-oldest and insert-new, microseconds, median of {options.repeat}")
    for name, values in times.items():
        median = statistics.median(values)
        print(f"{name:26}{median:8.2f}   {median / floor:5.2f} x SortedList   (min {min(values):.2f})")


if __name__ == "__main__":
    main()
