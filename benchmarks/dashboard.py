"""What twenty viewers of the dashboard cost those who write: `python benchmarks/dashboard.py`.

A writer streams as fast as the server takes it, in turns with the dashboard and its viewers paused and running. A
viewer is a page's stream of events. Server, writer, dashboard and viewers share this machine.
"""

import argparse
import http.client
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import contextmanager
from pathlib import Path
from statistics import median, quantiles

import numpy as np

from dynhull_client import HullClient

SERVER = ["-m", "dynhull_server", "--port", "0", "--in-memory", "--log-level", "warning"]
DASHBOARD = ["-m", "dynhull_cli", "dashboard", "--port", "0", "--address"]
POINTS, BATCH, VERTICES, CYCLE = 100_000, 2_048, 48, 64
FOLLOWED = {"subscriptions": {"a": {"path": "/hulls/a/events?measures=true&rate=10"}}}
HULLS = b"event: snapshot", b"event: change"
SETTLE = 0.3  # seconds from a turn's beginning to its measurement
TICKS = os.sysconf("SC_CLK_TCK")


@contextmanager
def running(*command):
    with subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1].removeprefix("http://"), process.pid
        finally:
            process.terminate()


@contextmanager
def aside(function, *arguments):
    process = multiprocessing.Process(target=function, args=arguments, daemon=True)
    process.start()
    try:
        yield process.pid
    finally:
        process.terminate()
        process.join()


@contextmanager
def paused(*pids):
    for pid in pids:
        os.kill(pid, signal.SIGSTOP)
    try:
        yield
    finally:
        for pid in pids:
            os.kill(pid, signal.SIGCONT)


def write(address, pause):
    """Moves without end; the outermost points are a ring that every batch turns."""
    generator = np.random.default_rng(1)
    inner = generator.uniform(-0.6, 0.6, size=(CYCLE, BATCH - VERTICES, 2))
    turns = np.linspace(0, 2 * np.pi, VERTICES, endpoint=False) + generator.uniform(size=(CYCLE, 1))
    batches = np.concatenate((np.stack((np.cos(turns), np.sin(turns)), axis=2), inner), axis=1)
    with HullClient(address) as client, client.ingest("a") as stream:
        stream.apply(insert=np.concatenate((generator.uniform(-0.6, 0.6, size=(POINTS, 2)), batches[0])))
        for number in range(sys.maxsize):
            stream.apply(move=(batches[number % CYCLE], batches[(number + 1) % CYCLE]))
            time.sleep(pause)


def view(address, viewers, told):
    """Viewers; each sends on how many hulls it was sent."""

    def read(viewer):
        connection = http.client.HTTPConnection(address)
        connection.request("POST", "/streams", json.dumps(FOLLOWED), {"Content-Type": "application/json"})
        for line in connection.getresponse():
            told[viewer] += line.startswith(HULLS)

    threads = [threading.Thread(target=read, args=[viewer]) for viewer in range(viewers)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()


def processor_seconds(pid):
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--viewers", type=int, default=20)
    parser.add_argument("--turns", type=int, default=15)
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--pause", type=float, default=0.0, help="seconds from a batch to the next")
    arguments = parser.parse_args()
    told = multiprocessing.Array("l", arguments.viewers)
    alone, watched = [], []
    hulls, processor = 0, 0.0
    with running(*SERVER) as (address, _), HullClient(address) as client:
        client.create_hull("a")

        def rate():
            time.sleep(SETTLE)
            revision, begun = client.get_hull("a").revision, time.perf_counter()
            time.sleep(arguments.seconds)
            revision, took = client.get_hull("a").revision - revision, time.perf_counter() - begun
            return revision * 2 * BATCH / took

        with (
            aside(write, address, arguments.pause),
            running(*DASHBOARD, address) as (page, pid),
            aside(view, page, arguments.viewers, told) as viewers,
        ):
            while min(told) == 0:
                time.sleep(0.1)
            for _ in range(arguments.turns):
                with paused(pid, viewers):
                    alone.append(rate())
                before, spent, begun = sum(told), processor_seconds(pid), time.perf_counter()
                watched.append(rate())
                took = time.perf_counter() - begun
                hulls += (sum(told) - before) / took / arguments.viewers / arguments.turns
                processor += (processor_seconds(pid) - spent) / took / arguments.turns
    lower, middle, upper = quantiles([with_ / without for with_, without in zip(watched, alone, strict=True)], n=4)
    print(f"{median(alone):,.0f} updates a second while nobody looks, {median(watched):,.0f} with viewers")
    print(f"with over without, turn by turn: {middle:.3f}, quartiles {lower:.3f} and {upper:.3f}")
    print(f"hulls a second to a viewer: {hulls:.1f}; processor of the dashboard: {processor:.2f} of one")


if __name__ == "__main__":
    main()
