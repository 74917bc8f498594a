"""Several processes against one: `python benchmarks/workers.py`.

Server and clients share the cores; the shapes take turns, and the figures are medians of rounds. h2load (Debian's
nghttp2-client) makes unary calls of Locate, of one point, over 16 connections: the system deals connections to gateways
at random, so four of them would often all be at one. The limit is that of handlers that do nothing, in one and in two
processes. The processor time of a call or a message is that of all processes of a server, then those of its workers and
gateways. Large batches are a stream of messages of 10,000 points each, inserted and deleted; once in memory, and once
stored, in a folder or in a PostgreSQL server of its own on the same disk, both with the durability of the default. A
restart is the time from the kill of a worker with a million points, in either of them, to its next answer.
"""

import argparse
import asyncio
import os
import signal
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from statistics import median

import numpy as np
from reads import POINTS, h2load

from dynhull_client import HullClient, UnavailableError
from server import CYCLE, DYNHULL, EMPTY, cycle, serving, stream

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from cluster import processes
from postgresql import postgresql
from processor import processor_time

SHAPES = {
    "one process": [],
    "1 worker, 1 gateway": ["--workers", "1", "--gateways", "1"],
    "1 worker, 2 gateways": ["--workers", "1", "--gateways", "2"],
    "2 workers, 2 gateways": ["--workers", "2", "--gateways", "2"],
}
WORKS = ["small", "large", "stored", "restart"]
STORED = ["-m", "dynhull_server", "--port", "0", "--scrub-cpu", "0", "--log-level", "error"]
# PostgreSQL as it is, with its syncs, but for room for the log between two checkpoints.
DURABLE = ("max_wal_size=4GB", "shared_buffers=128MB")
CONNECTIONS = 16
LARGE = 10_000
MILLION = 1_000_000


def restart(place):
    """Seconds from the kill of a worker with a million points, stored in some place, to its next answer."""
    command = [*STORED, *place, "--workers", "1"]
    with serving(command) as (address, supervisor), HullClient(address) as client:
        client.create_hull("a")
        client.apply("a", insert=np.random.default_rng(1).normal(size=(MILLION, 2)))
        os.kill(processes(supervisor)["worker-0"], signal.SIGKILL)
        begun = time.perf_counter()
        while True:
            try:
                assert client.get_hull("a").info.points == MILLION
                return time.perf_counter() - begun
            except UnavailableError:
                time.sleep(0.01)


def turns(repeat, works):
    """The values of each work, which take turns; the first turn warms up."""
    found = {name: [] for name in works}
    for turn in range(repeat + 1):
        for name, work in works.items():
            value = work()
            if turn:
                found[name].append(value)
    return found


class Spending:
    """The processor time of servers, of the kinds of their processes.

    Args:
        supervisors: the first process of each server.
    """

    def __init__(self, *supervisors):
        self._pids = {"all": supervisors}
        for supervisor in supervisors:
            for name, pid in processes(supervisor).items():
                kind = name.partition("-")[0] + "s"
                self._pids[kind] = (*self._pids.get(kind, ()), pid)
        self._times = []

    def during(self, work, number):
        """The result of some work, which makes `number` calls."""
        before = self._now()
        result = work()
        self._times.append({kind: (now - before[kind]) / number * 1e6 for kind, now in self._now().items()})
        return result

    def __str__(self):
        medians = {kind: median(each[kind] for each in self._times[1:] or self._times) for kind in self._pids}
        return ", ".join(f"{kind} {microseconds:.0f}" for kind, microseconds in medians.items()) + " us of processor"

    def _now(self):
        return {kind: sum(map(processor_time, pids)) for kind, pids in self._pids.items()}


def small(repeat, calls):
    """Unary calls a second, and the processor time of one."""

    with ExitStack() as stack:
        servers = {name: [stack.enter_context(serving([*DYNHULL, *shape]))] for name, shape in SHAPES.items()}
        for ((address, _),) in servers.values():
            with HullClient(address) as client:
                client.create_hull("a")
                client.apply("a", insert=POINTS)
        alone = stack.enter_context(serving(EMPTY))
        servers["empty handlers, 1 process"] = [alone]
        shared = stack.enter_context(serving(EMPTY))
        port = shared[0].rpartition(":")[2]
        servers["empty handlers, 2 processes"] = [shared, stack.enter_context(serving([*EMPTY, port]))]
        spent = {name: Spending(*(pid for _, pid in found)) for name, found in servers.items()}
        works = {
            name: lambda name=name, address=found[0][0]: spent[name].during(
                lambda: h2load(address, calls, CONNECTIONS), calls
            )
            for name, found in servers.items()
        }
        found = turns(repeat, works)
    base = median(found["one process"])
    for name, values in found.items():
        yield f"h2load: {name}", values, f"/s, {median(values) / base:.2f} of one process, a call: {spent[name]}"


def large(repeat):
    """Messages of many points a second, in memory."""
    yield from streamed(repeat, {name: [*DYNHULL, *shape] for name, shape in SHAPES.items()})


def stored(repeat):
    """The same, stored."""
    few = {name: SHAPES[name] for name in ("one process", "1 worker, 1 gateway")}
    with ExitStack() as stack:
        database = stack.enter_context(postgresql(*DURABLE))
        commands = {}
        for name, shape in few.items():
            folder = stack.enter_context(tempfile.TemporaryDirectory())
            commands[name] = [*STORED, "--data", folder, *shape]
            commands[f"{name}, PostgreSQL"] = [*STORED, "--journal", database.new_database(), *shape]
        yield from streamed(repeat, commands)


def streamed(repeat, commands):
    """Messages of many points a second to servers, the first of which is what the others are compared with."""
    messages = cycle("large", LARGE)
    with ExitStack() as stack:
        servers = {name: stack.enter_context(serving(command)) for name, command in commands.items()}
        for address, _ in servers.values():
            with HullClient(address) as client:
                client.create_hull("large")
        spent = {name: Spending(pid) for name, (_, pid) in servers.items()}
        works = {
            name: lambda name=name, address=address: spent[name].during(
                lambda: asyncio.run(stream(address, messages, 2 * CYCLE, 8)), 2 * CYCLE
            )
            for name, (address, _) in servers.items()
        }
        found = turns(repeat, works)
    base = median(found["one process"])
    for name, values in found.items():
        ratio = f"{median(values) / base:.2f} of one process"
        yield f"messages of 10,000 points: {name}", values, f"/s, {ratio}, a message: {spent[name]}"


def restarts(repeat):
    times = {"a folder": [], "PostgreSQL": []}
    with postgresql(*DURABLE) as database:
        for _ in range(repeat):
            with tempfile.TemporaryDirectory() as folder:
                times["a folder"].append(restart(["--data", folder]))
            times["PostgreSQL"].append(restart(["--journal", database.new_database()]))
    for place, seconds in times.items():
        yield f"restart of a worker, a million points in {place}", seconds, "s"


def rounds(repeat, calls, works):
    kinds = {
        "small": lambda: small(repeat, calls),
        "large": lambda: large(repeat),
        "stored": lambda: stored(repeat),
        "restart": lambda: restarts(3),
    }
    for name in works:
        yield from kinds[name]()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--calls", type=int, default=10_000, help="of h2load in a round")
    parser.add_argument("--works", nargs="+", choices=WORKS, default=WORKS)
    arguments = parser.parse_args()
    for name, values, unit in rounds(arguments.repeat, arguments.calls, arguments.works):
        print(f"{name:50}{median(values):10,.2f} {unit}   ({min(values):,.2f} to {max(values):,.2f})", flush=True)


if __name__ == "__main__":
    main()
