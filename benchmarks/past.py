"""What the past costs and how fast it is read: `python benchmarks/past.py [--scale 1] [--repeat 3] [--folder .]`.

A fleet of keyed vehicles makes small steps. Parts, all of them unless `--parts` names some:

* writers: batches of one move that are acknowledged, by servers with a history and without one, which take their turns
  in many blocks, each until nothing is left to do. Segments are a quarter of what they are by default, and so come
  more often. Rates and processor times are ratios of pairs, with 95 percent intervals.
* bytes: what a move takes in segments, one and a thousand a batch, of positions with seven decimals and of full
  doubles; the states beside the segments are apart.
* as-of: a hull with a million points as it was a million batches of one move after the last state, from the journal and
  later from segments, each time the first read of this hull since the start; and again 200 batches later, five times.
* memory: the resident memory of a server before its first hull and with its first segments; and from then on, while
  100 million moves become the past, no faster than segments are written: the most in the second half, beside the most
  in the first quarter; and the slope in the second half, which `--scale 0.1` gives for a tenth of the moves.
* day: a day of 5,000 vehicles that report every ten seconds: a replay of it as fast as it is read, the way of one
  vehicle, and the events of a fence after the fact; beside what pyarrow takes to read the same files, unchecked.

Client and server share the machine. `--scale 0.01` is over in a minute. The folder should lie on the disk that counts.
Each row has its aim beside what was found; how far a part has come is told on standard error.
"""

import argparse
import asyncio
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median

import grpc
import numpy as np
import pyarrow.parquet as pq
from scipy.stats import linregress
from scipy.stats import t as student

import server
from dynhull.keys import PackedKeys
from dynhull_proto.v1 import batch_pb2, fence_pb2, fence_service_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

COMMAND = ["-m", "dynhull_server", "--port", "0", "--scrub-cpu", "0", "--log-level", "warning"]
MANY, DAY, VEHICLES, REPORTED = 10**6, 8640, 5000, 10**8
LOADED = 8192
NEAR = 1000
SEGMENT_SECONDS = 20  # after which another segment would have come
MOVES = 2**18  # of what is weighed
BLOCK, PAIRS = 2**17, 4  # batches of one turn of writers, and turns of each server in a round
SEGMENTS = 2  # in a turn
STEP, SETTLED, IDLE = 0.25, 2.5, 0.1  # seconds, and the share of a processor that is no work
PACE = 250_000  # moves a second
BEHIND = 5 * 10**6  # moves that segments may lack: those after the last snapshot but one are not due
SNAPSHOT = 250_000  # points of batches between snapshots, as by default
BAR = 20  # the width of one
CLOCK_OF_PROCESS = 2  # what Linux adds to the complement of a process's number: clock_getcpuclockid(3)
PARTS = ("writers", "bytes", "as-of", "memory", "day")


@dataclass
class Served:
    """A server of its own."""

    process: subprocess.Popen[str]
    address: str
    stub: HullServiceStub
    channel: grpc.Channel

    @property
    def processor(self) -> float:
        """The seconds of processor time that it has taken, to the nanosecond: /proc has hundredths of seconds."""
        return time.clock_gettime(~self.process.pid << 3 | CLOCK_OF_PROCESS)

    @property
    def megabytes(self) -> float:
        """Its resident memory."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@contextmanager
def serving(folder: Path | None, *options: str) -> Iterator[Served]:
    """A server of its own, in memory without a folder."""
    place = ["--in-memory"] if folder is None else ["--data", str(folder)]
    command = [sys.executable, *COMMAND, *place, *options]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            address = process.stdout.readline().split()[-1]
            with grpc.insecure_channel(address, options=server.OPTIONS) as channel:
                yield Served(process, address, HullServiceStub(channel), channel)
        finally:
            process.terminate()


class Fleet:
    """Vehicles that make small steps."""

    def __init__(self, size: int, decimals: int | None = 7) -> None:
        self.random = np.random.default_rng(size)
        self.places = self.random.uniform([-10, 40], [10, 60], (size, 2))
        self.names = [f"vehicle {number:07}" for number in range(size)]
        self.decimals = decimals

    def batch(self, who: np.ndarray) -> bytes:
        """A message with one batch: these vehicles move."""
        self.places[who] += self.random.normal(0, 1e-4, (len(who), 2))
        places = self.places[who] if self.decimals is None else np.round(self.places[who], self.decimals)
        packed = PackedKeys.pack([self.names[each] for each in who.tolist()])
        keys = points_pb2.Keys(lengths=packed.lengths, text=packed.data)
        batch = batch_pb2.Batch(puts=batch_pb2.Puts(keys=keys, points=server.packed(places)))
        return pb.StreamRequest(batches=[pb.NumberedBatch(batch=batch)]).SerializeToString()

    def all(self, size: int) -> list[bytes]:
        """Messages that move every vehicle once, so many at a time."""
        everyone = np.arange(len(self.names))
        return [self.batch(everyone[first : first + size]) for first in range(0, len(everyone), size)]

    def some(self, batches: int, size: int = 1) -> list[bytes]:
        """Messages that move some vehicles each."""
        return [self.batch(self.random.choice(len(self.names), size, replace=False)) for _ in range(batches)]


def create(served: Served, name: str, *, history: bool = True) -> None:
    config = hull_pb2.HullConfig(identity=hull_pb2.IDENTITY_STRING_KEYS)
    if history:
        config.history.SetInParent()
    served.stub.CreateHull(pb.CreateHullRequest(name=name, config=config))


def write(served: Served, name: str, messages: list[bytes]) -> float:
    """Batches a second, acknowledged."""
    return asyncio.run(server.together(served.address, name, messages))


def told(what: str, done: float | None = None) -> None:
    """Say what goes on, and which share of it is done, as a bar."""
    bar = "" if done is None else f"[{'#' * round(BAR * min(done, 1)):.<{BAR}}] "
    print(f"{time.strftime('%H:%M:%S')} {bar}{what}", file=sys.stderr, flush=True)


def write_until_filed(served: Served, name: str, moves: int, messages: list[bytes]) -> None:
    """Write these again and again, until segments have so many moves: snapshots come once a second at most."""
    while (found := served.stub.GetHistory(pb.GetHistoryRequest(name=name)).moves) < moves:
        told(f"{found:,} of {moves:,} moves are in segments", found / moves)
        write(served, name, messages)
        time.sleep(1)


def writers(folder: Path, scale: float, repeat: int) -> Iterator[str]:
    """With a history, of without one."""
    messages = Fleet(VEHICLES).some(int(BLOCK * scale))
    options = "--snapshot-points", str(max(VEHICLES, len(messages) // SEGMENTS))
    found: dict[bool, list[tuple[float, float]]] = {True: [], False: []}
    with ExitStack() as stack:
        kinds = (True, False)
        servers = {each: stack.enter_context(serving(folder / f"writers {each}", *options)) for each in kinds}
        for history, served in servers.items():
            create(served, "fleet", history=history)
            settle(served)
        for number in range(-1, PAIRS * repeat):  # the first is not counted: what writes segments is loaded
            for history in kinds if number % 2 else kinds[::-1]:
                before = servers[history].processor
                rate = write(servers[history], "fleet", messages)
                settle(servers[history])
                if number >= 0:
                    found[history].append((rate, servers[history].processor - before))
            rates = " and ".join(f"{each[-1][0]:,.0f}" for each in found.values() if each)
            told(f"writers: {rates or 'no'} batches/s counted with and without", (number + 1) / (PAIRS * repeat))
        filed = servers[True].stub.GetHistory(pb.GetHistoryRequest(name="fleet")).moves
    pairs = zip(found[True], found[False], strict=True)
    ratios = zip(*([mine / none for mine, none in zip(*pair, strict=True)] for pair in pairs), strict=True)
    rate, processor = map(ratio_of, ratios)
    off = median(rate for rate, _ in found[False])
    yield f"writers with a history ({filed:,} moves in segments), of {off:,.0f} batches/s without | >= 0.97 | {rate}"
    yield f"processor time of the server with a history, of that without | | {processor}"


def settle(served: Served) -> None:
    """Wait until a server has nothing left to do: snapshots and segments come once a second."""
    idle = 0.0
    while idle < SETTLED:
        before = served.processor
        time.sleep(STEP)
        idle = idle + STEP if served.processor - before < STEP * IDLE else 0.0


def ratio_of(ratios: Sequence[float]) -> str:
    """The geometric mean of ratios with its 95 percent interval, from the spread of their logarithms."""
    logs = np.log(ratios)
    if len(logs) < 2:
        return f"{ratios[0]:.3f}"
    half = float(student.ppf(0.975, len(logs) - 1)) * logs.std(ddof=1) / math.sqrt(len(logs))
    return (
        " to ".join(f"{math.exp(logs.mean() + each):.3f}" for each in (0, -half, half)).replace(" to ", " (", 1) + ")"
    )


def weighed(folder: Path, scale: float, _: int) -> Iterator[str]:
    """What a move takes."""
    for decimals, most in ((7, "10 (aim 6)"), (None, "16")):
        for size, many in ((1, "one move a batch"), (1000, "1,000 moves a batch")):
            fleet, moves = Fleet(VEHICLES, decimals), int(MOVES * scale)
            place = folder / f"bytes {decimals} {size}"
            with serving(place, "--snapshot-points", str(moves // 2)) as served:
                create(served, "fleet")
                write_until_filed(served, "fleet", moves, fleet.some(moves // size, size))
                found = served.stub.GetHistory(pb.GetHistoryRequest(name="fleet"))
                size_of = {
                    kind: sum(each.stat().st_size for each in place.rglob(f"*.{kind}.parquet")) / found.moves
                    for kind in ("batches", "state")
                }
            what = "full doubles" if decimals is None else f"{decimals} decimals"
            yield f"bytes a move, {what}, {many}; states: {size_of['state']:.1f} | <= {most} | {size_of['batches']:.2f}"
            told(f"bytes: {size_of['batches']:.2f} {what}, {many}")


def as_of(folder: Path, scale: float, repeat: int) -> Iterator[str]:
    """Seconds until a hull is there as it was, and until it is there some batches later."""
    many = int(MANY * scale)
    fleet = Fleet(many)
    options = "--snapshot-points", str(min(many, 100_000))
    with serving(folder / "as-of", *options) as served:
        for name in ("small", "large"):
            create(served, name)
        write(served, "small", Fleet(10).some(10))
        write(served, "large", fleet.all(LOADED))
        loaded = revision_of(served, "large")
        time.sleep(3)  # the snapshot of these
        write(served, "large", fleet.some(many - NEAR))
        last = revision_of(served, "large")
        told(f"as-of: {last - loaded:,} batches since the state at revision {loaded}")
    yield from looked_up(folder / "as-of", last - NEAR, repeat, options, "in the journal")
    with serving(folder / "as-of", *options) as served:
        write_until_filed(served, "large", 2 * many, fleet.some(many))
    yield from looked_up(folder / "as-of", last - NEAR, repeat, options, "in segments")


def looked_up(folder: Path, revision: int, repeat: int, options: tuple[str, ...], where: str) -> Iterator[str]:
    cold, near = [], []
    for number in range(repeat):
        with serving(folder, *options) as served:
            read_as_of(served, "small", 5)  # what reads is loaded
            time.sleep(2)
            cold.append(read_as_of(served, "large", revision))
            near += [read_as_of(served, "large", revision + step) for step in range(NEAR // 5, NEAR + 1, NEAR // 5)]
        told(f"as-of, {where}: {cold[-1]:.3f} s, then {median(near) * 1000:.1f} ms", (number + 1) / repeat)
    yield f"AS OF, batches {where}, cold, s | <= 0.6 | {median(cold):.3f}"
    yield f"AS OF, batches {where}, {NEAR // 5} later, ms | <= 5 | {median(near) * 1000:.1f}"


def read_as_of(served: Served, name: str, revision: int) -> float:
    begun = time.perf_counter()
    served.stub.GetHull(pb.GetHullRequest(name=name, at_revision=revision))
    return time.perf_counter() - begun


def revision_of(served: Served, name: str) -> int:
    return int(served.stub.GetHull(pb.GetHullRequest(name=name)).hull.revision)


def memory(folder: Path, scale: float, _: int) -> Iterator[str]:
    """Megabytes by which a server has grown: at once, with the first segments, and from then on."""
    fleet = Fleet(VEHICLES)
    messages = [message for _ in range(20) for message in fleet.all(VEHICLES)]
    each = VEHICLES * len(messages)
    rounds = max(16, int(REPORTED * scale) // each)
    used = []
    with serving(folder / "memory") as served:
        empty, moves = served.megabytes, 0
        create(served, "fleet")
        while served.stub.GetHistory(pb.GetHistoryRequest(name="fleet")).moves < 2 * SNAPSHOT:
            write(served, "fleet", messages)
            moves += each
            settle(served)
        loaded = served.megabytes
        yield f"memory with the first segments (what writes them is loaded), of {empty:.0f} MB, MB | | {loaded:.0f}"
        begun, first = time.monotonic(), moves
        for number in range(rounds):
            write(served, "fleet", messages)
            moves += each
            used.append(served.megabytes)
            while (filed := served.stub.GetHistory(pb.GetHistoryRequest(name="fleet")).moves) < moves - BEHIND:
                time.sleep(1)
            if number % 20 == 19:
                told(f"memory: {moves:,} moves, {filed:,} in segments, {used[-1]:.0f} MB", (number + 1) / rounds)
            time.sleep(max(0.0, begun + (moves - first) / PACE - time.monotonic()))
    early, late = max(used[: max(2, rounds // 4)]), max(used[rounds // 2 :])
    half = used[rounds // 2 :]
    slope, spread = (found * 10**8 for found in _slope(np.arange(len(half)) * float(each), np.array(half)))
    yield f"memory after {moves:,} moves, of {early:.0f} MB after a quarter, MB | +- 50 | {late - early:+.0f}"
    yield f"memory by which it grows in 10^8 moves, as in the second half, MB | +- 50 | {slope:+.0f} +- {spread:.0f}"


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """The slope of a line through points, and half of its 95 percent interval, as if these did not depend on others."""
    found = linregress(x, y)
    return float(found.slope), float(student.ppf(0.975, len(x) - 2) * found.stderr)


def day(folder: Path, scale: float, repeat: int) -> Iterator[str]:
    """Seconds to read a day in three ways; most of it is in segments, and the rest in the journal."""
    reports = max(int(DAY * scale), 10)
    fleet = Fleet(VEHICLES)
    options = "--snapshot-points", str(int(SNAPSHOT * min(scale, 1)))
    with serving(folder / "day", *options) as served:
        create(served, "fleet")
        for first in range(0, reports, 100):
            write(served, "fleet", [each for _ in range(min(100, reports - first)) for each in fleet.all(VEHICLES)])
            told(f"day: {min(first + 100, reports):,} of {reports:,} reports are written", (first + 100) / reports)
        wait_until_filed(served, "fleet")
        filed = served.stub.GetHistory(pb.GetHistoryRequest(name="fleet")).moves / (reports * VEHICLES)
    files = sorted(map(str, (folder / "day").rglob("*.batches.parquet")))
    replayed = pb.ReplayRequest(name="fleet", start_revision=0)
    keys = PackedKeys.pack([fleet.names[VEHICLES // 2]])
    tracked = pb.TrackRequest(
        name="fleet", start_revision=0, keys=points_pb2.Keys(lengths=keys.lengths, text=keys.data)
    )
    first = pb.TrackRequest(name="fleet", start_revision=0, end_revision=1, keys=tracked.keys)
    disk = fence_pb2.CircleArea(center_x=15.0, center_y=35.0, radius=10.0)
    fenced = fence_service_pb2.FenceEventsBetweenRequest(
        config=fence_pb2.FenceConfig(circle_area=disk, subject_hull="fleet"), start_revision=1
    )
    took: dict[str, list[float]] = {"replay": [], "track": [], "fence": []}
    for _ in range(repeat):
        with serving(folder / "day", *options) as served:
            fences = FenceServiceStub(served.channel)
            list(served.stub.Track(first))  # what reads is loaded
            calls = (served.stub.Track, tracked), (served.stub.Replay, replayed), (fences.FenceEventsBetween, fenced)
            for name, (call, request) in zip(("track", "replay", "fence"), calls, strict=True):
                begun = time.perf_counter()
                seen = sum(1 for _ in call(request))
                took[name].append(time.perf_counter() - begun)
                told(f"day: {name} {took[name][-1]:.2f} s, {seen:,} messages")
    pq.read_table(files[0])  # what reads is loaded
    of_pyarrow = median(timed(lambda: [pq.read_table(file) for file in files]) for _ in range(repeat))
    chosen = [("key", "==", fleet.names[VEHICLES // 2])]
    of_key = median(timed(lambda: pq.read_table(files, filters=chosen)) for _ in range(repeat))
    replay, track, fence = (median(each) for each in took.values())
    what = f"{reports:,} reports of {VEHICLES:,} vehicles, {filed:.0%} in segments"
    yield f"replay of {what}; pyarrow reads the rows in {of_pyarrow:.2f}, s | <= {15 * scale:g} | {replay:.2f}"
    yield f"way of one vehicle; pyarrow finds it in segments in {of_key:.2f}, s | <= 0.2 | {track:.2f}"
    yield f"fence after the fact, a disk, s | <= {5 * scale:g} | {fence:.2f}"


def wait_until_filed(served: Served, name: str) -> None:
    """Wait until there are segments, and no more come."""
    before = -1
    while (found := served.stub.GetHistory(pb.GetHistoryRequest(name=name)).moves) != before or not found:
        told(f"{found:,} moves are in segments")
        before = found
        time.sleep(SEGMENT_SECONDS)


def timed(function: Callable[[], object]) -> float:
    begun = time.perf_counter()
    function()
    return time.perf_counter() - begun


def main() -> None:
    parser = argparse.ArgumentParser(description="What the past costs and how fast it is read.")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to put the data (default: here)")
    parser.add_argument("--scale", type=float, default=1.0, help="part of all sizes (default 1)")
    parser.add_argument("--repeat", type=int, default=3, help="rounds; medians are printed (default 3)")
    parser.add_argument("--parts", nargs="*", default=PARTS, choices=PARTS, help="which parts (default: all)")
    options = parser.parse_args()
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    works = dict(zip(PARTS, (writers, weighed, as_of, memory, day), strict=True))
    print(f"| at scale {options.scale:g}, load {os.getloadavg()[0]:.1f} | aim | found |")
    print("| --- | --- | ---: |", flush=True)
    for part in options.parts:
        with tempfile.TemporaryDirectory(dir=options.folder) as folder:
            for row in works[part](Path(folder), options.scale, options.repeat):
                print(f"| {row} |", flush=True)


if __name__ == "__main__":
    main()
