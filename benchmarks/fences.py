"""Fences over a keyed hull: moves with and without an index, a hull that changes as an area, and memory.

    nice python benchmarks/fences.py --subjects 1e6 --fences 23000
    python benchmarks/fences.py --works hulls --vertices 100 3000

moves: subjects walk at random, batch by batch; with each batch one of two equal hulls begins, one with an index of
polygon fences and `take`, one without. Columns: nanoseconds a move, median; the rate of the hull with fences as a share
of that without, median of the batches; the share of moves that crossed a fence.

hulls: a fence around a hull, of which a point is inserted or deleted in each revision: `set_hull` and `take`, beside
`locate` of all subjects. Columns: milliseconds a revision, median and greatest.

memory: how much larger the process is, a subject, once there is an index: without the fences' own, which an index of
the same fences without subjects has. And bytes of an event with a key of 16 bytes, in the server's memory and in a row
on the disk, alone and with others, for random positions and for decimals of five places.
"""

import argparse
import gc
import os
import platform
import statistics
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import dynhull
from dynhull_server.state.fences.events.block import EventBlock, block_of
from dynhull_server.state.fences.model.records import Cause, EventType, FenceEvent
from dynhull_server.state.records import NO_TIME
from dynhull_server.storage.rows.event_blocks import encode_block

WORKS = ("moves", "hulls", "memory")

EXTENT = 1000.0  # of the square where everything is
STEP = 0.1  # standard deviation of a move
CORNERS = 12  # of a polygon
BATCHES = 200  # at most
REVISIONS = 60
NOW = 1_790_000_000_000_000  # microseconds since 1970


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


def memory(n: int, fences: int) -> Iterator[str]:
    random = np.random.default_rng(3)
    before = resident()
    empty = indexed(dynhull.KeyedHull(key_type="int"), fences, np.random.default_rng(4))
    own = resident() - before
    _, hull = subjects(n, random)
    before = resident()
    index = indexed(hull, fences, np.random.default_rng(4))
    over = resident() - before - own
    assert len(index) == len(empty)
    yield f"| memory | {n:,} | {fences:,} fences | {over / n:.0f} bytes a subject, {own / fences:.0f} a fence | | |"
    for places, decimals in (("random", None), ("decimals", 5)):
        for size in (1, 16, 1024):
            block = events(size, random, decimals)
            stored = len(encode_block(block, np.ones(len(block.runs), np.bool_)))
            figures = f"{block.bytes / size:.0f} bytes an event in memory, {stored / size:.0f} on the disk"
            yield f"| memory | | {size:,} events in a row, {places} | {figures} | | |"


def events(n: int, random: np.random.Generator, decimals: int | None) -> EventBlock:
    """What moves of a moment mean for many fences: each an event of another fence and a key of 16 bytes."""
    made = {}
    for fence in random.choice(23_000, n, replace=False).tolist():
        positions = random.random((2, 2)) * EXTENT
        positions[1] = positions[0] + random.normal(scale=STEP, size=2)
        here, before = (positions if decimals is None else positions.round(decimals)).tolist()
        key, kind = f"vehicle/{random.integers(10**8):08}", random.choice([EventType.ENTER, EventType.EXIT])
        away = 0.0 if kind == EventType.ENTER else random.random() * STEP
        event = FenceEvent(
            int(random.integers(1, 1000)),
            EventType(kind),
            int(Cause.MOVED),
            "fleet",
            key,
            10**6,
            0,
            tuple(here),
            tuple(before),
            away,
            NO_TIME,
            NOW,
        )
        made[fence] = [event]
    return block_of(made)


def resident() -> int:
    """The bytes of memory of this process."""
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def number(text: str) -> int:
    return int(float(text))


def main() -> None:
    dynhull.set_threads(1)  # the clock counts one
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--subjects", type=number, default=10**6, help="entities of the hull (default 1e6)")
    parser.add_argument("--fences", type=number, default=23_000, help="polygon fences (default 23000)")
    parser.add_argument("--batches", nargs="+", type=int, default=[64, 8192], help="moves in a batch (default 64 8192)")
    parser.add_argument("--vertices", nargs="+", type=int, default=[100, 1000, 3000], help="points around a hull area")
    parser.add_argument("--works", nargs="+", default=list(WORKS), choices=WORKS)
    arguments = parser.parse_args()
    print(f"dynhull {dynhull.KERNEL}, Python {platform.python_version()}, {platform.machine()}\n")
    print("| work | subjects | | | of the rate without | crossings |")
    print("| --- | ---: | --- | --- | ---: | ---: |")
    for work in arguments.works:
        lines = {
            "moves": lambda: moves(arguments.subjects, arguments.fences, arguments.batches),
            "hulls": lambda: hulls(arguments.subjects, arguments.vertices),
            "memory": lambda: memory(arguments.subjects, arguments.fences),
        }[work]()
        for line in lines:
            print(line, flush=True)


if __name__ == "__main__":
    main()
