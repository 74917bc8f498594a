"""Fences over a keyed hull: moves with and without an index, a hull that changes as an area, and memory.

    nice python benchmarks/fences.py --subjects 1e6 --fences 23000
    python benchmarks/fences.py --works hulls --vertices 100 3000

moves: subjects walk at random, batch by batch; with each batch one of two equal hulls begins, one with an index of
polygon fences and `take`, one without. Columns: nanoseconds a move, median; the rate of the hull with fences as a share
of that without, median of the batches; the share of moves that crossed a fence.

hulls: a fence around a hull, of which a point is inserted or deleted in each revision: `set_hull` and `take`, beside
`locate` of all subjects. Columns: milliseconds a revision, median and greatest.

memory: bytes a subject of the index.
"""

import argparse
import platform
import statistics
import time
from collections.abc import Iterator

import numpy as np

import dynhull

EXTENT = 1000.0  # of the square where everything is
STEP = 0.1  # standard deviation of a move
CORNERS = 12  # of a polygon
BATCHES = 200  # at most
REVISIONS = 60


def star(random: np.random.Generator, center: np.ndarray, size: float) -> np.ndarray:
    """A simple polygon, not convex."""
    angles = (np.arange(CORNERS) + 0.8 * random.random(CORNERS)) * 2 * np.pi / CORNERS
    radii = size * (0.4 + 0.6 * random.random(CORNERS))
    return center + np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def indexed(hull: dynhull.KeyedHull, fences: int, random: np.random.Generator) -> dynhull.FenceIndex:
    index = dynhull.FenceIndex(hull)
    for fence in range(fences):
        index.set_polygons(fence, [[star(random, random.random(2) * EXTENT, 2 + 6 * random.random())]])
    return index


def subjects(n: int, random: np.random.Generator) -> tuple[np.ndarray, dynhull.KeyedHull]:
    places = random.random((n, 2)) * EXTENT
    return places, dynhull.KeyedHull.from_entities(np.arange(n, dtype=np.uint64), places, key_type="int")


def moves(n: int, fences: int, sizes: list[int]) -> Iterator[str]:
    random = np.random.default_rng(1)
    places, plain = subjects(n, random)
    fenced = plain.copy()
    began = time.perf_counter()
    index = indexed(fenced, fences, random)
    seconds = time.perf_counter() - began
    yield f"| set | {n:,} | {fences:,} | {seconds / fences * 1e6:.0f} µs a fence | | |"
    yield f"| memory | {n:,} | {fences:,} | {index._fences.memory / n:.0f} bytes a subject | | |"
    for size in sizes:
        times: dict[str, list[float]] = {"plain": [], "fenced": []}
        crossed = 0
        count = min(BATCHES, 400_000 // size)
        for turn in range(count):
            rows = random.permutation(n)[:size]
            places[rows] += random.normal(scale=STEP, size=(size, 2))
            keys, to = rows.astype(np.uint64), places[rows]
            for who in ("plain", "fenced") if turn % 2 else ("fenced", "plain"):
                began = time.thread_time()
                if who == "plain":
                    plain.update(keys, to)
                else:
                    fenced.update(keys, to)
                    crossed += len(index.take())
                times[who].append(time.thread_time() - began)
        share = statistics.median(a / b for a, b in zip(times["plain"], times["fenced"], strict=True))
        cost = ", ".join(f"{who} {statistics.median(each) / size * 1e9:.0f} ns" for who, each in times.items())
        yield f"| moves | {n:,} | {size:,} a batch | {cost} | {share:.2f} | {crossed / count / size:.2%} |"


def hulls(n: int, vertices: list[int]) -> Iterator[str]:
    random = np.random.default_rng(2)
    _, hull = subjects(n, random)
    index = dynhull.FenceIndex(hull)
    for fence, h in enumerate(vertices):
        angles = random.random(h) * 2 * np.pi
        radii = EXTENT * 0.4 * (1 - 1e-4 * random.random(2 * h))
        angles = np.concatenate([angles, random.random(h) * 2 * np.pi])
        around = EXTENT / 2 + np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])
        area = dynhull.DynamicHull(around[:h])
        index.set_hull(fence, area.vertices())
        times, brute, events = [], [], 0
        for revision in range(REVISIONS):
            area.insert(*around[h + revision])
            area.delete(*around[revision])
            corners = area.vertices()
            began = time.perf_counter()
            index.set_hull(fence, corners)
            events += len(index.take())
            times.append((time.perf_counter() - began) * 1e3)
        for _ in range(5):
            points = hull.points()
            began = time.perf_counter()
            area.locate(points)
            brute.append((time.perf_counter() - began) * 1e3)
        figures = f"{statistics.median(times):.2f} ms, at most {max(times):.2f}"
        located = f"locate of all {statistics.median(brute):.1f} ms"
        yield f"| hull of {len(corners)} | {n:,} | {events / REVISIONS:.0f} events | {figures} | {located} | |"


def number(text: str) -> int:
    return int(float(text))


def main() -> None:
    dynhull.set_threads(1)  # the clock counts one
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--subjects", type=number, default=10**6, help="entities of the hull (default 1e6)")
    parser.add_argument("--fences", type=number, default=23_000, help="polygon fences (default 23000)")
    parser.add_argument("--batches", nargs="+", type=int, default=[64, 8192], help="moves in a batch (default 64 8192)")
    parser.add_argument("--vertices", nargs="+", type=int, default=[100, 1000, 3000], help="points around a hull area")
    parser.add_argument("--works", nargs="+", default=["moves", "hulls"], choices=["moves", "hulls"])
    arguments = parser.parse_args()
    print(f"dynhull {dynhull.KERNEL}, Python {platform.python_version()}, {platform.machine()}\n")
    print("| work | subjects | | | of the rate without | crossings |")
    print("| --- | ---: | --- | --- | ---: | ---: |")
    for work in arguments.works:
        lines = (
            moves(arguments.subjects, arguments.fences, arguments.batches)
            if work == "moves"
            else hulls(arguments.subjects, arguments.vertices)
        )
        for line in lines:
            print(line, flush=True)


if __name__ == "__main__":
    main()
