"""One hull over shards: what the shards send to the root, and a model of a thousand of them.

    python benchmarks/shards.py traffic [--points 1000000] [--updates 1000000]
    python benchmarks/shards.py model
    python benchmarks/shards.py served [--shards 2] [--rounds 3]
    python benchmarks/shards.py pause [--points 1000000] [--rounds 3]

`traffic` measures. Points of a distribution are divided among k shards; an update deletes a random point or inserts
another one. It counts the updates that change the hull of their shard, which are what the root hears of if each is a
batch of its own; and the vertices that are sent in batches of 1,000 updates, in which some come and go unseen. On a
circle, where all points are vertices, take few points: each batch reads them all.

`served` measures real servers: a stream of messages of 10,000 points, inserted and deleted, stored with the durability
of the default, to one hull and to one over shards, which take turns; and the time of a call with one point.

`pause` measures real servers, too: how long writes wait while a hull gets another number of shards, 2 and 4 in turn.

`model` measures what the root does for a vertex, a message and a row on this machine, and multiplies. Nobody has run a
thousand shards.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from math import pi
from statistics import median

import numpy as np

from dynhull import DynamicHull, convex_hull
from dynhull_client import HullClient
from dynhull_cluster.shards.logs import Decided, Decision
from dynhull_cluster.shards.messages import Apply, Corners, Done, Effect, Opened, Reply, Request, ShardTotals
from dynhull_cluster.shards.parts import divided
from dynhull_cluster.shards.placement import point_hashes, shards_of
from dynhull_cluster.shards.requests import RootWrite
from dynhull_cluster.shards.root import Root
from dynhull_server.state.batch import NO_POINTS, Applied, Batch, Write
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import HullSettings
from dynhull_server.state.requests import WriteBatch

random = np.random.default_rng(1)
Draw = Callable[[int], np.ndarray]
BATCH = 1000
COUNTS = (2, 4, 8, 16)
LIMITS = Limits(max_hulls=1, max_points=2**62, max_producers=1, max_producers_per_caller=1, resume_bytes=0)


def uniform(n: int) -> np.ndarray:
    return random.uniform(size=(n, 2))


def gaussian(n: int) -> np.ndarray:
    return random.normal(size=(n, 2))


def disk(n: int) -> np.ndarray:
    return circle(n) * np.sqrt(random.uniform(size=(n, 1)))


def circle(n: int) -> np.ndarray:
    angles = random.uniform(0, 2 * pi, n)
    return np.column_stack([np.cos(angles), np.sin(angles)])


DRAWS: dict[str, Draw] = {"uniform": uniform, "gaussian": gaussian, "disk": disk, "circle": circle}


# Traffic


def traffic(distributions: list[str], points: int, updates: int) -> None:
    print(f"{points:,} points, {updates:,} updates; of a million updates:")
    print(
        "| distribution | k | change the hull of their shard | vertices sent, batches of 1,000 | vertices at the root |"
    )
    print("| --- | ---: | ---: | ---: | ---: |")
    for name in distributions:
        for count in COUNTS:
            changing, sent, held = measure(DRAWS[name], count, points, updates)
            million = 1e6 / updates
            print(f"| {name} | {count} | {changing * million:,.0f} | {sent * million:,.0f} | {held:,} |", flush=True)


def measure(draw: Draw, count: int, points: int, updates: int) -> tuple[int, int, int]:
    """Updates that change the hull of their shard, vertices sent in batches, vertices of all shards."""
    first, new = draw(points), draw(updates // 2)
    gone = first[random.permutation(points)[: updates // 2]]
    rows = np.empty((2 * len(new), 2))
    rows[::2], rows[1::2] = gone, new
    homes, starting = shards_of(point_hashes(rows), count), shards_of(point_hashes(first), count)
    changing = sent = held = 0
    for shard in range(count):
        singly, batched = (DynamicHull(first[starting == shard]) for _ in range(2))
        own = np.flatnonzero(homes == shard)
        changes = singly.changes
        for row in own.tolist():
            x, y = rows[row]
            (singly.insert if row % 2 else singly.delete)(x, y)
        changing += singly.changes - changes
        held += len(singly.vertices())
        before = complex_rows(batched.vertices())
        for batch in np.split(own, np.flatnonzero(np.diff(own // BATCH)) + 1):
            changes = batched.changes
            batched.apply(np.where(batch % 2, 1, -1).astype(np.int8), rows[batch])
            if batched.changes != changes:
                after = complex_rows(batched.vertices())
                sent += len(np.setxor1d(before, after, assume_unique=True))
                before = after
    return changing, sent, held


def complex_rows(points: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(points).view(np.complex128).ravel()


# The model

SHARDS, EACH, RATE = 1000, 10**6, 50_000_000
ROUND = 0.1  # seconds of updates that the root sends as one batch


def model() -> None:
    row = row_seconds()
    message = message_seconds()
    print(
        f"measured: {1e9 * row:.1f} ns a row divided among {SHARDS} shards, {1e6 * message:.1f} us a message and reply"
    )
    print(f"model: {SHARDS:,} shards of {EACH:,} points, {RATE:,} updates a second, a round every {ROUND} s")
    print("| distribution | vertices at the root | changes a second | us a change | of a core: merging | messages |")
    print("| --- | ---: | ---: | ---: | ---: | ---: |")
    for name in ("uniform", "gaussian", "disk"):
        held, each = merging(DRAWS[name])
        rate = RATE * held / (SHARDS * EACH)  # a point is a vertex of its shard with this probability
        share, messages = rate * each, SHARDS / ROUND * message
        print(f"| {name} | {held:,} | {rate:,.0f} | {1e6 * each:.2f} | {share:.2%} | {messages:.1%} |", flush=True)
    print(f"dividing the rows takes {RATE * row:.1f} cores, wherever it is done")


def merging(draw: Draw) -> tuple[int, float]:
    """The vertices of all shards, and the seconds that the root takes for one that comes or goes."""
    shards = [convex_hull(draw(EACH)) for _ in range(SHARDS // 10)]
    corners = np.concatenate([turned for shard in shards for turned in ten_of(shard)])
    hull = DynamicHull(corners)
    batch = max(1, int(RATE * len(corners) / (SHARDS * EACH) * ROUND) // 2)
    rounds = 20
    ops = np.repeat(np.array([1, -1], np.int8), batch)
    seconds = 0.0
    for _ in range(rounds):
        rows = random.choice(len(corners), batch, replace=False)
        moved = corners[rows] * (1 - 1e-9)
        begun = time.perf_counter()
        hull.apply(ops, np.concatenate([moved, corners[rows]]))
        seconds += time.perf_counter() - begun
        corners[rows] = moved
    return len(corners), seconds / (rounds * 2 * batch)


def ten_of(shard: np.ndarray) -> list[np.ndarray]:
    """Ten hulls with as many vertices, near each other as those of ten shards: drawing 10^9 points takes minutes."""
    return [shard * random.uniform(1 - 1e-6, 1) for _ in range(10)]


def row_seconds() -> float:
    batch = Batch(uniform(2**20), NO_POINTS, 0, count_missing=False)
    divided(batch, SHARDS)
    begun = time.perf_counter()
    divided(batch, SHARDS)
    return (time.perf_counter() - begun) / len(batch.inserts)


class NoLog:
    def begin(self, _: int | None) -> tuple[int, Decided]:
        return 1, Decided()

    def decide(self, epoch: int, decisions: Sequence[Decision]) -> None:
        pass


def message_seconds() -> float:
    """What the root takes to make a message and to take its reply, without the bytes between processes."""
    root = Root(HullSettings(), LIMITS, SHARDS, NoLog(), now=0.0)
    nothing = ShardTotals(0, 0, None)

    def reply(message: Request) -> Reply:
        header = message.epoch, message.ticket
        if isinstance(message, Apply):
            applied = Applied(1, 0, 0, 0, False, 0)
            return Done(*header, tuple(Effect(step.number, nothing, applied=applied) for step in message.steps))
        return Opened(*header, 0, nothing, Corners(NO_POINTS, None))

    def answer_all() -> None:
        for shard, message in root.messages():
            root.receive(shard, reply(message))

    answer_all()
    batch = Batch(uniform(8 * SHARDS), NO_POINTS, 0, count_missing=False)
    write = WriteBatch(None, Write("hull", batch, 0, len(batch.inserts)))
    dividing = time.perf_counter()
    divided(batch, SHARDS)
    dividing = time.perf_counter() - dividing
    rounds, begun = 20, time.perf_counter()
    for _ in range(rounds):
        root.submit(RootWrite(write, 0.0))
        answer_all()
    return ((time.perf_counter() - begun) / rounds - dividing) / SHARDS


# Real servers

SERVED = {"one process": [], "2 workers, 2 gateways": ["--workers", "2", "--gateways", "2"]}
MESSAGES, POINTS, CALLS = 100, 10_000, 200


def served(shards: int, rounds: int) -> None:
    print("| server | hull | messages of 10,000 points a second | range | a call with one point, ms |")
    print("| --- | --- | ---: | ---: | ---: |")
    for name, options in SERVED.items():
        with tempfile.TemporaryDirectory() as folder, serving(["--data", folder, *options]) as address:
            with HullClient(address) as client:
                client.create_hull("one")
                client.create_hull("many", shards=shards)
                found: dict[str, list[tuple[float, float]]] = {"one": [], "many": []}
                for turn in range(rounds + 1):  # the first one warms up
                    for hull, measured in found.items():
                        each = timed(client, hull)
                        measured += [each] if turn else []
            for hull, measured in found.items():
                rates, calls = zip(*measured, strict=True)
                kind = "one" if hull == "one" else f"{shards} shards"
                spread = f"{min(rates):.0f} to {max(rates):.0f}"
                print(f"| {name} | {kind} | {median(rates):.0f} | {spread} | {1e3 * median(calls):.2f} |", flush=True)


def timed(client: HullClient, hull: str) -> tuple[float, float]:
    """Messages a second, and the seconds of a call with one point."""
    points = random.normal(size=(POINTS, 2))
    begun = time.perf_counter()
    with client.writer(hull, batch_points=POINTS) as writer:
        for _ in range(MESSAGES // 2):
            writer.put(points)
            writer.put(delete=points)
    rate = MESSAGES / (time.perf_counter() - begun)
    begun = time.perf_counter()
    for _ in range(CALLS // 2):
        client.apply(hull, insert=points[:1])
        client.apply(hull, delete=points[:1])
    return rate, (time.perf_counter() - begun) / CALLS


def pause(points: int, rounds: int) -> None:
    print(f"| server | {points:,} points from 2 to 4 shards, s | from 4 to 2, s |")
    print("| --- | ---: | ---: |")
    for name, options in SERVED.items():
        with (
            tempfile.TemporaryDirectory() as folder,
            serving(["--data", folder, *options]) as address,
            HullClient(address, timeout=None) as client,
        ):
            client.create_hull("many", shards=2)
            with client.writer("many", batch_points=POINTS) as writer:
                for rows in np.array_split(random.normal(size=(points, 2)), max(1, points // POINTS)):
                    writer.put(rows)
            seconds: dict[int, list[float]] = {4: [], 2: []}
            for _ in range(rounds):
                for shards, measured in seconds.items():
                    begun = time.perf_counter()
                    client.reshard("many", shards)
                    measured.append(time.perf_counter() - begun)
        print(f"| {name} | {median(seconds[4]):.2f} | {median(seconds[2]):.2f} |", flush=True)


@contextmanager
def serving(options: Sequence[str]) -> Iterator[str]:
    command = [sys.executable, "-m", "dynhull_cli", "serve", "--port", "0", "--scrub-cpu", "0", "--log-level", "error"]
    with subprocess.Popen([*command, *options], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            yield process.stdout.readline().split()[-1]
        finally:
            process.terminate()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    measured = commands.add_parser("traffic")
    measured.add_argument("--distributions", nargs="+", choices=DRAWS, default=["uniform", "gaussian", "disk"])
    measured.add_argument("--points", type=int, default=1_000_000)
    measured.add_argument("--updates", type=int, default=1_000_000)
    commands.add_parser("model")
    real = commands.add_parser("served")
    real.add_argument("--shards", type=int, default=2)
    real.add_argument("--rounds", type=int, default=3)
    paused = commands.add_parser("pause")
    paused.add_argument("--points", type=int, default=1_000_000)
    paused.add_argument("--rounds", type=int, default=3)
    arguments = parser.parse_args()
    if arguments.command == "pause":
        pause(arguments.points, arguments.rounds)
    elif arguments.command == "traffic":
        traffic(arguments.distributions, arguments.points, arguments.updates)
    elif arguments.command == "served":
        served(arguments.shards, arguments.rounds)
    else:
        model()


if __name__ == "__main__":
    main()
