"""Layers, influence and sketches of a live hull, beside static tools that compute them anew: medians of one run.

    python benchmarks/robust.py [--repeat 5]

The rivals get the points as an array: ten layers are ten hulls by scipy (Qhull), each of the points left over; the
influence of a vertex is the area of the hull without it, once for each of ten vertices. Answers are compared.
"""

import argparse
import statistics
import time
from collections.abc import Callable

import numpy as np
import shapely
from scipy.spatial import ConvexHull

from dynhull import DynamicHull

N = 10**6
LAYERS = 10
FEW = 10  # vertices whose influence the rival computes


def inputs(random: np.random.Generator) -> dict[str, np.ndarray]:
    angle, away = random.random(N) * 2 * np.pi, np.sqrt(random.random(N))
    round_ = np.column_stack([np.cos(angle), np.sin(angle)])
    return {"uniform": random.random((N, 2)), "gaussian": random.normal(size=(N, 2)), "disk": round_ * away[:, None]}


def by_qhull(points: np.ndarray) -> list[int]:
    sizes = []
    for _ in range(LAYERS):
        layer = ConvexHull(points).vertices
        sizes.append(len(layer))
        points = np.delete(points, layer, axis=0)
    return sizes


def influence_by_qhull(points: np.ndarray, vertices: np.ndarray) -> list[float]:
    whole = ConvexHull(points).volume
    return [whole - ConvexHull(points[(points != vertex).any(axis=1)]).volume for vertex in vertices[:FEW]]


def median(repeat: int, work: Callable[..., object], *arguments: object) -> float:
    """Milliseconds."""
    times = []
    for _ in range(repeat):
        start = time.perf_counter()
        work(*arguments)
        times.append(1e3 * (time.perf_counter() - start))
    return statistics.median(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeat", type=int, default=5)
    repeat = parser.parse_args().repeat
    random = np.random.default_rng(22)
    for kind, points in inputs(random).items():
        hull = DynamicHull(points)
        ours = [len(layer) for layer in hull.layers(LAYERS)]
        theirs = by_qhull(points)
        live, anew = median(repeat, hull.layers, LAYERS), median(1, by_qhull, points)
        same = "the same sizes" if ours == theirs else f"other sizes: {ours}, {theirs}"
        print(f"{kind}: ten layers ({sum(ours):,} vertices, {same}): {live:.2f} ms; Qhull {anew:,.0f} ms", flush=True)
        vertices, influence = hull.vertices(), hull.influence()
        far = np.abs(influence[:FEW] / influence_by_qhull(points, vertices) - 1).max()
        each = 1e3 * median(repeat, hull.influence) / len(vertices)
        rival = median(1, influence_by_qhull, points, vertices) / min(FEW, len(vertices))
        print(f"{kind}: influence {each:.2f} us a vertex; Qhull {rival:,.0f} ms; relative difference {far:.1e}")
    angle = random.random(10**4) * 2 * np.pi
    hull = DynamicHull(np.column_stack([np.cos(angle), np.sin(angle)]))
    print(f"circle, 10,000 points: influence {1e3 * median(repeat, hull.influence) / len(hull):.2f} us a vertex")
    angle = random.random(10**5) * 2 * np.pi
    hull = DynamicHull(np.column_stack([np.cos(angle), np.sin(angle)]))
    vertices = hull.vertices()
    few, error = hull.sketch(33)
    shape, simple = shapely.Polygon(vertices), shapely.Polygon(few)
    difference = abs(shapely.hausdorff_distance(shape, simple) / error - 1)
    ours, simplify = median(repeat, hull.sketch, 33), median(repeat, shapely.simplify, shape, error)
    print(
        f"circle, {len(vertices):,} vertices: sketch of {len(few)} with its error {ours:.2f} ms; shapely's simplify to "
        f"the same distance {simplify:.2f} ms; its Hausdorff distance differs by {difference:.1e}"
    )


if __name__ == "__main__":
    main()
