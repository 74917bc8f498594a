"""One-shot hulls from Python against shapely and scipy, in one run.

    python benchmarks/static.py [--sizes 10000 100000 1000000] [--inputs uniform disk ...] [--repeat 5]
                                [--json FILE] [--out docs/images/static-hulls.png]

Every repetition runs all contenders on the same points in turn; wall-clock medians are printed. shapely's time is that
of `convex_hull` on a MultiPoint made beforehand: making it from the array takes much longer and is left out. The plain
chain is the kernel told to discard nothing and to use one thread: sort, then chain.
"""

import argparse
import json
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
from scipy.spatial import ConvexHull

import dynhull
from dynhull import static
from dynhull._implementation import kernel


def in_disk(random: np.random.Generator, n: int) -> np.ndarray:
    return np.sqrt(random.random((n, 1))) * on_circle(random, n)


def on_circle(random: np.random.Generator, n: int) -> np.ndarray:
    angle = 2 * np.pi * random.random(n)
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


def in_order(random: np.random.Generator, n: int) -> np.ndarray:
    xy = random.random((n, 2))
    return xy[np.lexsort(xy.T[::-1])]


def clustered(random: np.random.Generator, n: int) -> np.ndarray:
    return random.random((50, 2))[random.integers(0, 50, n)] + 1e-3 * random.standard_normal((n, 2))


INPUTS: dict[str, Callable[[np.random.Generator, int], np.ndarray]] = {
    "uniform": lambda random, n: random.random((n, 2)),
    "disk": in_disk,
    "gaussian": lambda random, n: random.standard_normal((n, 2)),
    "circle": on_circle,
    "sorted": in_order,
    "clustered": clustered,
    "grid": lambda random, n: random.integers(0, int(n**0.5), (n, 2)).astype(float),
}

# What each contender is given, and what is timed.
CONTENDERS: dict[str, tuple[Callable[[np.ndarray], Any], Callable[[Any], Any]]] = {
    "convex_hull": (np.asarray, dynhull.convex_hull),
    "plain chain": (np.asarray, lambda xy: kernel.convex_hull(xy, False, False)),
    "chan": (np.asarray, static.chan),
    "shapely": (shapely.multipoints, shapely.convex_hull),
    "scipy": (np.asarray, ConvexHull),
}


@dataclass(frozen=True)
class Row:
    input: str
    n: int
    vertices: int
    milliseconds: dict[str, list[float]]

    def median(self, name: str) -> float:
        return statistics.median(self.milliseconds[name])

    def ratio(self, name: str) -> float:
        """How many times as long as `convex_hull`."""
        return self.median(name) / self.median("convex_hull")


def measure(name: str, n: int, repeat: int) -> Row:
    xy = INPUTS[name](np.random.default_rng(n), n)
    given = {contender: prepare(xy) for contender, (prepare, _) in CONTENDERS.items()}
    vertices = dynhull.convex_hull(xy)
    np.testing.assert_array_equal(static.chan(xy), vertices)
    times: dict[str, list[float]] = {contender: [] for contender in CONTENDERS}
    for _ in range(repeat):
        for contender, (_, hull_of) in CONTENDERS.items():
            start = time.perf_counter()
            hull_of(given[contender])
            times[contender].append((time.perf_counter() - start) * 1e3)
    return Row(name, n, len(vertices), times)


def draw(rows: list[Row], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    every_n = sorted({row.n for row in rows})
    figure, grid = plt.subplots(1, len(every_n), figsize=(4.6 * len(every_n), 4.2), dpi=110, layout="constrained")
    colours = dict(zip(CONTENDERS, ["#D55E00", "#E69F00", "#009E73", "#56B4E9", "#0072B2"], strict=True))
    for axes, n in zip(np.atleast_1d(grid), every_n, strict=True):
        mine = [row for row in rows if row.n == n]
        for i, (contender, colour) in enumerate(colours.items()):
            left = np.arange(len(mine)) + 0.16 * (i - (len(colours) - 1) / 2)
            axes.bar(left, [row.median(contender) for row in mine], 0.16, color=colour, label=contender)
        axes.set_yscale("log")
        axes.set_xticks(range(len(mine)), [row.input for row in mine], fontsize=8, rotation=30)
        axes.set_title(f"n = {n:,}", fontsize=10)
        axes.grid(axis="y", alpha=0.25)
    np.atleast_1d(grid)[0].set_ylabel("milliseconds, median")
    np.atleast_1d(grid)[0].legend(fontsize=7.5)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description="One-shot hulls against shapely and scipy.")
    parser.add_argument("--sizes", type=int, nargs="+", default=[10**4, 10**5, 10**6], help="numbers of points")
    parser.add_argument("--inputs", nargs="+", choices=INPUTS, default=list(INPUTS), help="which inputs (default all)")
    parser.add_argument("--repeat", type=int, default=5, help="repetitions; medians are printed (default 5)")
    parser.add_argument("--json", type=Path, help="write all times")
    parser.add_argument("--out", type=Path, help="draw a chart")
    options = parser.parse_args()
    if kernel is None:
        parser.error("the kernel is not built: there is nothing to measure")
    print(f"milliseconds, median of {options.repeat}; in brackets, times as long as convex_hull")
    rivals = list(CONTENDERS)[1:]
    heads = "".join(f"{rival:>18}" for rival in rivals)
    print(f"{'input':10}{'n':>12}{'vertices':>12}{'convex_hull':>13}{heads}")
    rows = []
    for n in options.sizes:
        for name in options.inputs:
            row = measure(name, n, options.repeat)
            rows.append(row)
            cells = "".join(f"{row.median(rival):>10.2f}{f'({row.ratio(rival):.1f})':>8}" for rival in rivals)
            print(f"{name:10}{n:>12,}{row.vertices:>12,}{row.median('convex_hull'):>13.3f}{cells}", flush=True)
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    if options.out:
        draw(rows, options.out)


if __name__ == "__main__":
    main()
