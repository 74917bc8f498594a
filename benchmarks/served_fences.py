"""Fences in a durable server: `python benchmarks/served_fences.py [--works many moves hull] [--subjects N]`.

many: one client creates many polygon fences around many subjects, lists them, restarts the server and deletes them.
Columns: seconds of each, and seconds of the same start without fences.

moves: keyed moves of many subjects among many polygon fences, and the same moves in a server without fences, in turn.
Each subject walks at random; the length of a step decides how many moves make an event. Columns: batch, moves a second
without and with fences, the median of the ratios, and the share of moves that made an event.

hull: one fence around a hull that changes some times a second, and many subjects that stay. Columns: changes a second,
processor time of the server a change; the delay of events, from the moment at which the change is sent to the moment
at which its events are read, median and 99th percentile; and how many changes had events.

webhook: 10,000 subjects, each of which moves ten times a second, among 100 polygon fences, and a relay that delivers
the events to an HTTP endpoint; server, relay and endpoint are processes. Columns: the length of a step, moves a second,
events a second, how many were delivered, and their delay, from the moment at which the message with the move is due to
the moment at which the endpoint has the event; and the processor time of each process in a second.

stalled: single writes that make events each, in blocks, in pairs: one without anybody who watches, one with watches
that never read, of consumers that never acknowledge, once the server has sent them what they take. Columns: latency of
a write, median and 99th percentile, processor time of the server a write, and its memory at the end of the block; and
the ratios of the pairs.

emptied: one fence around a hull, and many subjects inside; the area is emptied in one batch and filled again, and the
fence is deleted, while another process writes to a hull of its own, one write after the other. Columns: seconds until
each of these is acknowledged, and the writes meanwhile: their number, and their latency, median and longest.
"""

import argparse
import asyncio
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import durability
import grpc
import numpy as np

import server
from dynhull_proto.v1 import batch_pb2, fence_pb2, hull_pb2
from dynhull_proto.v1 import fence_service_pb2 as fences
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub

WORKS = ["many", "moves", "hull", "webhook", "stalled", "emptied"]
NAME, OTHER, CONSUMER = "fleet", "other", "bench"
IN_FLIGHT = 8
LOADED = 8192
CORNERS = 8
NO_SNAPSHOTS = 10**12
AT_ONCE = 64  # fences created at a time
STALLED, CROSSING, WRITES = 8, 16, 250  # watches that never read, subjects that cross in a write, writes of a block
EVENT_BYTES = 2**20
REST = 0.3  # seconds
NO_READING_AHEAD = [("grpc.http2.bdp_probe", 0)]
MOVES = 2**18  # of a run, if these limits on its batches allow
FEWEST, MOST = 16, 2048
WALKERS, AREAS, PACE, TOGETHER = 10_000, 100, 10, 1000  # subjects, fences, moves a second of each, moves of a message
PACED_SECONDS, WARM_UP = 12, 2  # the first ones are not counted
DELIVERED_WITHIN = 60  # seconds after the last move
COVERED = 0.7  # of the side of a cell that a fence fills


def puts(keys: np.ndarray, places: np.ndarray) -> bytes:
    packed = {"packed_integers": keys.astype("<u8").tobytes()}
    batch = batch_pb2.Batch(puts=batch_pb2.Puts(keys=packed, points=server.packed(places)))
    return pb.StreamRequest(name=NAME, batch=batch).SerializeToString()


def send(address: str, messages: list[bytes]) -> float:
    """Messages a second."""
    return asyncio.run(server.stream(address, messages, len(messages), IN_FLIGHT))


def started(stack: ExitStack, folder: Path, *more: str) -> str:
    options = ["--data", str(folder), "--durability", "sync", "--snapshot-points", str(NO_SNAPSHOTS), *more]
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
    requests = [fences.CreateFenceRequest(name=f"fence/{i}", config=polygon(area)) for i, area in enumerate(areas)]
    await call_all(address, "CreateFence", requests)


async def delete_fences(address: str, number: int) -> None:
    await call_all(address, "DeleteFence", [fences.DeleteFenceRequest(name=f"fence/{i}") for i in range(number)])


async def call_all(address: str, method: str, requests: Iterable[object]) -> None:
    """Call a method with each request, some at a time."""
    async with grpc.aio.insecure_channel(address) as channel:
        call, left = getattr(FenceServiceStub(channel), method), iter(requests)

        async def work() -> None:
            for request in left:
                await call(request)

        await asyncio.gather(*(work() for _ in range(AT_ONCE)))


def polygon(area: np.ndarray) -> fence_pb2.FenceConfig:
    one = fence_pb2.Polygon(exterior=server.packed(area))
    return fence_pb2.FenceConfig(
        polygon_area=fence_pb2.PolygonArea(polygons=[one]), subject_hull=NAME, initial=fence_pb2.FENCE_INITIAL_NONE
    )


def events(address: str) -> int:
    """The number of all events so far."""
    return sum(fence.last_sequence for fence in all_fences(address))


def all_fences(address: str) -> Iterator[fence_pb2.Fence]:
    with grpc.insecure_channel(address) as channel:
        stub = FenceServiceStub(channel)
        token = ""
        while True:
            page = stub.ListFences(fences.ListFencesRequest(page_size=1000, page_token=token))
            yield from page.fences
            token = page.next_page_token
            if not token:
                return


def many(folder: Path, n: int, number: int) -> None:
    places = np.random.default_rng(0).random((n, 2))
    load = [puts(np.arange(i, min(i + LOADED, n)), places[i : i + LOADED]) for i in range(0, n, LOADED)]
    took: dict[str, float] = {}

    @contextmanager
    def timed(name: str) -> Iterator[None]:
        begun = time.perf_counter()
        yield
        took[name] = time.perf_counter() - begun

    with ExitStack() as stack:
        address = started(stack, folder / "many")
        send(address, load)
        with timed("create"):
            asyncio.run(create_fences(address, polygons(number)))
        with timed("list"):
            events(address)
    with ExitStack() as stack:
        with timed("start"):
            address = stack.enter_context(durability.serving("--data", str(folder / "many"), "--durability", "sync"))
        with timed("delete"):
            asyncio.run(delete_fences(address, number))
    with timed("start without fences"), durability.serving("--data", str(folder / "many")):
        pass
    print(f"\n| {number:,} fences, {n:,} subjects | {' | '.join(took)} |")
    print(f"| --- |{' ---: |' * len(took)}")
    print(f"| seconds | {' | '.join(f'{seconds:.2f}' for seconds in took.values())} |", flush=True)


def moves(folder: Path, n: int, number: int, batches: list[int], steps: list[float], repeat: int) -> None:
    random = np.random.default_rng(0)
    places = random.random((n, 2))
    with ExitStack() as stack:
        plain, fenced = (started(stack, folder / who) for who in ("plain", "fenced"))
        load = [puts(np.arange(i, min(i + LOADED, n)), places[i : i + LOADED]) for i in range(0, n, LOADED)]
        for address in (plain, fenced):
            send(address, load)
        asyncio.run(create_fences(fenced, polygons(number)))
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


def webhook(folder: Path, steps: list[float]) -> None:
    print(
        "\n| step | moves/s | events/s | delivered | delay, median | p99 | longest | CPU of server | relay | endpoint |"
    )
    print("| ---: |" + " ---: |" * 9)
    every = np.array_split(np.arange(WALKERS), WALKERS // TOGETHER)
    for step in steps:
        random = np.random.default_rng(0)
        places = random.random((WALKERS, 2))
        with ExitStack() as stack:
            address = started(stack, folder / f"webhook-{step}")
            send(address, [puts(np.arange(WALKERS), places)])
            asyncio.run(create_fences(address, polygons(AREAS)))
            endpoint, port = started_endpoint(stack)
            relay = started_relay(stack, address, port, folder / f"relay-{step}")
            messages = []
            for _ in range(PACED_SECONDS * PACE):
                places = (places + random.normal(0, step, places.shape)) % 1.0
                messages += [puts(keys, places[keys]) for keys in every]
            processes = [next(pid for pid in processor_times() if pid not in (relay.pid, endpoint.pid)), relay.pid]
            processes.append(endpoint.pid)
            before = processor_times()
            due, took = asyncio.run(send_paced(address, messages, PACE * len(every)))
            wait_until_acknowledged(address)
            after, total = processor_times(), events(address)
            endpoint.terminate()
            arrived = [line.split() for line in endpoint.communicate()[0].splitlines()]
        delays = sorted(float(at) - due[int(revision)] for _, revision, at in arrived if int(revision) in due)
        p99 = delays[min(len(delays) - 1, int(len(delays) * 0.99))]
        delay = " | ".join(f"{each * 1e3:.0f} ms" for each in (statistics.median(delays), p99, delays[-1]))
        shares = " | ".join(f"{(after[pid] - before[pid]) / took:.0%}" for pid in processes)
        delivered = f"{len({event for event, *_ in arrived}):,} of {total:,}"
        rates = f"{len(messages) * TOGETHER / took:,.0f} | {total / took:,.0f}"
        print(f"| {step:g} | {rates} | {delivered} | {delay} | {shares} |", flush=True)


async def send_paced(address: str, messages: list[bytes], rate: int) -> tuple[dict[int, float], float]:
    """Send messages at this rate, and read the answers: when each revision was due, of those counted, and the time."""
    due: dict[int, float] = {}
    async with grpc.aio.insecure_channel(address, options=server.OPTIONS) as channel:
        method = channel.stream_stream(server.SERVICE + "Stream", response_deserializer=pb.StreamResponse.FromString)
        call, begun = method(), time.monotonic()

        async def write() -> None:
            for number, message in enumerate(messages):
                await asyncio.sleep(begun + number / rate - time.monotonic())
                await call.write(message)
            await call.done_writing()

        writing = asyncio.create_task(write())
        for number in range(len(messages)):
            response = await call.read()
            if number >= WARM_UP * rate:
                due[response.result.revision] = begun + number / rate
        await writing
        return due, time.monotonic() - begun


def started_endpoint(stack: ExitStack) -> tuple[subprocess.Popen[str], int]:
    """A process that receives events, and its port."""
    command = [sys.executable, str(Path(__file__).with_name("endpoint.py"))]
    process = stack.enter_context(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
    stack.callback(process.terminate)
    assert process.stdout is not None
    return process, int(process.stdout.readline())


def started_relay(stack: ExitStack, address: str, port: int, state: Path) -> subprocess.Popen[bytes]:
    """A relay of all fences to an endpoint, whose consumers are there."""
    names = [f"fence/{number}" for number in range(AREAS)]
    command = [str(Path(sys.executable).with_name("dynhull")), "relay", *names, "--consumer", CONSUMER, "--unsigned"]
    command += ["--to", f"http://127.0.0.1:{port}/{{fence}}", "--allow-private", "--batch", "1000"]
    process = subprocess.Popen([*command, "--address", address, "--state", str(state)], stderr=subprocess.DEVNULL)
    stack.enter_context(process)
    stack.callback(process.terminate)
    wait_for(lambda: all(fence.consumers for fence in all_fences(address)))
    return process


def wait_until_acknowledged(address: str) -> None:
    wait_for(lambda: not any(consumer.backlog for fence in all_fences(address) for consumer in fence.consumers))


def wait_for(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + DELIVERED_WITHIN
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError("what was waited for has not come in time")
        time.sleep(0.1)


def stalled(folder: Path, pairs: int) -> None:
    """Blocks of writes in pairs, in one of which watches are open that are never read; either comes first in turn."""
    inside, outside = np.full((CROSSING, 2), 0.5), np.full((CROSSING, 2), 5.0)
    requests = [
        pb.ApplyRequest(name=NAME, batch=area_batch(np.arange(CROSSING), places)) for places in (inside, outside)
    ]
    found: dict[bool, list[tuple[float, ...]]] = {False: [], True: []}
    with ExitStack() as stack:
        # Little memory for recent events, which are there in either case: it is full before the first pair.
        address = started(stack, folder / "stalled", "--fence-event-bytes", str(EVENT_BYTES))
        # gRPC reads ahead of who does not read, the more the faster the connection is: not here.
        channel = stack.enter_context(grpc.insecure_channel(address, NO_READING_AHEAD))
        stub, fence_stub = stack.enter_context(durability.service(address)), FenceServiceStub(channel)
        around = polygon(np.array([[0, 0], [1, 0], [1, 1], [0, 1]], float))
        fence_stub.CreateFence(fences.CreateFenceRequest(name="around", config=around))
        for number in range(-2, 2 * pairs):  # the first two are not counted
            is_stalled = number % 4 in (1, 2)
            watches = [
                fence_stub.WatchFence(fences.WatchFenceRequest(name="around", consumer=f"idle-{each}"))
                for each in range(STALLED if is_stalled else 0)
            ]
            wait_for(at_rest)
            times, cpu = [], processor_seconds()
            for write in range(WRITES):
                begun = time.perf_counter()
                stub.Apply(requests[write % 2])
                times.append(time.perf_counter() - begun)
            times.sort()
            if number >= 0:
                cpu = (processor_seconds() - cpu) / WRITES
                found[is_stalled].append((statistics.median(times), times[int(len(times) * 0.99)], cpu, resident()))
            for watch in watches:
                watch.cancel()
    print("\n| | median | p99 | CPU | memory |")
    print("| --- | ---: | ---: | ---: | ---: |")
    for is_stalled, rows in found.items():
        median, p99, cpu, memory = (statistics.median(column) for column in zip(*rows, strict=True))
        who = f"with {STALLED} stalled watches" if is_stalled else "without a watch"
        times = " | ".join(f"{seconds * 1e3:.2f} ms" for seconds in (median, p99, cpu))
        print(f"| {who} | {times} | {memory / 2**20:.1f} MB |")
    both = [np.array(found[is_stalled]) for is_stalled in (True, False)]
    low, middle, high = np.percentile(both[0] / both[1], [25, 50, 75], axis=0)
    shown = " | ".join(f"{m:.3f} ({a:.3f} to {b:.3f})" for a, m, b in zip(low, middle, high, strict=True))
    print(f"| ratio of {pairs} pairs: median, quartiles | {shown} |", flush=True)


def emptied(folder: Path, n: int) -> None:
    places = np.random.default_rng(2).random((n, 2))
    keys, corners = np.arange(4), np.array([[-1, -1], [2, -1], [2, 2], [-1, 2]], float)
    empty = batch_pb2.Batch(removes={"packed_integers": keys.astype("<u8").tobytes()})
    print("\n| | seconds | other writes | median | longest |")
    print("| --- | ---: | ---: | ---: | ---: |")
    with ExitStack() as stack:
        address = started(stack, folder / "emptied")
        send(address, [puts(np.arange(i, min(i + LOADED, n)), places[i : i + LOADED]) for i in range(0, n, LOADED)])
        stub, channel = stack.enter_context(durability.service(address)), grpc.insecure_channel(address)
        fence_stub = FenceServiceStub(stack.enter_context(channel))
        config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_INTEGER_KEYS)
        for name in ("area", OTHER):
            stub.CreateHull(pb.CreateHullRequest(name=name, config=config))
        fill = pb.ApplyRequest(name="area", batch=area_batch(keys, corners))
        stub.Apply(fill)
        around = fence_pb2.FenceConfig(
            hull_area=fence_pb2.HullArea(name="area"), subject_hull=NAME, initial=fence_pb2.FENCE_INITIAL_NONE
        )
        fence_stub.CreateFence(fences.CreateFenceRequest(name="around", config=around))
        works: dict[str, Callable[[], object]] = {
            "nothing": lambda: time.sleep(1),
            "emptied": lambda: stub.Apply(pb.ApplyRequest(name="area", batch=empty)),
            "filled again": lambda: stub.Apply(fill),
            "deleted": lambda: fence_stub.DeleteFence(fences.DeleteFenceRequest(name="around")),
        }
        for what, work in works.items():
            wait_for(at_rest)
            command = [sys.executable, __file__, "--write-to", address]
            with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
                assert other.stdout is not None
                other.stdout.readline()
                begun = time.perf_counter()
                work()
                took = time.perf_counter() - begun
                times = sorted(map(float, other.communicate("")[0].split()))
            latencies = " | ".join(f"{each * 1e3:.1f} ms" for each in (statistics.median(times), times[-1]))
            print(f"| {what} | {took:.2f} | {len(times):,} | {latencies} |", flush=True)


def write_to(address: str) -> None:
    """Write to a hull, one write after the other, until the standard input ends; print how long each took."""
    ended, times = threading.Event(), []
    threading.Thread(target=lambda: (sys.stdin.read(), ended.set()), daemon=True).start()
    with durability.service(address) as stub:
        stub.Apply(pb.ApplyRequest(name=OTHER, batch=area_batch(np.arange(1), np.zeros((1, 2)))))
        print("writing", flush=True)
        while not ended.is_set():
            begun = time.perf_counter()
            stub.Apply(pb.ApplyRequest(name=OTHER, batch=area_batch(np.arange(1), np.full((1, 2), begun))))
            times.append(time.perf_counter() - begun)
    print(*times)


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


def at_rest() -> bool:
    """Whether the processes that this one has started have done almost nothing for a moment."""
    before = processor_seconds()
    time.sleep(REST)
    return processor_seconds() - before <= REST / 10


def processor_seconds() -> float:
    """The processor time of all processes that this one has started, so far."""
    return sum(processor_times().values())


def processor_times() -> dict[int, float]:
    """The processor time of each of these processes."""
    tick = os.sysconf("SC_CLK_TCK")
    return {pid: (int(fields[11]) + int(fields[12])) / tick for pid, fields in children()}


def resident() -> float:
    """The bytes of memory of these processes."""
    return sum(int(fields[21]) for _, fields in children()) * os.sysconf("SC_PAGE_SIZE")


def children() -> Iterator[tuple[int, list[str]]]:
    """The number of each process that this one has started, and the fields of /proc/PID/stat after its name."""
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except (OSError, IndexError):  # it has ended
            continue
        if int(fields[1]) == os.getpid():
            yield int(stat.parent.name), fields


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--works", nargs="+", choices=WORKS, default=WORKS)
    parser.add_argument("--subjects", type=float, default=1e6)
    parser.add_argument("--fences", type=float, default=23_000)
    parser.add_argument("--batches", type=int, nargs="+", default=[64, 8192])
    parser.add_argument("--steps", type=float, nargs="+", default=[5e-5, 4e-4], help="standard deviation of a move")
    parser.add_argument("--walks", type=float, nargs="+", default=[2e-4, 1e-3], help="the same, for `webhook`")
    parser.add_argument("--rates", type=float, nargs="+", default=[10, 100], help="changes of the hull a second")
    parser.add_argument("--seconds", type=float, default=10, help="of each of these rates")
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--folder", type=Path, default=Path(), help="where the servers put their data (default: here)")
    parser.add_argument("--write-to", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.write_to is not None:
        write_to(arguments.write_to)
        return
    print(f"load average {os.getloadavg()[0]:.1f}")
    with tempfile.TemporaryDirectory(dir=arguments.folder) as data:
        if "many" in arguments.works:
            many(Path(data), int(arguments.subjects), int(arguments.fences))
        if "moves" in arguments.works:
            number = int(arguments.fences)
            moves(Path(data), int(arguments.subjects), number, arguments.batches, arguments.steps, arguments.repeat)
        if "hull" in arguments.works:
            hull(Path(data), int(arguments.subjects), arguments.rates, arguments.seconds)
        if "webhook" in arguments.works:
            webhook(Path(data), arguments.walks)
        if "stalled" in arguments.works:
            stalled(Path(data), 5 * arguments.repeat)
        if "emptied" in arguments.works:
            emptied(Path(data), int(arguments.subjects))
    print(f"\nload average at the end {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
