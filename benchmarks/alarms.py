"""What alarms cost writers: `python benchmarks/alarms.py [--hulls 10000] [--pairs 64] [--in-memory] [--when ...]`.

Servers with the same hulls of keys: one without alarms, one with a rule for each hull, and one with a rule for all of
them by their prefix. No alarm is raised: the bound is far away. Writers on streams move one key a batch, and some of
the batches change an outline, a share that the heading says; each block has other hulls, and its own connections: how
fast one of those is depends on where the system puts its threads. So blocks are short and many. The servers take their
turns in a run, in an order that changes. Columns: batches a second, and ratios to the server without alarms, of rates
and of processor time: means of pairs with 95 percent intervals.

Clients and servers share the machine. The folder should lie on the disk that counts; a second one in memory (tmpfs) has
lines of its own, which say what is left where no disk makes pairs differ.
"""

import argparse
import asyncio
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median

import grpc
import numpy as np
import past

import server
from dynhull import KeyedHull
from dynhull.keys import PackedKeys
from dynhull_proto.v1 import alarm_pb2, batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import alarm_service_pb2 as alarms
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.alarm_service_pb2_grpc import AlarmServiceStub

RULES = ("none", "each", "prefix")
PREFIX, KEYS, STREAMS, AT_ONCE = "fleet/", 30, 8, 64
STEP = 0.01  # of a unit square
MANY = 10**6


def name(number: int) -> str:
    return f"{PREFIX}{number:06}"


def put(keys: np.ndarray, places: np.ndarray) -> batch_pb2.Batch:
    packed = PackedKeys.pack([f"vehicle {key}" for key in keys.tolist()])
    names = points_pb2.Keys(lengths=packed.lengths, text=packed.data)
    return batch_pb2.Batch(puts=batch_pb2.Puts(keys=names, points=server.packed(places)))


def moves(random: np.random.Generator, number: int) -> tuple[list[bytes], int]:
    """Batches of one key that makes a step, for any of the hulls; and how many change the outline of one."""
    places, found = random.random((KEYS, 2)), []
    hull = KeyedHull("int")
    hull.update(np.arange(KEYS, dtype=np.uint64), places)
    before = hull.changes
    for key in random.integers(KEYS, size=number).tolist():
        places[key] = np.clip(places[key] + random.normal(0, STEP, 2), 0, 1)
        hull.put(key, *places[key])
        batch = put(np.array([key]), places[key : key + 1])
        found.append(pb.StreamRequest(batches=[pb.NumberedBatch(batch=batch)]).SerializeToString())
    return found, hull.changes - before


async def fill(address: str, hulls: int, rules: str, when: str) -> None:
    """Make the hulls, then the alarms, many at a time."""
    places = np.random.default_rng(0).random((hulls, KEYS, 2))
    config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_STRING_KEYS)
    async with grpc.aio.insecure_channel(address) as channel:
        stub, numbers = AlarmServiceStub(channel), iter(range(hulls))
        create = channel.unary_unary(server.SERVICE + "CreateHull")
        apply = channel.unary_unary(server.SERVICE + "Apply")

        async def make(numbers: Iterator[int]) -> None:
            for number in numbers:
                await create(pb.CreateHullRequest(name=name(number), config=config).SerializeToString())
                batch = put(np.arange(KEYS), places[number])
                await apply(pb.ApplyRequest(name=name(number), batch=batch).SerializeToString())
                if rules == "each":
                    rule = alarm_pb2.AlarmRule(hull=name(number), when=when)
                    await stub.CreateAlarm(alarms.CreateAlarmRequest(name=name(number), rule=rule))

        await asyncio.gather(*(make(numbers) for _ in range(AT_ONCE)))
        if rules == "prefix":
            rule = alarm_pb2.AlarmRule(prefix=PREFIX, when=when)
            await stub.CreateAlarm(alarms.CreateAlarmRequest(name="all", rule=rule))


async def write(address: str, names: list[str], batches: list[list[bytes]]) -> float:
    """Batches a second of all writers together, each on a stream of its own to a hull after the other."""

    async def writer(own: list[str], some: list[bytes]) -> None:
        share = len(some) // len(own)
        for place, each in enumerate(own):
            await server.together(address, each, some[place * share : (place + 1) * share])

    begun = time.perf_counter()
    await asyncio.gather(*(writer(names[place::STREAMS], some) for place, some in enumerate(batches)))
    return sum(map(len, batches)) / (time.perf_counter() - begun)


@contextmanager
def serving(options: argparse.Namespace, folder: Path, rules: str) -> Iterator[past.Served]:
    """A server with its hulls and alarms."""
    with past.serving(None if options.in_memory else folder / rules) as served:
        asyncio.run(fill(served.address, options.hulls, rules, options.when))
        past.told(f"{options.hulls:,} hulls, rules: {rules}")
        yield served


Pairs = dict[str, list[tuple[float, float]]]


def measured(options: argparse.Namespace, where: Path, kinds: list[str]) -> tuple[Pairs, float]:
    """The rate and the processor time of each block, of each kind of server; and the share that changes the outline."""
    random, found, changed = np.random.default_rng(0), Pairs((kind, []) for kind in kinds), 0
    with tempfile.TemporaryDirectory(dir=where) as folder, ExitStack() as stack:
        servers = {kind: stack.enter_context(serving(options, Path(folder), kind)) for kind in kinds}
        for number in range(-1, options.pairs):  # the first is not counted
            made = [moves(random, options.batches // STREAMS) for _ in range(STREAMS)]
            batches, changes = [each for each, _ in made], sum(changes for _, changes in made)
            names = [name(each) for each in random.choice(options.hulls, STREAMS, replace=False).tolist()]
            changed += changes if number >= 0 else 0
            for kind in kinds if number % 2 else kinds[::-1]:
                before = servers[kind].processor
                rate = asyncio.run(write(servers[kind].address, names, batches))
                if number >= 0:
                    found[kind].append((rate, servers[kind].processor - before))
    return found, changed / (options.pairs * (options.batches // STREAMS) * STREAMS)


def main() -> None:
    parser = argparse.ArgumentParser(description="What alarms cost writers.")
    parser.add_argument(
        "--folder", type=Path, nargs="+", default=[Path()], help="where to put the data: one after the other"
    )
    parser.add_argument("--hulls", type=int, default=10_000, help="hulls (default 10,000)")
    parser.add_argument("--pairs", type=int, default=64, help="blocks of each server (default 64)")
    parser.add_argument("--batches", type=int, default=10_000, help="batches of a block (default 10,000)")
    parser.add_argument("--when", default=f"area > {MANY}", help=f"the condition (default: area > {MANY})")
    parser.add_argument("--rules", nargs="*", default=RULES[1:], choices=RULES[1:], help="which rules (default: both)")
    parser.add_argument("--in-memory", action="store_true", help="servers that keep nothing")
    options = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    kinds = ["none", *options.rules]
    for folder in options.folder[:1] if options.in_memory else options.folder:
        rates, share = measured(options, folder, kinds)
        where = "in memory" if options.in_memory else f"in {folder.resolve()}"
        what = f"{options.hulls:,} hulls {where}, {options.when}, {share:.0%} change the outline"
        print(f"| {what}, load {os.getloadavg()[0]:.1f} | ", end="")
        print("batches/s | rate, >= 0.95 | processor time |\n| --- | ---: | ---: | ---: |")
        for kind in kinds:
            pairs = zip(rates[kind], rates["none"], strict=True)
            ratios = zip(*([mine / none for mine, none in zip(*pair, strict=True)] for pair in pairs), strict=True)
            shown = " | ".join(past.ratio_of(column) for column in ratios)
            print(f"| rules: {kind} | {median(rate for rate, _ in rates[kind]):,.0f} | {shown} |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
