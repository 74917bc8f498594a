"""What hulls answer, beside libraries that answer the same: medians of one run.

    python benchmarks/queries.py [--repeat 5] [--only WORD ...]

Both are given the same input, made ready in the form they take (a live hull, a shapely geometry) outside the time; each
repetition runs both in turn. The answers are compared before: how far they differ is printed, relatively.
"""

import argparse
import statistics
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import fcl
import numpy as np
import shapely
from sklearn.svm import SVC

import dynhull
from dynhull import DynamicHull, measure
from dynhull._tree import HullTree
from dynhull.convex import Cloud
from dynhull.defects import convexity_defects
from dynhull.envelope import Frontier, PhaseDiagram, energy_above_hull_nd
from dynhull.gjk import contact, distance_many, intersect_many
from dynhull.margin import max_margin

sys.path.append(str(Path(__file__).parents[1] / "tests/support"))
from judges import fcl_body

RANDOM = np.random.default_rng(8)


@dataclass(frozen=True)
class Case:
    """One question, and who answers it. `per` answers a run."""

    question: str
    judge: str
    ours: Callable[[], object]
    theirs: Callable[[], object]
    per: int = 1


def measures() -> Iterator[Case]:
    angle = RANDOM.random(10**6) * 2 * np.pi
    vertices = dynhull.convex_hull(np.column_stack([5 + 3 * np.cos(angle), 7 + np.sin(angle)]))
    shape = shapely.Polygon(vertices)
    kind = f"hull of {len(vertices):,} vertices: "
    yield Case(kind + "area", "shapely", lambda: measure.area(vertices), lambda: shape.area)
    yield Case(kind + "centroid", "shapely", lambda: measure.centroid(vertices), lambda: shape.centroid.coords[0])
    yield Case(
        kind + "smallest box, area",
        "shapely",
        lambda: area_of(measure.min_box(vertices)),
        lambda: shapely.minimum_rotated_rectangle(shape).area,
    )
    few = vertices[::1000]
    circle = shapely.Polygon(few)
    yield Case(
        f"hull of {len(few):,} vertices: smallest circle, radius",
        "shapely",
        lambda: measure.min_circle(few)[1],
        lambda: shapely.minimum_bounding_radius(circle),
    )


def area_of(box: np.ndarray) -> float:
    return float(np.prod(np.hypot(*(box[[1, 3]] - box[0]).T)))


def many() -> Iterator[Case]:
    """Many questions about one live hull. Where shapely has no such question, numpy or this library's reference."""
    count, lines = 200_000, 60_000
    middle, size = np.array([5.0, 7.0]), np.array([3.0, 1.0])

    def around(n: int) -> np.ndarray:
        angle = RANDOM.random(n) * 2 * np.pi
        return np.column_stack([np.cos(angle), np.sin(angle)])

    hull = DynamicHull(middle + size * around(3000))
    vertices = hull.vertices()
    reference = HullTree(vertices)
    shape = shapely.Polygon(vertices)
    shapely.prepare(shape)
    anywhere = middle + 2 * size * RANDOM.standard_normal((count, 2))
    outside = middle + size * around(count) * (1.01 + RANDOM.exponential(1, (count, 1)))
    ways = around(count)
    p, q = middle + size * RANDOM.standard_normal((2, lines, 2))
    kind = f"live hull of {len(vertices):,} vertices, {count:,} points: "

    def support() -> np.ndarray:
        edges = np.roll(vertices, -1, axis=0) - vertices
        normals = np.unwrap(np.arctan2(-edges[:, 0], edges[:, 1]))
        angle = (np.arctan2(ways[:, 1], ways[:, 0]) - normals[0]) % (2 * np.pi) + normals[0]
        return vertices[np.searchsorted(normals, angle) % len(vertices)]

    def crossings() -> np.ndarray:
        far = 1e3 * (q - p)
        met = shapely.intersection(shapely.linestrings(np.stack([p - far, p + far], axis=1)), shape)
        found = np.full((lines, 2, 2), np.nan)
        hits = ~shapely.is_empty(met)
        found[hits] = shapely.get_coordinates(met[hits]).reshape(-1, 2, 2)
        return found

    yield Case(
        kind + "locate",
        "shapely",
        lambda: hull.locate(anywhere) >= 0,
        lambda: shapely.intersects_xy(shape, *anywhere.T),
        count,
    )
    yield Case(
        kind + "count",
        "Python, a call each",
        lambda: hull.count_many(anywhere),
        lambda: [hull.count(x, y) for x, y in anywhere.tolist()],
        count,
    )
    yield Case(kind + "support", "numpy, by angle", lambda: hull.support(ways), support, count)
    yield Case(
        kind + "tangents",
        "reference in Python",
        lambda: hull.tangents(outside),
        lambda: reference.tangents(outside),
        count,
    )
    yield Case(
        kind + "distance",
        "shapely",
        lambda: hull.distance(outside),
        lambda: shapely.distance(shape, shapely.points(outside)),
        count,
    )
    yield Case(
        f"live hull of {len(vertices):,} vertices, {lines:,} lines: crossings",
        "shapely",
        lambda: hull.intersect_lines(p, q),
        crossings,
        lines,
    )
    # Where pairs of doubles overflow: exact signs for every row.
    huge, block = 2.0**600, 8192
    large, judge = DynamicHull(huge * vertices), HullTree(huge * vertices)
    far, starts, ends = (huge * rows[:block] for rows in (outside, p, q))
    kind = f"the same times 2^600, {block:,} rows: "
    yield Case(
        kind + "distance", "reference in Python", lambda: large.distance(far), lambda: judge.distance(far), block
    )
    yield Case(
        kind + "crossings",
        "reference in Python",
        lambda: large.intersect_lines(starts, ends),
        lambda: judge.intersect_lines(starts, ends),
        block,
    )


def pairs() -> Iterator[Case]:
    count, corners = 100_000, 6
    angle = np.sort(RANDOM.random((2, count, corners)), axis=2) * 2 * np.pi
    a, b = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    b = b + 1.5 * RANDOM.standard_normal((count, 1, 2))
    first, second = shapely.polygons(a), shapely.polygons(b)
    kind = f"{count:,} pairs of hexagons: "
    yield Case(
        kind + "intersect", "shapely", lambda: intersect_many(a, b), lambda: shapely.intersects(first, second), count
    )
    yield Case(
        kind + "distance", "shapely", lambda: distance_many(a, b), lambda: shapely.distance(first, second), count
    )


def bodies() -> Iterator[Case]:
    clouds = RANDOM.standard_normal((400, 12, 3)) + [[[6.0, 0, 0]]] * np.arange(400)[:, None, None]
    shapes, judged = [Cloud(cloud) for cloud in clouds], [fcl_body(cloud) for cloud in clouds]

    def ours() -> list[float]:
        return [contact(shapes[i - 1], shapes[i]).distance for i in range(1, 400)]

    def theirs() -> list[float]:
        ask = fcl.DistanceRequest()
        return [fcl.distance(judged[i - 1], judged[i], ask, fcl.DistanceResult()) for i in range(1, 400)]

    yield Case("bodies of 12 points in space, one by one: distance", "python-fcl", ours, theirs, 399)


def margins() -> Iterator[Case]:
    for n in (1000, 100_000):
        a, b = RANDOM.standard_normal((2, n, 2)) + np.array([[[0, 0]], [[12, 3]]])
        live = DynamicHull(a), DynamicHull(b)
        hulls = shapely.convex_hull(shapely.multipoints(a)), shapely.convex_hull(shapely.multipoints(b))

        def machine(a=a, b=b, n=n) -> float:
            svm = SVC(kernel="linear", C=1e10).fit(np.concatenate([a, b]), np.repeat([0, 1], n))
            return float(2 / np.linalg.norm(svm.coef_))

        kind = f"margin of twice {n:,} points: "
        yield Case(kind + "from arrays", "SVC", lambda a=a, b=b: max_margin(a, b).margin, machine)
        yield Case(
            kind + "from live hulls",
            "shapely, hulls made",
            lambda live=live: max_margin(*live).margin,
            lambda hulls=hulls: shapely.distance(*hulls),
        )


def defects() -> Iterator[Case]:
    n = 10_000
    angle = np.arange(n) * 2 * np.pi / n
    radius = 30_000 * (1 + 0.3 * np.sin(9 * angle)) + RANDOM.integers(0, 9, n)
    contour = np.round(np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])).astype(np.int32)

    def theirs() -> float:
        found = cv2.convexityDefects(contour, np.sort(cv2.convexHull(contour, returnPoints=False), axis=0)[::-1])
        return float(found.reshape(-1, 4)[:, 3].max() / 256)

    yield Case(
        f"defects of a contour of {n:,}: deepest", "OpenCV", lambda: convexity_defects(contour).depth.max(), theirs
    )


def envelopes() -> Iterator[Case]:
    n = 10_000
    entries = np.column_stack([RANDOM.random(n), RANDOM.random(n)])
    entries[:2] = [[0, 0.5], [1, 0.5]]
    entries[:, 1] -= 4 * entries[:, 0] * (1 - entries[:, 0])
    diagram = PhaseDiagram(entries)
    shares = np.column_stack([1 - entries[:, 0], entries[:, 0]])
    yield Case(
        f"energy above hull of {n:,} entries",
        "Qhull, floats",
        lambda: diagram.energy_above_hull(entries),
        lambda: energy_above_hull_nd(shares, entries[:, 1]),
        n,
    )
    points = np.exp(RANDOM.standard_normal((10**6, 2)) / 4)
    frontier = Frontier(points)
    yield Case(
        "tangency among 1,000,000 points: Sharpe ratio",
        "numpy, all points",
        lambda: frontier.sharpe_ratio(0.5),
        lambda: ((points[:, 1] - 0.5) / points[:, 0]).max(),
    )


def difference(ours: object, theirs: object) -> float:
    """The largest, relative to the largest value."""
    a, b = (np.nan_to_num(np.asarray(answer, dtype=np.float64)) for answer in (ours, theirs))
    return float(np.abs(a - b).max() / max(np.abs(b).max(), 1e-300))


def seconds(answer: Callable[[], object]) -> float:
    start = time.perf_counter()
    answer()
    return time.perf_counter() - start


def readable(time_taken: float) -> str:
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if time_taken >= size:
            return f"{time_taken / size:.3g} {unit}"
    return f"{time_taken / 1e-9:.3g} ns"


def main() -> None:
    parser = argparse.ArgumentParser(description="What hulls answer, beside other libraries.")
    parser.add_argument("--repeat", type=int, default=5, help="repetitions; medians are printed (default 5)")
    parser.add_argument("--only", nargs="+", default=[""], help="only the questions that contain one of these words")
    options = parser.parse_args()
    print("| question | dynhull | judge | its time | differ by |")
    print("| --- | ---: | --- | ---: | ---: |")
    for source in (measures, many, pairs, bodies, margins, defects, envelopes):
        for case in source():
            if not any(word in case.question for word in options.only):
                continue
            off = difference(case.ours(), case.theirs())
            times = [(seconds(case.ours), seconds(case.theirs)) for _ in range(options.repeat)]
            ours, theirs = (statistics.median(column) / case.per for column in zip(*times, strict=True))
            each = " (each)" if case.per > 1 else ""
            cells = f"{readable(ours)}{each} | {case.judge} | {readable(theirs)}"
            print(f"| {case.question} | {cells} | {off:.0e} |", flush=True)


if __name__ == "__main__":
    main()
