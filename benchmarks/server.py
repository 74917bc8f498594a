"""The server against handlers that do nothing, client and server on the same cores: `python benchmarks/server.py`.

Medians over connections, the two servers in turn: how fast a connection is depends on where the system puts the threads
at its two ends, by a factor of two, for as long as it lives. Messages are made beforehand, so the client costs both the
same.
"""

import argparse
import asyncio
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from pathlib import Path
from statistics import median, quantiles

import grpc
import numpy as np

import dynhull
from dynhull_proto.v1 import batch_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb

SERVICE = "/dynhull.v1.HullService/"
EMPTY = [str(Path(__file__).with_name("empty_server.py"))]
DYNHULL = ["-m", "dynhull_server", "--port", "0", "--in-memory", "--scrub-cpu", "0", "--log-level", "warning"]
OPTIONS = [("grpc.max_receive_message_length", -1), ("grpc.max_send_message_length", -1)]
# Messages of a cycle that ends where it began: inserts, then their deletes.
CYCLE = 64
IN_FLIGHT = 256
MESSAGE_BYTES = 2**16  # batches share a message up to this size
WATCHERS, RATE, UPDATES_PER_SECOND = 200, 10.0, 100_000


@contextmanager
def serving(command):
    """The address and the process of a server."""
    with subprocess.Popen([sys.executable, *command], stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process.stdout.readline().split()[-1], process.pid
        finally:
            process.terminate()


@contextmanager
def running(command):
    with serving(command) as (address, _):
        yield address


def packed(xy):
    return points_pb2.Points(packed=np.ascontiguousarray(xy, "<f8").tobytes())


def cycle(name, points):
    """Serialised messages of so many points, whose effect is nothing in the end."""
    blocks = np.random.default_rng(points).normal(size=(CYCLE // 2, points, 2))
    inserts = [batch_pb2.Batch(inserts=packed(block)) for block in blocks]
    deletes = [batch_pb2.Batch(deletes=packed(block)) for block in blocks]
    return [pb.StreamRequest(name=name, batch=batch).SerializeToString() for batch in inserts + deletes]


async def stream(address, requests, messages, in_flight=IN_FLIGHT):
    """Messages a second, acknowledged: the serialised requests, over and over."""
    async with grpc.aio.insecure_channel(address, options=OPTIONS) as channel:
        call = channel.stream_stream(SERVICE + "Stream")()
        room = asyncio.Semaphore(in_flight)

        async def write():
            for i in range(messages):
                await room.acquire()
                await call.write(requests[i % len(requests)])
            await call.done_writing()

        begun = time.perf_counter()
        writing = asyncio.create_task(write())
        for _ in range(messages):
            assert await call.read() is not grpc.aio.EOF
            room.release()
        took = time.perf_counter() - begun
        await writing
        assert await call.code() == grpc.StatusCode.OK
    return messages / took


async def together(address, name, batches, in_flight=IN_FLIGHT):
    """Batches a second, acknowledged: those that there is room for share a message, as those of the SDK's writers do.

    Each is a serialised message with one batch in `batches`: one after the other they are a message with all of them.
    """
    async with grpc.aio.insecure_channel(address, options=OPTIONS) as channel:
        method = channel.stream_stream(SERVICE + "Stream", response_deserializer=pb.StreamResponse.FromString)
        call = method()
        await call.write(pb.StreamRequest(name=name, accept_results=True).SerializeToString())
        most = (await call.read()).max_batches
        begun = time.perf_counter()
        sent = acknowledged = 0
        while acknowledged < len(batches):
            end = min(acknowledged + in_flight, sent + most, len(batches))
            if sent < end:
                size, first = len(batches[sent]), sent
                sent += 1
                while sent < end and size + len(batches[sent]) <= MESSAGE_BYTES:
                    size += len(batches[sent])
                    sent += 1
                await call.write(b"".join(batches[first:sent]))
                if sent < min(acknowledged + in_flight, len(batches)):
                    continue
            response = await call.read()
            assert response is not grpc.aio.EOF
            acknowledged += len(response.results)
        took = time.perf_counter() - begun
        await call.done_writing()
        assert await call.code() == grpc.StatusCode.OK
    return len(batches) / took


async def locate(address, name, calls):
    """Microseconds of a unary call, the median."""
    request = pb.LocateRequest(name=name, points=packed([[0.1, 0.2]])).SerializeToString()
    times = []
    async with grpc.aio.insecure_channel(address) as channel:
        call = channel.unary_unary(SERVICE + "Locate")
        for _ in range(calls):
            begun = time.perf_counter()
            await call(request)
            times.append(time.perf_counter() - begun)
    return median(times) * 1e6


async def health(address, points):
    """Milliseconds of the longest health check while a batch of so many points is applied, and of the median one."""
    batch = batch_pb2.Batch(inserts=packed(np.random.default_rng(1).normal(size=(points, 2))))
    request = pb.ApplyRequest(name="health", batch=batch).SerializeToString()
    async with grpc.aio.insecure_channel(address, options=OPTIONS) as other, grpc.aio.insecure_channel(address) as own:
        await own.unary_unary(SERVICE + "CreateHull")(pb.CreateHullRequest(name="health").SerializeToString())
        check = own.unary_unary("/grpc.health.v1.Health/Check")
        await check(b"")
        applying = asyncio.ensure_future(other.unary_unary(SERVICE + "Apply")(request))
        times = []
        while not applying.done():
            begun = time.perf_counter()
            await check(b"")
            times.append(time.perf_counter() - begun)
        await applying
        await own.unary_unary(SERVICE + "DeleteHull")(pb.DeleteHullRequest(name="health").SerializeToString())
    return max(times) * 1e3, median(times) * 1e3


async def create(address, name):
    async with grpc.aio.insecure_channel(address) as channel:
        request = pb.CreateHullRequest(name=name).SerializeToString()
        await channel.unary_unary(SERVICE + "CreateHull")(request)
        batch = batch_pb2.Batch(inserts=packed(np.random.default_rng(0).normal(size=(100_000, 2))))
        await channel.unary_unary(SERVICE + "Apply")(pb.ApplyRequest(name=name, batch=batch).SerializeToString())


async def watch(address, name, seconds):
    """99th percentile of the delay in milliseconds from an acknowledgement to the last watcher's event that has it.

    The delay includes the watcher's own interval: it asked for so many events a second.
    """
    requests = cycle(name, 1000)
    acknowledged = {}
    delays = []
    async with grpc.aio.insecure_channel(address) as channel:
        watches = channel.unary_stream(SERVICE + "Watch", response_deserializer=pb.WatchResponse.FromString)

        async def follow(call):
            last = None
            async for event in call:
                now = time.perf_counter()
                if last is not None:
                    since = acknowledged.get(last + 1)
                    if since is not None:
                        delays.append(now - since)
                last = event.revision

        request = pb.WatchRequest(name=name, max_events_per_second=RATE).SerializeToString()
        calls = [watches(request) for _ in range(WATCHERS)]
        followers = [asyncio.create_task(follow(call)) for call in calls]
        stream = channel.stream_stream(SERVICE + "Stream", response_deserializer=pb.StreamResponse.FromString)()
        begun, sent = time.perf_counter(), 0
        while time.perf_counter() - begun < seconds:
            await stream.write(requests[sent % CYCLE])
            acknowledged[(await stream.read()).result.revision] = time.perf_counter()
            sent += 1
            await asyncio.sleep(begun + sent * 1000 / UPDATES_PER_SECOND - time.perf_counter())
        rate = sent * 1000 / (time.perf_counter() - begun)
        for call in calls:
            call.cancel()
        await asyncio.gather(*followers, return_exceptions=True)
    return quantiles(delays, n=100)[98] * 1e3, rate


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=5, help="connections, times 4 or 10 for short ones")
    parser.add_argument("--seconds", type=float, default=15.0, help="of the watchers")
    parser.add_argument("--only", default="", help="works whose name contains this")
    arguments = parser.parse_args()
    works = [
        ("Stream, 1 point a message", "msg/s", 4, lambda a: stream(a, cycle("bench", 1), 2_048)),
        ("Stream, 64 points a message", "msg/s", 4, lambda a: stream(a, cycle("bench", 64), 2_048)),
        ("Stream, 8,192 points a message", "msg/s", 1, lambda a: stream(a, cycle("bench", 8192), 192)),
        ("locate of one point, p50", "µs", 10, lambda a: locate(a, "bench", 100)),
    ]
    print(f"implementation: {dynhull.KERNEL}\n")
    print("| work | connections | empty handler | dynhull | ratio |\n|---|---|---|---|---|")
    with ExitStack() as stack:
        empty, ours = (stack.enter_context(running(command)) for command in (EMPTY, DYNHULL))
        asyncio.run(create(ours, "bench"))
        for work, unit, times, measure in works:
            if arguments.only not in work:
                continue
            connections = times * arguments.runs
            pairs = [(asyncio.run(measure(empty)), asyncio.run(measure(ours))) for _ in range(connections)]
            theirs, mine = (median(column) for column in zip(*pairs, strict=True))
            ratio = median(mine / theirs for theirs, mine in pairs)
            updates = f" ({mine * 8192 / 1e6:.2f} M updates/s)" if "8,192" in work else ""
            figures = f"{theirs:,.0f} {unit} | {mine:,.0f} {unit}{updates} | {ratio:.2f}"
            print(f"| {work} | {connections} | {figures} |", flush=True)
        if arguments.only in "health":
            longest, typical = zip(*(asyncio.run(health(ours, 1_000_000)) for _ in range(arguments.runs)), strict=True)
            work = "health check under a batch of 1,000,000 points"
            figures = f"longest {median(longest):.0f} ms, median {median(typical):.1f} ms"
            print(f"| {work} | {arguments.runs} | - | {figures} | - |", flush=True)
        if arguments.only in "watchers":
            delay, rate = asyncio.run(watch(ours, "bench", arguments.seconds))
            work = f"{WATCHERS} watchers at {RATE:.0f} Hz, {rate:,.0f} updates/s"
            print(f"| {work} | 1 | - | p99 delay {delay:.0f} ms | - |")


if __name__ == "__main__":
    main()
