"""Fences of a real server that is killed again and again: every event is compared with exact arithmetic.

    python tests/robustness/fences/kill_torture.py [--steps 1000000] [--kills 1000] [--worlds 4] [--seed 0]

Each world has hulls and fences of its own, and one client that writes, changes fences and acknowledges. The server gets
SIGKILL at any moment and starts on what is left; now and then its wall clock is set back then. A request without an
answer is sent again, batches under their numbers. Of each fence all events are read, some of them while the server is
about to be killed; they must be those that follow from the positions sent, with every field, none missing and none too
many. A step is a key or point that a batch names, or a change of a fence.
"""

import argparse
import random
import shutil
import sys
import tempfile
import threading
import time
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import grpc

sys.path += [str(Path(__file__).parent), str(Path(__file__).parents[2] / "support")]
from mortal_server import MortalServer
from pacing import pause
from told import Expectation, Reader, ToldWorld, must
from world import FENCES, GUEST, HULLS, KEYED, TICK, ZONE, Chance

from dynhull.keys import PackedKeys
from dynhull_proto.v1 import batch_pb2, fence_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import fence_service_pb2 as fs
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.fence_service_pb2_grpc import FenceServiceStub
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub
from dynhull_server.rpc.encode_fence import encode_config
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import FenceConfig, HullArea
from dynhull_server.state.fences.model.requests import Acknowledge, CreateFence, DeleteFence, ReplaceFence
from dynhull_server.state.requests import CreateHull, DeleteHull, WriteBatch, WriteTogether

KEYS = [f"é{i}" for i in range(32)]
BEGINNING = 10**15  # of the time of the data
YEAR = 365 * 86_400
# The fence that reports who stays, and for how long.
PATIENT_FENCE, DWELL = FENCES[0], 30_000
# Messages of a world between two comparisons.
BETWEEN = 50
SECONDS = 60
# Seconds until another fence is watched.
LONGEST_WATCH = 2
# Where the folder is: a kill of the process leaves what was written, synced or not.
SHARED_MEMORY = Path("/dev/shm")
STEPS_BACK = shutil.which("faketime") is not None
LOST = (grpc.StatusCode.UNAVAILABLE, grpc.StatusCode.CANCELLED, grpc.StatusCode.UNKNOWN)
Ask = Callable[[Any], Any]


class LiveWatch:
    """Watches one fence after the other until the server is killed, and keeps what it has seen.

    Args:
        world: its client.
        fences: the service.
    """

    def __init__(self, world: "WorldClient", fences: FenceServiceStub) -> None:
        self._world = world
        self._stub = fences
        self._seen: deque[tuple[str, fence_pb2.FenceEvent]] = deque()
        self.thread = threading.Thread(target=self._run, daemon=True)

    def _run(self) -> None:
        rng = random.Random(0)
        while not self._world.stopped:
            names = list(self._world.readers)
            if names:
                name = rng.choice(names)
                with suppress(grpc.RpcError):  # a kill, or a fence that is deleted meanwhile
                    self._watch(name)
            pause(0.05)

    def _watch(self, name: str) -> None:
        request = fs.WatchFenceRequest(name=self._world.prefix + name, only_new=True)
        uid = ""
        for response in self._stub.WatchFence(request, timeout=LONGEST_WATCH):
            uid = uid or response.uid
            self._seen.extend((uid, event) for event in response.events)

    def compare(self, uid: str, reader: Reader) -> None:
        """What was seen of a fence is what is kept of it, also if the server was killed at once."""
        for _ in range(len(self._seen)):
            of, event = self._seen.popleft()
            kept = reader.kept.get(event.sequence)
            if of == uid and event.sequence > reader.last:
                self._seen.append((of, event))
            elif of == uid and kept is not None:
                must(kept == event, "before a kill", event, "was seen, kept is", kept)
                self._world.counts["seen at once"] += 1
            elif of != uid and event.type != fence_pb2.FENCE_EVENT_TYPE_CLOSED:
                self._seen.append((of, event))

    def forget(self, uids: set[str]) -> None:
        """Forget what was seen of other fences than these."""
        for _ in range(len(self._seen)):
            of, event = self._seen.popleft()
            if of in uids:
                self._seen.append((of, event))


class Draw(Chance):
    """Draws requests of more keys, with event times."""

    patient = False  # whether the settings are for the fence that reports who stays

    def batch(self, name: str, time: int, to: Any) -> WriteBatch:
        if name == ZONE:
            return super().batch(name, time, to)
        rng = self._rng
        keys = rng.sample(KEYS, rng.choice([1, 2, 8, 24, 32]))
        removed = rng.randrange(len(keys) + 1) if rng.random() < 0.3 else 0
        puts = keys[removed:]
        made = KeyedBatch(
            "str",
            PackedKeys.pack(puts),
            self._points(len(puts)),
            PackedKeys.pack(keys[:removed]),
            ttl=rng.choice([None, None, None, TICK, 3 * TICK, 10 * TICK]),
        )
        # The hull's clock is that of the data: it stands still without puts.
        arrived = time if puts else self._world.clocks.get(name) or 0
        return WriteBatch(to, Write(name, made, arrived, 3))

    def config(self, before: FenceConfig | None = None) -> FenceConfig:
        while True:
            config = replace(super().config(before), dwell=0, min_dwell=0)  # those are by the server's clock
            if not (isinstance(config.area, HullArea) and config.area.without_self and self.patient):
                return config

    def of_fences(self, time: int, to: Any) -> Any:
        self.patient = False
        request = super().of_fences(time, to)
        if request.name == PATIENT_FENCE and isinstance(request, CreateFence | ReplaceFence):
            self.patient = True  # stays are not reported together with `without_self`
            before = self._world.fences.get(request.name)
            request.config = replace(self.config(before and before.config), initial=request.config.initial)
        return request


class WorldClient:
    """The only client of one world."""

    def __init__(self, number: int, server: MortalServer, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self.failure: BaseException | None = None
        self._server = server
        self.prefix = f"w{number}/"
        self._rng = random.Random(f"{seed}/{number}")
        self._world = ToldWorld()
        self._chance = Draw(self._rng, self._world)
        self._time = BEGINNING
        self.readers: dict[str, Reader] = {}
        self._uids: dict[str, str] = {}
        self._sequences: Counter[str] = Counter()
        self._guests = 0
        self._stop = threading.Event()
        self._channel = grpc.insecure_channel(server.address, [("grpc.max_reconnect_backoff_ms", 200)])
        self._hulls, self._fences = HullServiceStub(self._channel), FenceServiceStub(self._channel)
        for name in sorted(self._world.there):
            self._ask(self._hulls.CreateHull, self._new_hull(name))
        self._life = server.lives
        self._live = LiveWatch(self, self._fences)
        self._thread = threading.Thread(target=self._run)

    @property
    def stopped(self) -> bool:
        return self._stop.is_set()

    def start(self) -> None:
        self._thread.start()
        self._live.thread.start()

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()

    def _run(self) -> None:
        try:
            while not self._stop.is_set():
                self._step()
                if self._server.lives != self._life:
                    self._life = self._server.lives
                    self.compare()
                elif self.counts["messages"] % BETWEEN == 0:
                    self.compare()
        except BaseException as error:  # for the thread that watches over all worlds
            self.failure = error

    # Requests

    def _ask(self, method: Ask, request: Any, *refusals: grpc.StatusCode) -> Any:
        """The answer, over kills; None if it is refused with one of these codes."""
        self.counts["messages"] += 1
        end = time.monotonic() + SECONDS
        while True:
            self.wait()
            must(time.monotonic() < end, "there is no answer to", request)
            try:
                return method(request, timeout=SECONDS)  # type: ignore[call-arg]
            except grpc.RpcError as error:
                if error.code() in refusals:
                    return None
                must(error.code() in LOST, request, "is refused:", error)
                self.counts["asked again"] += 1
                pause(0.02)

    def wait(self) -> None:
        """Wait until the server is up."""
        while not self._server.up.wait(0.5):
            must(not self.stopped, "the server does not start again")

    def _step(self) -> None:
        """One request, and what follows from it."""
        rng = self._rng
        self._time += TICK
        dice = rng.random()
        if dice < 0.7:
            names = rng.sample((*KEYED[:2], ZONE), rng.choice([2, 2, 3]))
            request: Any = WriteTogether(self, [self._chance.batch(name, self._time, self).write for name in names])
            self._write_together(request)
        elif dice < 0.88:
            self._write(self._chance.batch(rng.choice(HULLS), self._time, self))
        elif dice < 0.98:
            self._change_fence(self._chance.of_fences(self._time, self))
        else:
            self._change_guest()

    def _commit(self, request: Any, steps: int) -> None:
        self._world.committed(request)
        self.counts["steps"] += steps

    def _write(self, write: WriteBatch) -> None:
        if write.name not in self._world.there:
            return
        producer = f"single{self._guests}" if write.name == GUEST else "single"
        numbered = producer + write.name
        self._sequences[numbered] += 1
        batch, rows = self._batch(write.write)
        request = pb.ApplyRequest(
            name=self.prefix + write.name, batch=batch, producer=producer, sequence=self._sequences[numbered]
        )
        result = self._ask(self._hulls.Apply, request).result
        self._commit(write, rows)
        self._applied(write.name, result)

    def _write_together(self, together: WriteTogether) -> None:
        producer = "_".join(sorted(part.name for part in together.parts))
        self._sequences[producer] += 1
        batches = [self._batch(part) for part in together.parts]
        request = pb.ApplyTogetherRequest(
            batches=[
                pb.HullBatch(name=self.prefix + part.name, batch=batch)
                for part, (batch, _) in zip(together.parts, batches, strict=True)
            ],
            producer=producer,
            sequence=self._sequences[producer],
        )
        results = self._ask(self._hulls.ApplyTogether, request).results
        self._commit(together, sum(rows for _, rows in batches))
        for part, result in zip(together.parts, results, strict=True):
            self._applied(part.name, result)

    def _applied(self, name: str, result: batch_pb2.BatchResult) -> None:
        """A batch has been acknowledged, now or before a kill."""
        self.counts["duplicates"] += result.duplicate
        revision = self._world.revisions[name]
        must(result.revision == revision, name, "is at revision", result.revision, "instead of", revision)

    def _batch(self, write: Write) -> tuple[batch_pb2.Batch, int]:
        """A batch as a message, and the number of keys or points that it names."""
        made: Any = write.batch
        if write.name == ZONE:
            message = batch_pb2.Batch(
                inserts=points_pb2.Points(coordinates=made.inserts.ravel()),
                deletes=points_pb2.Points(coordinates=made.deletes.ravel()),
                missing_points=batch_pb2.MISSING_POINT_POLICY_COUNT,
            )
            return message, len(made.inserts) + len(made.deletes)
        message = batch_pb2.Batch(removes=points_pb2.Keys(strings=made.removes))
        if len(made.keys):
            message.puts.keys.strings.extend(made.keys)
            message.puts.points.coordinates.extend(made.points.ravel())
            times = [write.arrived] * len(made.keys)
            message.puts.times.packed = packed(times)
            if made.ttl is not None:
                message.puts.expire_times.packed = packed([time + made.ttl for time in times])
        return message, len(made.keys) + len(made.removes)

    # Fences and the guest

    def _change_fence(self, request: Any) -> None:
        name = request.name
        there = name in self._world.fences
        match request:
            case CreateFence():
                config = self._config(name, request.config)
                message: Any = fs.CreateFenceRequest(name=self.prefix + name, config=config)
                self._ask(self._fences.CreateFence, message, grpc.StatusCode.ALREADY_EXISTS)
                if there:
                    return
                self._world.expected[name] = []
                self._commit(request, 1)
                reader = self.readers[name] = Reader(self.prefix, config.dwell.ToMicroseconds())
                if request.config.initial == "none":
                    reader.since = dict.fromkeys(self._world.fences[name].inside, 0)
            case ReplaceFence():
                config = self._config(name, request.config)
                self._ask(self._fences.ReplaceFence, fs.ReplaceFenceRequest(name=self.prefix + name, config=config))
                self._commit(request, 1)
            case DeleteFence():
                self._compare_fence(name)
                message = fs.DeleteFenceRequest(name=self.prefix + name)
                self._ask(self._fences.DeleteFence, message, grpc.StatusCode.NOT_FOUND)
                self._commit(request, 1)
                del self.readers[name], self._world.expected[name]
            case Acknowledge():  # the model does not count stays: what it acknowledges, the fence has
                message = fs.AckFenceRequest(
                    name=self.prefix + name, consumer=request.consumer, sequence=request.sequence or 0
                )
                self._ask(self._fences.AckFence, message)
                self._commit(request, 1)

    def _config(self, name: str, config: FenceConfig) -> Any:
        area = config.area
        if isinstance(area, HullArea):
            area = replace(area, name=self.prefix + area.name)
        renamed = replace(config, area=area, subjects=self.prefix + config.subjects)
        reports = name == PATIENT_FENCE and config.kind != "other"
        return encode_config(replace(renamed, dwell=DWELL if reports else 0))

    def _change_guest(self) -> None:
        name = self.prefix + GUEST
        if GUEST in self._world.there:
            self._ask(self._hulls.DeleteHull, pb.DeleteHullRequest(name=name), grpc.StatusCode.NOT_FOUND)
            self._commit(DeleteHull(self, GUEST, self._time), 1)
        else:
            self._guests += 1
            self._ask(self._hulls.CreateHull, self._new_hull(GUEST), grpc.StatusCode.ALREADY_EXISTS)
            self._commit(CreateHull(self, GUEST, self._chance.birth()), 1)

    def _new_hull(self, name: str) -> pb.CreateHullRequest:
        config = hull_pb2.HullConfig()
        if name in KEYED:
            config.identity = hull_pb2.IDENTITY_STRING_KEYS
            config.window.max_age.seconds = YEAR
            config.window.clock = hull_pb2.CLOCK_DATA
        return pb.CreateHullRequest(name=self.prefix + name, config=config)

    # Comparison

    def compare(self) -> None:
        """All events so far are there, and no others, and the server finds nothing wrong."""
        for name in sorted(self._world.there):
            verified = self._ask(self._hulls.Verify, pb.VerifyRequest(name=self.prefix + name))
            must(verified.equal and verified.keys_equal and not verified.fence_differences, name, verified)
            self.counts["verified fences"] += verified.fence_count
        for name in list(self._world.fences):
            self._compare_fence(name)
        self._world.forget()
        self._live.forget({self._uids[name] for name in self.readers})
        for reader in self.readers.values():
            reader.forget()

    def _compare_fence(self, name: str) -> None:
        reader, expected = self.readers[name], self._world.expected[name]
        found = self._ask(self._fences.GetFence, fs.GetFenceRequest(name=self.prefix + name)).fence
        fence = self._world.fences[name]
        must(found.inside_count == len(fence.inside) + fence.near, name, found, "and the model", fence)
        acknowledged = {each.name: each.acknowledged_sequence for each in found.consumers}
        must(acknowledged == fence.consumers, name, acknowledged, "and the model", fence.consumers)
        while reader.last < found.last_sequence:
            self._read(name, reader, expected, found.last_sequence)
        must(reader.compared == len(expected), name, "has no", expected[reader.compared : reader.compared + 1])
        self._uids[name] = found.uid
        self._live.compare(found.uid, reader)

    def _read(self, name: str, reader: Reader, expected: list[Expectation], last: int) -> None:
        """Read events up to a sequence, unless the server is killed meanwhile."""
        request = fs.WatchFenceRequest(name=self.prefix + name, after_sequence=reader.last)
        self.wait()
        watch = self._fences.WatchFence(request, timeout=SECONDS)
        try:
            for response in watch:
                must(not response.HasField("lost"), name, "has lost", response.lost)
                for message in response.events:
                    now = int((time.time() + 1) * 1e6)
                    kind = reader.take(message, self._world, expected, now)
                    self.counts[kind.name] += 1
                if reader.last >= last:
                    return
        except grpc.RpcError as error:
            must(error.code() in LOST, "a watch ends:", error)
        finally:
            watch.cancel()

    def end(self) -> None:
        """At the end everybody who stays has made its event."""
        self.compare()
        end = time.monotonic() + SECONDS
        while any(reader.waiting() for reader in self.readers.values()):
            must(time.monotonic() < end, "no stays of", [reader.waiting() for reader in self.readers.values()])
            pause(0.1)
            self.compare()
        self._channel.close()


def packed(times: list[int]) -> bytes:
    return b"".join(time.to_bytes(8, "little", signed=True) for time in times)


def run(steps: int, kills: int, worlds: int, seed: int, folder: Path) -> Counter[str]:
    """That many steps and kills; AssertionError at the first event that is missing, wrong or too many."""
    rng = random.Random(seed)
    server = MortalServer(folder, "--snapshot-points", "300", "--scrub-cpu", "0")
    counts: Counter[str] = Counter()
    begun = time.monotonic()
    clients = [WorldClient(number, server, seed) for number in range(worlds)]
    for client in clients:
        client.start()
    try:
        while counts["steps"] < steps or counts["kills"] < kills:
            least = min(counts["steps"] + steps // max(kills, 1), steps) if counts["kills"] < kills else steps
            _until(clients, least)
            pause(rng.uniform(0, 0.02))
            if counts["kills"] < kills:
                server.kill()
                counts["kills"] += 1
                stepped_back = STEPS_BACK and rng.random() < 0.05
                counts["clock set back"] += stepped_back
                server.start(stepped_back=stepped_back)
            total = sum((client.counts for client in clients), Counter())
            counts = Counter({name: counts[name] for name in ("kills", "clock set back")}) + total
            if counts["kills"] % 50 == 0 or counts["steps"] >= steps:
                print(f"{time.monotonic() - begun:.0f} s: {dict(counts)}", flush=True)
    finally:
        for client in clients:
            client.stop()
        with suppress(AssertionError):
            _look(clients)
            for client in clients:
                client.end()
        server.kill()
    _look(clients)
    total = sum((client.counts for client in clients), Counter())
    return Counter({name: counts[name] for name in ("kills", "clock set back")}) + total


def _until(clients: list[WorldClient], steps: int) -> None:
    while sum(client.counts["steps"] for client in clients) < steps:
        _look(clients)
        pause(0.005)


def _look(clients: list[WorldClient]) -> None:
    for client in clients:
        if client.failure is not None:
            raise AssertionError(str(client.failure)) from client.failure


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--kills", type=int, default=1_000)
    parser.add_argument("--worlds", type=int, default=4)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=SHARED_MEMORY if SHARED_MEMORY.is_dir() else None) as folder:
        counts = run(arguments.steps, arguments.kills, arguments.worlds, arguments.seed, Path(folder))
    print(f"0 missing, 0 extra: {dict(counts)}")


if __name__ == "__main__":
    main()
