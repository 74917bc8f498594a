"""Fences in a durable server: `python benchmarks/served_fences.py [--works moves hull] [--subjects N] [--fences N]`.

moves: keyed moves of many subjects among many polygon fences, and the same moves in a server without fences, in turn.
Each subject walks at random; the length of a step decides how many moves make an event. Columns: batch, moves a second
without and with fences, the median of the ratios, and the share of moves that made an event.

hull: one fence around a hull that changes some times a second, and many subjects that stay. Columns: changes a second,
processor time of the server a change; the delay of events, from the moment at which the change is sent to the moment
at which its events are read, median and 99th percentile; and how many changes had events.
"""

import argparse
import asyncio
import os
import statistics
import tempfile
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import durability
import grpc
import numpy as np

import server
from dynhull_proto.v1 import batch_pb2, fence_pb2, hull_pb2
from dynhull_proto.v1 import fence_service_pb2 as fences
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub

NAME = "fleet"
IN_FLIGHT = 8
LOADED = 8192
CORNERS = 8
NO_SNAPSHOTS = 10**12
AT_ONCE = 64  # fences created at a time
MOVES = 2**18  # of a run, if these limits on its batches allow
FEWEST, MOST = 16, 2048
COVERED = 0.7  # of the side of a cell that a fence fills


def puts(keys: np.ndarray, places: np.ndarray) -> bytes:
    packed = {"packed_integers": keys.astype("<u8").tobytes()}
    batch = batch_pb2.Batch(puts=batch_pb2.Puts(keys=packed, points=server.packed(places)))
    return pb.StreamRequest(name=NAME, batch=batch).SerializeToString()


def send(address: str, messages: list[bytes]) -> float:
    """Messages a second."""
    return asyncio.run(server.stream(address, messages, len(messages), IN_FLIGHT))


def started(stack: ExitStack, folder: Path) -> str:
    options = ["--data", str(folder), "--durability", "sync", "--snapshot-points", str(NO_SNAPSHOTS)]
    address = stack.enter_context(durability.serving(*options))
    with durability.service(address) as stub:
        config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_INTEGER_KEYS)
        stub.CreateHull(pb.CreateHullRequest(name=NAME, config=config))
    return address


def polygons(number: int) -> list[np.ndarray]:
    """Octagons in the cells of a grid over the unit square."""
    side = int(np.ceil(np.sqrt(number)))
    angles = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    shape = np.stack([np.cos(angles), np.sin(angles)], axis=1) * COVERED / 2 / side
    centres = (np.stack(np.meshgrid(range(side), range(side)), axis=-1).reshape(-1, 2)[:number] + 0.5) / side
    return [centre + shape for centre in centres]


async def create_fences(address: str, areas: list[np.ndarray]) -> None:
    async with grpc.aio.insecure_channel(address) as channel:
        stub = FenceServiceStub(channel)
        for first in range(0, len(areas), AT_ONCE):
            await asyncio.gather(
                *(
                    stub.CreateFence(fences.CreateFenceRequest(name=f"fence/{first + i}", config=polygon(area)))
                    for i, area in enumerate(areas[first : first + AT_ONCE])
                )
            )


def polygon(area: np.ndarray) -> fence_pb2.FenceConfig:
    one = fence_pb2.Polygon(exterior=server.packed(area))
    return fence_pb2.FenceConfig(
        polygon_area=fence_pb2.PolygonArea(polygons=[one]), subject_hull=NAME, initial=fence_pb2.FENCE_INITIAL_NONE
    )


def events(address: str) -> int:
    """The number of all events so far."""
    with grpc.insecure_channel(address) as channel:
        stub = FenceServiceStub(channel)
        total, token = 0, ""
        while True:
            page = stub.ListFences(fences.ListFencesRequest(page_size=1000, page_token=token))
            total += sum(fence.last_sequence for fence in page.fences)
            token = page.next_page_token
            if not token:
                return total


def moves(folder: Path, n: int, number: int, batches: list[int], steps: list[float], repeat: int) -> None:
    random = np.random.default_rng(0)
    places = random.random((n, 2))
    with ExitStack() as stack:
        plain, fenced = (started(stack, folder / who) for who in ("plain", "fenced"))
        load = [puts(np.arange(i, min(i + LOADED, n)), places[i : i + LOADED]) for i in range(0, n, LOADED)]
        for address in (plain, fenced):
            send(address, load)
        begun = time.perf_counter()
        asyncio.run(create_fences(fenced, polygons(number)))
        took = time.perf_counter() - begun
        print(f"{number:,} fences around {n:,} subjects were created in {took:.1f} s\n")
        print("| batch | step | without fences, moves/s | with fences, moves/s | ratio | moves with an event |")
        print("| ---: | ---: | ---: | ---: | ---: | ---: |")
        for size in batches:
            count = min(max(MOVES // size, FEWEST), MOST)
            for step in steps:
                without, with_fences, seen = [], [], events(fenced)
                for _ in range(repeat):
                    messages = []
                    for _ in range(count):
                        keys = random.choice(n, size, replace=False)
                        places[keys] = (places[keys] + random.normal(0, step, (size, 2))) % 1.0
                        messages.append(puts(keys, places[keys]))
                    without.append(send(plain, messages) * size)
                    with_fences.append(send(fenced, messages) * size)
                share = (events(fenced) - seen) / (repeat * count * size)
                ratio = statistics.median(b / a for a, b in zip(without, with_fences, strict=True))
                rates = " | ".join(f"{statistics.median(rates):,.0f}" for rates in (without, with_fences))
                print(f"| {size:,} | {step} | {rates} | {ratio:.2f} | {share:.1%} |", flush=True)


def hull(folder: Path, n: int, rates: list[float], seconds: float) -> None:
    random = np.random.default_rng(1)
    places = random.random((n, 2))
    with ExitStack() as stack:
        address = started(stack, folder / "hull")
        send(address, [puts(np.arange(i, min(i + LOADED, n)), places[i : i + LOADED]) for i in range(0, n, LOADED)])
        channel = stack.enter_context(grpc.insecure_channel(address))
        stub, fence_stub = stack.enter_context(durability.service(address)), FenceServiceStub(channel)
        config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_INTEGER_KEYS)
        stub.CreateHull(pb.CreateHullRequest(name="area", config=config))
        angles = np.linspace(0, 2 * np.pi, 400, endpoint=False)
        corners = 0.5 + 0.3 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        stub.Apply(pb.ApplyRequest(name="area", batch=area_batch(np.arange(400), corners)))
        around = fence_pb2.FenceConfig(
            hull_area=fence_pb2.HullArea(name="area"), subject_hull=NAME, initial=fence_pb2.FENCE_INITIAL_NONE
        )
        fence_stub.CreateFence(fences.CreateFenceRequest(name="around", config=around))
        print(
            "\n| changes a second | server CPU a change | events, delay median | p99 | changes with events reported |"
        )
        print("| ---: | ---: | ---: | ---: | ---: |")
        for rate in rates:
            seen: dict[int, float] = {}
            watch = fence_stub.WatchFence(fences.WatchFenceRequest(name="around", only_new=True, conflate=False))
            reader = threading.Thread(target=read, args=(watch, seen), daemon=True)
            reader.start()
            time.sleep(0.5)
            sent: dict[int, float] = {}
            cpu, begun = processor_seconds(), time.perf_counter()
            for i in range(int(rate * seconds)):
                time.sleep(max(0.0, begun + i / rate - time.perf_counter()))
                which = random.choice(400, 4, replace=False)
                corners[which] = 0.5 + (corners[which] - 0.5) * random.uniform(0.97, 1.03, (4, 1))
                request = pb.ApplyRequest(name="area", batch=area_batch(which, corners[which]))
                now = time.perf_counter()
                sent[stub.Apply(request).result.revision] = now
            cpu = (processor_seconds() - cpu) / len(sent)
            time.sleep(1)
            watch.cancel()
            reader.join()
            delays = sorted(seen[revision] - at for revision, at in sent.items() if revision in seen)
            p99 = delays[min(len(delays) - 1, int(len(delays) * 0.99))]
            print(
                f"| {rate:g} | {cpu * 1e3:.2f} ms | {statistics.median(delays) * 1e3:.1f} ms | {p99 * 1e3:.1f} ms "
                f"| {len(delays)} of {len(sent)} |",
                flush=True,
            )


def area_batch(keys: np.ndarray, places: np.ndarray) -> batch_pb2.Batch:
    packed = {"packed_integers": keys.astype("<u8").tobytes()}
    return batch_pb2.Batch(puts=batch_pb2.Puts(keys=packed, points=server.packed(places)))


def read(watch, seen: dict[int, float]) -> None:
    try:
        for response in watch:
            now = time.perf_counter()
            for event in response.events:
                seen.setdefault(event.area_revision, now)
    except grpc.RpcError as ended:
        if ended.code() != grpc.StatusCode.CANCELLED:
            raise


def processor_seconds() -> float:
    """The processor time of all processes that this one has started, so far."""
    tick = os.sysconf("SC_CLK_TCK")
    total = 0.0
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except (OSError, IndexError):  # it has ended
            continue
        if int(fields[1]) == os.getpid():
            total += (int(fields[11]) + int(fields[12])) / tick
    return total


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--works", nargs="+", choices=["moves", "hull"], default=["moves", "hull"])
    parser.add_argument("--subjects", type=float, default=1e6)
    parser.add_argument("--fences", type=float, default=23_000)
    parser.add_argument("--batches", type=int, nargs="+", default=[64, 8192])
    parser.add_argument("--steps", type=float, nargs="+", default=[5e-5, 4e-4], help="standard deviation of a move")
    parser.add_argument("--rates", type=float, nargs="+", default=[10, 100], help="changes of the hull a second")
    parser.add_argument("--seconds", type=float, default=10, help="of each of these rates")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--folder", type=Path, default=Path(), help="where the servers put their data (default: here)")
    arguments = parser.parse_args()
    print(f"load average {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(dir=arguments.folder) as data:
        if "moves" in arguments.works:
            number = int(arguments.fences)
            moves(Path(data), int(arguments.subjects), number, arguments.batches, arguments.steps, arguments.repeat)
        if "hull" in arguments.works:
            hull(Path(data), int(arguments.subjects), arguments.rates, arguments.seconds)
    print(f"\nload average at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
