"""Several processes against one: `python benchmarks/workers.py`.

Server and clients share the cores; the shapes take turns, and the figures are medians of rounds. h2load (Debian's
nghttp2-client) makes unary calls of Locate, of one point, over 16 connections: the system deals connections to gateways
at random, so four of them would often all be at one. The limit is that of handlers that do nothing, in one and in two
processes. The processor time of a call is that of all processes of a server. Large batches are a stream of messages of
10,000 points each, inserted and deleted. A restart is the time from the kill of a worker with a million points to its
next answer.
"""

import argparse
import asyncio
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median

import numpy as np
from reads import POINTS, h2load

from dynhull_client import HullClient, UnavailableError
from server import CYCLE, DYNHULL, EMPTY, cycle, stream

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from cluster import processes
from processor import processor_time

SHAPES = {
    "one process": [],
    "1 worker, 1 gateway": ["--workers", "1", "--gateways", "1"],
    "1 worker, 2 gateways": ["--workers", "1", "--gateways", "2"],
    "2 workers, 2 gateways": ["--workers", "2", "--gateways", "2"],
}
CONNECTIONS = 16
LARGE = 10_000
MILLION = 1_000_000


@contextmanager
def serving(command):
    """The address and the process of a server."""
    with subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1], process.pid
        finally:
            process.terminate()


def restart():
    """Seconds from the kill of a worker with a million points, in a folder, to its next answer."""
    with tempfile.TemporaryDirectory() as data:
        command = ["-m", "dynhull_server", "--port", "0", "--data", data, "--log-level", "error"]
        with serving([*command, "--workers", "1"]) as (address, supervisor), HullClient(address) as client:
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


def small(repeat, calls):
    """Unary calls a second, and the processor time of one."""
    spent = {}

    def work(name, address, pids):
        before = sum(map(processor_time, pids))
        rate = h2load(address, calls, CONNECTIONS)
        spent[name] = (sum(map(processor_time, pids)) - before) / calls * 1e6
        return rate

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
        works = {
            name: lambda name=name, found=found: work(name, found[0][0], [pid for _, pid in found])
            for name, found in servers.items()
        }
        found = turns(repeat, works)
    base = median(found["one process"])
    for name, values in found.items():
        ratio = f"{median(values) / base:.2f} of one process"
        yield f"h2load: {name}", values, f"/s, {ratio}, {spent[name]:.0f} us of processor a call"


def large(repeat):
    """Messages of many points a second."""
    messages = cycle("large", LARGE)
    with ExitStack() as stack:
        addresses = {name: stack.enter_context(serving([*DYNHULL, *shape]))[0] for name, shape in SHAPES.items()}
        for address in addresses.values():
            with HullClient(address) as client:
                client.create_hull("large")
        works = {
            name: lambda address=address: asyncio.run(stream(address, messages, 2 * CYCLE, 8))
            for name, address in addresses.items()
        }
        found = turns(repeat, works)
    base = median(found["one process"])
    for name, values in found.items():
        yield f"messages of 10,000 points: {name}", values, f"/s, {median(values) / base:.2f} of one process"


def restarts(repeat):
    yield "restart of a worker with a million points", [restart() for _ in range(repeat)], "s"


def rounds(repeat, calls, works):
    kinds = {"small": lambda: small(repeat, calls), "large": lambda: large(repeat), "restart": lambda: restarts(3)}
    for name in works:
        yield from kinds[name]()


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--calls", type=int, default=10_000, help="of h2load in a round")
    parser.add_argument(
        "--works", nargs="+", choices=["small", "large", "restart"], default=["small", "large", "restart"]
    )
    arguments = parser.parse_args()
    for name, values, unit in rounds(arguments.repeat, arguments.calls, arguments.works):
        print(f"{name:50}{median(values):10,.2f} {unit}   ({min(values):,.2f} to {max(values):,.2f})", flush=True)


if __name__ == "__main__":
    main()
