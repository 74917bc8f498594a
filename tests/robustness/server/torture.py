"""Torture of a real server, after etcd's robustness suite: writers, readers, watchers, and a process that keeps dying.

    python tests/robustness/server/torture.py --faults 50

Writers number their batches and keep a few under way. After a broken connection they ask the server for the last
number, and send the batches after it again. They write points, keys with event times, deadlines and windows, and move
keys between two hulls. After every fault models check each promise of docs/guarantees.md:

* an acknowledged batch is there; an unacknowledged one is there whole or not at all; none is there twice
* a batch to several hulls is in all of them or in none, and a reader that has seen it in one finds it in the others
* keys, positions, times, vertices and their names are those of the model at the hull's clock: no point has left early,
  and none is late
* the clock of a hull never goes back, and is that of the data, or not ahead of the time
* no reader ever sees a revision below one it has seen, or below what was acknowledged before it asked
* a watcher's copy is the exact hull, with the names of its vertices, at the revision and clock of each event
* the hull is the one that a static algorithm finds, here and in the server
* callers that cancel a call, and a server that is out of file descriptors, change nothing of this
* a server that starts with its wall clock an hour back changes nothing of this either
* a server whose data have one changed bit does not start, and reports why; or it keeps all this except for the last
  batches, and reports that it lost them
* a backup of the running server, and a restore of a killed one's folder, have every batch acknowledged before
* a server that begins again with a restored backup has what was in it; what resumes begins anew, and a writer with
  numbers from after the backup gets RESTORED with the last number that is kept
* after each fault all writers get batches acknowledged again; with --record it is noted how long that took
"""

import argparse
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext, suppress
from pathlib import Path

import grpc
import numpy as np

import dynhull
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

sys.path.append(str(Path(__file__).parents[2] / "support"))
import wall_clock
from actors import (
    Leaver,
    PointWriter,
    Reader,
    Shared,
    TogetherReader,
    Watcher,
    last_sequence,
    persist,
)
from cluster import processes
from pacing import pause
from patience import PATIENCE
from promises import require
from proxy import Proxy
from record import recorded
from server_process import run
from small_disk import arguments, on_small_disk
from timed import ModelledHull, Shuttle, TimedWriter, wall
from timeline import FLEETS, SECOND, TIMED
from tortured import Server, killed_at_the_end

HULL = "tortured"
POINT_WRITERS = 2
WORKERS = ("--workers", "2", "--gateways", "2")
DISK = "64m"
PAGE_BYTES = 8192  # of the database
CLOCK_BACK = "clock_back" if shutil.which("faketime") else "kill"
KINDS = ["kill", CLOCK_BACK, "descriptors", "damage", "kill", "full_disk", "pause", "copy", "restore", "sever"]
OF_WORKERS = [
    "kill_worker",
    "kill_gateway",
    "restart",
    "kill_worker",
    "pause_worker",
    "full_disk",
    "copy",
    "sever",
    "restore",
]
ON_ITS_WAY = 0.1  # seconds in which answers of a server that has been killed may still arrive


class Torture:
    """A server, its clients, the model, and the faults. Of a subclass with `shards`, hulls that can be divided are."""

    shards = 0

    def __init__(
        self,
        folder: Path,
        seed: int,
        breath: float,
        options: Sequence[str] = (),
        journal: str = "",
        tls: grpc.ChannelCredentials | None = None,
    ) -> None:
        self._folder, self._options, self._journal = folder, options, journal
        self._seed, self._random = seed, random.Random(seed)
        self.server = self._first_server()
        self.server.start()
        self._started = wall(), time.monotonic()
        self._proxy = Proxy(self.server.address)
        self.shared = Shared(self._proxy.address, tls, breath)
        self._channel, self._stub = self.shared.stub()
        persist(self._stub.CreateHull, pb.CreateHullRequest(name=HULL, config={"shards": self.shards}))
        for kind in (*TIMED, *FLEETS):
            config = kind.config()
            if kind in TIMED and not kind.geographic and not kind.max_points:
                config.shards = self.shards
            persist(self._stub.CreateHull, pb.CreateHullRequest(name=kind.name, config=config))
        points = [PointWriter(self.shared, i, HULL, seed + i) for i in range(POINT_WRITERS)]
        timed = [TimedWriter(self.shared, kind, seed + i) for i, kind in enumerate(TIMED)]
        shuttles = [Shuttle(self.shared, i, seed + i) for i in range(2)]
        self.hulls = [ModelledHull(self.shared, writer.kind, [writer]) for writer in timed]
        self.hulls += [ModelledHull(self.shared, kind, shuttles) for kind in FLEETS]
        self.writers = [*points, *timed, *shuttles]
        self._point_writers, self._timed_writers = points, timed
        self.readers = [self._new_reader(), TogetherReader(self.shared, shuttles[0].hulls)]
        self._copies = [Watcher(self.shared, f"watcher-{i}", HULL) for i in range(2)]
        self.watchers = [*self._copies, *(hull.watcher for hull in self.hulls)]
        self.leavers = [Leaver(self.shared, f"leaver-{i}", HULL, seed + i) for i in range(2)]
        self.faults: Counter[str] = Counter()
        self.damage: Counter[str] = Counter()
        self.seconds: list[float] = []
        self._began: float | None = None
        for actor in (*self.writers, *self.readers, *self.watchers, *self.leavers):
            actor.start()
        self.shared.gate.set()

    def _first_server(self) -> Server:
        return Server(self._folder, self._options, self._journal)

    def _new_reader(self, target: str = "") -> Reader:
        return Reader(self.shared, HULL, self.acknowledged, target)

    def acknowledged(self) -> int:
        """The revision of the points that no answer to a call from now on may be below."""
        return sum(writer.acknowledged for writer in self._point_writers)

    def round(self, fault: str) -> None:
        """Traffic, a fault during it, the checks that must hold at once, and those that must hold at rest."""
        self.faults[fault] += 1
        pause(self._random.uniform(0.05, 0.6))
        self._began = None
        getattr(self, f"_{fault}")()
        self.shared.gate.set()
        self._wait_until_served(self._began or time.monotonic())
        pause(self._random.uniform(0.05, 0.3))
        self._settle()
        self._check()
        self.shared.gate.set()

    def _begins(self) -> None:
        """From now on it counts how long it takes until all is served again; else from the end of the fault on."""
        self._began = time.monotonic()

    def _wait_until_served(self, since: float) -> None:
        """Count from now on how long it takes until all is served again; else that begins with the end of the fault."""
        least = since + ON_ITS_WAY
        self._wait(lambda: all(writer.moments and writer.moments[-1] > least for writer in self.writers))
        firsts = [next(moment for moment in writer.moments if moment > least) for writer in self.writers]
        self.seconds.append(max(firsts) - since)
        for writer in self.writers:
            writer.moments = []

    def _wait(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            self._raise_failures()
            require(time.monotonic() < deadline, f"after {self.faults} not all is served again within {PATIENCE} s")
            pause(0.02)

    def _start(self, wrap: Sequence[str] = ()) -> None:
        """Start the killed server."""
        self.server.start(wrap)
        self._started = self._latest_time(), time.monotonic()

    def _latest_time(self) -> int:
        """The latest time that the server has shown, or at which it was first started."""
        clocks = [each.clock for each in self._timed_writers if each.kind.follows_server and each.clock is not None]
        return max([self._started[0], *clocks])

    def _kill(self) -> None:
        self.shared.gate.clear()
        self.server.kill()
        self._begins()
        self._proxy.cut()
        self._start()

    def _clock_back(self) -> None:
        """A kill, and a start with the wall clock an hour back."""
        self.shared.gate.clear()
        self.server.kill()
        self._begins()
        self._proxy.cut()
        self._start(wall_clock.at("-1h"))

    def _pause(self) -> None:
        self.server.process.send_signal(signal.SIGSTOP)
        pause(self._random.uniform(0.1, 1.0))
        self.server.process.send_signal(signal.SIGCONT)

    def _kill_worker(self) -> None:
        self._kill_one_of("worker")

    def _kill_gateway(self) -> None:
        self._kill_one_of("gateway")

    def _kill_one_of(self, kind: str) -> None:
        """A kill of one process of several, which the server starts again."""
        self._begins()
        with suppress(ProcessLookupError):  # a restart of all may be under way, and have ended it
            os.kill(self._one_of(kind), signal.SIGKILL)

    def _pause_worker(self) -> None:
        worker = self._one_of("worker")
        with suppress(ProcessLookupError):  # as above
            os.kill(worker, signal.SIGSTOP)
            pause(self._random.uniform(0.1, 1.0))
            os.kill(worker, signal.SIGCONT)

    def _restart(self) -> None:
        """All processes are restarted, one at a time."""
        self.server.process.send_signal(signal.SIGHUP)

    def _one_of(self, kind: str) -> int:
        found = processes(self.server.process.pid)
        return self._random.choice([number for name, number in sorted(found.items()) if name.startswith(kind)])

    def _sever(self) -> None:
        self._proxy.cut()

    def _full_disk(self) -> None:
        ballast = self._folder / "ballast"
        with suppress(OSError), ballast.open("wb") as file:
            while True:
                file.write(bytes(2**16))
        pause(self._random.uniform(0.2, 0.8))
        if self._random.random() < 0.5:
            self.server.kill()
            ballast.unlink()
            self._start()
        else:
            ballast.unlink()

    def _descriptors(self) -> None:
        """For a while the server can open no file and accept no connection."""
        pid = self.server.process.pid
        before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        used = max(int(each.name) for each in Path(f"/proc/{pid}/fd").iterdir())
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (used, before[1]))
        pause(self._random.uniform(0.2, 1.5))
        self._proxy.cut()
        pause(self._random.uniform(0.2, 0.8))
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)

    def _copy(self) -> None:
        """A backup of the running server, and a restore of a killed one's folder: both are served, and are right."""
        acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
        with tempfile.TemporaryDirectory() as folder:
            copied = Server(Path(folder), self._options)
            self._command("backup", str(copied.data), "--data", str(self.server.data))
            self.shared.gate.clear()
            self._check_copy(copied, acknowledged)
        self.server.kill()
        acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
        with tempfile.TemporaryDirectory() as folder:
            restored = Server(Path(folder), self._options)
            self._command("restore", str(self.server.data), "--data", str(restored.data))
            self._proxy.cut()
            self._start()
            self._check_copy(restored, acknowledged)

    def _restore(self) -> None:
        """A backup is restored in place of the folder, and a writer with later numbers is told so."""
        self._settle()
        request = pb.ApplyRequest(name="restored", producer="early")
        request.batch.inserts.coordinates.extend([0.0, 0.0])

        def send() -> None:
            request.sequence += 1
            persist(self._stub.Apply, request)

        persist(self._stub.Apply, pb.ApplyRequest(name="restored", batch=request.batch))  # it creates the hull
        last = persist(self._stub.GetProducer, pb.GetProducerRequest(name="restored", producer="early"))
        request.sequence, request.uid = last.last_sequence, last.uid
        send()
        kept = request.sequence
        with tempfile.TemporaryDirectory() as folder:
            backup = Path(folder) / "backup"
            self._command("backup", str(backup), "--data", str(self.server.data))
            send()
            self.server.kill()
            self._begins()
            shutil.rmtree(self.server.data)
            self._command("restore", str(backup), "--data", str(self.server.data))
        self._proxy.cut()
        self._start()
        request.sequence += 1
        try:
            persist(self._stub.Apply, request)
        except grpc.RpcError as error:
            require(f"number {kept}:" in error.details(), f"a writer from before a restore: {error.details()}")
        else:
            require(False, "a restored hull takes numbers from before")

    def _command(self, *words: str) -> None:
        done = run(*words)
        require(done.returncode == 0, f"dynhull {' '.join(words)}: {done.stderr}")

    def _check_copy(self, copied: Server, acknowledged: dict[str, int]) -> None:
        copied.start()
        with killed_at_the_end(copied), grpc.insecure_channel(copied.address) as channel:
            self._check_copied(HullServiceStub(channel), acknowledged, copied)

    def _check_copied(self, stub: HullServiceStub, acknowledged: dict[str, int], copied: Server) -> None:
        last = self._check_damaged(stub, acknowledged, copied, "a copy")
        for name, count in acknowledged.items():
            require(last[name] >= count, f"{name}: of {count} batches acknowledged the copy has {last[name]}")

    def _damage(self) -> None:
        """A kill, and a second server on a copy of the data in which one bit is flipped."""
        self.shared.gate.clear()
        self.server.kill()
        with tempfile.TemporaryDirectory() as folder:
            damaged = Server(Path(folder))
            shutil.copytree(self.server.data, damaged.data)
            self._proxy.cut()
            self._start()
            acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
            where = self._flip_bit(damaged.data)
            if damaged.starts():
                with killed_at_the_end(damaged), grpc.insecure_channel(damaged.address) as channel:
                    self._check_damaged(HullServiceStub(channel), acknowledged, damaged, where)
                self.damage["served"] += 1
            else:
                require("cannot serve: " in damaged.said(), f"{where}: {damaged.said()}")
                require("Traceback" not in damaged.said(), f"{where}: {damaged.said()}")
                self.damage["refused"] += 1

    def _flip_bit(self, data: Path) -> str:
        """Any bit, or one of a header: they are few, and more depends on them."""
        files = [file for file in sorted(data.iterdir()) if file.stat().st_size and file.suffix != ".db-shm"]
        file = self._random.choices(files, [file.stat().st_size for file in files])[0]
        content = bytearray(file.read_bytes())
        place = self._random.randrange(len(content))
        if self._random.random() < 0.5:
            place = self._random.choice(list(self._header_bytes(file, len(content))))
        content[place] ^= 1 << self._random.randrange(8)
        file.write_bytes(content)
        return f"a bit of byte {place} of {file.name} changed"

    def _header_bytes(self, file: Path, size: int) -> Iterator[int]:
        """The places of the database's first header, or of the log's and all its frames'."""
        if file.suffix != ".db-wal":
            yield from range(min(100, size))
            return
        yield from range(min(32, size))
        for frame in range(32, size - 24, 24 + PAGE_BYTES):
            yield from range(frame, frame + 24)

    def _check_damaged(
        self, stub: HullServiceStub, acknowledged: dict[str, int], server: Server, where: str
    ) -> dict[str, int]:
        """It must hold whole batches, the first n of each writer; returns n for each writer."""
        last = {}
        for writer in self.writers:
            numbers = {last_sequence(stub, hull, writer.name) // writer.stride for hull in writer.hulls}
            require(len(numbers) == 1, f"{where}: a batch of {writer.name} is only in some of {writer.hulls}")
            last[writer.name] = numbers.pop()
        points, revision = self._points(last)
        hull = stub.GetHull(pb.GetHullRequest(name=HULL), timeout=PATIENCE).hull
        require(hull.revision == revision, f"{where}: revision {hull.revision} of batches {last}")
        require(hull.point_count == points.total(), f"{where}: {hull.point_count} points of {points.total()}")
        require(stub.Verify(pb.VerifyRequest(name=HULL), timeout=PATIENCE).equal, f"{where}: the hull is wrong")
        self._check_counts(stub, points)
        for each in self.hulls:
            each.check_copy(stub, last, where)
        lost = {name: count for name, count in acknowledged.items() if last[name] < count}
        said = server.said()
        require(not lost or "lost" in said, f"{where}: of batches {acknowledged} there are {last}, and nothing is said")
        return last

    def _settle(self) -> None:
        """Wait until every batch is acknowledged, and no writer sends another."""
        self.shared.gate.clear()
        for writer in self.writers:
            deadline = time.monotonic() + PATIENCE
            while not (writer.idle.wait(0.05) and writer.acknowledged == len(writer.batches)):
                self._raise_failures()
                require(time.monotonic() < deadline, f"{writer.name} does not get its batches acknowledged")

    def _check(self) -> None:
        self._raise_failures()
        points, revision = self._points({writer.name: len(writer.batches) for writer in self.writers})
        answer = persist(self._stub.GetHull, pb.GetHullRequest(name=HULL, min_revision=revision))
        require(answer.hull.revision == revision, f"revision {answer.hull.revision} after {revision} batches")
        require(answer.hull.point_count == points.total(), f"{answer.hull.point_count} points of {points.total()}")
        expected = dynhull.static.monotone_chain(np.array(sorted(points), dtype=float).reshape(-1, 2))
        held = persist(self._stub.Verify, pb.VerifyRequest(name=HULL))
        require(held.equal, "the live hull differs from Chan's recomputation")
        for watcher in self._copies:
            copy = watcher.vertices_at(revision)
            require(np.array_equal(copy, expected), f"{watcher.name}'s copy is not the hull at {revision}")
        self._check_counts(self._stub, points)
        latest, started = self._started
        now = latest + round((time.monotonic() - started) * SECOND)  # or later, if the wall clock is later
        for hull in self.hulls:
            hull.check_at_rest(self._stub, now)
        self._raise_failures()

    def _check_counts(self, stub: HullServiceStub, points: Counter[tuple[float, float]]) -> None:
        sample = self._random.sample(sorted(points), min(50, len(points)))
        query = pb.CountRequest(name=HULL)
        query.points.packed = np.array(sample, dtype=float).tobytes()
        counts = list(persist(stub.Count, query).counts)
        require(counts == [points[p] for p in sample], "points are there more or less often than they were inserted")

    def _points(self, last: dict[str, int]) -> tuple[Counter[tuple[float, float]], int]:
        """The points after the first `last[name]` batches of each writer, and the number of these batches."""
        points: Counter[tuple[float, float]] = Counter()
        for writer in self._point_writers:
            for inserts, deletes in writer.batches[: last[writer.name]]:
                points.update(map(tuple, inserts.tolist()))
                points.subtract(map(tuple, deletes.tolist()))
        return +points, sum(last[writer.name] for writer in self._point_writers)

    def _raise_failures(self) -> None:
        if self.shared.failures:
            raise self.shared.failures[0]

    def counts(self) -> str:
        """What was done and seen, in a line."""
        acknowledged = sum(writer.acknowledged for writer in self.writers)
        kinds = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in sorted(self.faults.items()))
        return (
            f"faults: {kinds}; batches acknowledged: {acknowledged}, lost: 0, doubled: 0; "
            f"reads: {sum(reader.reads for reader in self.readers)}, revisions back: 0, stale: 0; "
            f"watch events after a resume: {sum(watcher.resumed for watcher in self.watchers)}; "
            f"calls left: {sum(leaver.left for leaver in self.leavers)}"
        )

    def rounds(self, kinds: Sequence[str], faults: int, *, record: bool) -> None:
        """That many rounds, of each kind in turn, and the end."""
        try:
            with recorded(self._seed, self.faults, self.seconds) if record else nullcontext():
                for i in range(faults):
                    self.round(kinds[i % len(kinds)])
                    print(f"\rseed {self._seed}, {i + 1}/{faults} faults", end="", file=sys.stderr, flush=True)
        finally:
            self.finish()

    def finish(self) -> None:
        self.shared.over.set()
        self.shared.gate.set()
        self._channel.close()
        self._proxy.close()
        self._end_servers()

    def _end_servers(self) -> None:
        self.server.process.terminate()
        self.server.process.wait()


def torture(folder: Path, options: argparse.Namespace) -> str:
    """Run `faults` rounds. Returns the counts; raises BrokenPromiseError with the broken promise."""
    run = Torture(folder, options.seed, options.breath, options=WORKERS if options.workers else ())
    run.rounds(options.kinds or (OF_WORKERS if options.workers else KINDS), options.faults, record=options.record)
    damage = (
        f"with a bit changed: {run.damage['refused']} refused to start, {run.damage['served']} served what is right"
    )
    return f"{run.counts()}; {damage}"


def main() -> None:
    options = arguments(
        "Kill, pause, cut off and starve a server while a model watches.", KINDS, OF_WORKERS
    ).parse_args()
    on_small_disk(__file__, DISK, lambda folder: torture(folder, options), mounted=options.mounted)


if __name__ == "__main__":
    main()
