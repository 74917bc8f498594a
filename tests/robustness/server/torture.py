"""Torture of a real server, after etcd's robustness suite: writers, readers, watchers, and a process that keeps dying.

    python tests/robustness/server/torture.py --faults 50

Writers number their batches and keep a few under way; what a broken connection leaves open they ask the server about
and send again. After every fault a model, the multiset of all batches, checks each promise of docs/guarantees.md:

* an acknowledged batch is there; an unacknowledged one is there whole or not at all; none is there twice
* no reader ever sees a revision below one it has seen
* a watcher's copy is the exact hull at the revision named
* the hull is the one that a static algorithm finds, here and in the server
* callers that cancel a call, and a server that is out of file descriptors, change nothing of this
* a server that is given the data with one bit changed does not start, and says why, or keeps all this too, but for the
  last batches, and says that it lost them
* a backup of the running server, and a restore of a killed one's folder, have every batch acknowledged before
"""

import argparse
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import grpc
import numpy as np

import dynhull
from dynhull_client import HullCopy
from dynhull_client._messages import decode_event
from dynhull_proto.v1 import batch_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

sys.path.append(str(Path(__file__).parents[2] / "support"))
from proxy import Proxy

HULL = "tortured"
COMMAND = str(Path(sys.executable).with_name("dynhull"))
IN_FLIGHT = 12
PATIENCE = 60.0  # seconds, for anything to happen at all
DISK = "64m"
PAGE_BYTES = 8192  # of the database
# What a client hears when a server dies, stalls, or is cut off; all of it may be tried again.
PASSING = {
    grpc.StatusCode.UNAVAILABLE,
    grpc.StatusCode.DEADLINE_EXCEEDED,
    grpc.StatusCode.CANCELLED,
    grpc.StatusCode.UNKNOWN,
    grpc.StatusCode.RESOURCE_EXHAUSTED,
}


class BrokenPromiseError(AssertionError):
    """The server did what it says it never does."""


def require(condition: object, what: str) -> None:
    if not condition:
        raise BrokenPromiseError(what)


class Server:
    """`dynhull serve` on a folder; it keeps its port over its lives."""

    def __init__(self, folder: Path) -> None:
        self.data = folder / "data"
        self._port = 0
        self._log = folder / "server.log"

    def start(self) -> None:
        require(self.starts(), f"the server did not start: {self.said()}")

    def starts(self) -> bool:
        command = [COMMAND, "serve", "--port", str(self._port), "--data", str(self.data)]
        command += ["--create-on-write", "--snapshot-points", "2000", "--log-level", "warning", "--scrub-cpu", "0"]
        with self._log.open("ab") as log:
            self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=log, text=True)
        line = self.process.stdout.readline()
        if "serving on" not in line:
            self.process.wait()
            return False
        self._port = int(line.rsplit(":", 1)[1])
        return True

    @property
    def address(self) -> str:
        return f"127.0.0.1:{self._port}"

    def said(self) -> str:
        return self._log.read_text()

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


@dataclass
class Shared:
    """The state that all threads share."""

    target: str
    gate: threading.Event = field(default_factory=threading.Event)  # open: writers write
    over: threading.Event = field(default_factory=threading.Event)
    failures: list[BaseException] = field(default_factory=list)

    def stub(self) -> tuple[grpc.Channel, HullServiceStub]:
        options = [("grpc.initial_reconnect_backoff_ms", 20), ("grpc.max_reconnect_backoff_ms", 200)]
        channel = grpc.insecure_channel(self.target, options=[*options, ("grpc.use_local_subchannel_pool", 1)])
        return channel, HullServiceStub(channel)


class Actor(threading.Thread):
    """Repeats one action; a transient failure makes it start again."""

    def __init__(self, shared: Shared, name: str) -> None:
        super().__init__(name=name, daemon=True)
        self.shared = shared

    def run(self) -> None:
        while not self.shared.over.is_set():
            channel, stub = self.shared.stub()
            try:
                self.act(stub)
            except grpc.RpcError as error:
                if error.code() not in PASSING:
                    self.shared.failures.append(error)
                    return
                time.sleep(0.02)
            except BaseException as error:
                self.shared.failures.append(error)
                return
            finally:
                channel.close()

    def act(self, stub: HullServiceStub) -> None:
        raise NotImplementedError


class Writer(Actor):
    """Inserts points and deletes some of its own; `batches` holds every batch it has sent, in order."""

    def __init__(self, shared: Shared, number: int, seed: int) -> None:
        super().__init__(shared, f"writer-{number}")
        self.batches: list[tuple[np.ndarray, np.ndarray]] = []
        self.acknowledged = 0
        self.idle = threading.Event()
        self._random = np.random.default_rng(seed)
        self._own: list[tuple[float, float]] = []
        self._revision = 0

    def act(self, stub: HullServiceStub) -> None:
        if not self.shared.gate.is_set() and self.acknowledged == len(self.batches):
            self.idle.set()
            self.shared.gate.wait(0.1)
            return
        self.idle.clear()
        last = stub.GetProducer(pb.GetProducerRequest(name=HULL, producer=self.name), timeout=10).last_sequence
        require(last >= self.acknowledged, f"{self.name}: batch {self.acknowledged} was acknowledged and is lost")
        require(last <= len(self.batches), f"{self.name}: batch {last} was never sent")
        self.acknowledged = last
        room = threading.Semaphore(IN_FLIGHT)
        for response in stub.Stream(self._requests(last, room), timeout=30):
            room.release()
            self.acknowledged += 1
            require(response.sequence == self.acknowledged, f"{self.name}: acknowledged out of order")
            require(response.result.revision > self._revision, f"{self.name}: a revision was given twice")
            self._revision = response.result.revision

    def _requests(self, last: int, room: threading.Semaphore):
        yield pb.StreamRequest(name=HULL, producer=self.name)
        sequence = last
        while True:
            if not room.acquire(timeout=10):
                return
            sequence += 1
            if sequence > len(self.batches):
                if not self.shared.gate.is_set():
                    return
                self.batches.append(self._next())
            inserts, deletes = self.batches[sequence - 1]
            batch = batch_pb2.Batch()
            batch.inserts.packed, batch.deletes.packed = inserts.tobytes(), deletes.tobytes()
            yield pb.StreamRequest(batch=batch, sequence=sequence)

    def _next(self) -> tuple[np.ndarray, np.ndarray]:
        rng = self._random
        inserts = rng.normal(size=(rng.integers(1, 30), 2)).round(rng.integers(0, 4)) + 0.0
        deletes = []
        if len(self._own) > 400:
            deletes = [self._own.pop(rng.integers(len(self._own))) for _ in range(rng.integers(1, 60))]
        self._own += map(tuple, inserts.tolist())
        return inserts, np.array(deletes, dtype=float).reshape(-1, 2)


class Reader(Actor):
    """Never sees a revision below one it has seen."""

    seen = 0
    reads = 0

    def act(self, stub: HullServiceStub) -> None:
        while not self.shared.over.is_set():
            revision = stub.GetHull(pb.GetHullRequest(name=HULL), timeout=10).hull.revision
            require(revision >= self.seen, f"revision {revision} after {self.seen}")
            self.seen = revision
            self.reads += 1
            time.sleep(0.005)


class Watcher(Actor):
    """Keeps a copy over all its connections."""

    def __init__(self, shared: Shared, name: str) -> None:
        super().__init__(shared, name)
        self.copy = HullCopy()
        self.moved = threading.Condition()
        self.resumed = 0
        self._uid = ""

    def act(self, stub: HullServiceStub) -> None:
        request = pb.WatchRequest(name=HULL)
        request.progress_interval.FromMilliseconds(200)
        if self._uid:
            request.resume.uid, request.resume.revision = self._uid, self.copy.revision
        try:
            for response in stub.Watch(request):
                self._take(response)
        except grpc.RpcError as error:
            if error.code() is not grpc.StatusCode.OUT_OF_RANGE:
                raise
            self._uid = ""  # the server has trimmed its history: begin anew

    def _take(self, response: pb.WatchResponse) -> None:
        with self.moved:
            if response.HasField("snapshot"):
                self._uid = response.snapshot.uid
            else:
                self.resumed += 1
                require(response.revision >= self.copy.revision, f"{self.name}: revision {response.revision} came back")
            self.copy.update(decode_event(response))
            self.moved.notify_all()

    def vertices_at(self, revision: int) -> np.ndarray:
        with self.moved:
            reached = self.moved.wait_for(lambda: self.copy.revision >= revision or self.shared.failures, PATIENCE)
            require(reached, f"{self.name} stays at revision {self.copy.revision}, {revision} was reached")
            require(self.copy.revision == revision, f"{self.name} is at {self.copy.revision} of {revision}")
            return self.copy.vertices


class Leaver(Actor):
    """Makes calls and cancels most of them: no other caller may notice."""

    NAMES = ("left/a", "left/b")

    def __init__(self, shared: Shared, name: str, seed: int) -> None:
        super().__init__(shared, name)
        self.left = 0
        self._random = random.Random(seed)

    def act(self, stub: HullServiceStub) -> None:
        while not self.shared.over.is_set():
            hull = self._random.choice((*self.NAMES, HULL))
            call = self._begin(stub, hull)
            threading.Event().wait(self._random.random() ** 3 * 0.02)
            self.left += call.cancel()
            if (code := call.code()) in PASSING - {grpc.StatusCode.CANCELLED}:
                time.sleep(0.02 if code else 0)

    def _begin(self, stub: HullServiceStub, hull: str) -> grpc.Future:
        if hull == HULL:
            return self._random.choice(
                [
                    lambda: stub.GetHull.future(pb.GetHullRequest(name=HULL)),
                    lambda: stub.CreateHull.future(pb.CreateHullRequest(name=HULL)),
                    lambda: stub.Verify.future(pb.VerifyRequest(name=HULL)),
                ]
            )()
        batch = batch_pb2.Batch()
        batch.inserts.packed = np.random.default_rng(self.left).normal(size=(5, 2)).tobytes()
        return self._random.choice(
            [
                lambda: stub.CreateHull.future(pb.CreateHullRequest(name=hull)),
                lambda: stub.DeleteHull.future(pb.DeleteHullRequest(name=hull)),
                lambda: stub.Apply.future(pb.ApplyRequest(name=hull, batch=batch)),
            ]
        )()


class Torture:
    def __init__(self, folder: Path, seed: int, writers: int) -> None:
        self._folder = folder
        self._random = random.Random(seed)
        self.server = Server(folder)
        self.server.start()
        self._proxy = Proxy(self.server.address)
        self.shared = Shared(self._proxy.address)
        self._channel, self._stub = self.shared.stub()
        self._call(self._stub.CreateHull, pb.CreateHullRequest(name=HULL))
        self.writers = [Writer(self.shared, i, seed + i) for i in range(writers)]
        self.readers = [Reader(self.shared, "reader")]
        self.watchers = [Watcher(self.shared, f"watcher-{i}") for i in range(2)]
        self.leavers = [Leaver(self.shared, f"leaver-{i}", seed + i) for i in range(2)]
        self.faults: Counter[str] = Counter()
        self.damage: Counter[str] = Counter()
        for actor in (*self.writers, *self.readers, *self.watchers, *self.leavers):
            actor.start()
        self.shared.gate.set()

    def round(self, fault: str) -> None:
        """Traffic, a fault during it, the checks that must hold at once, and those that must hold at rest."""
        self.faults[fault] += 1
        time.sleep(self._random.uniform(0.05, 0.6))
        getattr(self, f"_{fault}")()
        self.shared.gate.set()
        time.sleep(self._random.uniform(0.05, 0.3))
        self._settle()
        self._check()
        self.shared.gate.set()

    def _kill(self) -> None:
        self.shared.gate.clear()
        self.server.kill()
        self._proxy.cut()
        self.server.start()

    def _pause(self) -> None:
        self.server.process.send_signal(signal.SIGSTOP)
        time.sleep(self._random.uniform(0.1, 1.0))
        self.server.process.send_signal(signal.SIGCONT)

    def _sever(self) -> None:
        self._proxy.cut()

    def _full_disk(self) -> None:
        ballast = self._folder / "ballast"
        with suppress(OSError), ballast.open("wb") as file:
            while True:
                file.write(bytes(2**16))
        time.sleep(self._random.uniform(0.2, 0.8))
        if self._random.random() < 0.5:
            self.server.kill()
            ballast.unlink()
            self.server.start()
        else:
            ballast.unlink()

    def _descriptors(self) -> None:
        """For a while the server can open no file and accept no connection."""
        pid = self.server.process.pid
        before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        used = max(int(each.name) for each in Path(f"/proc/{pid}/fd").iterdir())
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (used, before[1]))
        time.sleep(self._random.uniform(0.2, 1.5))
        self._proxy.cut()
        time.sleep(self._random.uniform(0.2, 0.8))
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)

    def _copy(self) -> None:
        """A backup of the running server, and a restore of a killed one's folder: both are served, and are right."""
        acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
        with tempfile.TemporaryDirectory() as folder:
            copied = Server(Path(folder))
            self._command("backup", str(copied.data), "--data", str(self.server.data))
            self._check_copy(copied, acknowledged)
        self.shared.gate.clear()
        self.server.kill()
        acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
        with tempfile.TemporaryDirectory() as folder:
            restored = Server(Path(folder))
            self._command("restore", str(self.server.data), "--data", str(restored.data))
            self._proxy.cut()
            self.server.start()
            self._check_copy(restored, acknowledged)

    def _command(self, *words: str) -> None:
        run = subprocess.run([COMMAND, *words], capture_output=True, text=True, check=False)
        require(run.returncode == 0, f"dynhull {' '.join(words)}: {run.stderr}")

    def _check_copy(self, copied: Server, acknowledged: dict[str, int]) -> None:
        copied.start()
        with grpc.insecure_channel(copied.address) as channel:
            last = self._check_damaged(HullServiceStub(channel), acknowledged, copied, "a copy")
        for name, count in acknowledged.items():
            require(last[name] >= count, f"{name}: of {count} batches acknowledged the copy has {last[name]}")
        copied.kill()

    def _damage(self) -> None:
        """A kill, and a second server on a copy of the data in which one bit is flipped."""
        self.shared.gate.clear()
        self.server.kill()
        with tempfile.TemporaryDirectory() as folder:
            damaged = Server(Path(folder))
            shutil.copytree(self.server.data, damaged.data)
            self._proxy.cut()
            self.server.start()
            acknowledged = {writer.name: writer.acknowledged for writer in self.writers}
            where = self._flip_bit(damaged.data)
            if damaged.starts():
                with grpc.insecure_channel(damaged.address) as channel:
                    self._check_damaged(HullServiceStub(channel), acknowledged, damaged, where)
                damaged.kill()
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
        for name in acknowledged:
            last[name] = stub.GetProducer(pb.GetProducerRequest(name=HULL, producer=name), timeout=10).last_sequence
        points = self._model(last)
        hull = stub.GetHull(pb.GetHullRequest(name=HULL), timeout=10).hull
        require(hull.revision == sum(last.values()), f"{where}: revision {hull.revision} of batches {last}")
        require(hull.point_count == points.total(), f"{where}: {hull.point_count} points of {points.total()}")
        require(stub.Verify(pb.VerifyRequest(name=HULL), timeout=10).equal, f"{where}: the hull is wrong")
        self._check_counts(stub, points)
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
        last = {writer.name: len(writer.batches) for writer in self.writers}
        points, revision = self._model(last), sum(last.values())
        answer = self._call(self._stub.GetHull, pb.GetHullRequest(name=HULL, min_revision=revision))
        require(answer.hull.revision == revision, f"revision {answer.hull.revision} after {revision} batches")
        require(answer.hull.point_count == points.total(), f"{answer.hull.point_count} points of {points.total()}")
        expected = dynhull.static.monotone_chain(np.array(sorted(points), dtype=float).reshape(-1, 2))
        held = self._call(self._stub.Verify, pb.VerifyRequest(name=HULL))
        require(held.equal, "the live hull differs from Chan's recomputation")
        for watcher in self.watchers:
            copy = watcher.vertices_at(revision)
            require(np.array_equal(copy, expected), f"{watcher.name}'s copy is not the hull at {revision}")
        self._check_counts(self._stub, points)
        self._raise_failures()

    def _check_counts(self, stub: HullServiceStub, points: Counter[tuple[float, float]]) -> None:
        sample = self._random.sample(sorted(points), min(50, len(points)))
        query = pb.CountRequest(name=HULL)
        query.points.packed = np.array(sample, dtype=float).tobytes()
        counts = list(self._call(stub.Count, query).counts)
        require(counts == [points[p] for p in sample], "points are there more or less often than they were inserted")

    def _model(self, last: dict[str, int]) -> Counter[tuple[float, float]]:
        """The points after the first `last[name]` batches of each writer."""
        points: Counter[tuple[float, float]] = Counter()
        for writer in self.writers:
            for inserts, deletes in writer.batches[: last[writer.name]]:
                points.update(map(tuple, inserts.tolist()))
                points.subtract(map(tuple, deletes.tolist()))
        return +points

    def _call(self, method, request):
        deadline = time.monotonic() + PATIENCE
        while True:
            try:
                return method(request, timeout=10)
            except grpc.RpcError as error:
                if error.code() not in PASSING or time.monotonic() > deadline:
                    raise
                time.sleep(0.05)

    def _raise_failures(self) -> None:
        if self.shared.failures:
            raise self.shared.failures[0]

    def finish(self) -> None:
        self.shared.over.set()
        self.shared.gate.set()
        self._channel.close()
        self._proxy.close()
        self.server.process.terminate()
        self.server.process.wait()


def torture(folder: Path, faults: int, seed: int, writers: int = 3) -> str:
    """Run `faults` rounds. Returns the counts; raises BrokenPromiseError with the broken promise."""
    run = Torture(folder, seed, writers)
    kinds = ["kill", "kill", "descriptors", "damage", "kill", "full_disk", "pause", "copy", "kill", "sever"]
    try:
        for i in range(faults):
            run.round(kinds[i % len(kinds)])
            print(f"\r{i + 1}/{faults} faults", end="", file=sys.stderr, flush=True)
    finally:
        run.finish()
    acknowledged = sum(writer.acknowledged for writer in run.writers)
    kinds_seen = ", ".join(f"{count} {kind.replace('_', ' ')}" for kind, count in sorted(run.faults.items()))
    return (
        f"faults: {kinds_seen}; batches acknowledged: {acknowledged}, lost: 0, doubled: 0; "
        f"reads: {sum(reader.reads for reader in run.readers)}, revisions back: 0; "
        f"watch events after a resume: {sum(watcher.resumed for watcher in run.watchers)}; "
        f"calls left: {sum(leaver.left for leaver in run.leavers)}; "
        f"with a bit changed: {run.damage['refused']} refused to start, {run.damage['served']} served what is right"
    )


def in_namespace(arguments: list[str]) -> list[str]:
    """The command that runs this file where it can mount a small disk of its own."""
    unshare = ["unshare", "--mount"] if os.geteuid() == 0 else ["unshare", "--mount", "--map-root-user"]
    return [*unshare, sys.executable, __file__, "--mounted", *arguments]


def main() -> None:
    parser = argparse.ArgumentParser(description="Kill, pause, cut off and starve a server while a model watches.")
    parser.add_argument("--faults", type=int, default=50, help="how many (default 50)")
    parser.add_argument("--seed", type=int, default=0, help="what the faults and the batches depend on (default 0)")
    parser.add_argument("--mounted", action="store_true", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if not options.mounted:
        sys.exit(subprocess.run(in_namespace(sys.argv[1:]), check=False).returncode)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={DISK}", "none", folder], check=True)
        try:
            print("\n" + torture(Path(folder), options.faults, options.seed))
        except BaseException:
            print((Path(folder) / "server.log").read_text(), file=sys.stderr)
            raise
        finally:
            subprocess.run(["umount", "--lazy", folder], check=True)


if __name__ == "__main__":
    main()
