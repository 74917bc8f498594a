"""Drives the core: passes in requests and the outcomes of effects, one at a time, and carries out the effects."""

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Iterator, Sequence
from concurrent.futures import Future
from functools import partial
from typing import Any, Protocol, TypeVar, assert_never

from ..state import events
from ..state.batch import Applied
from ..state.core import Core, Written, not_stored
from ..state.errors import StoppingError
from ..state.events import (
    Commit,
    Compute,
    Computed,
    Divide,
    Effect,
    Event,
    Examine,
    Examined,
    Failed,
    Gone,
    NotExamined,
    Reply,
    Retried,
    Retry,
    Stopping,
    Tick,
    WakeFences,
)
from ..state.fences.events.block import EventBlock
from ..state.fences.model.fence import Fence
from ..state.hull import Hull
from ..state.hull_state import HullState
from ..state.limits import Limits
from ..state.records import CommitStamp, Kept
from ..state.requests import Birth, Expire, Request, Stream, WriteBatch
from ..state.trip import Trip
from ..storage.port import Storage
from .group_commit import GroupCommit
from .recalls import UNREADABLE
from .server_time import ServerTime
from .supervisor import Supervisor
from .threads import Machine, Pool
from .waiter import Waiter

# The number of threads for trips, for large reads outside of trips, and for the disk.
TURN_THREADS, READ_THREADS, DISK_THREADS = 4, 4, 3
# The number of threads that rebuild hulls as they were.
PAST_THREADS = 2
# Seconds between updates of the core's clock, which makes points leave that have become too old.
TICK = 0.1
# Seconds that a commit may take before it is reported as failing: a disk that hangs raises no error.
STUCK = 10.0
# Each step of a snapshot or sweep is followed by a pause of this many times its duration.
PAUSE_FACTOR = 4.0
# Seconds between looks at the commit in progress.
WATCH_SECONDS = 1.0

T = TypeVar("T")


class HullObserver(Protocol):
    """What the driver calls for effects that concern hulls."""

    def moved(self, hulls: Sequence[Hull]) -> None:
        """Hulls have a new, committed revision, or were deleted."""

    def divide(self, hull: Hull, requests: Sequence[WriteBatch | Expire]) -> None:
        """Have the shards of a hull carry out requests, in this order, and answer them."""


class FenceObserver(Protocol):
    """What the driver calls for effects that concern fences."""

    def notify(self, fences: Sequence[Fence], events: EventBlock | None) -> None:
        """Fences have new events, or have changed otherwise."""


class Expiries:
    """Receives the answers to the core's own requests, and reports their failures.

    Attributes:
        points: the number of points that have left.
    """

    def __init__(self, supervisor: Supervisor) -> None:
        self.points = 0
        self._supervisor = supervisor

    def answer(self, request: Request) -> None:
        """Report the outcome of a request; at a shutdown there is none."""
        if request.error is None:
            self.points += request.result
        elif not isinstance(request.error, StoppingError):
            self._supervisor.failed("expiry", request.error)


class Driver:
    """A core with its threads, its commits and its clock. Use it from one event loop.

    Args:
        limits: the limits on the state.
        storage: keeps the hulls.
        supervisor: receives all failures in the background.
        machine: time, threads and random names.

    Attributes:
        limits, supervisor, machine: as given.
        core: the core; only the engine's own parts look into it.
        published: the latest commit whose changes callers see.
        time: the server's clock, in microseconds since 1970, once there is a `start`.
        commit_time: the time that a commit of now would have, likewise.
    """

    time: Callable[[], int]
    commit_time: Callable[[], int]

    def __init__(self, limits: Limits, storage: Storage, supervisor: Supervisor, machine: Machine) -> None:
        self.limits = limits
        self.supervisor = supervisor
        self.machine = machine
        self.core = Core(limits)
        self.published = CommitStamp(0, 0)
        self._storage = storage
        self._events: deque[Event] = deque()
        self._calls: deque[Callable[[], None]] = deque()
        self._woken = False
        self._stepping = False
        self._expiries = Expiries(supervisor)
        self._idle: asyncio.Event | None = None
        # The last commit there was when an outcome was decided, until all that is in doubt is published; who waits.
        self._decided: CommitStamp | None = None
        self._undecided: list[asyncio.Future[None]] = []
        self._begun = self._started = False

    # Start and shutdown

    def begin(self) -> None:
        """Start the threads, if that has not been done."""
        if self._begun:
            return
        self._begun = True
        self._loop = asyncio.get_running_loop()
        threads = self.machine.threads
        self._turns, self._reads = threads.pool("turn", TURN_THREADS), threads.pool("read", READ_THREADS)
        self._disk = threads.pool("disk", DISK_THREADS)
        self._history = threads.pool("history", 1)  # a segment may take seconds
        self._past = threads.pool("past", PAST_THREADS)

    def start(self, hulls: HullObserver, fences: FenceObserver, committed: CommitStamp) -> None:
        """Serve the hulls and fences of the core.

        Args:
            hulls: called for effects that concern hulls.
            fences: called for effects that concern fences.
            committed: the last commit of the storage.
        """
        clock = self.machine.clock
        latest = self.core.latest_time
        self._hulls, self._fences = hulls, fences
        self.time = ServerTime(clock, latest).now
        if self._storage.keeps:
            self.published = committed
        # A window does not follow the last commit: the clock that it was made by may have been wrong.
        self.commit_time = ServerTime(clock, max(latest or 0, committed.time)).now
        self._commits = GroupCommit(
            self._storage,
            self.machine.threads,
            clock,
            self.commit_time,
            lambda error: self._from_thread(partial(self._commit_reported, error)),
            lambda error: self._from_thread(partial(self.supervisor.died, "commits", error)),
        )
        self._started = True
        self._look()  # at what has become due while nothing was served
        self.supervisor.every(TICK, "clock", self._tick)
        self.supervisor.every(WATCH_SECONDS, "commit watch", self._watch_commits)

    async def stop(self) -> None:
        """Complete the trips in progress, and refuse the waiting requests."""
        self.dispatch(Stopping())
        self._idle = asyncio.Event()
        self._have_decided(StoppingError())
        self._notice_idle()
        await self._idle.wait()

    def join(self) -> None:
        """End the threads. Not on the event loop, which their work needs to complete."""
        if self._started:
            self._commits.close()
        if self._begun:
            for pool in (self._turns, self._reads, self._disk, self._history, self._past):
                pool.shutdown()

    # Requests

    def birth(self) -> Birth:
        """The origin of a hull or fence that is created now."""
        return Birth(self.machine.token(), self.machine.clock.wall())

    @property
    def expired(self) -> int:
        """The number of points that have left by the server's clock, without those that left before a batch."""
        return self._expiries.points

    def idle(self, hull: Hull) -> bool:
        """Whether a small read of a hull can run now, without a request."""
        return not self._stepping and self.core.idle(hull)

    def dispatch(self, event: Event) -> None:
        """Pass an event to the core, and carry out its effects."""
        if self._stepping:
            self._events.append(event)
            return
        self._stepping = True
        try:
            while True:
                effects = self.core.step(event)
                if self._decided is not None and not self.core.undecided:
                    self.published, self._decided = max(self.published, self._decided), None
                    self._have_decided(None)
                for effect in effects:
                    self._carry_out(effect)
                if self._idle is not None:
                    self._notice_idle()
                if not self._events:
                    return
                event = self._events.popleft()
        except Exception as error:  # a bug in the core: its state is no longer reliable
            self.supervisor.died("core", error)
            raise
        finally:
            self._stepping = False

    def at_once(self, apply: "Callable[[Stream, T], Written | None]", stream: Stream, batch: T) -> Applied | None:
        """The result of a small batch of a stream, which is applied without a request; None if it takes one."""
        if self._stepping:
            return None
        try:
            written = apply(stream, batch)
            if written is None:
                return None
            hull, applied, changes = written
            if changes:
                self._commit(None, changes)
            if not applied.duplicate:
                self._moved((hull,))
        except Exception as error:  # a bug in the core: its state is no longer reliable
            self.supervisor.died("core", error)
            raise
        return applied

    async def ask(self, request: Request) -> Any:
        """The result of a request with a Waiter, or raise its error. Cancelling the caller ends only the wait."""
        waiter = request.to
        assert isinstance(waiter, Waiter)
        self.dispatch(request)
        if not waiter.answered:
            waiter.future = self._loop.create_future()
            try:
                await waiter.future
            except asyncio.CancelledError:
                self.dispatch(Gone(request))
                raise
        if request.error is not None:
            raise request.error.with_traceback(None)
        return request.result

    def ask_from_thread(self, request: Request) -> Any:
        """The result of a request, from another thread."""
        return asyncio.run_coroutine_threadsafe(self.ask(request), self._loop).result()

    # Work in threads. Cancelling the caller ends only the wait; the function continues.

    async def aside(self, function: Callable[[], Any]) -> Any:
        """Call a step of a large read, outside of the trips."""
        return await self._run(self._reads, function)

    async def on_disk(self, function: Callable[[], Any]) -> Any:
        """Call a function that reads or writes the storage."""
        return await self._run(self._disk, function)

    async def in_history(self, function: Callable[[], Any]) -> Any:
        """Call a function in the thread that writes segments."""
        return await self._run(self._history, function)

    async def rebuild(self, function: Callable[[], Any]) -> Any:
        """Call a step of what rebuilds a hull as it was."""
        return await self._run(self._past, function)

    async def in_turn(self, function: Callable[[], Any]) -> Any:
        """Call a function in a thread of the trips."""
        return await self._run(self._turns, function)

    async def _run(self, pool: Pool, function: Callable[[], Any]) -> Any:
        return await asyncio.wrap_future(pool.submit(function))

    # Commits

    def commit(self, changes: list[Any]) -> "asyncio.Future[None]":
        """Commit steps of a snapshot or sweep, together with batches; the future raises the error of a failure."""
        done: asyncio.Future[None] = self._loop.create_future()
        self._commits.submit(changes, lambda error, _: self._from_thread(partial(_settle, done, error)))
        return done

    async def commit_steps(
        self, steps: Iterator[Any], run: Callable[[Callable[[], Any]], Awaitable[Any]], pause: float = PAUSE_FACTOR
    ) -> None:
        """Commit steps one after another, each made by `run` after the commit of the one before.

        Batches have priority: a pause follows each step, so many times as long as that took. While the outcome of an
        earlier commit is not known, steps cannot be made: so that is decided first, or NotStoredError raised.
        """
        clock = self.machine.clock
        if self._commits.undecided:
            await self.settled()
        while True:
            begun = clock.monotonic()
            step = await run(partial(next, steps, None))
            if step is None:
                return
            try:
                await self.commit([step])
            except Exception:
                # Now, not when its memory is freed: it takes note of what it has begun in vain.
                steps.close()  # type: ignore[attr-defined]  # all are generators
                raise
            await clock.sleep(pause * (clock.monotonic() - begun))

    async def settled(self) -> None:
        """Wait for the commits that have begun, or raise NotStoredError: their outcome cannot be decided at present."""
        done: asyncio.Future[None] = self._loop.create_future()
        self._commits.settle(lambda error, _: self._from_thread(partial(_settle, done, error)))
        try:
            await done
        except UNREADABLE as error:
            raise not_stored(error) from error

    async def whole(self) -> CommitStamp:
        """A commit that is published as a whole, with all before it: the newest one.

        Waits for the commits that have begun, and until what was in doubt is published, or raises NotStoredError:
        that cannot be decided at present.
        """
        while True:
            published = self.published
            await self.settled()
            if not self.core.undecided:
                return published
            if self._idle is not None:  # perhaps nobody looks any more
                raise StoppingError
            decided: asyncio.Future[None] = self._loop.create_future()
            self._undecided.append(decided)
            await decided

    def _have_decided(self, error: Exception | None) -> None:
        """Have those who wait for what is in doubt hear of it."""
        waiting, self._undecided = self._undecided, []
        for each in waiting:
            _settle(each, error)

    def commit_from_thread(self, changes: list[Any]) -> None:
        """Commit, from another thread, changes of shards; raises the error of a failure."""
        done: Future[None] = Future()
        self._commits.submit(changes, lambda error, _: _settle(done, error))
        done.result()

    # Effects

    def _carry_out(self, effect: Effect) -> None:
        match effect:
            case Reply():
                if effect.moved:
                    self._moved(effect.moved)
                for request in effect.requests:
                    request.to.answer(request)
            case Divide():
                self._hulls.divide(effect.hull, effect.requests)
            case Commit():
                self._commit(effect.ticket, effect.changes)
            case Compute():
                self._compute(effect.ticket)
            case Examine():
                self._examine(effect)
            case WakeFences():
                self._fences.notify(effect.fences, effect.events)
            case Retry():
                self.supervisor.failed("examination", effect.reason)
                self._have_decided(not_stored(effect.reason))
                self._loop.call_later(effect.pause, self.dispatch, Retried(effect.ticket))
            case _:
                assert_never(effect)

    def _moved(self, hulls: Sequence[Hull]) -> None:
        if not self._storage.keeps:  # it does not number its commits: nor does it need their time exactly
            self.published = CommitStamp(self.published[0] + 1, self._ticked)
        self._hulls.moved(hulls)

    def _commit(self, trip: Trip | None, changes: list[Any]) -> None:
        if trip is None:  # the storage is immediate
            self.published = self._storage.commit(changes, self.commit_time())
            return

        def done(error: Exception | None, unknown: bool) -> None:
            if error is None:
                assert self._commits.latest is not None  # it has just been made
                self._from_thread(partial(self._committed, trip, self._commits.latest))
            else:
                self._from_thread(partial(self.dispatch, Failed(trip, error, unknown)))

        self._commits.submit(changes, done)

    def _committed(self, trip: Trip, commit: CommitStamp) -> None:
        self.published = commit
        self.dispatch(events.Committed(trip, commit))

    def _compute(self, trip: Trip) -> None:
        def ran(_: "Future[None]") -> None:
            self._from_thread(partial(self.dispatch, Computed(trip)))

        self._turns.submit(trip.run).add_done_callback(ran)

    def _examine(self, effect: Examine) -> None:
        """Decide earlier commits in the committing thread, then read the hulls in another."""

        def settled(error: Exception | None, _: bool) -> None:
            if error is None:
                self._from_thread(partial(self._read_for, effect, self._commits.latest))
            else:
                self._from_thread(partial(self.dispatch, NotExamined(effect.ticket, error)))

        self._commits.settle(settled)

    def _read_for(self, effect: Examine, latest: CommitStamp | None) -> None:
        if self._idle is not None and self._idle.is_set():  # the server has stopped without waiting for it
            return
        self._decided = max(self._decided or self.published, latest or self.published)

        def examined() -> Event:
            try:
                states = [self._stored(number, load) for number, load in effect.hulls]
                fences = self._storage.read_fences(effect.fences)
                restored = None if effect.restore is None else effect.restore(states, fences)
                return Examined(effect.ticket, states, fences, restored)
            except Exception as error:  # no error may end the trip
                return NotExamined(effect.ticket, error)

        def done(future: "Future[Event]") -> None:
            self._from_thread(partial(self.dispatch, future.result()))

        self._disk.submit(examined).add_done_callback(done)

    def _stored(self, number: int, load: Callable[[Kept], HullState]) -> HullState | None:
        return None if self._storage.row(number) is None else load(self._storage.read(number))

    def _from_thread(self, function: Callable[[], None]) -> None:
        """Call a function on the event loop. The functions that are passed until it wakes share one wake-up."""
        self._calls.append(function)
        if not self._woken:
            self._wake()

    def _wake(self) -> None:
        self._woken = True
        self._loop.call_soon_threadsafe(self._take_calls)

    def _take_calls(self) -> None:
        self._woken = False  # first, so that a function that is passed meanwhile is not left behind
        try:
            while self._calls:
                self._calls.popleft()()
        finally:
            if self._calls:  # one of them has failed
                self._wake()

    # Background work

    def _commit_reported(self, error: BaseException | None) -> None:
        if error is None:
            self.supervisor.succeeded("commits")
            if self.supervisor.fails("examination") and not self.core.ill:  # `ill` is O(hulls)
                self.supervisor.succeeded("examination")
        else:
            self.supervisor.failed("commits", error)

    def _notice_idle(self) -> None:
        if self._idle is not None and not self.core.busy:
            self._idle.set()

    async def _tick(self) -> None:
        time = self._look()
        if self.supervisor.fails("expiry") and not self.core.expiring(time):  # `expiring` is O(hulls)
            self.supervisor.succeeded("expiry")

    def _look(self) -> int:
        """Have the core look at the clock. Returns the time."""
        now = self.machine.clock.monotonic()
        time, self._ticked = self.time(), self.commit_time()
        self.dispatch(Tick(now, time, self._expiries))
        return time

    async def _watch_commits(self) -> None:
        """Report a commit that hangs."""
        now = self.machine.clock.monotonic()
        since = self._commits.since
        if since is not None and now - since > STUCK:
            self.supervisor.failed("commits", TimeoutError(f"a commit has been running for {now - since:.0f} s"))


def _settle(done: "Future[None] | asyncio.Future[None]", error: Exception | None) -> None:
    """Have whoever waits for a commit hear of it; they may have gone."""
    if done.done():
        return
    if error is None:
        done.set_result(None)
    else:
        done.set_exception(error)
