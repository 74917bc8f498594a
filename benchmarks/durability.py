"""What durability costs: streams with every --durability beside the same server in memory, pauses, restarts.

    python benchmarks/durability.py [--folder .] [--repeat 5]

Client and server share the machine. The folder should lie on the disk that counts.
"""

import argparse
import asyncio
import sqlite3
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import grpc
import numpy as np

import server
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

OPTIONS = ["-m", "dynhull_server", "--port", "0", "--scrub-cpu", "0", "--log-level", "warning"]
LARGE, LARGE_IN_FLIGHT, SINGLE_IN_FLIGHT = 8192, 16, 64
MANY_POINTS = 10**6
SNAPSHOTS, PAUSE_SECONDS = 4, 8


@contextmanager
def serving(*options: str) -> Iterator[str]:
    """The address of a server of its own."""
    with server.running([*OPTIONS, *options]) as address:
        yield address


@contextmanager
def service(address: str) -> Iterator[HullServiceStub]:
    with grpc.insecure_channel(address) as channel:
        yield HullServiceStub(channel)


def inserts(name: str, points: np.ndarray, size: int) -> list[bytes]:
    """Serialised messages that insert the points, so many at a time."""
    blocks = (points[first : first + size] for first in range(0, len(points), size))
    batches = (batch_pb2.Batch(inserts=server.packed(block)) for block in blocks)
    return [pb.StreamRequest(name=name, batch=batch).SerializeToString() for batch in batches]


def stream(address: str, name: str, points: np.ndarray, size: int, in_flight: int) -> float:
    """Points a second into a new hull or an old one, acknowledged."""
    with service(address) as stub:
        if name not in (hull.name for hull in stub.ListHulls(pb.ListHullsRequest()).hulls):
            stub.CreateHull(pb.CreateHullRequest(name=name))
    todo = inserts(name, points, size)
    return asyncio.run(server.stream(address, todo, len(todo), in_flight)) * len(points) / len(todo)


def streams(folder: Path, repeat: int) -> None:
    rng = np.random.default_rng(0)
    large, single = rng.random((100 * LARGE, 2)), rng.random((10_000, 2))
    modes = {"in memory": ["--in-memory"]}
    modes |= {mode: ["--data", str(folder / mode), "--durability", mode] for mode in ("none", "interval", "sync")}
    rates: dict[str, tuple[list[float], list[float]]] = {mode: ([], []) for mode in modes}
    for repetition in range(repeat):
        for mode, options in modes.items():
            with serving(*options) as address:
                rates[mode][0].append(stream(address, f"large-{repetition}", large, LARGE, LARGE_IN_FLIGHT))
                rates[mode][1].append(stream(address, f"single-{repetition}", single, 1, SINGLE_IN_FLIGHT))
    floor = [statistics.median(values) for values in rates["in memory"]]
    print(
        f"medians of {repeat}; 100 batches of {LARGE:,} points, 10,000 of one point with {SINGLE_IN_FLIGHT} in flight"
    )
    print(
        f"{'durability':12}{'points/s, large batches':>26}{'of in memory':>14}"
        f"{'acks/s, one point':>20}{'of in memory':>14}"
    )
    for mode, values in rates.items():
        many, one = (statistics.median(each) for each in values)
        print(f"{mode:12}{many:>26,.0f}{many / floor[0]:>14.2f}{one:>20,.0f}{one / floor[1]:>14.2f}")


def restart(folder: Path, repeat: int) -> None:
    rng = np.random.default_rng(1)
    data = folder / "restart"
    options = ["--data", str(data), "--snapshot-points", str(MANY_POINTS)]
    with serving(*options) as address:
        stream(address, "large", rng.random((MANY_POINTS, 2)), LARGE, LARGE_IN_FLIGHT)
        wait_for_snapshot(data)
    before = used(data)
    with serving(*options) as address:
        operations = rng.random((MANY_POINTS - LARGE, 2))
        stream(address, "large", operations, LARGE, LARGE_IN_FLIGHT)
    print(f"disk: {(used(data) - before) / len(operations):.1f} bytes an operation of the journal")
    times = []
    for _ in range(repeat):
        begun = time.perf_counter()
        with serving(*options) as address, service(address) as stub:
            times.append(time.perf_counter() - begun)
            points = stub.GetHull(pb.GetHullRequest(name="large")).hull.point_count
    begun = time.perf_counter()
    with serving("--in-memory"):
        empty = time.perf_counter() - begun
    print(
        f"ready after {statistics.median(times):.2f} s (median of {repeat}) with {points:,} points: a snapshot of "
        f"{MANY_POINTS:,}, {len(operations):,} operations in the journal; an empty server in memory: {empty:.2f} s"
    )


def pauses(folder: Path) -> None:
    """How long single points wait for their acknowledgement, one after another, while large hulls get snapshots."""
    rng = np.random.default_rng(2)
    names = [f"large-{number}" for number in range(SNAPSHOTS)]
    points, single = rng.random((MANY_POINTS, 2)), rng.random((1000, 2))
    print(f"acknowledgements of single points to hulls of {MANY_POINTS:,}:    median      p99  longest, ms")
    for every in (100 * MANY_POINTS, MANY_POINTS):
        data = folder / f"pauses-{every}"
        with serving("--data", str(data), "--durability", "sync", "--snapshot-points", str(every)) as address:
            for name in names:
                stream(address, name, points, LARGE, LARGE_IN_FLIGHT)
            waits = np.sort(asyncio.run(one_by_one(address, [inserts(name, single, 1) for name in names])))
        with closing(sqlite3.connect(data / "dynhull.db")) as database:
            taken = database.execute("SELECT count(*) FROM snapshots").fetchone()[0]
        median, p99, longest = waits[len(waits) // 2], waits[-len(waits) // 100], waits[-1]
        what = f"{taken} snapshots, {len(waits):,} points"
        print(f"    {what:47}{median:9.2f}{p99:9.2f}{longest:9.2f}")


async def one_by_one(address: str, todo: list[list[bytes]]) -> list[float]:
    """Milliseconds to each acknowledgement, of as many streams in turn."""
    waits = []
    async with grpc.aio.insecure_channel(address) as channel:
        calls = [channel.stream_stream(server.SERVICE + "Stream")() for _ in todo]
        end = time.perf_counter() + PAUSE_SECONDS
        while (begun := time.perf_counter()) < end:
            turn = len(waits) % len(todo)
            await calls[turn].write(todo[turn][len(waits) % len(todo[turn])])
            assert await calls[turn].read() is not grpc.aio.EOF
            waits.append((time.perf_counter() - begun) * 1e3)
    return waits


def used(data: Path) -> int:
    """Bytes of the folder of a server that has stopped and left no log beside its database."""
    return sum(file.stat().st_size for file in data.rglob("*") if file.is_file())


def wait_for_snapshot(data: Path) -> None:
    with closing(sqlite3.connect(f"file:{data / 'dynhull.db'}?mode=ro", uri=True)) as database:
        while database.execute("SELECT count(*) FROM snapshots").fetchone()[0] == 0:
            time.sleep(0.2)


def main() -> None:
    parser = argparse.ArgumentParser(
        description="Durable streams beside the same in memory, pauses by snapshots, and restarts."
    )
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    parser.add_argument("--repeat", type=int, default=5, help="repetitions; medians are printed (default 5)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        streams(Path(folder), options.repeat)
        pauses(Path(folder))
        restart(Path(folder), options.repeat)


if __name__ == "__main__":
    main()
