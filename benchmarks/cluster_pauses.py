"""How long a hull of a cluster is away: when its partition is moved, and when its worker or its node is killed.

    python benchmarks/cluster_pauses.py --points 1000000
    python benchmarks/cluster_pauses.py --points 1000000 --shards 4
    python benchmarks/cluster_pauses.py --points 1000000 --ray

Two servers on this machine share a PostgreSQL of their own, and one partition, or as many as the hull has shards. A
caller writes numbered batches of one point to one hull, each as soon as the one before is acknowledged. Prints the
longest wait around each event, and the median of all waits. With --ray, Ray has started the servers, each on a node of
its own, and the raylet of the one that has the partition is killed; callers use the other one.
"""

import argparse
import os
import signal
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from cluster import processes
from patience import wait_until
from postgresql import postgresql, query
from ray_nodes import ENVIRONMENT, nodes_of_ray
from server_process import run, server_process
from steady_writer import SteadyWriter

from dynhull_client import HullClient
from dynhull_cluster.placement import worker_of

HULL = "hull"
CHUNK = 100_000
OWNER = "SELECT epoch, worker FROM owners WHERE partition = %s AND until > '-infinity' AND address <> ''"
# Seconds of writing before and after each event.
BEFORE, AFTER = 1.0, 0.5


def options(partitions: int) -> tuple[str, ...]:
    """Those of a server."""
    return ("--partitions", str(partitions), "--scrub-cpu", "0", "--log-level", "error")


def fill(address: str, points: int, shards: int) -> None:
    """A hull of that many points."""
    with HullClient(address, retries=1000) as client:
        client.create_hull(HULL, shards=shards)
        random = np.random.default_rng(1)
        for number, first in enumerate(range(0, points, CHUNK), 1):
            some = random.normal(size=(min(CHUNK, points - first), 2))
            client.apply(HULL, insert=some, producer="first", sequence=number)


class Cluster:
    """Two servers."""

    def __init__(self, stack: ExitStack, url: str, points: int, shards: int) -> None:
        self.url = url
        partitions = max(1, shards)
        serve = ("--cluster", "--journal", url, *options(partitions))
        self.servers = [stack.enter_context(server_process(*serve, complaints=None, killed=True)) for _ in range(2)]
        fill(self.address, points, shards)
        self.partition = worker_of(HULL, partitions)  # of the hull, or of its root and the first shard
        self.beside = (self.partition + 1) % partitions  # of another shard

    @property
    def address(self) -> str:
        return self.servers[0].address

    def move(self, partition: int) -> None:
        """A partition, to the worker that does not have it."""
        epoch, before = owner(self.url, partition)
        workers = [name for (name,) in query(self.url, "SELECT worker FROM workers")]
        run("cluster", "move", partition, next(each for each in workers if each != before), "--journal", self.url)
        wait_until(lambda: owner(self.url, partition)[0] > epoch)

    def kill(self) -> None:
        """The worker that has the partition. Its server starts it again."""
        epoch, name = owner(self.url, self.partition)
        server = next(each for each in self.servers if f"-{each.process.pid}-" in name)
        os.kill(processes(server.process.pid)["worker-0"], signal.SIGKILL)
        wait_until(lambda: owner(self.url, self.partition)[0] > epoch)

    def events(self) -> dict[str, Callable[[], None]]:
        """What is measured."""
        found = {"the partition is moved": partial(self.move, self.partition), "its worker is killed": self.kill}
        if self.beside != self.partition:
            found["the partition of another shard is moved"] = partial(self.move, self.beside)
        return found


def owner(url: str, partition: int = 0) -> tuple[int, str]:
    """The epoch and the name of the worker that serves a partition."""
    rows: list[tuple[int, str]] = []

    def found() -> bool:
        rows[:] = query(url, OWNER, partition)
        return bool(rows)

    wait_until(found)
    return rows[0]


def measured(address: str, event: Callable[[], None]) -> tuple[float, float]:
    """The longest wait around an event, and the median."""
    with HullClient(address, retries=1000) as client:
        before = client.get_hull(HULL).revision
    writer = SteadyWriter(address, HULL, f"writer-{before}")
    writer.start()
    time.sleep(BEFORE)
    event()
    time.sleep(AFTER)
    writer.stop()
    assert writer.revisions == list(range(before + 1, before + len(writer.waits) + 1)), "lost or doubled"
    return max(writer.waits), statistics.median(writer.waits)


def killed_node(url: str, points: int) -> tuple[float, float]:
    """What callers notice of the death of a node of Ray."""
    with nodes_of_ray(2) as nodes:
        os.environ |= {**ENVIRONMENT, "RAY_ADDRESS": nodes[0].address}
        import ray

        from dynhull_cluster.machines import launcher

        launcher.start_ray()
        launcher.scale(2, ["--port", "0", "--insecure", *options(1)], {"DYNHULL_JOURNAL": url}, "")
        actors = list(launcher.servers().values())
        addresses = [said.split()[-1] for said in ray.get([each.serving.remote() for each in actors])]
        processes = [server for _, server in ray.get([each.processes.remote() for each in actors])]
        fill(addresses[0], points, shards=0)
        epoch, name = owner(url)
        which = next(i for i, each in enumerate(processes) if f"-{each}-" in name)
        node = next(each for each in nodes if processes[which] in each.servers())

        def kill() -> None:
            node.kill("raylet")
            wait_until(lambda: owner(url)[0] > epoch)

        pause = measured(addresses[1 - which], kill)
        ray.shutdown()
    return pause


def show(what: str, pauses: Sequence[tuple[float, float]]) -> None:
    """A line of the table."""
    longest, usual = zip(*pauses, strict=True)
    each = ", ".join(f"{1000 * pause:.0f}" for pause in longest)
    middle, of_all = 1000 * statistics.median(longest), 1000 * statistics.median(usual)
    print(f"{what}: median of the longest {middle:.0f} ({each}); of all {of_all:.1f}", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Measure how long a hull is away.")
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--shards", type=int, default=0, help="divide the hull among shards, each in a partition")
    parser.add_argument("--ray", action="store_true", help="kill nodes of Ray, which take long to start")
    given = parser.parse_args()
    print(f"{given.points:,} points; milliseconds until a batch is acknowledged", flush=True)
    with postgresql("shared_buffers=256MB", "autovacuum=off") as database, ExitStack() as stack:
        if given.ray:
            pauses = [killed_node(database.new_database(), given.points) for _ in range(given.rounds)]
            show("its node is killed", pauses)
            return
        cluster = Cluster(stack, database.new_database(), given.points, given.shards)
        for what, event in cluster.events().items():
            show(what, [measured(cluster.address, event) for _ in range(given.rounds)])
        for server in cluster.servers:
            server.process.kill()


if __name__ == "__main__":
    main()
