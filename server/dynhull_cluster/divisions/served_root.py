"""The root of a hull over shards in this process, with a thread of its own.

The thread runs the protocol; the event loop brings messages to the shards, again and again until they are answered.
"""

import asyncio
import logging
from collections.abc import Awaitable, Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import PackedKeys, key_list
from dynhull.static import chan
from dynhull.static.trace import Round, Rounds
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.verification import Verification, first_difference
from dynhull_server.engine.waiter import Waiter
from dynhull_server.state import events
from dynhull_server.state.contents.keyed import Found
from dynhull_server.state.errors import (
    HullNotFoundError,
    NotStoredError,
    OutcomeUnknownError,
    RefusedError,
    ShardAwayError,
    StoppingError,
    words,
)
from dynhull_server.state.hull import Hull
from dynhull_server.state.hull_state import Counts
from dynhull_server.state.records import FOREVER, NO_TIME, Contents, Keys, Times
from dynhull_server.state.trip import refuse
from dynhull_server.storage.port import DamagedError

from ..shards import messages as say
from ..shards.logs import FencedError
from ..shards.requests import Expire, Read, Request, Write
from ..shards.root import Root, ShardsDifferError
from .logs import StoredRootLog
from .peers import PeerAwayError

# Seconds that requests wait for a shard whose worker cannot be reached, and for one that does not answer.
AWAY_SECONDS, SILENT_SECONDS = 3.0, 30.0
# Seconds before a message to a worker that is away is sent again.
AGAIN_SECONDS = 0.05
# Seconds before a root that has failed is replaced: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.1, 5.0

# Brings a message to a shard, and returns its reply. Raises PeerAwayError.
Deliver = Callable[[int, say.Request], Awaitable[say.Reply | None]]
# Returns the last epoch that a shard knows of; it is created if there is none. Raises PeerAwayError.
Greet = Callable[[int], Awaitable[int]]

log = logging.getLogger(__name__)


class _Batch(Write):
    """A batch of a caller. Its stream stops with it, in the thread of the root, before another one begins."""

    def __init__(self, request: events.WriteBatch, hull: Hull, now: float, answered: list[Request]) -> None:
        super().__init__(request, now)
        self._hull = hull
        self._answered = answered

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        super().answer(result, error)
        if error is not None:
            refuse(self.batch, error)
        else:
            self.batch.result = result
            if self.batch.stream is not None:
                self.batch.stream.hull = self._hull
        self._answered.append(self)

    @property
    def for_another_hull(self) -> bool:
        """Whether the batches of its stream before it were applied to another hull of this name."""
        stream = self.batch.stream
        return stream is not None and stream.hull is not None and stream.hull is not self._hull

    def tell(self) -> None:
        """Have the caller hear of it."""
        if not self.batch.abandoned:
            self.batch.to.answer(self.batch)


class _Expiry(Expire):
    def __init__(self, request: events.Expire, answered: list[Request]) -> None:
        super().__init__(request.time)
        self._request = request
        self._answered = answered

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        super().answer(result, error)
        self._request.result, self._request.error = result, error
        self._answered.append(self)

    def tell(self) -> None:
        """Have the core hear of it."""
        self._request.to.answer(self._request)


class _Question(Read):
    """A question of a reader. The counts are those of its revision: readers see each decision before the next one."""

    def __init__(self, question: say.Question, hull: Hull, answered: list[Request]) -> None:
        super().__init__(question)
        self.counts = hull.counts
        self.asked: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._hull = hull
        self._answered = answered

    def answer(self, result: Any = None, error: Exception | None = None) -> None:
        """Answer it."""
        super().answer(result, error)
        self.counts = self._hull.counts
        assert error is not None or self.counts.revision == result[0]
        self._answered.append(self)

    def tell(self) -> None:
        """Have the reader hear of it."""
        if not self.asked.done():
            self.asked.set_result(None)


class ServedRoot:
    """A root, from `begin` until `close`. It is a Division.

    Args:
        engine: the hulls.
        hull: the hull that its readers see.
        greet: looks for a shard.
        deliver: brings a message to a shard.
    """

    def __init__(self, engine: Engine, hull: Hull, greet: Greet, deliver: Deliver) -> None:
        self._engine = engine
        self._hull = hull
        self._greet = greet
        self._deliver = deliver
        self._loop = asyncio.get_running_loop()
        self._clock = engine.machine.clock
        self._pool = engine.machine.threads.pool("root", 1)
        self._work = f"shards of {hull.name}"
        # Of the thread:
        self._root: Root | None = None
        self._log: StoredRootLog | None = None
        self._backlog: list[Request] = []
        self._answered: list[Request] = []
        self._refusal: Exception | None = None  # why every request is refused
        self._opened = False
        self._damage: Exception | None = None
        # Of the event loop:
        self._waits = False
        self._couriers: dict[int, tuple[Any, asyncio.Task[None]]] = {}
        self._unanswered: dict[int, float] = {}  # since when
        self._away: set[int] = set()
        self._starting = self._loop.create_task(self._start(FIRST_PAUSE))

    # Requests

    def carry_out(self, requests: Sequence[events.WriteBatch | events.Expire]) -> None:
        """Carry out requests in this order, and answer them."""
        now = self._clock.monotonic()
        made: list[Request] = []
        for request in requests:
            if isinstance(request, events.Expire):
                made.append(_Expiry(request, self._answered))
                continue
            batch = _Batch(request, self._hull, now, self._answered)
            if batch.abandoned:
                continue
            made.append(batch)
        if made:
            self._waits = True
            self._do(partial(self._submit, made))

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
            found = Found(np.where(here, each.points, found.points), found.present | each.present, times)
        return counts, found, vertices

    async def contents(self) -> tuple[Counts, Contents]:
        """All points, in the order of their keys if they have any."""
        counts, (answers, _) = await self._ask(say.AllOf())
        return counts, await self._engine.aside(partial(_joined, answers))

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

        return counts, await self._engine.aside(compare)

    async def _ask(self, question: say.Question) -> tuple[Counts, Any]:
        asked = _Question(question, self._hull, self._answered)
        self._waits = True
        self._do(partial(self._submit, [asked]))
        await asked.asked
        if asked.error is not None:
            raise asked.error.with_traceback(None)
        return asked.counts, asked.result[1]

    # Life

    def look(self) -> None:
        """Refuse what waits for a shard that has been away for long. Called several times a second."""
        if self._damage is not None:
            self._engine.supervisor.failed(self._work, self._damage)
        now = self._clock.monotonic()
        for shard, since in self._unanswered.items():
            patience = AWAY_SECONDS if shard in self._away else SILENT_SECONDS
            if self._waits and now - since > patience:
                self._do(partial(self._give_up, ShardAwayError(self._hull.name, shard)))
                return

    def end(self) -> None:
        """The hull is deleted: refuse what waits."""
        self._do(partial(self._refuse_all, HullNotFoundError(self._hull.name)))

    async def close(self) -> None:
        """Refuse what waits, and stop."""
        self._do(partial(self._refuse_all, StoppingError()))
        self._starting.cancel()
        for _, courier in self._couriers.values():
            courier.cancel()
        await asyncio.to_thread(self._pool.shutdown)
        await asyncio.sleep(0)  # callers hear of it before the engine closes

    async def _start(self, pause: float) -> None:
        """Greet the shards, and make a root; try again until that succeeds."""
        while True:
            greeted = await asyncio.gather(*map(self._greeted, range(self._hull.row.settings.shards)))
            error = await self._try(partial(self._make_root, max(greeted) + 1))
            if error is None or isinstance(error, HullNotFoundError):
                return
            self._engine.supervisor.failed(self._work, error)
            await self._clock.sleep(pause)
            pause = min(2 * pause, LONGEST_PAUSE)

    async def _greeted(self, shard: int) -> int:
        self._unanswered.setdefault(shard, self._clock.monotonic())
        while True:
            try:
                epoch = await self._greet(shard)
            except PeerAwayError:
                self._away.add(shard)
                await self._clock.sleep(AGAIN_SECONDS)
            except Exception as error:  # its storage may have failed
                self._engine.supervisor.failed(self._work, error)
                self._away.add(shard)
                await self._clock.sleep(FIRST_PAUSE)
            else:
                self._heard(shard)
                return epoch

    def _heard(self, shard: int) -> None:
        self._unanswered.pop(shard, None)
        self._away.discard(shard)

    # Messages

    def _took(
        self, messages: list[tuple[int, say.Request]] | None, answered: list[Any], *, waits: bool, opened: bool
    ) -> None:
        """What the thread leaves to the event loop."""
        self._waits = waits
        for each in answered:
            each.tell()
        if opened:
            self._engine.supervisor.succeeded(self._work)
        if messages is None:  # there is no root, and shards are greeted
            return
        now = self._clock.monotonic()
        for shard in self._unanswered.keys() - {shard for shard, _ in messages}:
            self._heard(shard)
        for shard, message in messages:
            before = self._couriers.get(shard)
            if before is not None:
                if before[0] is message:
                    continue
                before[1].cancel()
            self._unanswered.setdefault(shard, now)
            self._couriers[shard] = message, self._loop.create_task(self._bring(shard, message))

    async def _bring(self, shard: int, message: say.Request) -> None:
        """Bring a message to a shard, again and again until it is answered, and the reply to the root."""
        while True:
            try:
                reply = await self._deliver(shard, message)
            except PeerAwayError:
                self._away.add(shard)
                await self._clock.sleep(AGAIN_SECONDS)
            except Exception as error:  # the shard has failed, and the next message finds another one
                self._engine.supervisor.failed(self._work, error)
                self._away.add(shard)
                await self._clock.sleep(FIRST_PAUSE)
            else:
                break
        self._heard(shard)
        self._do(partial(self._receive, shard, message, reply))

    # In the thread

    def _do(self, function: Callable[[], None]) -> None:
        try:
            self._pool.submit(partial(self._run, function))
        except RuntimeError:  # it is closed, and so are those who wait
            return

    async def _try(self, function: Callable[[], None]) -> Exception | None:
        return await asyncio.wrap_future(self._pool.submit(partial(self._run, function)))

    def _run(self, function: Callable[[], None]) -> Exception | None:
        """Call a function; if it fails, the root is replaced. Returns the error."""
        failure = None
        try:
            function()
            self._notice_opened()
        except Exception as error:  # a commit, memory, or damage
            failure = error
            self._fail(error)
        root = self._root
        messages = None if root is None else root.messages()
        answered, self._answered[:] = list(self._answered), []
        waits = bool(self._backlog) or (root is not None and root.waits)
        opened = root is not None and self._opened
        self._loop.call_soon_threadsafe(partial(self._took, messages, answered, waits=waits, opened=opened))
        return failure

    def _make_root(self, epoch: int) -> None:
        self._log = StoredRootLog(self._engine, self._hull, epoch)
        settings = self._hull.row.settings
        self._opened = False
        now = self._clock.monotonic()
        as_one = replace(settings, shards=0)  # it admits batches as one hull does
        self._root = Root(as_one, self._engine.limits, settings.shards, self._log, now)
        backlog, self._backlog = self._backlog, []
        self._submit(backlog)

    def _submit(self, requests: Sequence[Request]) -> None:
        for request in requests:
            if isinstance(request, _Batch) and request.for_another_hull:
                request.answer(error=HullNotFoundError(self._hull.name))
            elif self._refusal is not None:
                request.answer(error=self._refusal)
            elif self._root is None:
                self._backlog.append(request)
            else:
                self._root.submit(request)

    def _receive(self, shard: int, message: say.Request, reply: say.Reply | None) -> None:
        if self._root is None:
            return
        if reply is not None:
            self._root.receive(shard, reply)
        elif any(each is message for _, each in self._root.messages()):
            raise FencedError("a shard knows of a later root")

    def _notice_opened(self) -> None:
        """Tell the core when points leave, once all shards have said so, and after nothing has left."""
        root, stored = self._root, self._log
        if root is None or stored is None or root.hull is None:
            return
        if not self._opened:
            read = events.ReadHull(Waiter(), self._hull, lambda state: state.hull.points())
            _, seen = self._engine.ask_from_thread(read)
            if not np.array_equal(seen, root.hull.points()):
                raise ShardsDifferError("the shards have other vertices than those that were decided")
        due = root.due_of_shards()
        lone = any(isinstance(each, _Expiry) and not each.result for each in self._answered)
        if not self._opened or lone or due != stored.due:
            self._opened = True
            stored.due = due
            if self._refusal is None:
                stored.follow([])

    def _give_up(self, error: Exception) -> None:
        if self._root is not None:
            self._root.give_up(error)
        else:
            backlog, self._backlog = self._backlog, []
            self._refuse(backlog, error)

    def _refuse_all(self, error: Exception) -> None:
        self._refusal = error
        root, self._root = self._root, None
        current, waiting = ([], []) if root is None else root.leave()
        backlog, self._backlog = self._backlog, []
        self._refuse([*current, *waiting, *backlog], error)

    def _refuse(self, requests: Sequence[Request], error: Exception) -> None:
        for request in requests:
            request.answer(error=error)

    def _fail(self, error: Exception) -> None:
        """End the root. What is under way gets the error, unless that is about something else; what waits goes on."""
        root, self._root = self._root, None
        if root is None:
            return
        current, waiting = root.leave()
        if isinstance(error, ShardsDifferError):
            log.error("a hull over shards is damaged", extra={"hull": self._hull.name, "reason": str(error)})
            self._refusal = NotStoredError(f"the hull is damaged, and only a backup has it: {error}")
            self._refuse([*current, *waiting], self._refusal)
            self._damage = DamagedError(str(error))
            return
        known = isinstance(error, RefusedError | OutcomeUnknownError | StoppingError)
        self._refuse(current, error if known else NotStoredError(f"the root has failed: {words(error)}"))
        self._backlog = [*waiting, *self._backlog]
        self._loop.call_soon_threadsafe(self._begin_again, error)

    def _begin_again(self, error: Exception) -> None:
        if not isinstance(error, HullNotFoundError | StoppingError) and self._starting.done():
            self._engine.supervisor.failed(self._work, error)
            self._starting = self._loop.create_task(self._start(FIRST_PAUSE))


def _joined_times(parts: Sequence[Times | None], lengths: Sequence[int], none: int) -> Times | None:
    """The times of all, with `none` for those of shards that have none."""
    if all(part is None for part in parts):
        return None
    filled = [np.full(n, none) if part is None else part for part, n in zip(parts, lengths, strict=True)]
    return np.concatenate(filled)


def _joined(answers: Sequence[Contents]) -> Contents:
    """All points, in the order of their keys if they have any."""
    points = np.concatenate([each.points for each in answers])
    times = _joined_times([each.times for each in answers], [len(each) for each in answers], NO_TIME)
    deadlines = _joined_times([each.deadlines for each in answers], [len(each) for each in answers], FOREVER)
    if answers[0].keys is None:
        return Contents(points, None, times, deadlines)
    names = [key for each in answers for key in key_list(each.keys)]  # type: ignore[arg-type]  # all have keys
    order = np.array(sorted(range(len(names)), key=names.__getitem__), np.intp)
    strings = isinstance(answers[0].keys, PackedKeys)
    ordered = [names[row] for row in order.tolist()]
    keys: Keys = PackedKeys.pack(ordered) if strings else np.array(ordered, np.uint64)
    times, deadlines = (None if each is None else each[order] for each in (times, deadlines))
    return Contents(points[order], keys, times, deadlines)
