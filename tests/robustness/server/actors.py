"""The clients of a tortured server, each a thread: writers, readers, watchers, and callers that disconnect."""

import random
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import permutations
from typing import Any

import grpc
import numpy as np
from pacing import pause
from patience import PATIENCE
from promises import require

from dynhull_client import HullCopy
from dynhull_client._messages import decode_event
from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

IN_FLIGHT = 12
SEVERAL = 5  # batches in a message, at most
BREATH = 0.004  # seconds between the batches or calls of an actor, which leave the processor to the others
# What a client gets when a server dies, stalls, or is cut off; all of it may be tried again.
PASSING = {
    grpc.StatusCode.UNAVAILABLE,
    grpc.StatusCode.DEADLINE_EXCEEDED,
    grpc.StatusCode.CANCELLED,
    grpc.StatusCode.UNKNOWN,
    grpc.StatusCode.RESOURCE_EXHAUSTED,
}


@dataclass
class Shared:
    """The state that all threads share."""

    target: str
    tls: grpc.ChannelCredentials | None = None
    breath: float = BREATH
    gate: threading.Event = field(default_factory=threading.Event)  # open: writers write
    over: threading.Event = field(default_factory=threading.Event)
    failures: list[BaseException] = field(default_factory=list)

    def stub(self, target: str = "") -> tuple[grpc.Channel, HullServiceStub]:
        channel = self.channel(target or self.target)
        return channel, HullServiceStub(channel)

    def channel(self, target: str) -> grpc.Channel:
        """A channel of its own to a server."""
        options = [
            ("grpc.initial_reconnect_backoff_ms", 20),
            ("grpc.max_reconnect_backoff_ms", 200),
            ("grpc.use_local_subchannel_pool", 1),
        ]
        if self.tls is None:
            return grpc.insecure_channel(target, options=options)
        return grpc.secure_channel(target, self.tls, options=options)


class Actor(threading.Thread):
    """Repeats one action, on the server of all or the one at `target`; a transient failure makes it start again."""

    def __init__(self, shared: Shared, name: str, target: str = "") -> None:
        super().__init__(name=name, daemon=True)
        self.shared = shared
        self._target = target

    def run(self) -> None:
        channel, stub = self.shared.stub(self._target)
        with channel:
            while not self.shared.over.is_set():
                try:
                    self.act(stub)
                except grpc.RpcError as error:
                    if error.code() not in PASSING:
                        self.shared.failures.append(error)
                        return
                    pause(0.05)
                except BaseException as error:
                    self.shared.failures.append(error)
                    return

    def act(self, stub: HullServiceStub) -> None:
        raise NotImplementedError


def persist(method: Callable[..., Any], request: Any) -> Any:
    """The answer to a call, which is made again until there is one."""
    deadline = time.monotonic() + PATIENCE
    while True:
        try:
            return method(request, timeout=10)
        except grpc.RpcError as error:
            if error.code() not in PASSING or time.monotonic() > deadline:
                raise
            pause(0.05)


class Writer(Actor):
    """Numbers its batches, each to all of `hulls`; `batches` holds every batch it has sent, in order.

    With a `stride` the numbers skip: only each so many is used.
    """

    stride = 1

    def __init__(self, shared: Shared, name: str, hulls: tuple[str, ...]) -> None:
        super().__init__(shared, name)
        self.hulls = hulls
        self.batches: list[Any] = []
        self.acknowledged = 0
        self.moments: list[float] = []  # at which batches were acknowledged
        self.idle = threading.Event()

    def act(self, stub: HullServiceStub) -> None:
        if not self.shared.gate.is_set() and self.acknowledged == len(self.batches):
            self.idle.set()
            self.shared.gate.wait(0.1)
            return
        self.idle.clear()
        # Read one after the other: what the first has, the others have, too.
        numbers = [last_sequence(stub, hull, self.name) for hull in self.hulls]
        require(numbers == sorted(numbers), f"{self.name}: a batch is only in some of {self.hulls}: {numbers}")
        require(not numbers[-1] % self.stride, f"{self.name}: number {numbers[-1]} was never sent")
        last = numbers[-1] // self.stride
        require(last >= self.acknowledged, f"{self.name}: batch {self.acknowledged} was acknowledged and is lost")
        require(last <= len(self.batches), f"{self.name}: batch {last} was never sent")
        while self.acknowledged < last:
            self.acknowledge()
        self.write(stub)

    def write(self, stub: HullServiceStub) -> None:
        """Send the batches after those acknowledged, and new ones while the gate is open."""
        raise NotImplementedError

    def acknowledge(self, *results: batch_pb2.BatchResult) -> None:
        """The next batch is acknowledged, with its result for each hull, or none if only its number is known."""
        require(len(results) in (0, len(self.hulls)), f"{self.name}: {len(results)} results")
        self.acknowledged += 1
        self.moments.append(time.monotonic())

    def create_batch(self) -> Any:
        raise NotImplementedError


def last_sequence(stub: HullServiceStub, hull: str, producer: str) -> int:
    return stub.GetProducer(pb.GetProducerRequest(name=hull, producer=producer), timeout=10).last_sequence


class Streamer(Writer):
    """Keeps a few batches under way, in a stream to one hull; with `several`, a few in each message."""

    several = False
    _revision = 0

    def write(self, stub: HullServiceStub) -> None:
        room = threading.Semaphore(IN_FLIGHT)
        announced = threading.Event()
        for response in stub.Stream(self._requests(self.acknowledged, room, announced), timeout=30):
            if response.max_batches:
                announced.set()
                continue
            for each in response.results if self.several else [response]:
                room.release()
                self.acknowledge(each.result)
                require(each.sequence == self.acknowledged * self.stride, f"{self.name}: acknowledged out of order")
                # What a process that outlives its server still commits is a duplicate when it is sent again: its
                # revision is then any one that has it.
                rises = each.result.revision > self._revision - each.result.duplicate
                require(rises, f"{self.name}: a revision was given twice: {each.result.revision} {self._revision}")
                self._revision = each.result.revision

    def _requests(self, sent: int, room: threading.Semaphore, announced: threading.Event) -> Iterator[pb.StreamRequest]:
        may_skip = self.stride > 1
        yield pb.StreamRequest(name=self.hulls[0], producer=self.name, accept_results=self.several, may_skip=may_skip)
        if self.several and not announced.wait(10):
            return
        while True:
            numbered = []
            for _ in range(1 + sent % SEVERAL if self.several else 1):
                if not room.acquire(timeout=0 if numbered else 10):
                    break
                if sent == len(self.batches):
                    if not self.shared.gate.is_set():
                        break
                    self.batches.append(self.create_batch())
                sent += 1
                batch = self.encode(self.batches[sent - 1])
                numbered.append(pb.NumberedBatch(batch=batch, sequence=sent * self.stride))
            if not numbered:
                return
            if self.several:
                yield pb.StreamRequest(batches=numbered)
            else:
                yield pb.StreamRequest(batch=numbered[0].batch, sequence=numbered[0].sequence)

    def encode(self, batch: Any) -> batch_pb2.Batch:
        raise NotImplementedError


class PointWriter(Streamer):
    """Inserts points and deletes some of its own."""

    def __init__(self, shared: Shared, number: int, hull: str, seed: int) -> None:
        super().__init__(shared, f"writer-{number}", (hull,))
        self.several = number % 2 > 0
        self.stride = 3 if number % 4 == 1 else 1
        self._random = np.random.default_rng(seed)
        self._own: list[tuple[float, float]] = []

    def create_batch(self) -> tuple[np.ndarray, np.ndarray]:
        pause(self.shared.breath)
        rng = self._random
        inserts = rng.normal(size=(rng.integers(1, 30), 2)).round(rng.integers(0, 4)) + 0.0
        deletes = []
        if len(self._own) > 400:
            deletes = [self._own.pop(rng.integers(len(self._own))) for _ in range(rng.integers(1, 60))]
        self._own += map(tuple, inserts.tolist())
        return inserts, np.array(deletes, dtype=float).reshape(-1, 2)

    def encode(self, batch: tuple[np.ndarray, np.ndarray]) -> batch_pb2.Batch:
        inserts, deletes = batch
        packed = (points_pb2.Points(packed=each.tobytes()) for each in (inserts, deletes))
        return batch_pb2.Batch(inserts=next(packed), deletes=next(packed))


class Reader(Actor):
    """Never sees a revision below one it has seen, nor one below what was `acknowledged` before it asked."""

    seen = 0
    reads = 0

    def __init__(
        self, shared: Shared, hull: str, acknowledged: Callable[[], int] = lambda: 0, target: str = ""
    ) -> None:
        super().__init__(shared, f"reader of {hull}" + (target and f" at {target}"), target)
        self._hull = hull
        self._acknowledged = acknowledged

    def act(self, stub: HullServiceStub) -> None:
        while not self.shared.over.is_set():
            acknowledged = self._acknowledged()
            revision = self.read(stub)
            require(revision >= self.seen, f"{self.name}: revision {revision} after {self.seen}")
            require(
                revision >= acknowledged, f"{self.name}: stale: revision {revision}, {acknowledged} was acknowledged"
            )
            self.seen = revision
            self.reads += 1
            pause(2 * self.shared.breath)

    def read(self, stub: HullServiceStub) -> int:
        return stub.GetHull(pb.GetHullRequest(name=self._hull), timeout=10).hull.revision


class TogetherReader(Reader):
    """Reads two hulls that are only written together: both are always at the same revision."""

    def __init__(self, shared: Shared, hulls: Sequence[str]) -> None:
        super().__init__(shared, " and ".join(hulls))
        keys = points_pb2.Keys(integers=range(8))
        self._requests = [pb.LocateRequest(name=one, keys=keys, keys_of=other) for one, other in permutations(hulls)]

    def read(self, stub: HullServiceStub) -> int:
        for request in self._requests:
            found = stub.Locate(request, timeout=10)
            apart = f"{request.name} is at {found.revision}, {request.keys_of} at {found.keys_revision}"
            require(found.revision == found.keys_revision, apart)
        return found.keys_revision


@dataclass(frozen=True, slots=True)
class Seen:
    """The hull that a watcher has after an event."""

    revision: int
    points: int
    clock: int | None
    vertices: np.ndarray
    keys: tuple[str | int, ...] | None


class Watcher(Actor):
    """Keeps a copy over all its connections, and remembers the last events."""

    def __init__(self, shared: Shared, name: str, hull: str, *, keys: bool = False) -> None:
        super().__init__(shared, name)
        self.copy = HullCopy()
        self.moved = threading.Condition()
        self.resumed = 0
        self._seen: deque[Seen] = deque(maxlen=20)
        self._uid = self._of = ""
        self._request = pb.WatchRequest(name=hull, include_keys=keys)
        self._request.progress_interval.FromMilliseconds(200)

    def act(self, stub: HullServiceStub) -> None:
        request = pb.WatchRequest()
        request.CopyFrom(self._request)
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
                if self._uid != self._of:  # another hull, as a restored one is
                    self._seen.clear()
                self._of = self._uid
            else:
                self.resumed += 1
                require(response.revision >= self.copy.revision, f"{self.name}: revision {response.revision} came back")
            clock = response.clock_time.ToMicroseconds() if response.HasField("clock_time") else None
            before = self._seen[-1].clock if self._seen else None
            require(before is None or (clock is not None and clock >= before), f"{self.name}: the clock went back")
            self.copy.update(decode_event(response, keys=self._request.include_keys))
            copy = self.copy
            self._seen.append(Seen(copy.revision, copy.points, clock, copy.vertices, copy.vertex_keys))
            self.moved.notify_all()

    def vertices_at(self, revision: int) -> np.ndarray:
        self.wait_for(revision)
        require(self.copy.revision == revision, f"{self.name} is at {self.copy.revision} of {revision}")
        return self.copy.vertices

    def wait_for(self, revision: int) -> None:
        with self.moved:
            reached = self.moved.wait_for(lambda: self.copy.revision >= revision or self.shared.failures, PATIENCE)
            require(reached, f"{self.name} stays at revision {self.copy.revision}, {revision} was reached")

    def seen(self) -> list[Seen]:
        """The last events."""
        with self.moved:
            return list(self._seen)


class Leaver(Actor):
    """Makes calls and cancels most of them: no other caller may notice."""

    NAMES = ("left/a", "left/b", "left/keys")

    def __init__(self, shared: Shared, name: str, hull: str, seed: int) -> None:
        super().__init__(shared, name)
        self.left = 0
        self._hull = hull
        self._random = random.Random(seed)

    def act(self, stub: HullServiceStub) -> None:
        while not self.shared.over.is_set():
            hull = self._random.choice((*self.NAMES, self._hull))
            pause(4 * self.shared.breath)
            call = self._begin(stub, hull)
            pause(self._random.random() ** 3 * 0.02)
            self.left += call.cancel()
            if (code := call.code()) in PASSING - {grpc.StatusCode.CANCELLED}:
                pause(0.02 if code else 0)

    def _begin(self, stub: HullServiceStub, hull: str) -> grpc.Future:
        if hull == self._hull:
            return self._random.choice(
                [
                    lambda: stub.GetHull.future(pb.GetHullRequest(name=hull)),
                    lambda: stub.CreateHull.future(pb.CreateHullRequest(name=hull)),
                    lambda: stub.Verify.future(pb.VerifyRequest(name=hull)),
                ]
            )()
        keyed = hull == "left/keys"
        identity = hull_pb2.IDENTITY_STRING_KEYS if keyed else hull_pb2.IDENTITY_MULTISET
        config = hull_pb2.HullConfig(identity=identity)
        batches = [pb.HullBatch(name=each, batch=self._batch(each)) for each in self.NAMES]
        return self._random.choice(
            [
                lambda: stub.CreateHull.future(pb.CreateHullRequest(name=hull, config=config)),
                lambda: stub.DeleteHull.future(pb.DeleteHullRequest(name=hull)),
                lambda: stub.Apply.future(pb.ApplyRequest(name=hull, batch=self._batch(hull))),
                lambda: stub.ApplyTogether.future(pb.ApplyTogetherRequest(batches=batches)),
            ]
        )()

    def _batch(self, hull: str) -> batch_pb2.Batch:
        points = points_pb2.Points(packed=np.random.default_rng(self.left).normal(size=(5, 2)).tobytes())
        if hull != "left/keys":
            return batch_pb2.Batch(inserts=points)
        batch = batch_pb2.Batch(puts=batch_pb2.Puts(keys=points_pb2.Keys(strings="abcde"), points=points))
        batch.puts.ttl.FromMilliseconds(100)
        return batch
