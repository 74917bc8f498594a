"""How hulls grow with the dimension: facets of the worst points, and facets and vertices of random ones.

    python benchmarks/dimensions.py [--largest 7] [--points 1000] [--out docs/images/dimensions.png]

Counts of `dynhull.static.hull_nd`. The worst points lie on the moment curve (t, t², ..., t^d): their hull, the cyclic
polytope, has the most facets that any hull of as many points can have (McMullen 1970). Random points are uniform in a
cube and in a ball.
"""

import argparse
from math import comb
from pathlib import Path

import numpy as np

from dynhull import static

ON_THE_CURVE = 24
BLUE, ORANGE, GREEN, RED = "#0072B2", "#E69F00", "#009E73", "#D55E00"


def most_facets(n: int, d: int) -> int:
    """The upper bound theorem's number for n points in d dimensions."""
    half = d // 2
    return comb(n - half, half) * n // (n - half) if d % 2 == 0 else 2 * comb(n - half - 1, half)


def moment_curve(n: int, d: int) -> np.ndarray:
    """Around 0, so that powers stay small: parameters from -1 to 1."""
    return np.linspace(-1, 1, n)[:, None] ** np.arange(1, d + 1)


def cube(n: int, d: int) -> np.ndarray:
    return np.random.default_rng(d).random((n, d))


def ball(n: int, d: int) -> np.ndarray:
    random = np.random.default_rng(d)
    directions = random.normal(size=(n, d))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return directions * random.random((n, 1)) ** (1 / d)


def facets_and_vertices(points: np.ndarray) -> tuple[int, int]:
    hull = static.hull_nd(points)
    return len(hull.faces), len(hull.vertices)


def draw(rows: list[tuple[int, ...]], n: int, path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(11, 4.4), dpi=110, layout="constrained")
    d, worst, _, in_cube, cube_vertices, in_ball, ball_vertices = np.array(rows).T
    left.semilogy(d, in_ball, "o-", color=BLUE, label=f"{n:,} random points in a ball")
    left.semilogy(d, in_cube, "o-", color=GREEN, label=f"{n:,} random points in a cube")
    left.semilogy(d, worst, "o-", color=RED, label=f"{ON_THE_CURVE} points on the moment curve")
    left.semilogy(d, [most_facets(n, k) for k in d], ":", color=ORANGE, label=f"the most that {n:,} points can have")
    left.set(title="Facets of the hull", xlabel="dimension")
    left.legend(fontsize=8)
    right.plot(d, 100 * ball_vertices / n, "o-", color=BLUE, label="in a ball")
    right.plot(d, 100 * cube_vertices / n, "o-", color=GREEN, label="in a cube")
    right.set(title=f"Share of {n:,} random points that are vertices", xlabel="dimension", ylabel="%", ylim=(0, 100))
    right.legend(fontsize=8)
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description="How hulls grow with the dimension.")
    parser.add_argument("--largest", type=int, default=7, help="largest dimension (default 7)")
    parser.add_argument("--points", type=int, default=1000, help="random points (default 1000)")
    parser.add_argument("--out", type=Path, help="draw a chart")
    options = parser.parse_args()
    print(f"{'d':>3}{'curve':>9}{'bound':>9}{'cube':>11}{'vertices':>10}{'ball':>11}{'vertices':>10}")
    rows = []
    for d in range(2, options.largest + 1):
        worst, _ = facets_and_vertices(moment_curve(ON_THE_CURVE, d))
        in_cube, in_ball = (facets_and_vertices(make(options.points, d)) for make in (cube, ball))
        rows.append((d, worst, most_facets(ON_THE_CURVE, d), *in_cube, *in_ball))
        print("{:>3}{:>9,}{:>9,}{:>11,}{:>10,}{:>11,}{:>10,}".format(*rows[-1]), flush=True)
    if options.out:
        draw(rows, options.points, options.out)


if __name__ == "__main__":
    main()
