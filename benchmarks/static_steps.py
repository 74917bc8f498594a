"""Counted work of the static algorithms: orientations evaluated for n points, h of them vertices.

    python benchmarks/static_steps.py [--largest 1000000] [--most 1e8] [--out docs/images/static-steps.png]

Counts do not depend on the machine. Sorting by coordinates and searching in sorted chains need no orientations: their
comparisons are counted beside them, so that nobody's work is hidden. Graham's sort compares angles: orientations.
Combinations that would take more than about --most steps are left out.
"""

import argparse
import json
import math
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from static_work import ALGORITHMS, Work, count


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
