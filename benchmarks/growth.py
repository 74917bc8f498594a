"""The cost of growth: each work of the kernel and of the server at n = 10^4 to 10^7, and its slope.

    python benchmarks/growth.py                      the tables of docs/performance.md, in less than ten minutes
    python benchmarks/growth.py --sizes 1e4 1e5 --parts kernel

Medians of --repeat rounds, in which all sizes take their turns: a kernel's on one thread, in processor time, but that
`build` and `convex_hull` use all threads. A server's are elapsed times, client and server on the same machine, the
journal synced, data in --folder. The slope is that of the line that fits best on logarithmic scales: 0 for
a constant cost, 1 for a cost that grows like n.

A hull at a past revision is of one with a history; its batches are of one point.
"""

import argparse
import statistics
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from core import INPUTS, clocked, slope
from past import Served, serving

import dynhull
from dynhull import DynamicHull
from dynhull_proto.v1 import batch_pb2, hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from server import packed

SINGLE = 20_000  # calls
BATCH, BATCHES = 8_192, 8
ASKED = 200_000  # rows of a batch of locates
ROWS = 20_000  # of other queries
FEW = 64  # points of a small batch of the server
ROUND_TRIPS = 200
PICTURES = 10
LOADED = 65_536  # points of a batch that fills a hull
NEAR = 200  # revisions between one that was read and the next one
READS_NEAR = 5
MOST_WITH_HISTORY = 1_000_000

Found = Iterator[tuple[str, float]]  # a work, seconds


def single_calls(rows: np.ndarray, n: int) -> Found:
    hull = DynamicHull(rows[:n])
    new, old = rows[n : n + SINGLE].tolist(), rows[: min(SINGLE, n // 2)].tolist()

    def insert() -> None:
        for x, y in new:
            hull.insert(x, y)

    def delete() -> None:
        for x, y in old:
            hull.delete(x, y)

    yield "insert, a call, µs", clocked(insert, len(new))
    yield "delete any point, a call, µs", clocked(delete, len(old))


def vertices_leave(rows: np.ndarray, n: int) -> Found:
    hull = DynamicHull(rows[:n])
    spent, deleted = 0.0, 0
    while deleted < 3_000:
        vertices = hull.vertices().tolist()[:3_000]

        def delete(vertices: list = vertices) -> None:
            for x, y in vertices:
                hull.delete(x, y)

        spent += clocked(delete)
        deleted += len(vertices)
    yield "delete a vertex, a call, µs", spent / deleted


def batches(rows: np.ndarray, n: int) -> Found:
    hull, half = DynamicHull(rows[:n]), BATCH // 2
    ops = np.repeat(np.array([1, -1], np.int8), half)
    starts = range(0, min(BATCHES * half, n - half + 1), half)
    todo = [np.concatenate([rows[n + i : n + i + half], rows[i : i + half]]) for i in starts]

    def apply() -> None:
        for batch in todo:
            hull.apply(ops, batch)

    yield f"an update, batches of {BATCH:,}, ns", clocked(apply, BATCH * len(todo))


def queries(rows: np.ndarray, n: int) -> Found:
    hull, random = DynamicHull(rows[:n]), np.random.default_rng(n)
    low, high = rows.min(axis=0), rows.max(axis=0)
    points = low + random.random((ASKED, 2)) * (high - low)
    turn = random.random(ROWS) * 2 * np.pi
    directions = np.column_stack([np.cos(turn), np.sin(turn)])
    beyond = (low + high) / 2 + 2 * (high - low) * directions
    hull.locate(points)
    yield "locate, a batch, ns", clocked(lambda: hull.locate(points), ASKED)
    yield "support, a batch, ns", clocked(lambda: hull.support(directions), ROWS)
    yield "tangents, a batch, ns", clocked(lambda: hull.tangents(beyond), ROWS)


def at_once(rows: np.ndarray, n: int) -> Found:
    dynhull.set_threads(None)
    for name, work in (("build", DynamicHull), ("convex_hull", dynhull.convex_hull)):
        began = time.perf_counter()
        processor = clocked(lambda work=work: work(rows[:n]), clock=time.process_time)
        yield f"{name}, elapsed, ms", time.perf_counter() - began
        yield f"{name}, processor time of its threads, ms", processor
    dynhull.set_threads(1)


UNITS = {"ns": 1e9, "µs": 1e6, "ms": 1e3, "s": 1}
WORKS: tuple[Callable[[np.ndarray, int], Found], ...] = (single_calls, vertices_leave, batches, queries, at_once)
KINDS = ("uniform", "circle")  # few points are vertices, or all are
Costs = dict[tuple[str, int], list[float]]  # of a work at a size


def of_the_kernel(sizes: list[int], repeat: int) -> Costs:
    dynhull.set_threads(1)
    found: Costs = {}
    for kind in KINDS:
        for turn in range(repeat):
            for n in sizes:
                rows = np.ascontiguousarray(INPUTS[kind](n + max(SINGLE, BATCHES * BATCH), np.random.default_rng(turn)))
                for work in WORKS:
                    for name, seconds in work(rows, n):
                        found.setdefault((f"{kind}: {name}", n), []).append(seconds)
    return found


def elapsed(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


class Client:
    """One hull of a server."""

    def __init__(self, served: Served, name: str, *, history: bool) -> None:
        self.stub, self.name = served.stub, name
        config = hull_pb2.HullConfig()
        if history:
            config.history.SetInParent()
        self.stub.CreateHull(pb.CreateHullRequest(name=name, config=config))

    def insert(self, points: np.ndarray) -> None:
        request = pb.ApplyRequest(name=self.name, batch=batch_pb2.Batch(inserts=packed(points)))
        self.stub.Apply(request)

    def load(self, points: np.ndarray) -> None:
        for first in range(0, len(points), LOADED):
            self.insert(points[first : first + LOADED])

    def locate(self, points: np.ndarray) -> None:
        self.stub.Locate(pb.LocateRequest(name=self.name, points=packed(points)))

    def first_picture(self) -> None:
        call = self.stub.Watch(pb.WatchRequest(name=self.name))
        next(call)
        call.cancel()

    def read(self, revision: int = 0) -> int:
        """The revision of the hull, as it is or as it was."""
        request = pb.GetHullRequest(name=self.name, at_revision=revision or None)
        return int(self.stub.GetHull(request).hull.revision)


def of_calls(hull: Client, random: np.random.Generator) -> Found:
    """What a client waits for, one call after the other."""
    for count, calls in ((1, ROUND_TRIPS), (FEW, ROUND_TRIPS), (BATCH, BATCHES)):
        took = [elapsed(lambda count=count: hull.insert(random.random((count, 2)))) for _ in range(calls)]
        yield f"apply {count:,} point{'s' * (count > 1)}, ms", statistics.median(took)
    for count, calls in ((1, ROUND_TRIPS), (BATCH, BATCHES)):
        took = [elapsed(lambda count=count: hull.locate(random.random((count, 2)))) for _ in range(calls)]
        yield f"locate {count:,} point{'s' * (count > 1)}, ms", statistics.median(took)
    yield "first picture of a watch, ms", statistics.median(elapsed(hull.first_picture) for _ in range(PICTURES))


def of_the_past(served: Served, points: np.ndarray, random: np.random.Generator) -> Found:
    hull = Client(served, "past", history=True)
    hull.load(points)
    for _ in range(NEAR * (READS_NEAR + 1)):
        hull.insert(random.random((1, 2)))
    first = hull.read() - NEAR * READS_NEAR
    yield "a past revision, the first, ms", elapsed(lambda: hull.read(first))
    near = [elapsed(lambda step=step: hull.read(first + NEAR * step)) for step in range(1, READS_NEAR + 1)]
    yield f"one {NEAR} revisions later, ms", statistics.median(near)


def of_the_server(sizes: list[int], repeat: int, parent: Path) -> Costs:
    found: Costs = {}
    for n in sizes:
        random = np.random.default_rng(n)
        points = random.random((n, 2))
        for _ in range(repeat):
            with tempfile.TemporaryDirectory(dir=parent) as folder:
                for name, seconds in a_round(points, random, Path(folder)):
                    found.setdefault((f"server: {name}", n), []).append(seconds)
    return found


def a_round(points: np.ndarray, random: np.random.Generator, folder: Path) -> Found:
    with serving(folder / "live") as served:
        hull = Client(served, "live", history=False)
        yield "load, s", elapsed(lambda: hull.load(points))
        yield from of_calls(hull, random)
    yield "start, s", start(folder / "live")
    if len(points) <= MOST_WITH_HISTORY:
        with serving(folder / "past") as served:
            yield from of_the_past(served, points, random)


def start(folder: Path) -> float:
    """Seconds until a server has loaded its data, and serves."""
    began = time.perf_counter()
    with serving(folder):
        return time.perf_counter() - began


def table(found: Costs, sizes: list[int]) -> Iterator[str]:
    powers = [f"10^{round(np.log10(n))}" if n == 10 ** round(np.log10(n)) else f"{n:,}" for n in sizes]
    yield f"| | {' | '.join(powers)} | slope |"
    yield f"| --- |{' ---: |' * (len(sizes) + 1)}"
    for work in dict.fromkeys(name for name, _ in found):
        name, _, unit = work.rpartition(", ")
        costs = [(n, statistics.median(found[work, n]) * UNITS[unit]) for n in sizes if (work, n) in found]
        cells = [f"{cost:,.3g}" if cost < 1000 else f"{cost:,.0f}" for _, cost in costs]
        cells += [""] * (len(sizes) - len(cells))
        grows = f"{slope(costs):.2f}".replace("-", "\N{MINUS SIGN}") if len(costs) > 1 else ""
        yield f"| {name}, {unit} | {' | '.join(cells)} | {grows} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", nargs="+", type=float, default=[1e4, 1e5, 1e6, 1e7])
    parser.add_argument("--parts", nargs="+", default=["kernel", "server"], choices=("kernel", "server"))
    parser.add_argument("--repeat", type=int, default=5, help="rounds of the kernel (default 5)")
    parser.add_argument("--server-repeat", type=int, default=3, help="rounds of the server (default 3)")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the servers' data (default: here)")
    arguments = parser.parse_args()
    if dynhull.KERNEL != "cpp":
        sys.exit("the kernel is not built")
    sizes = [int(size) for size in arguments.sizes]
    for part in arguments.parts:
        began = time.perf_counter()
        if part == "kernel":
            found = of_the_kernel(sizes, arguments.repeat)
        else:
            found = of_the_server(sizes, arguments.server_repeat, arguments.folder)
        print("\n".join(table(found, sizes)), flush=True)
        print(f"\n{time.perf_counter() - began:.0f} s of work\n", file=sys.stderr, flush=True)


if __name__ == "__main__":
    main()
