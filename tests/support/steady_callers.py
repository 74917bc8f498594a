"""Callers of every kind, who go on all the time beside changes that are planned, and who must notice none of them.

Each has hulls of its own and a model of them: an error, a batch that is missing or there twice, an event that is
missing or out of order, and a wrong answer are faults. Nothing is sent again here, so what the client or the server
sends again must be safe.
"""

import asyncio
import threading
import time
import traceback
from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import numpy as np
from pacing import pause_async

from dynhull_client import AsyncHullClient, HullClient, HullCopy

BREATH = 0.05  # seconds between two calls, which leave the processor to others
SHARDS = 3
# More bytes than one frame between a gateway and a worker may have.
LARGE = 20_000
INSIDE, OUTSIDE = [[1.0, 1.0]], [[9.0, 9.0]]


def place(number: int) -> tuple[float, float]:
    """A point that stands for a number."""
    return float(number), float(number * number % 1_009)


class Timed:
    """A client that notes how long each of its calls takes, also of one that fails."""

    def __init__(self, client: HullClient, took: list[str]) -> None:
        self._client = client
        self._took = took

    def __getattr__(self, name: str) -> Callable[..., Any]:
        call = getattr(self._client, name)

        def timed(*arguments: object, **options: object) -> object:
            begun = time.monotonic()
            try:
                return call(*arguments, **options)
            finally:
                self._took.append(f"{name} {time.monotonic() - begun:.2f} s")

        return timed


class Caller(threading.Thread, ABC):
    """One caller.

    Args:
        address: the address of a server.
        number: distinguishes callers of a kind, whose names are elsewhere then.

    Attributes:
        calls: how many were answered.
        longest: the most seconds that one took.
        errors: what went wrong.
    """

    config: ClassVar[dict[str, Any]] = {}

    def __init__(self, address: str, number: int = 0) -> None:
        super().__init__(daemon=True)
        self.address = address
        self.hull = f"{type(self).__name__}-{number}"
        self.calls = 0
        self.longest = 0.0
        self.errors: list[str] = []
        self.over = threading.Event()
        self._begun = time.monotonic()
        self._took: list[str] = []  # the steps of the call that is under way

    def begin(self) -> None:
        """Create the hull, and call."""
        with HullClient(self.address) as client:
            client.create_hull(self.hull, **self.config)
            self.prepare(client)
        self.start()

    def prepare(self, client: HullClient) -> None:
        """Create what else is needed."""

    def finish(self) -> None:
        """Call no more, and compare what is there with the model."""
        self.over.set()
        self.join()
        with HullClient(self.address) as client:
            self.check(client)

    def run(self) -> None:
        """Call until `finish`. After an error the model may be wrong, so the first one is the last."""
        try:
            self.work()
        except Exception as error:
            made = "".join(traceback.format_tb(error.__traceback__, 2)[1:]).split("\n")[1].strip()
            took = ", ".join([f"{time.monotonic() - self._begun:.2f} s after it began", *self._took])
            self.failed(f"call {self.calls + 1}, {made} ({took})", error)

    def failed(self, what: str, error: Exception) -> None:
        """Note an error, and whose it is."""
        self.errors.append(f"{type(self).__name__}, {what}: {type(error).__name__}: {error}")

    def work(self) -> None:
        """Call."""
        with HullClient(self.address) as client:
            while not self.over.is_set():
                self.under_way()
                self.step(Timed(client, self._took), self.calls + 1)
                self.done()
                self.over.wait(BREATH)

    def under_way(self) -> None:
        """A call begins."""
        self._begun = time.monotonic()
        self._took.clear()

    def done(self) -> None:
        """Count a call that was answered."""
        self.calls += 1
        self.longest = max(self.longest, time.monotonic() - self._begun)

    def step(self, client: Timed, number: int) -> None:
        """One call."""
        raise NotImplementedError

    @abstractmethod
    def check(self, client: HullClient) -> None:
        """Note what differs from the model."""

    def require(self, holds: object, what: str) -> None:
        """Note a fault unless something holds."""
        if not holds:
            self.errors.append(f"{type(self).__name__}: {what}")

    def require_all(self, client: HullClient, inserted: int) -> None:
        """Each of the first points is there once, and no other one."""
        info = client.get_hull(self.hull).info
        self.require(info.points == inserted, f"{info.points} points, {inserted} acknowledged")
        points = [place(each) for each in range(1, inserted + 2)]
        counts = client.count(self.hull, points).counts.tolist()
        self.require(counts == [1] * inserted + [0], f"points that are missing or there twice: {counts}")
        self.require(client.verify(self.hull).equal, "the hull is not that of its points")


class Plain(Caller):
    """Batches without numbers."""

    def step(self, client: Timed, number: int) -> None:
        applied = client.apply(self.hull, insert=[place(number)])
        self.require(applied.revision == number, f"batch {number} is revision {applied.revision}")

    def check(self, client: HullClient) -> None:
        self.require_all(client, self.calls)


class PlainOverShards(Plain):
    """The same, of a hull over shards."""

    config: ClassVar = {"shards": SHARDS}


class Large(Caller):
    """Batches without numbers that do not fit into a frame: each deletes what the one before has inserted."""

    def __init__(self, address: str, number: int = 0) -> None:
        super().__init__(address, number)
        self._points = np.random.default_rng(number).normal(size=(LARGE, 2))

    def prepare(self, client: HullClient) -> None:
        client.apply(self.hull, insert=self._points)

    def step(self, client: Timed, number: int) -> None:
        applied = client.apply(self.hull, delete=self._points + (number - 1), insert=self._points + number)
        self.require(applied.revision == number + 1, f"batch {number} is revision {applied.revision}")
        self.over.wait(20 * BREATH)

    def check(self, client: HullClient) -> None:
        info = client.get_hull(self.hull).info
        self.require((info.points, info.revision) == (LARGE, self.calls + 1), f"the hull is {info}")
        self.require(client.verify(self.hull).equal, "the hull is not that of its points")


class Numbered(Caller):
    """Numbered batches."""

    def step(self, client: Timed, number: int) -> None:
        applied = client.apply(self.hull, insert=[place(number)], producer="p", sequence=number)
        self.require(applied.revision == number, f"batch {number} is revision {applied.revision}")

    def check(self, client: HullClient) -> None:
        self.require_all(client, self.calls)


class NumberedOverShards(Numbered):
    """The same, of a hull over shards."""

    config: ClassVar = {"shards": SHARDS}


class Writes(Caller):
    """A writer; a call is a batch, from its put until it is acknowledged."""

    def work(self) -> None:
        with HullClient(self.address) as client, client.writer(self.hull, batch_points=1, linger=0) as writer:
            while not self.over.is_set():
                self.under_way()
                writer.put(insert=[place(self.calls + 1)]).result()
                self.done()
                self.over.wait(BREATH)

    def check(self, client: HullClient) -> None:
        self.require_all(client, self.calls)


class WritesOverShards(Writes):
    """The same, of a hull over shards."""

    config: ClassVar = {"shards": SHARDS}


class AsyncWrites(Writes):
    """A writer of asyncio."""

    def work(self) -> None:
        asyncio.run(self._work())

    async def _work(self) -> None:
        async with (
            AsyncHullClient(self.address) as client,
            client.writer(self.hull, batch_points=1, linger=0) as writer,
        ):
            while not self.over.is_set():
                self.under_way()
                await (await writer.put(insert=[place(self.calls + 1)]))
                self.done()
                await pause_async(BREATH)


class Watches(Caller):
    """A watch whose copy must be the hull; a call is an event, and what it takes is the time since the one before.

    Somebody else writes, without numbers.
    """

    def prepare(self, _: HullClient) -> None:
        self.copy = HullCopy()
        self._written = 0
        self._last: int | None = None  # the revision of the last event
        self._writer = threading.Thread(target=self._write, daemon=True)
        self._writer.start()

    def _write(self) -> None:
        try:
            with HullClient(self.address) as client:
                while not self.over.is_set():
                    self._written = client.apply(self.hull, insert=[place(self._written + 1)]).revision
                    self.over.wait(BREATH)
        except Exception as error:
            self.failed(f"batch {self._written + 1} of the watched hull", error)

    def finish(self) -> None:
        self.over.set()
        self._writer.join()
        self._last = self._written + 1
        with HullClient(self.address) as client:  # the watch waits for it
            self._written = client.apply(self.hull, insert=[place(self._last)]).revision
        super().finish()

    def work(self) -> None:
        with HullClient(self.address) as client, client.watch(self.hull, copy=self.copy) as events:
            for event in events:
                if self.heard(event.revision):
                    return

    def heard(self, revision: int) -> bool:
        """Count an event; returns whether it is the last one."""
        self.require(revision >= self.calls, f"event {revision} after {self.calls}")
        self.done()
        self.calls = revision
        self.under_way()
        return revision == self._last

    def check(self, client: HullClient) -> None:
        hull = client.get_hull(self.hull)
        self.require(np.array_equal(self.copy.vertices, hull.vertices), "the copy is not the hull")
        self.require_all(client, self._written)


class WatchesOverShards(Watches):
    """The same, of a hull over shards."""

    config: ClassVar = {"shards": SHARDS}


class AsyncWatches(Watches):
    """A watch of asyncio."""

    def work(self) -> None:
        asyncio.run(self._work())

    async def _work(self) -> None:
        async with AsyncHullClient(self.address) as client, client.watch(self.hull, copy=self.copy) as events:
            async for event in events:
                if self.heard(event.revision):
                    return


class Consumes(Caller):
    """A consumer of a fence, which acknowledges each event; a call is an event. A key goes in and out."""

    config: ClassVar = {"keyed": "str"}

    @property
    def _fence(self) -> str:
        return f"{self.hull}/fence"

    def prepare(self, client: HullClient) -> None:
        client.create_fence(self._fence, area=[[0, 0], [4, 0], [4, 4], [0, 4]], subjects=self.hull)
        self._puts = 0
        self._last: int | None = None  # the sequence of the last event
        self._putting = threading.Thread(target=self._put, daemon=True)
        self._putting.start()

    def _put(self) -> None:
        try:
            with HullClient(self.address) as client:
                while not self.over.is_set():
                    client.put(self.hull, ["key"], OUTSIDE if self._puts % 2 else INSIDE)
                    self._puts += 1
                    self.over.wait(BREATH)
        except Exception as error:
            self.failed(f"put {self._puts + 1} of a fenced key", error)

    def work(self) -> None:
        with HullClient(self.address) as client, client.watch_fence(self._fence, consumer="c") as events:
            for event in events:
                self.under_way()
                self.require(event.sequence == self.calls + 1, f"event {event.sequence} after {self.calls}")
                client.ack_fence(self._fence, "c", event.sequence)
                self.done()
                if event.sequence == self._last:
                    return

    def finish(self) -> None:
        self.over.set()
        self._putting.join()
        self._last = self._puts + 2  # the first one is the snapshot
        with HullClient(self.address) as client:  # the watch waits for it
            client.put(self.hull, ["key"], OUTSIDE if self._puts % 2 else INSIDE)
        self._puts += 1
        super().finish()

    def check(self, client: HullClient) -> None:
        self.require(self.calls == self._puts + 1, f"{self.calls} events of {self._puts} puts")
        self.require(client.get_hull(self.hull).info.revision == self._puts, "puts are missing or there twice")


class Pipes(Caller):
    """A pipeline of reads, some of a hull over shards, and reads of one message."""

    @property
    def _other(self) -> str:
        return f"other-{self.hull}"

    def prepare(self, client: HullClient) -> None:
        client.create_hull(self._other, shards=SHARDS)
        for name in (self.hull, self._other):
            client.apply(name, insert=[[0, 0], [4, 0], [4, 4], [0, 4]])

    def work(self) -> None:
        with HullClient(self.address) as client, client.pipeline() as pipeline:
            while not self.over.is_set():
                self.under_way()
                located = [pipeline.locate(name, [[x, 1]]) for name in (self.hull, self._other) for x in (1, 4, 5)]
                counted = pipeline.count(self._other, [[4, 4]])
                sides = [each.result().sides.tolist() for each in located]
                self.require(sides == [[1], [0], [-1]] * 2, f"read {self.calls}: {sides}")
                self.require(counted.result().counts.tolist() == [1], f"read {self.calls} of a count")
                self.done()
                self.over.wait(BREATH)

    def check(self, client: HullClient) -> None:
        """Each answer was looked at."""


class AsyncPipes(Pipes):
    """A pipeline of asyncio."""

    def work(self) -> None:
        asyncio.run(self._work())

    async def _work(self) -> None:
        async with AsyncHullClient(self.address) as client, client.pipeline() as pipeline:
            while not self.over.is_set():
                self.under_way()
                located = [pipeline.locate(name, [[x, 1]]) for name in (self.hull, self._other) for x in (1, 4, 5)]
                sides = [(await each).sides.tolist() for each in located]
                self.require(sides == [[1], [0], [-1]] * 2, f"read {self.calls}: {sides}")
                self.done()
                await pause_async(BREATH)


class Reads(Pipes):
    """Reads of one message each, of both hulls."""

    def work(self) -> None:
        Caller.work(self)

    def step(self, client: Timed, number: int) -> None:
        name = (self.hull, self._other)[number % 2]
        self.require(client.locate(name, [[1, 1]]).sides.tolist() == [1], f"read {number}")
        self.require(client.get_hull(name).info.points == 4, f"read {number}")


class Creates(Caller):
    """Hulls and fences that are created and deleted; every third hull is over shards."""

    def step(self, client: Timed, number: int) -> None:
        name = f"{self.hull}-{number}"
        client.create_hull(name, keyed="str", shards=None if number % 3 else SHARDS)
        self.require(client.put(name, ["key"], INSIDE).revision == 1, f"hull {number} is an older one")
        if number % 3:
            client.create_fence(f"{name}/fence", area=[[0, 0], [4, 0], [4, 4]], subjects=name)
            client.delete_fence(f"{name}/fence")
        client.delete_hull(name)

    def check(self, client: HullClient) -> None:
        left = [each.name for each in client.list_hulls(f"{self.hull}-")]
        self.require(not left, f"deleted hulls: {left}")


KINDS: Sequence[type[Caller]] = (
    Plain,
    PlainOverShards,
    Large,
    Numbered,
    NumberedOverShards,
    Writes,
    WritesOverShards,
    AsyncWrites,
    Watches,
    WatchesOverShards,
    AsyncWatches,
    Consumes,
    Pipes,
    AsyncPipes,
    Reads,
    Creates,
)
