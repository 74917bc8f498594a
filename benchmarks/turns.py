"""How long writes wait for large reads, for watchers that resume, and for points that leave another hull.

    python benchmarks/turns.py [--works reads resume expiry]

One writer sends single points, one after the other, to a hull of 3,000 vertices while large questions are asked about
it; to another hull while watchers resume from revisions that only the disk remembers; and to another hull while
many entities leave at once, because their deadlines pass or because the window ends. The longest wait counts.
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
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

OPTIONS = ["-m", "dynhull_server", "--port", "0", "--scrub-cpu", "0", "--log-level", "warning", "--resume-bytes", "0"]
UNLIMITED = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
VERTICES, ROWS = 3_000, 200_000
RESUMED, WATCHERS, BATCHES = 1_000_000, 12, 200
IDENTITIES = {"integer": hull_pb2.IDENTITY_INTEGER_KEYS, "string": hull_pb2.IDENTITY_STRING_KEYS}


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


def numbered(rows: np.ndarray, kind: str) -> points_pb2.Keys:
    if kind == "integer":
        return points_pb2.Keys(packed_integers=rows.astype("<u8").tobytes())
    return points_pb2.Keys(lengths=bytes([16]) * len(rows), text=b"".join(b"%016d" % row for row in rows.tolist()))


async def leaving(address: str, kind: str, why: str, entities: int, seconds: int) -> None:
    async with grpc.aio.insecure_channel(address, options=UNLIMITED) as channel:
        stub = HullServiceStub(channel)
        config = hull_pb2.HullConfig(identity=IDENTITIES[kind])
        if why == "window":
            config.window.max_age.FromSeconds(seconds)
        name = f"{kind}-{why}"
        await stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
        if kind == "integer" and why == "deadline":
            await stub.CreateHull(pb.CreateHullRequest(name="small"))
        begun = time.time()
        ends = np.int64((begun + seconds) * 1e6)
        rng = np.random.default_rng(6)
        for rows in np.arange(entities).reshape(BATCHES, -1):
            points = server.packed(rng.uniform(-1, 1, (len(rows), 2)))
            puts = batch_pb2.Puts(keys=numbered(rows, kind), points=points)
            at = points_pb2.Times(
                packed=np.full(len(rows), ends if why == "deadline" else begun * 1e6, "<i8").tobytes()
            )
            (puts.expire_times if why == "deadline" else puts.times).CopyFrom(at)
            result = (await stub.Apply(pb.ApplyRequest(name=name, batch=batch_pb2.Batch(puts=puts)))).result
        if result.point_count < entities:
            raise SystemExit(f"filling the hull took more than {seconds} s")
        await asyncio.sleep(begun + seconds - 1 - time.time())

        async def all_leave() -> None:
            request = pb.GetHullRequest(name=name, min_revision=result.revision + 1, view=pb.HULL_VIEW_BASIC)
            assert (await stub.GetHull(request)).hull.point_count == 0

        row(f"{entities:,} {kind} keys leave, {why}", *await waits(stub, "small", all_leave))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--works", nargs="+", default=["reads", "resume", "expiry"], choices=["reads", "resume", "expiry"]
    )
    parser.add_argument("--entities", type=int, default=1_000_000, help="that leave at once (default 1,000,000)")
    parser.add_argument("--seconds", type=int, default=60, help="from the first put until they leave (default 60)")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    options = parser.parse_args()
    print("| beside | writes | median ms | longest ms | all took ms |\n|---|---|---|---|---|")
    if "reads" in options.works:
        with server.running([*OPTIONS, "--in-memory"]) as address:
            asyncio.run(large_reads(address, address))
    if "resume" in options.works:
        clouds = {"points": np.random.default_rng(5).normal(size=(RESUMED, 2)), "vertices": on_circle(RESUMED)}
        for what, points in clouds.items():
            with (
                tempfile.TemporaryDirectory(dir=options.folder) as data,
                server.running([*OPTIONS, "--data", data]) as address,
            ):
                asyncio.run(resuming(address, what, points))
    if "expiry" in options.works:
        with server.running([*OPTIONS, "--in-memory"]) as address:
            for why in ("deadline", "window"):
                for kind in IDENTITIES:
                    asyncio.run(leaving(address, kind, why, options.entities, options.seconds))


if __name__ == "__main__":
    main()
