"""Watchers that do not read, while updates stream in: the server's resident memory. `python benchmarks/pressure.py`.

Every update moves a vertex, so every batch changes the hull that each watcher is owed.
"""

import argparse
import os
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path

import grpc
import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt

from dynhull_client import HullClient
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

COMMAND = ["-m", "dynhull_server", "--port", "0", "--in-memory", "--log-level", "warning"]
# Without this a client takes in megabytes that nobody reads.
SMALL_WINDOW = [("grpc.http2.bdp_probe", 0)]
VERTICES, BATCH = 4_096, 8_192
PAGE = os.sysconf("SC_PAGE_SIZE")


@contextmanager
def running():
    with subprocess.Popen([sys.executable, *COMMAND], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1], process.pid
        finally:
            process.terminate()


def resident(pid: int) -> float:
    """Megabytes."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 2**20


def ring(i: int) -> np.ndarray:
    angles = np.linspace(0, 2 * np.pi, VERTICES, endpoint=False) + i
    return 1e6 * np.stack((np.cos(angles), np.sin(angles)), axis=1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--watchers", type=int, default=200)
    parser.add_argument("--updates", type=int, default=10_000_000)
    parser.add_argument("--warm-up", type=float, default=0.1, help="share of the updates before the first measurement")
    parser.add_argument("--plot", type=Path)
    arguments = parser.parse_args()
    batches = arguments.updates // BATCH
    samples: list[tuple[float, float]] = []
    with (
        running() as (address, pid),
        HullClient(address) as client,
        grpc.insecure_channel(address, SMALL_WINDOW) as channel,
    ):
        client.create_hull("a")
        client.apply("a", insert=ring(0))
        stub = HullServiceStub(channel)
        watches = [stub.Watch(pb.WatchRequest(name="a")) for _ in range(arguments.watchers)]
        for watch in watches:
            next(watch)
        done = threading.Event()
        begun = time.perf_counter()

        def sample() -> None:
            while not done.wait(0.1):
                samples.append((client.get_hull("a").revision * BATCH / 1e6, resident(pid)))

        sampler = threading.Thread(target=sample)
        sampler.start()
        with client.ingest("a") as stream:
            for i in range(batches):
                stream.apply(move=(ring(i), ring(i + 1)))
        took = time.perf_counter() - begun
        done.set()
        sampler.join()
        for watch in watches:
            watch.cancel()
    warm = [memory for updates, memory in samples if updates >= arguments.warm_up * arguments.updates / 1e6]
    growth = 100 * (max(warm) / warm[0] - 1)
    print(f"{arguments.watchers} watchers that do not read, {batches * BATCH:,} updates in {took:.0f} s")
    print(f"resident: {warm[0]:.1f} MB after the warm-up, at most {max(warm):.1f} MB later: {growth:+.1f} %")
    if arguments.plot:
        figure, axes = plt.subplots(figsize=(8, 4), dpi=120, layout="constrained")
        axes.plot(*zip(*samples, strict=True))
        axes.set(xlabel="million updates", ylabel="resident memory, MB", ylim=(0, None))
        axes.set_title(f"{arguments.watchers} watchers that do not read", loc="left")
        figure.savefig(arguments.plot)


if __name__ == "__main__":
    main()
