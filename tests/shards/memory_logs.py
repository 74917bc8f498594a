"""Logs in memory, and a cluster whose messages arrive at once."""

from collections.abc import Callable, Sequence
from typing import Any

from dynhull_cluster.shards.epochs import Epochs
from dynhull_cluster.shards.logs import Decided, Decision, FencedError
from dynhull_cluster.shards.messages import Message
from dynhull_cluster.shards.placement import ShardAddress
from dynhull_cluster.shards.requests import RootRequest
from dynhull_cluster.shards.root import Root
from dynhull_cluster.shards.shard import Shard
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import HullSettings, Kept, Record

# Called before and after each change of a log; may raise, as a process that dies there would.
Hook = Callable[[], None]


def nothing() -> None:
    pass


class Decisions:
    """What is decided, and who owns it: processes that take it over, one after the other."""

    def __init__(self) -> None:
        self.owner = 0
        self.made: list[Decision] = []


class MemoryRootLog:
    """The log of the roots of a process, from when it takes the decisions over. What it decides is refused once another
    one has. Of what others have decided since, it knows nothing.

    Attributes:
        known: the greatest epoch that shards know of, as far as the next root has heard.
    """

    def __init__(self, decisions: Decisions, epochs: Callable[[int], Epochs] = Epochs, hook: Hook = nothing) -> None:
        hook()
        decisions.owner += 1
        hook()
        self._decisions = decisions
        self._owner = decisions.owner
        self._made = list(decisions.made)
        self._epochs = epochs(self._owner)
        self._epoch = 0
        self.known = 0
        self.hook = hook

    def begin(self, epoch: int | None) -> tuple[int, Decided]:
        if epoch not in (None, self._epoch):
            raise FencedError
        self._epoch = self._epochs.next(self.known if epoch is None else epoch)
        return self._epoch, self._decided()

    def _decided(self) -> Decided:
        if not self._made:
            return Decided()
        last = self._made[-1]
        division, steps = None, dict[int, int]()
        for each in self._made:
            if each.division is None:
                steps |= dict.fromkeys(each.shards, each.number)
            else:
                division, steps = each.division, {shard: each.effects[shard].number for shard in each.shards}
        return Decided(
            max(steps.values(), default=0),
            last.revision,
            last.cause,
            last.clock,
            {each.producer: each.sequence for each in self._made if each.producer},
            frozenset(each.producer for each in self._made if each.may_skip),
            steps,
            division,
        )

    def decide(self, epoch: int, decisions: Sequence[Decision]) -> None:
        if epoch != self._epoch or self._owner != self._decisions.owner:
            raise FencedError
        self.hook()
        self._decisions.made += decisions
        self._made += decisions
        self.hook()


class MemoryShardLog:
    def __init__(self, hook: Hook = nothing) -> None:
        self.epoch = 0
        self.steps: list[tuple[int, list[Record]]] = []
        self.hook = hook

    def begin(self, epoch: int, decided: int) -> None:
        assert epoch > self.epoch
        self.hook()
        self.epoch = epoch
        self.steps = [(number, records) for number, records in self.steps if number <= decided]
        self.hook()

    def add(self, steps: Sequence[tuple[int, list[Record]]]) -> None:
        numbers = [number for number, _ in (*self.steps[-1:], *steps)]
        assert numbers == sorted(set(numbers))
        self.hook()
        self.steps += steps
        self.hook()

    def drop(self, number: int) -> None:
        self.hook()
        self.steps = [step for step in self.steps if step[0] < number]
        self.hook()

    def read(self) -> tuple[Kept, int]:
        number = self.steps[-1][0] if self.steps else 0
        return Kept(records=[record for _, records in self.steps for record in records]), number


class Cluster:
    """A root and its shards, whose messages arrive at once."""

    def __init__(self, settings: HullSettings, limits: Limits, count: int) -> None:
        self._settings, self._limits = settings, limits
        self._count = count
        self._decisions = Decisions()
        self._logs: dict[ShardAddress, MemoryShardLog] = {}
        self._shards: dict[ShardAddress, Shard] = {}
        self.restart_root()

    @property
    def shard_logs(self) -> list[MemoryShardLog]:
        """The logs of the shards of the present division."""
        (generation,) = self.root.generations
        return [log for place, log in sorted(self._logs.items()) if place.generation == generation]

    def restart_root(self) -> None:
        log = MemoryRootLog(self._decisions)
        self.root = Root(self._settings, self._limits, self._count, log, now=0.0)
        self.deliver()

    def restart_shard(self, shard: int) -> None:
        (generation,) = self.root.generations
        place = ShardAddress(generation, shard)
        self._shards[place] = Shard(self._settings, self._logs[place])

    def deliver(self) -> None:
        while messages := self.root.messages():
            for place, message in messages:
                reply = self.receive(place, message)
                if reply is not None:
                    self.root.receive(place, reply)

    def receive(self, place: ShardAddress, message: Message) -> Any:
        """What a shard replies, a new one if there is none."""
        if place not in self._shards:
            self._logs[place] = MemoryShardLog()
            self._shards[place] = Shard(self._settings, self._logs[place])
        return self._shards[place].receive(message)

    def serve(self, *requests: RootRequest) -> RootRequest:
        """Have requests answered, those that can be in one round. Returns the last one."""
        for request in requests:
            self.root.submit(request)
        self.deliver()
        assert all(request.answered for request in requests)
        return requests[-1]
