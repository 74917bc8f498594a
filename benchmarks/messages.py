"""Small batches, acknowledged one by one: what a message costs, and what batches that share messages cost.

    python benchmarks/messages.py [--folder .] [--repeat 5]

Each work runs in turn, on a durable server and on one in memory; client and server share the machine.

* `Writer`, `AsyncWriter`: the SDK's writers with `batch_points=1`, from Python points to resolved futures.
* `shared messages`: the same batches, made beforehand, in messages that take as many as there is room for.
* `one a message`: a batch in each message, as from clients that know no other messages; of 1 point, and of 64.
* `empty handler`: grpcio with a handler that only reads and writes; it gets the messages of the line before.
* `Redis`: GEOADD of one member a command, pipelined over a Unix socket as raw bytes; its log is synced before each
  answer (`appendfsync always`), or there is none. Debian: `apt-get install redis-server`.

At most 1,024 batches or commands are not acknowledged. Columns: the median, the least and the greatest of the runs, and
the median of the ratios: to the empty handler for `one a message`, else to Redis.
"""

import argparse
import asyncio
import statistics
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import served_entities
from durability import inserts, service, serving

import server
from dynhull_client import AsyncHullClient, HullClient
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

IN_FLIGHT = 1024
BATCHES = 20_000
FEWER = 4_000  # of works that send one batch a message
MANY_POINTS = 64

Points = np.ndarray
Work = Callable[[str, str, Points], float]


def writer(address: str, name: str, points: Points) -> float:
    with (
        HullClient(address) as client,
        client.writer(name, batch_points=1, in_flight=IN_FLIGHT) as writing,
    ):
        begun = time.perf_counter()
        outcomes = [writing.put(insert=point) for point in points[:, np.newaxis]]
        writing.flush()
        took = time.perf_counter() - begun
        assert outcomes[-1].result().inserted == 1
    return len(points) / took


def async_writer(address: str, name: str, points: Points) -> float:
    async def write() -> float:
        async with (
            AsyncHullClient(address) as client,
            client.writer(name, batch_points=1, in_flight=IN_FLIGHT) as writing,
        ):
            begun = time.perf_counter()
            outcomes = [await writing.put(insert=point) for point in points[:, np.newaxis]]
            await writing.flush()
            took = time.perf_counter() - begun
            assert outcomes[-1].result().inserted == 1
        return len(points) / took

    return asyncio.run(write())


def shared(address: str, name: str, points: Points) -> float:
    batches = (batch_pb2.Batch(inserts=server.packed(point)) for point in points[:, np.newaxis])
    messages = [pb.StreamRequest(batches=[pb.NumberedBatch(batch=batch)]).SerializeToString() for batch in batches]
    return asyncio.run(server.together(address, name, messages, IN_FLIGHT))


def single(address: str, name: str, points: Points, size: int = 1) -> float:
    messages = inserts(name, points[: FEWER * size], size)
    return asyncio.run(server.stream(address, messages, len(messages), IN_FLIGHT))


def many(address: str, name: str, points: Points) -> float:
    return single(address, name, np.resize(points, (FEWER * MANY_POINTS, 2)), MANY_POINTS)


def geoadd(address: str, _: str, points: Points) -> float:
    commands = [served_entities.geoadd(np.array([i]), place[np.newaxis]) for i, place in enumerate(points)]
    return served_entities.pipeline(address, commands, IN_FLIGHT)


WORKS: dict[str, tuple[str, Work]] = {
    "Redis": ("Redis", geoadd),
    "Writer": ("dynhull", writer),
    "AsyncWriter": ("dynhull", async_writer),
    "shared messages": ("dynhull", shared),
    "empty handler, 1 point": ("empty", single),
    "one a message, 1 point": ("dynhull", single),
    "empty handler, 64 points": ("empty", many),
    "one a message, 64 points": ("dynhull", many),
}
RIVALS = dict.fromkeys(("Redis", "Writer", "AsyncWriter", "shared messages"), "Redis") | {
    f"{who}, {size}": f"empty handler, {size}"
    for who in ("empty handler", "one a message")
    for size in ("1 point", "64 points")
}


def measure(folder: Path, durable: bool, repeat: int, chosen: str) -> None:
    """Print a row for each work; runs in turn."""
    options = ["--data", str(folder / "dynhull"), "--durability", "sync"] if durable else ["--in-memory"]
    rates: dict[str, list[float]] = {work: [] for work in WORKS if chosen in work}
    random = np.random.default_rng(0)
    with ExitStack() as stack:
        servers = {
            "Redis": stack.enter_context(served_entities.redis(folder / "redis", log=durable)),
            "dynhull": stack.enter_context(serving(*options)),
            "empty": stack.enter_context(server.running(server.EMPTY)),
        }
        for repetition in range(repeat):
            points = np.round(random.normal(size=(BATCHES, 2)), served_entities.DECIMALS)
            for work in rates:
                who, run = WORKS[work]
                name = f"{work.replace(',', '').replace(' ', '-')}-{repetition}"
                if who == "dynhull":
                    with service(servers[who]) as stub:
                        stub.CreateHull(pb.CreateHullRequest(name=name))
                rates[work].append(run(servers[who], name, points))
    for work, values in rates.items():
        figures = " | ".join(f"{f(values):,.0f}" for f in (statistics.median, min, max))
        rivals = rates.get(RIVALS[work], [])
        ratio = f"{statistics.median(a / b for a, b in zip(values, rivals, strict=True)):.2f}" if rivals else "-"
        print(f"| {'sync' if durable else 'in memory'} | {work} | {figures} | {ratio} |", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description="Small batches, acknowledged one by one, beside Redis.")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    parser.add_argument("--repeat", type=int, default=5, help="runs of each work (default 5)")
    parser.add_argument("--only", default="", help="works whose name contains this")
    options = parser.parse_args()
    served_entities.require_redis()
    served_entities.warn_if_busy()
    print("| durability | work | batches a second, median | least | greatest | ratio |")
    print("| --- | --- | ---: | ---: | ---: | ---: |")
    for durable in (True, False):
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            measure(Path(folder), durable, options.repeat, options.only)


if __name__ == "__main__":
    main()
