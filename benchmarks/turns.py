"""How long writes wait for large reads and for watchers that resume: `python benchmarks/turns.py`.

One writer sends single points, one after the other, to a hull of 3,000 vertices while large questions are asked about
it, and to another hull while watchers resume from revisions that only the disk remembers. The longest wait counts.
"""

import argparse
import asyncio
import tempfile
import time
from collections.abc import Awaitable, Callable
from pathlib import Path

import grpc
import numpy as np

import server
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

OPTIONS = ["-m", "dynhull_server", "--port", "0", "--scrub-cpu", "0", "--log-level", "warning", "--history-bytes", "0"]
UNLIMITED = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
VERTICES, ROWS = 3_000, 200_000
RESUMED, WATCHERS, BATCHES = 1_000_000, 12, 200


def on_circle(n: int, radius: float = 1e6) -> np.ndarray:
    angles = np.random.default_rng(3).uniform(0, 2 * np.pi, n)
    return np.column_stack((radius * np.cos(angles), radius * np.sin(angles)))


async def apply(stub: HullServiceStub, name: str, points: np.ndarray) -> int:
    batch = batch_pb2.Batch(inserts=server.packed(points))
    return (await stub.Apply(pb.ApplyRequest(name=name, batch=batch))).result.revision


async def waits(stub: HullServiceStub, name: str, others: Callable[[], Awaitable[object]]) -> tuple[list[float], float]:
    """Milliseconds of each single write while the others are at work, and how long those took."""
    working = asyncio.ensure_future(others())
    begun = time.perf_counter()
    taken = []
    while not working.done():
        before = time.perf_counter()
        await apply(stub, name, np.zeros((1, 2)))
        taken.append((time.perf_counter() - before) * 1e3)
        await asyncio.sleep(0.001)
    await working
    return taken, (time.perf_counter() - begun) * 1e3


def row(work: str, taken: list[float], total: float) -> None:
    ordered = sorted(taken)
    print(f"| {work} | {len(taken)} | {ordered[len(ordered) // 2]:.1f} | {ordered[-1]:.1f} | {total:.0f} |", flush=True)


async def large_reads(address: str, other: str) -> None:
    rng = np.random.default_rng(4)
    points, targets = (server.packed(rng.uniform(-2e6, 2e6, (ROWS, 2))) for _ in range(2))
    async with (
        grpc.aio.insecure_channel(address, options=UNLIMITED) as reading,
        grpc.aio.insecure_channel(other) as writing,
    ):
        readers, writer = HullServiceStub(reading), HullServiceStub(writing)
        await writer.CreateHull(pb.CreateHullRequest(name="round"))
        await apply(writer, "round", on_circle(VERTICES))
        lines = pb.IntersectLinesRequest(name="round", origins=points, targets=targets)
        works = {
            f"{ROWS:,} distances": lambda: readers.Distance(pb.DistanceRequest(name="round", points=points)),
            f"{ROWS:,} line crossings": lambda: readers.IntersectLines(lines),
            f"{ROWS:,} tangents": lambda: readers.Tangents(pb.TangentsRequest(name="round", points=points)),
            f"{ROWS:,} located": lambda: readers.Locate(pb.LocateRequest(name="round", points=points)),
            f"{ROWS:,} counted": lambda: readers.Count(pb.CountRequest(name="round", points=points)),
        }
        for work, ask in works.items():

            async def asked(ask=ask) -> None:
                await ask()

            row(work, *await waits(writer, "round", asked))

            async def given_up(ask=ask) -> None:
                call = ask()
                await asyncio.sleep(0.3)
                call.cancel()
                await asyncio.sleep(0.5)

            row(f"{work}, given up after 0.3 s", *await waits(writer, "round", given_up))


async def resuming(address: str, what: str, points: np.ndarray) -> None:
    async with grpc.aio.insecure_channel(address, options=UNLIMITED) as channel:
        stub = HullServiceStub(channel)
        for name in ("large", "small"):
            await stub.CreateHull(pb.CreateHullRequest(name=name))
        size = RESUMED // BATCHES
        for block in points.reshape(BATCHES, size, 2):
            newest = await apply(stub, "large", block)
        uid = (await stub.GetHull(pb.GetHullRequest(name="large", view=pb.HULL_VIEW_BASIC))).hull.uid

        async def resume(i: int) -> None:
            request = pb.WatchRequest(name="large")
            request.resume.uid, request.resume.revision = uid, newest - 2 * i - 1
            async for _ in stub.Watch(request):
                return

        async def all_resume() -> None:
            await asyncio.gather(*(resume(i) for i in range(WATCHERS)))

        row(f"{WATCHERS} watchers of {RESUMED:,} {what} resume", *await waits(stub, "small", all_resume))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    options = parser.parse_args()
    print("| beside | writes | median ms | longest ms | all took ms |\n|---|---|---|---|---|")
    with server.running([*OPTIONS, "--in-memory"]) as address:
        asyncio.run(large_reads(address, address))
    clouds = {"points": np.random.default_rng(5).normal(size=(RESUMED, 2)), "vertices": on_circle(RESUMED)}
    for what, points in clouds.items():
        with (
            tempfile.TemporaryDirectory(dir=options.folder) as data,
            server.running([*OPTIONS, "--data", data]) as address,
        ):
            asyncio.run(resuming(address, what, points))


if __name__ == "__main__":
    main()
