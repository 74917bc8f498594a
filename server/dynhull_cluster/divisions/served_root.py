"""The root of a hull over shards in this process, as the event loop serves it: requests, and messages to shards."""

import asyncio
from collections.abc import Awaitable, Callable, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.static import chan
from dynhull.static.trace import Round, Rounds
from dynhull_server.engine.driver import Driver
from dynhull_server.engine.verification import Verification, first_difference
from dynhull_server.engine.waiter import Waiter
from dynhull_server.state.contents.joining import joined
from dynhull_server.state.contents.keyed import Found
from dynhull_server.state.errors import HullNotFoundError, ShardAwayError, StoppingError
from dynhull_server.state.hull import Hull
from dynhull_server.state.hull_state import Counts, HullState
from dynhull_server.state.records import Contents, Division, Keys
from dynhull_server.state.requests import Expire, ReadHull, WriteBatch
from dynhull_server.state.root_state import RootState
from dynhull_server.storage.port import DamagedError

from ..shards import messages as say
from ..shards.placement import ShardAddress
from .asked import Asked, AskedExpiry, AskedRead, AskedReshard, AskedWrite
from .peers import PeerAwayError
from .root_thread import RootThread, Turn

# Seconds that requests wait for a shard that does not answer, though its worker can be reached.
SILENT_SECONDS = 30.0
# Seconds before a message to a worker that is away is sent again.
AGAIN_SECONDS = 0.05
# Seconds before a root that has failed is replaced: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0

Reply = TypeVar("Reply")
# Brings a message to a shard, and returns its reply. Raises PeerAwayError.
Deliver = Callable[[ShardAddress, say.Request], Awaitable[say.Reply | None]]
# Returns the last epoch that a shard knows of; it is created if there is none. Raises PeerAwayError.
Greet = Callable[[ShardAddress], Awaitable[int]]


class ServedRoot:
    """A root, until `close`. It is a Division.

    Args:
        driver: drives the core that has the hull.
        epoch: that of this server as the owner of its storage.
        hull: the hull that its readers see.
        greet: looks for a shard.
        deliver: brings a message to a shard.
        patience: the seconds that requests wait for a shard whose worker cannot be reached.
    """

    def __init__(self, driver: Driver, epoch: int, hull: Hull, greet: Greet, deliver: Deliver, patience: float) -> None:
        self._driver = driver
        self._hull = hull
        self._greet = greet
        self._deliver = deliver
        self._patience = patience
        self._loop = asyncio.get_running_loop()
        self._clock = driver.machine.clock
        self._work = f"shards of {hull.name}"
        self._thread = RootThread(driver, epoch, hull, self._took)
        self._waits = False
        self._generations: frozenset[int] | None = None  # those that are needed; None where that is not known
        self._couriers: dict[ShardAddress, tuple[say.Request, asyncio.Task[None]]] = {}
        self._unanswered: dict[ShardAddress, float] = {}  # since when
        self._away: set[ShardAddress] = set()
        self._closed = False
        self._begun = False  # whether there is a root, as the last turn of its thread says
        self._starting = self._loop.create_task(self._start(FIRST_PAUSE))

    # Requests

    def carry_out(self, requests: Sequence[WriteBatch | Expire]) -> None:
        """Carry out requests in this order, and answer them."""
        now, answered = self._clock.monotonic(), self._thread.answered
        made: list[Asked] = []
        for request in requests:
            if isinstance(request, Expire):
                made.append(AskedExpiry(request, answered))
                continue
            batch = AskedWrite(request, self._hull, now, answered)
            if not batch.abandoned:
                made.append(batch)
        if made:
            self._submit(made)

    async def count(self, points: Points) -> tuple[Counts, npt.NDArray[np.int64]]:
        """The multiplicity of each of (k, 2) points."""
        counts, answer = await self._ask(say.CountOf(points))
        return counts, answer

    async def sample(self, size: int) -> tuple[Counts, Points]:
        """A sample of at most `size` of all points."""
        counts, answer = await self._ask(say.SampleOf(size))
        return counts, answer

    async def find(self, keys: Keys) -> tuple[Counts, Found, Points]:
        """The positions of keys, and the vertices of the hull."""
        counts, (answers, vertices) = await self._ask(say.FoundOf(keys))
        found: Found = answers[0]
        for each in answers[1:]:
            here = each.present[:, np.newaxis]
            times = found.times
            if times is not None:
                times = np.where(each.present, each.times, times)
            accuracies = found.accuracies
            if accuracies is None or each.accuracies is None:
                accuracies = each.accuracies if accuracies is None else accuracies
            else:
                accuracies = accuracies + each.accuracies  # a key is in one shard
            found = Found(np.where(here, each.points, found.points), found.present | each.present, times, accuracies)
        return counts, found, vertices

    async def contents(self) -> tuple[Counts, Contents]:
        """All points, in the order of their keys if they have any."""
        counts, (answers, _) = await self._ask(say.AllOf())
        return counts, await self._driver.aside(partial(joined, answers))

    async def verify(self) -> tuple[Counts, Verification]:
        """Compare the hull with Chan's algorithm on the points of all shards."""
        begun = self._clock.monotonic()
        counts, (answers, vertices) = await self._ask(say.Recompute())

        def compare() -> Verification:
            trace = Rounds()
            recomputed = chan(np.concatenate([each.vertices for each in answers]), trace=trace)
            rounds = [found for each in answers for found in each.rounds]
            rounds += [each for each in trace if isinstance(each, Round)]
            return Verification(
                sum(each.points for each in answers),
                len(vertices),
                rounds,
                first_difference(vertices, recomputed),
                self._clock.monotonic() - begun,  # no less than the processor time of this process
                all(each.keys_equal for each in answers),
            )

        return counts, await self._driver.aside(compare)

    async def reshard(self, shards: int) -> Counts:
        """Divide the points among another number of shards."""
        asked = AskedReshard(shards, self._hull, self._thread.answered)
        await self._answered(asked)
        return asked.counts

    async def _ask(self, question: say.Question) -> tuple[Counts, Any]:
        asked = AskedRead(question, self._hull, self._thread.answered)
        await self._answered(asked)
        revision, answer = asked.result
        assert revision == asked.counts.revision
        return asked.counts, answer

    async def _answered(self, asked: AskedRead | AskedReshard) -> None:
        """Wait until it is answered, or raise the error; it goes on if the caller does not wait."""
        self._submit([asked])
        await asked.asked
        if asked.error is not None:
            raise asked.error.with_traceback(None)

    def _submit(self, requests: Sequence[Asked]) -> None:
        self._waits = True
        self._thread.submit(requests)

    # Life

    def look(self) -> None:
        """Refuse what waits for a shard that has been away for long. Called several times a second."""
        if self._thread.damage is not None:
            self._driver.supervisor.failed(self._work, DamagedError(str(self._thread.damage)))
        now = self._clock.monotonic()
        for place, since in self._unanswered.items():
            patience = self._patience if place in self._away else SILENT_SECONDS
            if self._waits and now - since > patience:
                self._thread.give_up(ShardAwayError(self._hull.name, place.number))
                return

    def needs(self, generation: int) -> bool:
        """Whether the shards of a generation may be needed."""
        return self._generations is None or generation in self._generations

    def end(self) -> None:
        """The hull is deleted: refuse what waits."""
        self._thread.refuse_all(HullNotFoundError(self._hull.name))

    async def close(self) -> None:
        """Refuse what waits, and stop."""
        self._closed = True  # what the thread still completes begins nothing
        self._thread.refuse_all(StoppingError())
        self._starting.cancel()
        for _, courier in self._couriers.values():
            courier.cancel()
        await self._thread.close()
        await asyncio.sleep(0)  # callers hear of it before the engine closes

    async def _start(self, pause: float) -> None:
        """Greet the shards, and make a root; try again until that succeeds."""
        while True:
            error = await self._begin()
            if error is None or isinstance(error, HullNotFoundError | StoppingError):
                return
            self._driver.supervisor.failed(self._work, error)
            await self._clock.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    async def _begin(self) -> Exception | None:
        """Greet the shards, and make a root. Returns what prevents that."""
        try:
            read = ReadHull(Waiter(), self._hull, _division)
            _, division = await self._driver.ask(read)
        except Exception as error:  # the storage may have failed
            return error
        places = [ShardAddress(division.generation, number) for number in range(division.shards)]
        greeted = await asyncio.gather(*map(self._greeted, places))
        return await self._thread.begin(max(greeted))

    async def _greeted(self, place: ShardAddress) -> int:
        self._unanswered.setdefault(place, self._clock.monotonic())
        return await self._answer_of(place, lambda: self._greet(place))

    # Messages

    def _took(self, turn: Turn) -> None:
        """What the thread leaves to the event loop."""
        self._waits, self._generations = turn.waits, turn.generations
        for each in turn.answered:
            each.tell()
        if self._closed:
            return
        if turn.opened:
            self._driver.supervisor.succeeded(self._work)
        begun, self._begun = self._begun, turn.messages is not None
        # The task that has begun it may not have noticed yet. Where none has begun, it tries again itself.
        if turn.failure is not None and begun:
            self._driver.supervisor.failed(self._work, turn.failure)
            self._starting = self._loop.create_task(self._start(FIRST_PAUSE))
        if turn.messages is None:  # there is no root, and shards are greeted
            return
        now = self._clock.monotonic()
        for place in self._unanswered.keys() - {place for place, _ in turn.messages}:
            self._heard(place)
        for place in self._couriers.keys() - {place for place, _ in turn.messages}:
            if place.generation not in (turn.generations or ()):
                self._couriers.pop(place)[1].cancel()
        for place, message in turn.messages:
            before = self._couriers.get(place)
            if before is not None:
                if before[0] is message:
                    continue
                before[1].cancel()
            self._unanswered.setdefault(place, now)
            self._couriers[place] = message, self._loop.create_task(self._bring(place, message))

    async def _bring(self, place: ShardAddress, message: say.Request) -> None:
        """Bring a message to a shard, which is created for the first one, and the reply to the root."""
        if isinstance(message, say.Open):
            await self._answer_of(place, lambda: self._greet(place))
            self._unanswered[place] = self._clock.monotonic()
        reply = await self._answer_of(place, lambda: self._deliver(place, message))
        self._thread.receive(place, message, reply)

    async def _answer_of(self, place: ShardAddress, ask: Callable[[], Awaitable[Reply]]) -> Reply:
        """Ask a shard, again and again until it answers."""
        while True:
            try:
                answer = await ask()
            except PeerAwayError:
                self._away.add(place)
                await self._clock.sleep(AGAIN_SECONDS)
            except Exception as error:  # it has failed, and the next message finds another one
                self._driver.supervisor.failed(self._work, error)
                self._away.add(place)
                await self._clock.sleep(FIRST_PAUSE)
            else:
                self._heard(place)
                return answer

    def _heard(self, place: ShardAddress) -> None:
        self._unanswered.pop(place, None)
        self._away.discard(place)


def _division(state: HullState) -> Division:
    assert isinstance(state, RootState)  # nobody else has a root
    return state.division
