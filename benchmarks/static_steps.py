"""Counted work of the static algorithms: orientations evaluated for n points, h of them vertices.

    python benchmarks/static_steps.py [--largest 1000000] [--most 1e8] [--out docs/images/static-steps.png]

Counts do not depend on the machine. Sorting by coordinates and searching in sorted chains need no orientations: their
comparisons are counted beside them, so that nobody's work is hidden. Graham's sort compares angles: orientations.
Combinations that would take more than about --most steps are left out.
"""

import argparse
import functools
import json
import math
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from dynhull import static

ALGORITHMS: dict[str, Callable[..., np.ndarray]] = {
    "graham_scan": static.graham_scan,
    "monotone_chain": static.monotone_chain,
    "jarvis_march": static.jarvis_march,
    "chan": static.chan,
}


@dataclass(frozen=True)
class Work:
    algorithm: str
    n: int
    h: int
    orientations: int
    comparisons: int  # of coordinates, by a sort or a binary search

    @property
    def steps(self) -> int:
        return self.orientations + self.comparisons


def points_with_vertices(n: int, h: int) -> np.ndarray:
    """n points in random order: h vertices on the unit circle, the others in a disk inside their polygon."""
    rng = np.random.default_rng(n + h)
    angle = 2 * math.pi * np.arange(h) / h
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    angle = 2 * math.pi * rng.random(n - h)
    radius = 0.99 * math.cos(math.pi / h) * np.sqrt(rng.random(n - h))
    inside = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return rng.permutation(np.concatenate([corners, inside]))


@contextmanager
def counted() -> Iterator[dict[str, int]]:
    """Count orientations, and comparisons of points by sorts and binary searches, in all static algorithms."""
    counts = {"orientations": 0, "comparisons": 0}
    names = [function.__globals__ for function in ALGORITHMS.values()]
    orientation = names[0]["orientation"]

    def counting_orientation(a, b, c):
        counts["orientations"] += 1
        return orientation(a, b, c)

    def counting_sorted(values, key=None):
        def compare(p, q):
            counts["comparisons"] += 1
            return -1 if p < q else 1

        return sorted(values, key=key or functools.cmp_to_key(compare))

    def counting_bisect(chain, p):
        counts["comparisons"] += len(chain).bit_length()  # one more than it needs, now and then
        return bisect_left(chain, p)

    chan = static.chan.__globals__
    kernel, chan["kernel"] = chan["kernel"], None  # what it does cannot be counted from here
    chan["bisect_left"] = counting_bisect
    for module in names:
        module["orientation"], module["sorted"] = counting_orientation, counting_sorted
    try:
        yield counts
    finally:
        chan["bisect_left"], chan["kernel"] = bisect_left, kernel
        for module in names:
            module["orientation"] = orientation
            del module["sorted"]


def count(algorithm: str, n: int, h: int) -> Work:
    xy = points_with_vertices(n, h)
    with counted() as counts:
        hull = ALGORITHMS[algorithm](xy)
    assert len(hull) == h
    return Work(algorithm, n, h, counts["orientations"], counts["comparisons"])


def estimate(algorithm: str, n: int, h: int) -> float:
    return n * h if algorithm == "jarvis_march" else 4 * n * math.log2(n)


def sizes(n: int) -> list[int]:
    """3, powers of ten, and n."""
    return [3, *(10**k for k in range(1, 9) if 10**k < n), n]


def draw(rows: list[Work], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    every_n = sorted({row.n for row in rows})
    figure, grid = plt.subplots(1, len(every_n), figsize=(3.6 * len(every_n), 4.2), dpi=110, layout="constrained")
    colours = dict(zip(ALGORITHMS, ["#0072B2", "#56B4E9", "#D55E00", "#009E73"], strict=True))
    for axes, n in zip(np.atleast_1d(grid), every_n, strict=True):
        for name, colour in colours.items():
            mine = [row for row in rows if (row.n, row.algorithm) == (n, name)]
            xs, ys = [row.h for row in mine], [row.steps / n for row in mine]
            axes.loglog(xs, ys, marker="o", markersize=4, color=colour, label=name)
        h = np.array(sizes(n))
        axes.loglog(h, 11 * np.log2(h), ":", color="#009E73", linewidth=1, label="11 log₂ h")
        axes.loglog(h, np.log2(h) ** 2, ":", color="#707070", linewidth=1, label="log₂² h, for comparison")
        axes.set_title(f"n = {n:,}", fontsize=10)
        axes.set_xlabel("vertices h")
        axes.set_ylim(1, 1000)
        axes.grid(alpha=0.25)
    np.atleast_1d(grid)[0].set_ylabel("orientations and comparisons, per point")
    np.atleast_1d(grid)[0].legend(fontsize=7.5, loc="upper left")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description="Counted work of the static algorithms.")
    parser.add_argument("--largest", type=int, default=10**6, help="largest n (default 1,000,000)")
    parser.add_argument("--most", type=float, default=1e8, help="leave out runs of more steps than this (default 1e8)")
    parser.add_argument("--out", type=Path, help="draw a chart")
    parser.add_argument("--json", type=Path, help="write the counts")
    options = parser.parse_args()
    rows: list[Work] = []
    columns = f"{'n':>10}{'h':>10}  {'algorithm':16}{'orientations':>14}{'comparisons':>13}"
    print(columns + f"{'steps/n':>9}{'/(n log2 h)':>13}{'/(n log2² h)':>14}")
    n = 1000
    while n <= options.largest:
        for h in sizes(n):
            for name in ALGORITHMS:
                if estimate(name, n, h) > options.most:
                    continue
                row = count(name, n, h)
                rows.append(row)
                by_n, log = row.steps / n, math.log2(h)
                print(
                    f"{n:>10,}{h:>10,}  {name:16}{row.orientations:>14,}{row.comparisons:>13,}"
                    f"{by_n:>9.2f}{by_n / log:>13.2f}{by_n / log**2:>14.2f}",
                    flush=True,
                )
        n *= 10
    if options.json:
        options.json.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n")
    if options.out:
        draw(rows, options.out)


if __name__ == "__main__":
    main()
