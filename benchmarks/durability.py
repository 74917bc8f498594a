"""What durability costs: streams with every --durability beside the same server in memory, and restarts.

    python benchmarks/durability.py [--folder .] [--repeat 5]

Client and server share the machine. The folder should lie on the disk that counts.
"""

import argparse
import sqlite3
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import grpc
import numpy as np

from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

COMMAND = str(Path(sys.executable).with_name("dynhull"))
LARGE, SINGLE_IN_FLIGHT = 8192, 64
RESTART_POINTS = 10**6


@contextmanager
def server(*options: str) -> Iterator[HullServiceStub]:
    command = [COMMAND, "serve", "--port", "0", "--scrub-cpu", "0", "--log-level", "warning", *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        address = process.stdout.readline().split()[-1]
        with grpc.insecure_channel(address) as channel:
            yield HullServiceStub(channel)
        process.terminate()


def batches(points: np.ndarray, size: int) -> list[batch_pb2.Batch]:
    made = []
    for first in range(0, len(points), size):
        batch = batch_pb2.Batch()
        batch.inserts.packed = points[first : first + size].tobytes()
        made.append(batch)
    return made


def stream(stub: HullServiceStub, name: str, todo: list[batch_pb2.Batch], in_flight: int) -> float:
    """Seconds until all are acknowledged."""
    room = threading.Semaphore(in_flight)

    def requests() -> Iterator[pb.StreamRequest]:
        for i, batch in enumerate(todo):
            room.acquire()
            yield pb.StreamRequest(name=name if i == 0 else "", batch=batch)

    begun = time.perf_counter()
    for _ in stub.Stream(requests()):
        room.release()
    return time.perf_counter() - begun


def create(stub: HullServiceStub, name: str) -> str:
    stub.CreateHull(pb.CreateHullRequest(name=name))
    return name


def streams(folder: Path, repeat: int) -> None:
    rng = np.random.default_rng(0)
    large = batches(rng.random((100 * LARGE, 2)), LARGE)
    single = batches(rng.random((10_000, 2)), 1)
    modes = {"in memory": ["--in-memory"]}
    modes |= {mode: ["--data", str(folder / mode), "--durability", mode] for mode in ("none", "interval", "sync")}
    rates: dict[str, tuple[list[float], list[float]]] = {mode: ([], []) for mode in modes}
    for repetition in range(repeat):
        for mode, options in modes.items():
            with server(*options) as stub:
                name = create(stub, f"large/{repetition}")
                rates[mode][0].append(len(large) * LARGE / stream(stub, name, large, 16))
                name = create(stub, f"single/{repetition}")
                rates[mode][1].append(len(single) / stream(stub, name, single, SINGLE_IN_FLIGHT))
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
    options = ["--data", str(data), "--snapshot-points", str(RESTART_POINTS)]
    with server(*options) as stub:
        name = create(stub, "large")
        stream(stub, name, batches(rng.random((RESTART_POINTS, 2)), LARGE), 16)
        wait_for_snapshot(data)
    before = used(data)
    with server(*options) as stub:
        operations = rng.random((RESTART_POINTS - LARGE, 2))
        stream(stub, "large", batches(operations, LARGE), 16)
    print(f"disk: {(used(data) - before) / len(operations):.1f} bytes an operation of the journal")
    times = []
    for _ in range(repeat):
        begun = time.perf_counter()
        with server(*options) as stub:
            times.append(time.perf_counter() - begun)
            points = stub.GetHull(pb.GetHullRequest(name="large")).hull.point_count
    begun = time.perf_counter()
    with server("--in-memory"):
        empty = time.perf_counter() - begun
    print(
        f"ready after {statistics.median(times):.2f} s (median of {repeat}) with {points:,} points: a snapshot of "
        f"{RESTART_POINTS:,}, {len(operations):,} operations in the journal; an empty server in memory: {empty:.2f} s"
    )


def used(data: Path) -> int:
    """Bytes of the folder of a server that has stopped: the log is in the database."""
    return sum(file.stat().st_size for file in data.iterdir())


def wait_for_snapshot(data: Path) -> None:
    with closing(sqlite3.connect(f"file:{data / 'dynhull.db'}?mode=ro", uri=True)) as database:
        while database.execute("SELECT count(*) FROM snapshots").fetchone()[0] == 0:
            time.sleep(0.2)


def main() -> None:
    parser = argparse.ArgumentParser(description="Durable streams beside the same in memory, and restarts.")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    parser.add_argument("--repeat", type=int, default=5, help="repetitions; medians are printed (default 5)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        streams(Path(folder), options.repeat)
        restart(Path(folder), options.repeat)


if __name__ == "__main__":
    main()
