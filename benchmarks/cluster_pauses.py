"""How long a hull of a cluster is away: when its partition is moved, and when its worker is killed.

    python benchmarks/cluster_pauses.py --points 1000000

Two servers on this machine share a PostgreSQL of their own. A caller writes numbered batches of one point to one hull,
each as soon as the one before is acknowledged. Prints the longest wait around each of several events, and the median.
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
from postgresql import postgresql, query
from server_process import run, server_process

from dynhull_client import HullClient
from dynhull_cluster.placement import worker_of

PARTITIONS = 4
HULL = "hull"
OWNER = "SELECT worker FROM owners WHERE partition = %s AND until > '-infinity' AND address <> ''"


class Caller(threading.Thread):
    """Writes, and remembers how long each batch took."""

    def __init__(self, client: HullClient) -> None:
        super().__init__(daemon=True)
        self._client = client
        self.waits: list[float] = []
        self.over = threading.Event()

    def run(self) -> None:
        sequence = 0
        while not self.over.is_set():
            sequence += 1
            begun = time.perf_counter()
            self._client.apply(HULL, insert=[[0.0, 0.0]], producer=f"caller-{self.ident}", sequence=sequence)
            self.waits.append(time.perf_counter() - begun)


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure how long a hull is away.")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    with ExitStack() as stack:
        database = stack.enter_context(postgresql("shared_buffers=256MB"))
        url = database.new_database()
        serve = (
            "--cluster",
            "--partitions",
            str(PARTITIONS),
            "--journal",
            url,
            "--scrub-cpu",
            "0",
            "--log-level",
            "error",
        )
        complaints = "is started again"
        servers = [stack.enter_context(server_process(*serve, complaints=complaints, killed=True)) for _ in range(2)]
        client = stack.enter_context(HullClient(servers[0].address, retries=1000))
        client.create_hull(HULL)
        random = np.random.default_rng(1)
        for _ in range(0, options.points, 100_000):
            client.apply(HULL, insert=random.normal(size=(min(100_000, options.points), 2)))
        partition = worker_of(HULL, PARTITIONS)

        def owner() -> str:
            while not (rows := query(url, OWNER, partition)):
                time.sleep(0.01)
            return str(rows[0][0])

        def move() -> None:
            before = owner()
            workers = [name for (name,) in query(url, "SELECT worker FROM workers")]
            run("cluster", "move", partition, next(each for each in workers if each != before), "--journal", url)
            while owner() == before:
                time.sleep(0.01)

        def kill() -> None:
            name = owner().partition("/")[0]
            server = next(each for each in servers if name.endswith(f"-{each.process.pid}"))
            os.kill(processes(server.process.pid)["worker-0"], signal.SIGKILL)

        print(f"{options.points:,} points, {options.rounds} times each; seconds until a batch is acknowledged")
        for what, event in {"the partition is moved": move, "its worker is killed": kill}.items():
            print(f"{what}: {', '.join(measured(client, event) for _ in range(options.rounds))}")
        for server in servers:
            server.process.kill()


def measured(client: HullClient, event: Callable[[], None]) -> str:
    """The longest wait while something happens; the median in brackets."""
    caller = Caller(client)
    caller.start()
    time.sleep(1.0)
    event()
    time.sleep(8.0)
    caller.over.set()
    caller.join(60)
    return f"{max(caller.waits):.3f} ({statistics.median(caller.waits):.4f})"


if __name__ == "__main__":
    main()
