"""Moves of entities in a keyed hull, beside the same moves without keys, and through a server beside Redis.

    nice python benchmarks/entities.py --sizes 1e5 1e6
    python benchmarks/entities.py --works moves --batches 8192 --repeat 9
    python benchmarks/entities.py --works names memory reference
    python benchmarks/entities.py --works server --sizes 1e6 --batches 64 8192 --repeat 7

moves, names, memory and reference measure the library. Without keys, a move is a delete and an insert in one batch.
Every hull moves the same entities to the same places, batch by batch, and with each batch another hull begins, so that
ratios compare neighbours in time. Columns: the median, the least and the greatest over the batches, and the median of
the ratios to the unkeyed hull.

server measures `dynhull serve --durability sync` with a keyed hull beside Redis 7 with GEOADD and `appendfsync always`,
which is started for the run (Debian: `apt-get install redis-server`). The two take the same moves in turn, 8 batches
under way. Redis keeps no hull, and truncates coordinates to a geohash of 52 bits. Columns: moves a second, median,
least and greatest of the runs; the median of the ratios to Redis; the growth of the data on the disk.
"""

import argparse
import platform
import resource
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
import served_entities

import dynhull
from dynhull import DynamicHull, KeyedHull
from dynhull._entities import Entities
from dynhull._tree import HullTree
from dynhull.keys import PackedKeys

INPUTS = {
    "uniform": lambda n, random: random.random((n, 2)),
    "normal": lambda n, random: random.normal(size=(n, 2)),
    "circle": lambda n, random: unit(random.random(n) * 2 * np.pi),
}
UPDATES = 200_000  # moves of each hull in a repetition, at most
REFERENCE = 20_000, 2048  # entities and rows of a batch of the reference in Python
SCATTER = np.uint64(0x9E3779B97F4A7C15)  # keys that are spread over all of uint64

Times = dict[str, list[float]]


def unit(angle: np.ndarray) -> np.ndarray:
    return np.column_stack([np.cos(angle), np.sin(angle)])


def integers(rows: np.ndarray) -> np.ndarray:
    return rows.astype(np.uint64) * SCATTER


def strings(rows: np.ndarray) -> list[str]:
    return [f"{row:016}" for row in rows.tolist()]


def clocked(times: Times, moves: int, works: dict[str, Callable[[], object]]) -> None:
    """Nanoseconds of a move, of each in turn."""
    turn = sum(map(len, times.values())) // len(works) % len(works)
    for who in [*works][turn:] + [*works][:turn]:
        began = time.thread_time()
        works[who]()
        times.setdefault(who, []).append((time.thread_time() - began) / moves * 1e9)


def batches(n: int, size: int, make: Callable, random: np.random.Generator) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Rows that move, and where to. Made before anything is measured, which leaves the caches to the hulls."""
    count = max(min(UPDATES // size, 400), 3)
    return iter([(random.permutation(n)[:size], make(size, random)) for _ in range(count)])


def moves(n: int, size: int, make: Callable, random: np.random.Generator, times: Times) -> None:
    """Move entities: by integers, by 16-byte strings, packed and in lists, and with names of the vertices."""
    current = make(n, random)
    everyone = strings(np.arange(n))
    unkeyed = DynamicHull(current)
    integer = KeyedHull.from_entities(integers(np.arange(n)), current, key_type="int")
    packed = KeyedHull.from_entities(everyone, current)
    listed = packed.copy()
    ops = np.repeat(np.array([-1, 1], np.int8), size)
    for rows, places in batches(n, size, make, random):
        keys, names = integers(rows), [everyone[row] for row in rows.tolist()]
        block = PackedKeys.pack(names)
        both = np.concatenate([current[rows], places])
        works = {
            "unkeyed": partial(unkeyed.apply, ops, both),
            "uint64": partial(integer.put_many, keys, places),
            "packed strings": partial(packed.put_many, block, places),
            "list of strings": partial(listed.put_many, names, places),
        }
        clocked(times, size, works)
        current[rows] = places


def put_and_name(hull: KeyedHull, keys: np.ndarray, places: np.ndarray) -> None:
    hull.put_many(keys, places)
    hull.vertex_keys()


def names(n: int, size: int, make: Callable, random: np.random.Generator, times: Times) -> None:
    """Move entities and ask for the names of all vertices after each batch."""
    current = make(n, random)
    unkeyed = DynamicHull(current)
    plain = KeyedHull.from_entities(integers(np.arange(n)), current, key_type="int")
    named = plain.copy()
    named.vertex_keys()
    ops = np.repeat(np.array([-1, 1], np.int8), size)
    for rows, places in batches(n, size, make, random):
        keys = integers(rows)
        both = np.concatenate([current[rows], places])
        works = {
            "unkeyed": partial(unkeyed.apply, ops, both),
            "uint64, no names": partial(plain.put_many, keys, places),
            "uint64, names after each batch": partial(put_and_name, named, keys, places),
        }
        clocked(times, size, works)
        current[rows] = places


def reference(n: int, size: int, make: Callable, random: np.random.Generator, times: Times) -> None:
    """The same in pure Python."""
    current = make(n, random)
    everyone = strings(np.arange(n))
    unkeyed, integer, string = HullTree(current), Entities("int"), Entities("str")
    integer.load(integers(np.arange(n)), current, None)
    string.load(everyone, current, None)
    ops = np.repeat(np.array([-1, 1], np.int8), size)
    for _ in range(3):
        rows, places = random.permutation(n)[:size], make(size, random)
        both = np.concatenate([current[rows], places])
        keys, chosen = integers(rows), [everyone[row] for row in rows.tolist()]
        works = {
            "unkeyed": partial(unkeyed.apply, ops, both, ignore_missing=False),
            "uint64": partial(integer.update, keys, places, None, None),
            "list of strings": partial(string.update, chosen, places, None, None),
        }
        clocked(times, size, works)
        current[rows] = places


def grown_bytes(n: int, key_type: str, kind: str) -> float:
    """The bytes by which this process has grown for an entity, after every entity has moved once."""
    random = np.random.default_rng(0)
    make, size = INPUTS[kind], 8192
    hull = KeyedHull(key_type)
    warm = KeyedHull(key_type)
    warm.put_many([0] if key_type == "int" else ["a"], [[0, 0]])
    before = resident()
    for start in range(0, 2 * n, size):
        rows = np.arange(start, min(start + size, 2 * n)) % n
        hull.put_many(integers(rows) if key_type == "int" else PackedKeys.pack(strings(rows)), make(len(rows), random))
    if key_type == "str":
        hull.vertex_keys()
    return (resident() - before) / n


def resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize()


def memory(n: int, kind: str) -> Iterator[tuple[str, float]]:
    """Each in a process of its own."""
    for who, key_type in (("uint64", "int"), ("16-byte strings, with names", "str")):
        command = [sys.executable, __file__, "--measure-memory", str(n), key_type, kind]
        run = subprocess.run(command, check=True, capture_output=True, text=True)
        yield who, float(run.stdout)


WORKS = {"moves": moves, "names": names, "reference": reference, "memory": None}
SERVER = "server"
PARTS = [*WORKS, SERVER]


def measure(arguments: argparse.Namespace, works: list[str]) -> None:
    print("| work | input | n | batch | who | median | least | greatest | of unkeyed |")
    print("| --- | --- | ---: | ---: | --- | ---: | ---: | ---: | ---: |")
    for work in works:
        for kind in arguments.inputs:
            for n in arguments.sizes:
                if work == "memory":
                    for who, size in memory(n, kind):
                        print(f"| {work} | {kind} | {n:,} | | {who} | {size:.1f} bytes | | | |", flush=True)
                    continue
                for size in arguments.batches:
                    if work == "reference":
                        n, size = REFERENCE
                    times: Times = {}
                    for repetition in range(arguments.repeat):
                        WORKS[work](n, size, INPUTS[kind], np.random.default_rng(repetition), times)
                    for who, values in times.items():
                        ratio = statistics.median(a / b for a, b in zip(values, times["unkeyed"], strict=True))
                        figures = " | ".join(f"{f(values):.0f} ns" for f in (statistics.median, min, max))
                        print(f"| {work} | {kind} | {n:,} | {size:,} | {who} | {figures} | {ratio:.2f} |", flush=True)
                    if work == "reference":
                        break
            if work == "reference":
                break


def main() -> None:
    dynhull.set_threads(1)  # the clock counts one
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--sizes", nargs="+", type=number, default=[10**5, 10**6], help="numbers of entities (default 1e5 1e6)"
    )
    parser.add_argument(
        "--batches", nargs="+", type=int, default=[64, 8192, 65536], help="moves in a batch (default 64 8192 65536)"
    )
    parser.add_argument(
        "--inputs", nargs="+", default=["uniform"], choices=INPUTS, help="where the points are (default uniform)"
    )
    parser.add_argument("--works", nargs="+", default=PARTS, choices=PARTS, help="what to measure (default all)")
    parser.add_argument("--repeat", type=int, default=3, help="repetitions, and runs of each server (default 3)")
    parser.add_argument("--folder", type=Path, default=Path(), help="where the servers put their data (default here)")
    parser.add_argument("--measure-memory", nargs=3, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure_memory:
        n, key_type, kind = arguments.measure_memory
        print(grown_bytes(int(n), key_type, kind))
        return
    if dynhull.KERNEL != "cpp":
        sys.exit("the kernel is not built")
    if SERVER in arguments.works:
        served_entities.require_redis()
    print(
        f"dynhull {dynhull.KERNEL}, Python {platform.python_version()}, numpy {np.__version__}, {platform.machine()}\n"
    )
    if works := [work for work in arguments.works if work != SERVER]:
        measure(arguments, works)
    if SERVER in arguments.works:
        inputs = {kind: INPUTS[kind] for kind in arguments.inputs}
        served_entities.measure(arguments.folder, inputs, arguments.sizes, arguments.batches, arguments.repeat)


def number(text: str) -> int:
    return int(float(text))


if __name__ == "__main__":
    main()
