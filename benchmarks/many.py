"""Many hulls watched at once: the first picture, and what watchers cost. `python benchmarks/many.py`.

The hulls of a server in memory get batches of one point, a thousand a second, while nobody, one and many watch all of
them, by turns in one run. Then nothing changes, and what the watchers are sent is counted. Writers and watchers are
processes of their own, and watchers do not decode what they get.
"""

import argparse
import asyncio
import multiprocessing
import os
import statistics
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from subprocess import PIPE, Popen
from typing import Any

import grpc
import numpy as np

import server
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

COMMAND = [
    sys.executable,
    "-m",
    "dynhull_server",
    "--port",
    "0",
    "--in-memory",
    "--scrub-cpu",
    "0",
    "--log-level",
    "warning",
]
WATCH_MANY = "/dynhull.v1.HullService/WatchMany"
PREFIX, POINTS, TOGETHER = "fleet/", 30, 20
PAGE, TICK = os.sysconf("SC_PAGE_SIZE"), os.sysconf("SC_CLK_TCK")
SETTLED = 2.0  # seconds after which writers and watchers are at work


@dataclass(frozen=True)
class Turn:
    """What was measured while some watched.

    Attributes:
        processor: seconds of the server a second.
        rate: writes a second.
        latency: the median of a write in milliseconds.
        resident: megabytes of the server.
        sent: bytes that each watcher got a second.
    """

    processor: float
    rate: float
    latency: float
    resident: float
    sent: float


def processor_seconds(pid: int) -> float:
    return sum(map(int, Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13])) / TICK


def resident(pid: int) -> float:
    """Megabytes."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 2**20


def name(number: int) -> str:
    return f"{PREFIX}{number:05}"


def fill(address: str, hulls: int) -> None:
    random = np.random.default_rng(1)
    with grpc.insecure_channel(address) as channel:
        stub = HullServiceStub(channel)
        for number in range(hulls):
            stub.CreateHull(pb.CreateHullRequest(name=name(number)))
            batch = batch_pb2.Batch(inserts=server.packed(random.normal(size=(POINTS, 2))))
            stub.Apply(pb.ApplyRequest(name=name(number), batch=batch))


def write(address: str, hulls: int, rate: float, told: Connection) -> None:
    """Write until told to end; say how many a second, and how long one took."""

    async def run() -> None:
        random = np.random.default_rng()
        taken: list[float] = []
        async with grpc.aio.insecure_channel(address) as channel:
            stub = HullServiceStub(channel)

            async def one() -> None:
                batch = batch_pb2.Batch(inserts=server.packed(random.normal(scale=1.5, size=(1, 2))))
                begun = time.perf_counter()
                await stub.Apply(pb.ApplyRequest(name=name(random.integers(hulls)), batch=batch))
                taken.append(time.perf_counter() - begun)

            begun = time.perf_counter()
            while not told.poll():
                await asyncio.sleep(begun + len(taken) / rate - time.perf_counter())
                await asyncio.gather(*(one() for _ in range(TOGETHER)))
            told.send((len(taken) / (time.perf_counter() - begun), statistics.median(taken) * 1e3))

    asyncio.run(run())


def watch(address: str, watchers: int, told: Connection) -> None:
    """Watch until told to end; say when all have had their picture, and what they got, each time it is asked for."""

    async def run() -> None:
        got: Counter[str] = Counter()
        pictured = asyncio.Semaphore(0)

        async def one(channel: grpc.aio.Channel) -> None:
            call = channel.unary_stream(WATCH_MANY, pb.WatchManyRequest.SerializeToString)
            complete = False
            async for message in call(pb.WatchManyRequest(prefix=PREFIX)):
                got["bytes"] += len(message)
                got["messages"] += 1
                if not complete and pb.WatchManyResponse.FromString(message).picture == pb.PICTURE_COMPLETE:
                    complete = True
                    pictured.release()

        async with grpc.aio.insecure_channel(address) as channel:
            begun = time.perf_counter()
            watching = [asyncio.create_task(one(channel)) for _ in range(watchers)]
            for _ in watching:
                await pictured.acquire()
            told.send(time.perf_counter() - begun)
            while await asyncio.to_thread(told.recv):
                told.send(dict(got))
                got.clear()
            for each in watching:
                each.cancel()

    asyncio.run(run())


@contextmanager
def beside(work: Any, *arguments: object) -> Iterator[Connection]:
    """Some work in a process of its own, until it is told to end."""
    ours, theirs = multiprocessing.Pipe()
    process = multiprocessing.Process(target=work, args=(*arguments, theirs))
    process.start()
    try:
        yield ours
    finally:
        process.join()


@contextmanager
def watched(address: str, watchers: int) -> Iterator[tuple[Connection | None, float]]:
    """Some watchers, and the seconds until all had a picture."""
    if not watchers:
        yield None, 0.0
        return
    with beside(watch, address, watchers) as told:
        yield told, told.recv()
        told.send(False)


def sent(told: Connection | None) -> dict[str, int]:
    """What watchers got since the last time."""
    if told is None:
        return {"bytes": 0, "messages": 0}
    told.send(True)
    found: dict[str, int] = {"bytes": 0, "messages": 0, **told.recv()}
    return found


def turn(address: str, pid: int, watchers: int, options: argparse.Namespace) -> Turn:
    with watched(address, watchers) as (watching, _), beside(write, address, options.hulls, options.writes) as writing:
        time.sleep(SETTLED)
        sent(watching)
        before, begun = processor_seconds(pid), time.perf_counter()
        time.sleep(options.seconds)
        took = time.perf_counter() - begun
        processor = (processor_seconds(pid) - before) / took
        got = sent(watching)["bytes"] / took / max(watchers, 1)
        memory = resident(pid)
        writing.send(None)
        rate, latency = writing.recv()
    return Turn(processor, rate, latency, memory, got)


def still(address: str, pid: int, options: argparse.Namespace) -> None:
    """What watchers get while nothing changes, and when one hull does."""
    with watched(address, options.watchers) as (watching, _), grpc.insecure_channel(address) as channel:
        time.sleep(SETTLED)
        sent(watching)
        before = processor_seconds(pid)
        time.sleep(options.seconds)
        got, used = sent(watching), processor_seconds(pid) - before
        each = options.watchers * options.seconds
        print(
            f"without changes: {got['messages'] / each:.2f} messages and {got['bytes'] / each:.0f} bytes a second for "
            f"each of {options.watchers} watchers, {used / options.seconds:.3f} processor seconds a second"
        )
        batch = batch_pb2.Batch(inserts=server.packed(np.full((1, 2), 100.0)))
        HullServiceStub(channel).Apply(pb.ApplyRequest(name=name(0), batch=batch))
        time.sleep(1)
        print(f"and one changes: {sent(watching)['bytes'] / options.watchers:.0f} bytes in that second")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--hulls", type=int, default=10_000)
    parser.add_argument("--writes", type=float, default=1_000, help="a second (default 1,000)")
    parser.add_argument("--watchers", type=int, default=64)
    parser.add_argument("--seconds", type=float, default=10, help="of each measurement (default 10)")
    parser.add_argument("--turns", type=int, default=5, help="each without watchers, with one and with all (default 5)")
    options = parser.parse_args()
    with Popen(COMMAND, stdout=PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().split()[-1]
            fill(address, options.hulls)
            pictures = []
            for _ in range(options.turns):
                with watched(address, 1) as (_, took):
                    pictures.append(took)
            print(
                f"first picture of {options.hulls:,} hulls: {statistics.median(pictures):.2f} s, "
                f"median of {options.turns}"
            )
            kinds = 0, 1, options.watchers
            turns: dict[int, list[Turn]] = {watchers: [] for watchers in kinds}
            for _ in range(options.turns):
                for watchers in kinds:
                    turns[watchers].append(turn(address, process.pid, watchers, options))
            table(turns, options)
            still(address, process.pid, options)
        finally:
            process.terminate()


def table(turns: dict[int, list[Turn]], options: argparse.Namespace) -> None:
    def median(watchers: int, field: str) -> float:
        return statistics.median(getattr(each, field) for each in turns[watchers])

    def ratio(watchers: int, other: int, field: str) -> float:
        pairs = zip(turns[watchers], turns[other], strict=True)
        return statistics.median(getattr(one, field) / getattr(two, field) for one, two in pairs)

    headings = (
        "watchers",
        "processor seconds of the server a second",
        "of that with one",
        "writes a second",
        "of those without",
        "median ms",
        "kB a second each",
    )
    print(f"| {' | '.join(headings)} |")
    print("| ---: | ---: | ---: | ---: | ---: | ---: | ---: |")
    for watchers in turns:
        cells = (
            f"{median(watchers, 'processor'):.3f}",
            f"{ratio(watchers, 1, 'processor'):.2f}",
            f"{median(watchers, 'rate'):,.0f}",
            f"{ratio(watchers, 0, 'rate'):.3f}",
            f"{median(watchers, 'latency'):.1f}",
            f"{median(watchers, 'sent') / 1e3:.0f}",
        )
        print(f"| {watchers} | {' | '.join(cells)} |")
    more = median(options.watchers, "resident") - median(1, "resident")
    first, last = (turns[options.watchers][row].resident for row in (0, -1))
    print(f"memory a watcher: {more / max(options.watchers - 1, 1):.2f} MB; all: {first:.0f} MB, at last {last:.0f} MB")


if __name__ == "__main__":
    main()
