"""Callers that disconnect: in every call, at every moment, many on one name, while others go on and kills happen.

    python tests/robustness/server/callers.py --calls 10000 --kills 5

Batches are single points, each another one on a parabola, so the count of a point says whether its batch is there. In
one hull the points have keys.

* Of the hulls that no caller deletes: an acknowledged batch is there once, over every kill; a refused one is not; one
  whose caller disconnected is there once or not at all, and does not change once a reader has seen it. Batches that
  one call applies to two hulls are in both or in none.
* Of the hulls that are created and deleted all the time: at the end each can be created, written, read and deleted.
* Alarms over both are created, deleted, watched and taken care of meanwhile: of each that is left no event is missing,
  it was raised once between two clears, and is raised as its hulls say.
* Others write to another hull meanwhile: every one of their batches is acknowledged.
"""

import argparse
import asyncio
import random
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from itertools import count
from pathlib import Path

import grpc
import numpy as np

sys.path.append(str(Path(__file__).parents[2] / "support"))
from alarm_calls import AlarmCalls
from forked import COMMAND, Process
from pacing import pause_async
from patience import PATIENCE
from ports import free_port
from promises import BrokenPromiseError, require

from dynhull_proto.v1 import batch_pb2, hull_pb2, points_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_proto.v1.hull_service_pb2_grpc import HullServiceStub

KEYED = "kept/keys"
KEPT = ["kept/a", "kept/b", "kept/c", KEYED]
CHURNED = ["churned/a", "churned/b", "churned/c"]
STEADY = "steady"
CALLERS = 24
LONGEST_STAY = 0.02  # seconds until a caller disconnects
# Otherwise a channel to a new server waits for the pause that one to the killed server has begun.
OWN = [("grpc.use_local_subchannel_pool", 1)]
STREAMED = 4  # batches of a stream
# What says that nothing was applied.
REFUSED = {
    grpc.StatusCode.NOT_FOUND,
    grpc.StatusCode.ALREADY_EXISTS,
    grpc.StatusCode.RESOURCE_EXHAUSTED,
    grpc.StatusCode.FAILED_PRECONDITION,
}


def batch_of(name: str, number: int) -> batch_pb2.Batch:
    point = points_pb2.Points(packed=np.array([number, float(number) ** 2]).tobytes())
    if name != KEYED:
        return batch_pb2.Batch(inserts=point)
    return batch_pb2.Batch(puts=batch_pb2.Puts(keys=points_pb2.Keys(integers=[number]), points=point))


def creation_of(name: str) -> pb.CreateHullRequest:
    identity = hull_pb2.IDENTITY_INTEGER_KEYS if name == KEYED else hull_pb2.IDENTITY_MULTISET
    return pb.CreateHullRequest(name=name, config=hull_pb2.HullConfig(identity=identity))


class Server:
    def __init__(self, data: Path) -> None:
        self.data = data
        self.port = free_port()
        self.log = data.with_name("server.log")

    def start(self) -> None:
        command = [COMMAND, "serve", "--port", str(self.port), "--data", str(self.data), "--create-on-write"]
        command += ["--snapshot-points", "500", "--log-level", "warning"]
        with self.log.open("ab") as log:
            self.process = Process(command, stdout=subprocess.PIPE, stderr=log, text=True)
        line = self.process.stdout.readline()
        require("serving on" in line, f"the server did not start: {self.log.read_text()}")

    def kill(self) -> None:
        with self.process:  # which waits for its end
            self.process.kill()

    def stop(self) -> int:
        with self.process:
            self.process.send_signal(signal.SIGTERM)
            return self.process.wait(PATIENCE)


class Model:
    """What is known of each batch: True, it must be there; False, it must not; None, either is correct."""

    def __init__(self) -> None:
        self.numbers = count(1)
        self.batches: dict[str, dict[int, bool | None]] = {name: {} for name in (*KEPT, STEADY)}
        self.together: list[tuple[str, str, int]] = []  # the same batch in two hulls

    def new(self, name: str) -> int:
        number = next(self.numbers)
        self.batches.get(name, {})[number] = None
        return number

    def new_together(self, one: str, other: str) -> int:
        number = self.new(one)
        self.batches[other][number] = None
        self.together.append((one, other, number))
        return number

    def answered(self, name: str, number: int, applied: bool) -> None:
        if name in self.batches:
            self.batches[name][number] = applied


class Callers:
    def __init__(self, server: Server, seed: int) -> None:
        self._server = server
        self._random = random.Random(seed)
        self._model = Model()
        self._alarms = AlarmCalls(self._random, [*KEPT, *CHURNED])
        self.calls = self.gone = self.acknowledged = self.steady = self.events = 0
        self.outcomes: Counter[str] = Counter()

    async def run(self, calls: int, kills: int) -> None:
        for life in range(kills + 1):
            self._server.start()
            async with grpc.aio.insecure_channel(f"127.0.0.1:{self._server.port}", OWN) as channel:
                stub = HullServiceStub(channel)
                await self._check(stub)
                self.events += await self._alarms.check(channel)
                end = calls * (life + 1) // (kills + 1)
                steady = asyncio.create_task(self._write_steadily(stub))
                async with asyncio.TaskGroup() as group:
                    for _ in range(CALLERS):
                        group.create_task(self._call_until(channel, stub, end))
                steady.cancel()
                await asyncio.gather(steady, return_exceptions=True)
                if not steady.cancelled() and (error := steady.exception()) is not None:
                    raise error
                if life < kills:
                    last = end + 2 * CALLERS
                    burst = [asyncio.create_task(self._call_until(channel, stub, last)) for _ in range(CALLERS)]
                    await pause_async(self._random.uniform(0, 0.03))
                    self._server.kill()
                    await asyncio.gather(*burst, return_exceptions=True)
                else:
                    await self._check(stub)
                    self.events += await self._alarms.check(channel)
                    await self._probe(stub)
        require(self._server.stop() == 0, "the server did not end in peace")

    async def _call_until(self, channel: grpc.aio.Channel, stub: HullServiceStub, calls: int) -> None:
        while self.calls < calls:
            self.calls += 1
            name = self._random.choice(KEPT * 2 + CHURNED * 3)
            make = self._random.choice([self._apply, self._apply, self._stream, self._create, self._read, self._watch])
            if name in KEPT and self._random.random() < 0.15:
                make = self._together
            if name in CHURNED and self._random.random() < 0.3:
                make = self._delete
            of_alarm = self._random.random() < 0.2
            doing = asyncio.create_task(self._alarms.call(channel) if of_alarm else make(stub, name))
            if self._random.random() < 0.8:
                await asyncio.wait([doing], timeout=self._random.random() ** 3 * LONGEST_STAY)
                self.gone += not doing.done()
                doing.cancel()
            try:
                await asyncio.wait_for(doing, PATIENCE)
            except asyncio.CancelledError:
                self.outcomes["gone"] += 1
            except TimeoutError:
                raise BrokenPromiseError(f"{make.__name__} {name} was not answered") from None
            except grpc.RpcError as error:
                self.outcomes[error.code().name] += 1
                require("see the server's log" not in error.details(), f"{make.__name__} {name}: {error.details()}")

    async def _apply(self, stub: HullServiceStub, name: str) -> None:
        number = self._model.new(name)
        try:
            await stub.Apply(pb.ApplyRequest(name=name, batch=batch_of(name, number)))
        except grpc.RpcError as error:
            if error.code() in REFUSED:
                self._model.answered(name, number, applied=False)
            raise
        self._model.answered(name, number, applied=True)
        self.acknowledged += 1

    async def _together(self, stub: HullServiceStub, name: str) -> None:
        names = name, self._random.choice([other for other in KEPT if other != name])
        number = self._model.new_together(*names)
        batches = [pb.HullBatch(name=each, batch=batch_of(each, number)) for each in names]
        try:
            await stub.ApplyTogether(pb.ApplyTogetherRequest(batches=batches))
        except grpc.RpcError as error:
            if error.code() in REFUSED:
                for each in names:
                    self._model.answered(each, number, applied=False)
            raise
        for each in names:
            self._model.answered(each, number, applied=True)
        self.acknowledged += 1

    async def _stream(self, stub: HullServiceStub, name: str) -> None:
        numbers = [self._model.new(name) for _ in range(STREAMED)]

        async def requests():
            for number in numbers:
                yield pb.StreamRequest(name=name, batch=batch_of(name, number))

        call = stub.Stream(requests())
        try:
            done = iter(numbers)
            async for _ in call:
                self._model.answered(name, next(done), applied=True)
                self.acknowledged += 1
        finally:
            call.cancel()

    async def _create(self, stub: HullServiceStub, name: str) -> None:
        await stub.CreateHull(creation_of(name))

    async def _delete(self, stub: HullServiceStub, name: str) -> None:
        await stub.DeleteHull(pb.DeleteHullRequest(name=name))

    async def _read(self, stub: HullServiceStub, name: str) -> None:
        await stub.GetHull(pb.GetHullRequest(name=name))

    async def _watch(self, stub: HullServiceStub, name: str) -> None:
        call = stub.Watch(pb.WatchRequest(name=name))
        try:
            async for _ in call:
                return
        finally:
            call.cancel()

    async def _write_steadily(self, stub: HullServiceStub) -> None:
        while True:
            number = self._model.new(STEADY)
            await stub.Apply(pb.ApplyRequest(name=STEADY, batch=batch_of(STEADY, number)), timeout=PATIENCE)
            self._model.answered(STEADY, number, applied=True)
            self.steady += 1

    async def _check(self, stub: HullServiceStub) -> None:
        for name, batches in self._model.batches.items():
            numbers = list(batches)
            xy = np.array([[number, float(number) ** 2] for number in numbers]).reshape(-1, 2)
            query = pb.CountRequest(name=name)
            query.points.packed = xy.tobytes()
            try:
                counts = list((await stub.Count(query, timeout=PATIENCE)).counts)
            except grpc.RpcError as error:
                require(error.code() == grpc.StatusCode.NOT_FOUND, f"{name}: {error.details()}")
                counts = [0] * len(numbers)
            for number, times in zip(numbers, counts, strict=True):
                known = batches[number]
                require(times <= 1, f"{name}: batch {number} is there {times} times")
                require(known is not True or times == 1, f"{name}: batch {number} was acknowledged and is lost")
                require(known is not False or times == 0, f"{name}: batch {number} was refused and is there")
                batches[number] = times == 1
        for one, other, number in self._model.together:
            both = self._model.batches[one][number] == self._model.batches[other][number]
            require(both, f"batch {number} of one call is there in {one} or {other}, not in both")

    async def _probe(self, stub: HullServiceStub) -> None:
        """No zombies: every name can be deleted, created, written, read and deleted."""
        for name in CHURNED:
            try:
                await stub.DeleteHull(pb.DeleteHullRequest(name=name), timeout=PATIENCE)
            except grpc.RpcError as error:
                require(error.code() == grpc.StatusCode.NOT_FOUND, f"{name}: {error.details()}")
            await stub.CreateHull(creation_of(name), timeout=PATIENCE)
            await stub.Apply(pb.ApplyRequest(name=name, batch=batch_of(name, 1)), timeout=PATIENCE)
            hull = (await stub.GetHull(pb.GetHullRequest(name=name), timeout=PATIENCE)).hull
            require((hull.revision, hull.point_count) == (1, 1), f"{name} holds another hull's points: {hull}")
            await stub.DeleteHull(pb.DeleteHullRequest(name=name), timeout=PATIENCE)


def callers(folder: Path, calls: int, kills: int, seed: int) -> str:
    """Make the calls. Returns the counts; raises BrokenPromiseError with the broken promise."""
    server = Server(folder / "data")
    run = Callers(server, seed)
    try:
        asyncio.run(run.run(calls, kills))
    except BaseException:
        print(server.log.read_text(), file=sys.stderr)
        raise
    finally:
        server.kill()
    return (
        f"calls: {run.calls}, their callers went away in {run.gone}; kills: {kills}; batches acknowledged: "
        f"{run.acknowledged}, and {run.steady} of a steady writer; lost: 0, doubled: 0, zombies: 0; events of alarms: "
        f"{run.events}; "
        f"other ends: {dict(run.outcomes.most_common())}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description="Callers that disconnect while a model checks every answer.")
    parser.add_argument("--calls", type=int, default=10_000, help="how many (default 10,000)")
    parser.add_argument("--kills", type=int, default=5, help="how often the server is killed meanwhile (default 5)")
    parser.add_argument("--seed", type=int, default=0, help="what the calls depend on (default 0)")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        print(callers(Path(folder), options.calls, options.kills, options.seed))


if __name__ == "__main__":
    main()
