"""How long a hull of a cluster is away: when its partition is moved, and when its worker is killed.

    python benchmarks/cluster_pauses.py --points 1000000

Two servers on this machine share a PostgreSQL of their own, and one partition. A caller writes numbered batches of one
point to one hull, each as soon as the one before is acknowledged. Prints the longest wait around each event, and the
median of all waits.
"""

import argparse
import os
import signal
import statistics
import sys
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from cluster import processes
from patience import wait_until
from postgresql import postgresql, query
from server_process import run, server_process

from dynhull_client import HullClient

HULL = "hull"
CHUNK = 100_000
OWNER = "SELECT epoch, worker FROM owners WHERE until > '-infinity' AND address <> ''"
# Seconds of writing before and after each event.
BEFORE, AFTER = 1.0, 0.5


class Caller(threading.Thread):
    """Writes, and remembers how long each batch took."""

    def __init__(self, address: str, revision: int) -> None:
        super().__init__(daemon=True)
        self._address = address
        self._producer = f"caller-{revision}"
        self._over = threading.Event()
        self.waits: list[float] = []
        self.revision = revision

    def run(self) -> None:
        with HullClient(self._address, retries=1000) as client:
            while not self._over.is_set():
                sequence = len(self.waits) + 1
                begun = time.perf_counter()
                done = client.apply(HULL, insert=[[0, 0]], producer=self._producer, sequence=sequence)
                self.revision = done.revision
                self.waits.append(time.perf_counter() - begun)

    def stop(self) -> None:
        self._over.set()
        self.join()


class Cluster:
    """Two servers."""

    def __init__(self, stack: ExitStack, points: int) -> None:
        database = stack.enter_context(postgresql("shared_buffers=256MB", "autovacuum=off"))
        self.url = database.new_database()
        options = ("--cluster", "--partitions", "1", "--journal", self.url, "--scrub-cpu", "0", "--log-level", "error")
        self.servers = [stack.enter_context(server_process(*options, complaints=None, killed=True)) for _ in range(2)]
        with HullClient(self.address, retries=1000) as client:
            client.create_hull(HULL)
            random = np.random.default_rng(1)
            for first in range(0, points, CHUNK):
                client.apply(HULL, insert=random.normal(size=(min(CHUNK, points - first), 2)))

    @property
    def address(self) -> str:
        return self.servers[0].address

    def owner(self) -> tuple[int, str]:
        """Its epoch and its name."""
        rows: list[tuple[int, str]] = []

        def found() -> bool:
            rows[:] = query(self.url, OWNER)
            return bool(rows)

        wait_until(found)
        return rows[0]

    def move(self) -> None:
        """The partition, to the worker that does not have it."""
        epoch, before = self.owner()
        workers = [name for (name,) in query(self.url, "SELECT worker FROM workers")]
        run("cluster", "move", 0, next(each for each in workers if each != before), "--journal", self.url)
        wait_until(lambda: self.owner()[0] > epoch)

    def kill(self) -> None:
        """The worker that has the partition. Its server starts it again."""
        epoch, name = self.owner()
        server = next(each for each in self.servers if name.partition("/")[0].endswith(f"-{each.process.pid}"))
        os.kill(processes(server.process.pid)["worker-0"], signal.SIGKILL)
        wait_until(lambda: self.owner()[0] > epoch)


def measured(cluster: Cluster, event: Callable[[], None]) -> tuple[float, float]:
    """The longest wait around an event, and the median."""
    with HullClient(cluster.address, retries=1000) as client:
        before = client.get_hull(HULL).revision
        caller = Caller(cluster.address, before)
        caller.start()
        time.sleep(BEFORE)
        event()
        time.sleep(AFTER)
        caller.stop()
        assert caller.revision == client.get_hull(HULL).revision == before + len(caller.waits), "lost or doubled"
    return max(caller.waits), statistics.median(caller.waits)


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure how long a hull is away.")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with ExitStack() as stack:
        cluster = Cluster(stack, options.points)
        print(f"{options.points:,} points; milliseconds until a batch is acknowledged")
        for what, event in {"the partition is moved": cluster.move, "its worker is killed": cluster.kill}.items():
            longest, usual = zip(*(measured(cluster, event) for _ in range(options.rounds)), strict=True)
            all_of_them = ", ".join(f"{1000 * each:.0f}" for each in longest)
            middle, every = 1000 * statistics.median(longest), 1000 * statistics.median(usual)
            print(f"{what}: median of the longest {middle:.0f} ({all_of_them}); of all {every:.1f}", flush=True)
        for server in cluster.servers:
            server.process.kill()


if __name__ == "__main__":
    main()
