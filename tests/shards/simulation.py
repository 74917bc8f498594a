"""Schedules of one hull over shards: messages are lost, doubled and overtaken, roots and shards die in any moment.

    PYTHONPATH=tests python -m shards.simulation --schedules 100000 [--first 0]

A schedule follows from its seed. Processes die between two messages or at a change of their log, before or after it.
One that was replaced may go on for a while, with one root after the other, as in a cluster; or never does, as where
only one process can open a folder. Clients number their batches and send them again until they are answered. In the
end the decisions are replayed on one hull, which must agree with every answer that anybody got.
"""

import argparse
import random
import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynhull_cluster.shards import root as root_module
from dynhull_cluster.shards import shard as shard_module
from dynhull_cluster.shards.epochs import Epochs
from dynhull_cluster.shards.logs import FencedError
from dynhull_cluster.shards.messages import Open, SampleOf, StaticHull
from dynhull_cluster.shards.placement import ShardAddress
from dynhull_cluster.shards.requests import ExpirePoints, Read, Reshard, RootRequest, RootWrite
from dynhull_server.state.batch import Write
from dynhull_server.state.hull_state import HullState
from dynhull_server.state.records import Kept
from dynhull_server.state.requests import WriteBatch

from .memory_logs import Decisions, MemoryRootLog, MemoryShardLog
from .workload import KINDS, LIMITS, Workload, same_effect

EVERYTHING = 10**6
# So that even few points go to new shards in several messages.
root_module.PIECE_POINTS = FEW = 4
FEW_POINTS = replace(LIMITS, max_points=20)  # so that the limit is met
STEPS, MORE_STEPS, CLIENTS, AT_A_TIME = 120, 500, 2, 3
# Steps without faults within which everything that waits is answered.
PATIENCE = 400


class BrokenPromiseError(AssertionError):
    pass


class KilledError(Exception):
    """A process died here."""


@dataclass(eq=False)
class RootProcess:
    log: MemoryRootLog
    root: Any


@dataclass
class InFlight:
    """A message between a root and a shard, or the reply to it; None says that it came too late."""

    root: RootProcess
    shard: ShardAddress
    message: Any
    replied: bool = False
    reply: Any = None


class Client:
    """Sends numbered batches, some at a time, and all of them again until they are answered."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.sequence = 0  # of the last batch that was applied
        self.waiting: list[RootWrite] = []
        self.refused = False  # so that those behind it are out of order

    def may_send(self) -> bool:
        return not self.waiting or not (self.refused or len(self.waiting) == AT_A_TIME)


class World:
    """One schedule. The three types may have faults that it must find."""

    def __init__(
        self,
        seed: int,
        root_type: Any = root_module.Root,
        shard_type: Any = shard_module.Shard,
        epochs_type: Any = Epochs,
    ) -> None:
        self._draw = draw = random.Random(seed)
        self._root_type, self._shard_type, self._epochs_type = root_type, shard_type, epochs_type
        self._in_folder = draw.random() < 0.3
        self._settings = KINDS[draw.choice(list(KINDS))]
        self._workload = Workload(self._settings, seed)
        self._deadly = draw.choice((0.0, 0.01, 0.05))  # that a process dies at a change of its log
        self._lossy = draw.choice((0.0, 0.05, 0.3))
        self._restless = draw.choice((0.0, 0.05, 0.2))  # that the next request asks for another number of shards
        self._faults = True
        self._decisions = Decisions()
        self._count = draw.choice((1, 2, 2, 3))
        self._shard_logs: dict[ShardAddress, MemoryShardLog] = {}
        self._shards: dict[ShardAddress, Any] = {}
        self._in_flight: list[InFlight] = []
        self._process: RootProcess | None = None
        self._replaced: list[RootProcess] = []
        self._clients = [Client(name) for name in "ab"[:CLIENTS]]
        self._reads: list[Read] = []
        self._expiries: list[ExpirePoints] = []
        self._reshards: list[Reshard] = []
        self._batches: dict[tuple[str, int], Write] = {}
        self._acknowledged: dict[tuple[str, int], Any] = {}
        self._refused: list[tuple[int, Write, Exception]] = []
        self._read: list[tuple[int, Any, Any]] = []

    def _perhaps_die(self) -> None:
        if self._faults and self._draw.random() < self._deadly:
            raise KilledError

    # Turns

    def play(self) -> None:
        draw = self._draw
        # Another division takes many messages, most of which are old ones in a network that is always full.
        actions = [self._send, *[self._deliver] * (6 if self._restless else 3), self._ask]
        for _ in range(draw.randint(20, MORE_STEPS if self._restless else STEPS)):
            roll = draw.random()
            if roll < 0.01 and self._shards:
                self._kill_shard(draw.choice(list(self._shards)))
            elif roll < 0.02:
                self._replace_root()
            elif roll < 0.03:
                self._fail_root()
            elif roll < 0.05:
                self._drop_unneeded()
            else:
                draw.choice(actions)()
        self._faults = False
        for _ in range(PATIENCE):
            if not self._waits():
                break
            self._resume()
            self._send()
            while self._in_flight:
                self._deliver()
        if self._waits():
            raise BrokenPromiseError("a request is never answered")
        self._restart_everything()
        self._check()

    def _waits(self) -> bool:
        requests = [request for client in self._clients for request in client.waiting]
        return self._process is None or any(
            not each.answered for each in (*requests, *self._reads, *self._expiries, *self._reshards)
        )

    def _resume(self) -> None:
        """A root is started where there is none, and clients send again what they have no answer to."""
        if self._process is None:
            try:
                log = MemoryRootLog(self._decisions, self._epochs, self._perhaps_die)
                self._process = RootProcess(log, self._new_root(log))
            except KilledError:
                return
            self._ask_again()

    def _ask_again(self) -> None:
        """Clients send again what they have no answer to."""
        self._reads, self._expiries = [], []
        for client in self._clients:
            client.waiting = [RootWrite(request.batch, now=0.0) for request in client.waiting]
            for request in client.waiting:
                self._ask_root(request)
        self._reshards = [Reshard(reshard.shards) for reshard in self._reshards]
        for reshard in self._reshards:
            self._ask_root(reshard)

    def _epochs(self, owner: int) -> Any:
        return self._epochs_type(0 if self._in_folder else owner)

    def _new_root(self, log: MemoryRootLog) -> Any:
        """A root, after all shards have said which epochs they know; others may begin between that and its own."""
        log.known = max((each.epoch for each in self._shard_logs.values()), default=0)
        return self._root_type(self._settings, FEW_POINTS, self._count, log, now=0.0)

    def _ask(self) -> None:
        self._resume()
        if self._process is None:
            return
        draw = self._draw
        roll = draw.random()
        if roll < 0.15:
            read = Read(draw.choice((SampleOf(EVERYTHING), StaticHull())))
            self._reads.append(read)
            self._ask_root(read)
        elif roll < 0.3 and self._settings.window is not None and self._settings.window.clock == "server":
            self._workload.time += draw.choice((0, 10**6))
            expiry = ExpirePoints(self._workload.time)
            self._expiries.append(expiry)
            self._ask_root(expiry)
        elif roll > 1 - self._restless and not self._reshards:
            reshard = Reshard(draw.choice((1, 2, 3, 4)))
            self._reshards.append(reshard)
            self._ask_root(reshard)
        else:
            client = draw.choice(self._clients)
            if client.may_send():
                client.refused = False
                sequence = client.sequence + len(client.waiting) + 1
                write = self._workload.batch()._replace(producer=client.name, sequence=sequence)
                self._batches[client.name, write.sequence] = write
                client.waiting.append(RootWrite(WriteBatch(None, write), now=0.0))
                self._ask_root(client.waiting[-1])

    def _ask_root(self, request: RootRequest) -> None:
        process = self._process
        if process is None:  # it died of the request before
            return
        try:
            process.root.submit(request)
        except KilledError:
            self._lose_root()
        self._hear()

    def _send(self) -> None:
        self._resume()
        for process in [self._process, *self._replaced]:
            if process is not None:
                self._in_flight += [InFlight(process, *each) for each in process.root.messages()]

    def _deliver(self) -> None:
        if not self._in_flight:
            return
        draw = self._draw
        at = draw.randrange(len(self._in_flight))
        each = self._in_flight[at]
        if not (self._faults and draw.random() < self._lossy):  # else it comes again
            self._in_flight[at] = self._in_flight[-1]
            self._in_flight.pop()
        if self._faults and draw.random() < self._lossy:
            return
        if each.replied:
            self._deliver_reply(each)
        else:
            if each.shard not in self._shards:
                if not isinstance(each.message, Open):
                    return
                self._shard_logs[each.shard] = MemoryShardLog(self._perhaps_die)
                self._kill_shard(each.shard)
            try:
                reply = self._shards[each.shard].receive(each.message)
            except KilledError:
                self._kill_shard(each.shard)
                return
            self._in_flight.append(InFlight(each.root, each.shard, each.message, True, reply))

    def _deliver_reply(self, each: InFlight) -> None:
        current = each.root is self._process
        if not current and each.root not in self._replaced:
            return
        if each.reply is None:
            if any(message is each.message for _, message in each.root.root.messages()):
                if current and not self._in_folder:  # in a folder, messages of a dead process may still arrive
                    raise BrokenPromiseError("the latest root is fenced")
                self._begin_root(each.root)
            return
        try:
            each.root.root.receive(each.shard, each.reply)
        except KilledError:
            if current:
                self._lose_root()
            else:
                self._replaced.remove(each.root)
        except FencedError:
            if current:
                raise BrokenPromiseError("the latest root is fenced") from None
            self._replaced.remove(each.root)
        except root_module.ShardsDifferError:
            if current:
                raise
            self._replaced.remove(each.root)  # the shards that it knows have been dropped: the hull has others
        self._hear()

    def _kill_shard(self, shard: ShardAddress) -> None:
        self._shards[shard] = self._shard_type(self._settings, self._shard_logs[shard])

    def _drop_unneeded(self) -> None:
        """Shards ask the root that serves now whether they are needed, and are dropped for good if they are not."""
        if self._process is not None and self._process not in self._replaced:
            needed = self._process.root.generations
            for place in [each for each in self._shards if each.generation not in needed]:
                del self._shards[place], self._shard_logs[place]

    def _lose_root(self) -> None:
        self._process = None

    def _replace_root(self) -> None:
        """Another process takes over; the old one may go on, unaware of that."""
        if self._process is not None and not self._in_folder and self._draw.random() < 0.5:
            self._replaced.append(self._process)
        self._lose_root()

    def _fail_root(self) -> None:
        """A process, which may have been replaced, begins another root, as after an error."""
        processes = [each for each in (self._process, *self._replaced) if each is not None]
        if processes:
            self._begin_root(self._draw.choice(processes))

    def _begin_root(self, process: RootProcess) -> None:
        try:
            process.root = self._new_root(process.log)
        except FencedError:
            if process is self._process:
                raise BrokenPromiseError("the latest root is fenced") from None
            self._replaced.remove(process)
        if process is self._process:
            self._ask_again()

    # Answers

    def _hear(self) -> None:
        """Take note of what is answered, by whichever root."""
        for client in self._clients:
            answered = [request for request in client.waiting if request.answered]
            client.waiting = [request for request in client.waiting if not request.answered]
            for request in answered:
                write = request.batch.write
                if request.error is None:
                    client.sequence = max(client.sequence, write.sequence)
                    self._acknowledged[client.name, write.sequence] = request.result
                else:  # its number is free again
                    client.refused = True
                    self._refused.append((len(self._decisions.made), write, request.error))
        for read in self._reads:
            if read.answered:
                self._read.append((*read.result, read.question))
        self._reads = [read for read in self._reads if not read.answered]
        self._expiries = [expiry for expiry in self._expiries if not expiry.answered]
        for reshard in self._reshards:
            if reshard.answered and reshard.error is not None:
                raise BrokenPromiseError(f"resharding failed: {reshard.error}")
        self._reshards = [reshard for reshard in self._reshards if not reshard.answered]

    # The end

    def _restart_everything(self) -> None:
        self._replaced, self._in_flight, self._process = [], [], None
        for shard in self._shards:
            self._kill_shard(shard)
        self._resume()
        for question in (SampleOf(EVERYTHING), StaticHull()):
            self._reads.append(Read(question))
            self._ask_root(self._reads[-1])
        for _ in range(PATIENCE):
            if not self._waits():
                return
            self._send()
            while self._in_flight:
                self._deliver()
        raise BrokenPromiseError("no answer after a restart")

    def _check(self) -> None:
        one = HullState(FEW_POINTS, self._settings, Kept(), now=0.0)
        reads: dict[int, list[tuple[Any, Any]]] = {}
        for revision, answer, question in self._read:
            reads.setdefault(revision, []).append((answer, question))
        refused: dict[int, list[tuple[Write, Exception]]] = {}
        for position, write, error in self._refused:
            refused.setdefault(position, []).append((write, error))
        for position in range(len(self._decisions.made) + 1):
            self._check_reads(one, reads.pop(one.counts.revision, []))
            for write, error in refused.get(position, []):
                check_refused(one, write, error)
            if position < len(self._decisions.made):
                self._replay(one, self._decisions.made[position])
        if reads:
            raise BrokenPromiseError(f"reads of the revisions {sorted(reads)}, which never were")
        if self._acknowledged:
            raise BrokenPromiseError(f"acknowledged, but not there: {sorted(self._acknowledged)}")
        assert self._process is not None
        root = self._process.root
        if not np.array_equal(root.hull.vertices(), one.vertices()):
            raise BrokenPromiseError("the hull has other vertices")
        if (root.points, root.revision, root.clock) != (one.counts.points, one.counts.revision, one.counts.clock):
            raise BrokenPromiseError("other counts")
        if root.distinct is None and root.vertex_keys() != one.vertex_keys().tolist():
            raise BrokenPromiseError("other keys at the vertices")

    def _check_reads(self, one: HullState, reads: list[tuple[Any, Any]]) -> None:
        for answer, question in reads:
            right = answer if isinstance(question, StaticHull) else np.array_equal(answer, one.hull.points())
            if not right:
                raise BrokenPromiseError(f"another answer to {question} at revision {one.counts.revision}")

    def _replay(self, one: HullState, decision: Any) -> None:
        if decision.division is not None:
            one.counts.revision += 1  # the hull and its points stay as they are
        elif decision.cause == "expiry":
            if not one.expire(decision.clock, None):
                raise BrokenPromiseError("an expiry without points")
        else:
            number = decision.producer, decision.sequence
            before = one.vertices()
            try:
                expected = one.apply(self._batches[number], 0.0, None)
            except Exception as error:
                raise BrokenPromiseError(f"one hull refuses {number}: {error}") from error
            if expected.duplicate:
                raise BrokenPromiseError(f"{number} is applied twice")
            told = self._acknowledged.pop(number, None)
            same = told is None or told.duplicate or same_effect(told, expected, before, one.vertices())
            if not same:
                raise BrokenPromiseError(f"{number}: {told}, not {expected}")
        if one.counts.revision != decision.revision:
            raise BrokenPromiseError(f"revision {decision.revision}, not {one.counts.revision}")


def check_refused(one: HullState, write: Write, error: Exception) -> None:
    try:
        one.apply(write, 0.0, None)
    except Exception:
        return
    raise BrokenPromiseError(f"refused, but one hull applies it: {error}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--schedules", type=int, default=100_000)
    parser.add_argument("--first", type=int, default=0, help="the seed of the first one")
    arguments = parser.parse_args()
    begun = time.monotonic()
    for seed in range(arguments.first, arguments.first + arguments.schedules):
        try:
            World(seed).play()
        except Exception as error:
            raise SystemExit(f"schedule {seed}: {type(error).__name__}: {error}") from error
    print(f"{arguments.schedules} schedules in {time.monotonic() - begun:.0f} s: no promise is broken")


if __name__ == "__main__":
    main()
