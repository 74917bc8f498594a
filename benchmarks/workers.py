"""Several processes against one: `python benchmarks/workers.py`.

Server and clients share the cores; the shapes take turns, and the figures are medians of rounds. h2load (Debian's
nghttp2-client) makes unary calls of Locate, of one point. Large batches are a stream of messages of 10,000 points each,
inserted and deleted. A restart is the time from the kill of a worker with a million points to its next answer.
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
from server import CYCLE, DYNHULL, cycle, stream

sys.path.append(str(Path(__file__).parents[1] / "tests" / "support"))
from cluster import processes

SHAPES = {
    "one process": [],
    "1 worker, 1 gateway": ["--workers", "1", "--gateways", "1"],
    "1 worker, 2 gateways": ["--workers", "1", "--gateways", "2"],
    "2 workers, 2 gateways": ["--workers", "2", "--gateways", "2"],
}
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


def rounds(repeat, calls):
    with ExitStack() as stack:
        addresses = {name: stack.enter_context(serving([*DYNHULL, *shape]))[0] for name, shape in SHAPES.items()}
        for address in addresses.values():
            with HullClient(address) as client:
                client.create_hull("a")
                client.create_hull("large")
                client.apply("a", insert=POINTS)
        large = cycle("large", LARGE)
        works = {"calls of h2load": lambda address: h2load(address, calls)}
        works["messages of 10,000 points"] = lambda address: asyncio.run(stream(address, large, 2 * CYCLE, 8))
        for kind, work in works.items():
            found = {name: [] for name in addresses}
            for turn in range(repeat + 1):
                for name, address in addresses.items():
                    value = work(address)
                    if turn:  # the first warms up
                        found[name].append(value)
            base = median(found["one process"])
            for name, values in found.items():
                yield f"{kind}: {name}", values, f"/s, {median(values) / base:.2f} of one process"
    yield "restart of a worker with a million points", [restart() for _ in range(3)], "s"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--calls", type=int, default=10_000, help="of h2load in a round")
    arguments = parser.parse_args()
    for name, values, unit in rounds(arguments.repeat, arguments.calls):
        print(f"{name:50}{median(values):10,.2f} {unit}   ({min(values):,.2f} to {max(values):,.2f})", flush=True)


if __name__ == "__main__":
    main()
