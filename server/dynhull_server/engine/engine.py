"""Drives the core: passes in requests and the outcomes of effects, one at a time, and carries out the effects."""

import asyncio
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any, assert_never

from ..state import events
from ..state.batch import Applied
from ..state.core import Core
from ..state.errors import HullUnsuitableError, StoppingError
from ..state.events import (
    Birth,
    Commit,
    Compute,
    Computed,
    CreateHull,
    DeleteHull,
    Divide,
    Effect,
    Event,
    Examine,
    Examined,
    Failed,
    Gone,
    NotExamined,
    Reply,
    Request,
    Retried,
    Retry,
    Stir,
    Stopping,
    Tick,
    WriteBatch,
    WriteTogether,
)
from ..state.hull import Hull
from ..state.hull_state import HullState
from ..state.limits import Limits
from ..state.records import DEFAULT, Committed, Create, Delete, HullRow, HullSettings, Kept
from ..state.root_state import state_of
from ..state.trip import Trip, unsaved_of
from ..storage.port import Contents, FollowedStorage, NotCommittedError, Progress, Storage, StorageError
from .batch_stream import BatchStream
from .divided_hull import DividedHull
from .division import Divisions
from .fence_keeping import FenceKeeping
from .fences import Fences
from .group_commit import GroupCommit
from .housekeeping import Housekeeping
from .layers import COPIES
from .live_hull import LiveHull
from .positions import Standing, incarnation_of, standing
from .recalls import Recalls
from .rosters import Rosters
from .server_time import ServerTime
from .supervisor import Supervisor
from .threads import Machine, Pool
from .waiter import Waiter

# The number of threads for trips, for large reads outside of trips, and for the disk.
TURN_THREADS, READ_THREADS, DISK_THREADS = 4, 4, 3
# Seconds between updates of the core's clock, which makes points leave that have become too old.
TICK = 0.1
# Seconds that a commit may take before it is reported as failing: a disk that hangs raises no error.
STUCK = 10.0
# Hulls that share queries of the storage at the start.
READ_TOGETHER = 1000
# Seconds of loading between reports of the progress.
LOAD = 0.1
# Seconds between looks at the commit in progress.
WATCH_SECONDS = 1.0


@dataclass(slots=True)
class _Loaded:
    """A hull that is loaded, and not yet in the core; `unsaved` is the number of points since its last snapshot."""

    row: HullRow
    state: HullState
    unsaved: int


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


class Engine:
    """Named hulls, in memory and in a storage. Use it from one event loop.

    Args:
        limits: the limits on the state.
        storage: keeps the hulls.
        supervisor: receives all failures in the background.
        machine: time, threads and random names.
        divisions: runs hulls over shards; None for a server that has none.

    Attributes:
        fences: the fences.
        copies: limits the copies of hulls that large reads make.
        rosters: those of the watches of many hulls.
    """

    def __init__(
        self,
        limits: Limits,
        storage: Storage,
        supervisor: Supervisor,
        machine: Machine,
        divisions: Divisions | None = None,
    ) -> None:
        self._limits = limits
        self._storage = storage
        self._supervisor = supervisor
        self._machine = machine
        self._core = Core(limits)
        self.fences = Fences(self, storage)
        self.copies = asyncio.Semaphore(COPIES)
        self.divisions = divisions
        self.rosters = Rosters(lambda: self._core.hulls.values())
        self._incarnation = machine.token()  # that of hulls in memory; others find theirs in the storage
        self._published = Committed(0, 0)
        self._standing = standing(self._incarnation, self._published)
        self._live: dict[Hull, LiveHull] = {}
        self._events: deque[Event] = deque()
        self._calls: deque[Callable[[], None]] = deque()
        self._woken = False
        self._stepping = False
        self._expiries = Expiries(supervisor)
        self._idle: asyncio.Event | None = None
        self._followed: FollowedStorage | None = None
        self._loaded: dict[int, _Loaded] = {}
        self._begun = self._opened = self._started = False

    # Start and shutdown

    async def read_ahead(self, storage: FollowedStorage, progress: Progress) -> None:
        """Load the hulls while another server owns them; again to load what has come since, before `start`.

        Args:
            storage: the storage of the engine.
            progress: called with the amount read so far and the total; what it raises ends this.

        Raises:
            StorageError: the storage cannot be used; only `close` may follow, as after any other error.
        """
        self._begin()
        self._followed = storage
        self._opened = True
        contents: Contents = await self.run(self.disk, partial(storage.follow, progress))
        await self._load(contents, progress)

    async def start(self, progress: Progress) -> list[str]:
        """Load the hulls of the storage. Returns messages about what was lost or repaired there.

        Args:
            progress: called with the amount read so far and the total.

        Raises:
            StorageError: the storage cannot be used.
        """
        self._begin()
        clock, threads = self._machine.clock, self._machine.threads
        contents: Contents = await self.run(self.disk, partial(self._open, progress))
        self._core = Core(
            self._limits,
            contents.next_number,
            clock.monotonic(),
            immediate=self._storage.immediate,
            keeps=self._storage.keeps,
        )
        await self._load(contents, progress)
        for loaded in self._loaded.values():
            self._core.restore(loaded.row, loaded.state, loaded.unsaved)
        self._loaded.clear()
        shards = [row for row in contents.hulls if row.settings.shard is not None]
        await self.run(self._turns, partial(self._restore_fences, contents))
        latest = self._core.latest_time
        self._time = ServerTime(clock, latest)
        if self._storage.keeps:
            self._incarnation = incarnation_of(contents.hulls)
            self._published = Committed(contents.commits, contents.committed)
        # A window does not follow the last commit: the clock that it was made by may have been wrong.
        self._commit_time = ServerTime(clock, max(latest or 0, contents.committed))
        self._commits = GroupCommit(
            self._storage,
            threads,
            clock,
            self._commit_time.now,
            lambda error: self._from_thread(partial(self._commit_reported, error)),
            lambda error: self._from_thread(partial(self._supervisor.died, "commits", error)),
        )
        self._recalls = Recalls(self._storage, partial(self.run, self.disk))
        self._started = True
        self._supervisor.every(TICK, "clock", self._tick)
        self._supervisor.every(WATCH_SECONDS, "commit watch", self._watch_commits)
        keeping = FenceKeeping(self, self._storage, clock, self._limits.fences)
        self._supervisor.every(keeping.SECONDS, "fences", keeping.round)
        if self.divisions is not None:
            roots = [hull for hull in self._core.hulls.values() if hull.divided]
            await self.divisions.start(self, shards, roots)
        elif shards or any(hull.divided for hull in self._core.hulls.values()):
            raise StorageError("the storage has hulls over shards: start the server with `dynhull serve`")
        return contents.notes

    def _open(self, progress: Progress) -> Contents:
        contents = self._storage.open(progress)
        self._opened = True
        return contents

    def _begin(self) -> None:
        """Start the threads."""
        if self._begun:
            return
        self._begun = True
        self._loop = asyncio.get_running_loop()
        threads = self._machine.threads
        self._turns, self._reads = threads.pool("turn", TURN_THREADS), threads.pool("read", READ_THREADS)
        self.disk = threads.pool("disk", DISK_THREADS)

    async def _load(self, contents: Contents, progress: Progress) -> None:
        """Load the hulls of the storage, or what has come since they were loaded."""
        rows = [row for row in contents.hulls if row.settings.shard is None]
        if self._loaded:
            for number in self._loaded.keys() - {row.number for row in rows}:
                del self._loaded[number]
            await self.run(self.disk, self._catch_up)
        progress(len(self._loaded), len(rows))
        left = self._stored_hulls([row for row in rows if row.number not in self._loaded])
        while loaded := await self.run(self.disk, partial(self._load_some, left)):
            self._loaded.update((each.row.number, each) for each in loaded)
            progress(len(self._loaded), len(rows))

    def _catch_up(self) -> None:
        """Follow what has come since to the hulls that are loaded."""
        assert self._followed is not None  # otherwise none are
        now = self._machine.clock.monotonic()
        for number, records in self._followed.read_since(
            {number: each.state.counts.revision for number, each in self._loaded.items()}
        ):
            hull = self._loaded[number]
            hull.state.catch_up(records, now)
            hull.unsaved += sum(map(unsaved_of, records))

    def _stored_hulls(self, rows: Sequence[HullRow]) -> Iterator[tuple[HullRow, Kept]]:
        for first in range(0, len(rows), READ_TOGETHER):
            some = rows[first : first + READ_TOGETHER]
            yield from zip(some, self._storage.read_each([row.number for row in some]), strict=True)

    def _load_some(self, stored: Iterator[tuple[HullRow, Kept]]) -> "list[_Loaded]":
        """Load the next hulls, for LOAD seconds: handing each to a thread takes longer than loading a small one.

        Returns none after the last.
        """
        clock = self._machine.clock
        until = clock.monotonic() + LOAD
        loaded = []
        for row, kept in stored:
            state = state_of(self._limits, row.settings, kept, now=clock.monotonic())
            loaded.append(_Loaded(row, state, sum(map(unsaved_of, kept.records))))
            if clock.monotonic() > until:
                break
        return loaded

    def _restore_fences(self, contents: Contents) -> None:
        kept = self._storage.read_fences([row.number for row in contents.fences])
        self._core.restore_fences([each for each in kept if each is not None])

    def keep_house(self, snapshot_points: int, sync_seconds: float | None) -> None:
        """Begin the background work on the storage.

        Args:
            snapshot_points: the least number of points in batches that makes a snapshot due.
            sync_seconds: the interval at which commits are made durable; None where each commit is.
        """
        house = Housekeeping(self, self._storage, self._machine.clock)
        self._supervisor.every(house.CHECKPOINT_SECONDS, "checkpoint", house.checkpoint)
        self._supervisor.every(house.SNAPSHOT_SECONDS, "snapshots", partial(house.snapshots, snapshot_points))
        self._supervisor.every(house.SWEEP_SECONDS, "sweep", house.sweep)
        if sync_seconds is not None:
            self._supervisor.every(sync_seconds, "sync", house.sync)

    async def close(self) -> None:
        """Complete the trips in progress, refuse the waiting requests, and close the storage."""
        if not self._started:
            if self._begun:
                await asyncio.to_thread(self._forget)
            return
        if self.divisions is not None:
            await self.divisions.close()
        self.dispatch(Stopping())
        self._idle = asyncio.Event()
        self._notice_idle()
        await self._idle.wait()
        # Join the pools' threads in another thread, because their work needs the event loop to complete.
        await asyncio.to_thread(self._join)

    def _join(self) -> None:
        self._commits.close()
        self._forget()

    def _forget(self) -> None:
        for pool in (self._turns, self._reads, self.disk):
            pool.shutdown()
        if self._opened:
            self._storage.close()

    # Hulls

    def __len__(self) -> int:
        return len(self._core.hulls)

    def __iter__(self) -> Iterator[LiveHull]:
        return iter([self._live_hull(hull) for hull in list(self._core.hulls.values())])

    def get(self, name: str) -> LiveHull:
        """The hull of that name, or raise HullNotFoundError."""
        return self._live_hull(self._core.get(name))

    def has(self, name: str) -> bool:
        """Whether a hull of that name exists."""
        return name in self._core.hulls

    def page(self, prefixes: Sequence[str], after: str, size: int) -> tuple[list[LiveHull], bool]:
        """At most `size` hulls whose names follow `after`, and whether there are more.

        Only names that begin with one of the prefixes. These are sorted, and none of them begins with another.
        """
        hulls: list[LiveHull] = []
        for prefix in prefixes:
            for name in self._core.hulls.irange(minimum=max(prefix, after)):
                if not name.startswith(prefix):
                    break
                if name == after:
                    continue
                if len(hulls) == size:
                    return hulls, True
                hulls.append(self.get(name))
        return hulls, False

    async def create(self, name: str, settings: HullSettings = DEFAULT) -> LiveHull:
        """Create an empty hull, or raise HullExistsError, LimitExceededError or NotStoredError."""
        if settings.divided:
            no_shards = "config.shards", "cannot be divided: this server has no shards"
            why_not = no_shards if self.divisions is None else self.divisions.why_not(settings)
            if why_not is not None:
                field, reason = why_not
                raise HullUnsuitableError(name, reason, field=field)
        hull: Hull = await self.ask(CreateHull(Waiter(), name, self.birth(), settings))
        return self._live_hull(hull)

    async def delete(self, name: str) -> None:
        """Delete the hull of that name, or raise HullNotFoundError or NotStoredError."""
        await self.ask(DeleteHull(Waiter(), name, self.time()))

    async def apply(self, name: str, request: WriteBatch, *, create: bool) -> Applied:
        """Apply a batch as the next revision of a hull, or raise the error that refuses it.

        With `create`, a missing hull is created.
        """
        request.to, request.name = Waiter(), name
        if create:
            request.birth = self.birth()
        request.arrived = self.time()
        applied: Applied = await self.ask(request)
        return applied

    async def apply_together(self, request: WriteTogether) -> list[Applied]:
        """Apply a batch to each of several hulls, or raise the error that refuses one of them: then none is applied."""
        request.to = Waiter()
        for part in request.parts:
            part.arrived = self.time()
        results: list[Applied] = await self.ask(request)
        return results

    def stream(self, name: str, notify: Callable[[], None], *, create: bool) -> BatchStream:
        """A stream of batches to one hull; `notify` is called after each that was applied or refused.

        Raises:
            HullNotFoundError: no hull has that name, and `create` is False.
        """
        hull = self._core.get(name) if self.has(name) or not create else None
        return BatchStream(self, name, hull, notify, self.birth)

    def time(self) -> int:
        """The server's clock, in microseconds since 1970."""
        return self._time.now()

    @property
    def standing(self) -> Standing:
        """How far what is published has come."""
        if not self._core.undecided:  # otherwise it may lack an earlier commit than the latest
            self._standing = standing(self._incarnation, self._published)
        return self._standing

    @property
    def expired(self) -> int:
        """The number of points that have left by the server's clock, without those that left before a batch."""
        return self._expiries.points

    # The core

    def dispatch(self, event: Event) -> None:
        """Pass an event to the core, and carry out its effects."""
        if self._stepping:
            self._events.append(event)
            return
        self._stepping = True
        try:
            while True:
                for effect in self._core.step(event):
                    self._carry_out(effect)
                if self._idle is not None:
                    self._notice_idle()
                if not self._events:
                    return
                event = self._events.popleft()
        except Exception as error:  # a bug in the core: its state is no longer reliable
            self._supervisor.died("core", error)
            raise
        finally:
            self._stepping = False

    @property
    def machine(self) -> Machine:
        """Time, threads and random names."""
        return self._machine

    @property
    def supervisor(self) -> Supervisor:
        """Receives all failures in the background."""
        return self._supervisor

    @property
    def limits(self) -> Limits:
        """The limits on the state."""
        return self._limits

    @property
    def core(self) -> Core:
        """The core; only the engine's own parts look into it."""
        return self._core

    def idle(self, hull: Hull) -> bool:
        """Whether a small read of a hull can run now, without a request."""
        return not self._stepping and self._core.idle(hull)

    async def ask(self, request: Request) -> Any:
        """The result of a request with a Waiter, or raise its error. Cancelling the caller ends only the wait."""
        waiter: Waiter = request.to
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

    async def run(self, pool: Pool, function: Callable[[], Any]) -> Any:
        """Call a function in a pool. Cancelling the caller ends only the wait; the function continues."""
        return await asyncio.wrap_future(pool.submit(function))

    async def aside(self, function: Callable[[], Any]) -> Any:
        """Call a step of a large read, outside of the trips."""
        return await self.run(self._reads, function)

    def commit(self, changes: list[Any]) -> "asyncio.Future[None]":
        """Commit steps of a snapshot or sweep, together with batches; the future raises the error of a failure."""
        done: asyncio.Future[None] = self._loop.create_future()

        def finish(error: Exception | None) -> None:
            if done.done():
                return
            if error is None:
                done.set_result(None)
            else:
                done.set_exception(error)

        self._commits.submit(changes, lambda error, _: self._from_thread(partial(finish, error)))
        return done

    def commit_from_thread(self, changes: list[Any]) -> None:
        """Commit, from another thread, changes of shards; raises the error of a failure."""
        done: Future[None] = Future()

        def finish(error: Exception | None, _: bool) -> None:
            if error is None:
                done.set_result(None)
            else:
                done.set_exception(error)

        self._commits.submit(changes, finish)
        done.result()

    def ask_from_thread(self, request: Request) -> Any:
        """The result of a request, from another thread."""
        return asyncio.run_coroutine_threadsafe(self.ask(request), self._loop).result()

    def read_from_thread(self, number: int) -> Kept:
        """A shard as it is stored, after the outcomes of all commits are decided; from another thread."""
        self.commit_from_thread([])
        return self._storage.read(number)

    async def add_shard(self, row: HullRow) -> None:
        """Create a shard, unless an earlier attempt has, whose outcome was not known."""
        await self._commit_unless([Create(row)], row.number, there=True)

    async def drop_shard(self, number: int) -> None:
        """Delete a shard, unless an earlier attempt has."""
        await self._commit_unless([Delete(number)], number, there=False)

    async def _commit_unless(self, changes: list[Any], number: int, *, there: bool) -> None:
        """Commit changes of which shards there are; what does not take effect may have done so before."""
        if not self.keeps:
            return
        try:
            await self.commit(changes)
        except NotCommittedError:
            row = await self.run(self.disk, partial(self._storage.row, number))
            if (row is not None) != there:
                raise

    def cut_from_thread(self, number: int, last: int) -> Any:
        """What drops the revisions of a shard after `last`, from another thread; None for nothing."""
        return self._storage.cut(number, last)

    @property
    def keeps(self) -> bool:
        """Whether the storage keeps batches."""
        return self._storage.keeps

    @property
    def epoch(self) -> int:
        """The epoch of this server as the owner of its storage; 0 where it has none."""
        return self._storage.epoch

    def entitled(self) -> bool:
        """Whether no other server may have other hulls."""
        return self._storage.entitled()

    def _carry_out(self, effect: Effect) -> None:
        match effect:
            case Reply():
                if effect.moved:
                    self._publish(effect.moved)
                for request in effect.requests:
                    request.to.answer(request)
            case Divide():
                assert self.divisions is not None  # otherwise there is no such hull
                self.divisions.carry_out(effect.hull, effect.requests)
            case Commit():
                self._commit(effect.ticket, effect.changes)
            case Compute():
                self._compute(effect.ticket)
            case Examine():
                self._examine(effect)
            case Stir():
                self.fences.stir(effect.fences, effect.events)
            case Retry():
                self._supervisor.failed("examination", effect.reason)
                self._loop.call_later(effect.pause, self.dispatch, Retried(effect.ticket))
            case _:
                assert_never(effect)

    def _publish(self, moved: Iterable[Hull]) -> None:
        if not self._storage.keeps:  # it does not number them
            self._published = Committed(self._published.number + 1, self._commit_time.now())
        for hull in moved:
            hull.committed = self._published
            self._move(hull)
        self.rosters.moved(moved)

    def _move(self, hull: Hull) -> None:
        if hull.divided and self.divisions is not None:
            if hull.ended:
                self.divisions.end(hull)
            else:
                self.divisions.begin(hull)
        live = self._live.get(hull)
        if live is not None:
            live.moved()
            if hull.ended:
                del self._live[hull]

    def _commit(self, trip: Trip | None, changes: list[Any]) -> None:
        if trip is None:  # the storage is immediate
            self._published = self._storage.commit(changes, self._commit_time.now())
            return

        def done(error: Exception | None, unknown: bool) -> None:
            if error is None:
                assert self._commits.latest is not None  # it has just been made
                self._from_thread(partial(self._committed, trip, self._commits.latest))
            else:
                self._from_thread(partial(self.dispatch, Failed(trip, error, unknown)))

        self._commits.submit(changes, done)

    def _committed(self, trip: Trip, commit: Committed) -> None:
        self._published = commit
        self.dispatch(events.Committed(trip))

    def _compute(self, trip: Trip) -> None:
        def ran(_: "Future[None]") -> None:
            self._from_thread(partial(self.dispatch, Computed(trip)))

        self._turns.submit(trip.run).add_done_callback(ran)

    def _examine(self, effect: Examine) -> None:
        """Decide earlier commits in the committing thread, then read the hulls in another."""

        def settled(error: Exception | None, _: bool) -> None:
            if error is None:
                self._from_thread(partial(self._read_for, effect))
            else:
                self._from_thread(partial(self.dispatch, NotExamined(effect.ticket, error)))

        self._commits.settle(settled)

    def _read_for(self, effect: Examine) -> None:
        if self._idle is not None and self._idle.is_set():  # the server has stopped without waiting for it
            return

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

        self.disk.submit(examined).add_done_callback(done)

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

    def _commit_reported(self, error: BaseException | None) -> None:
        if error is None:
            self._supervisor.succeeded("commits")
            if self._supervisor.fails("examination") and not self._core.ill:  # `ill` is O(hulls)
                self._supervisor.succeeded("examination")
        else:
            self._supervisor.failed("commits", error)

    def _notice_idle(self) -> None:
        if self._idle is not None and not self._core.busy:
            self._idle.set()

    async def _tick(self) -> None:
        now = self._machine.clock.monotonic()
        time = self.time()
        self.dispatch(Tick(now, time, self._expiries))
        if self._supervisor.fails("expiry") and not self._core.expiring(time):  # `expiring` is O(hulls)
            self._supervisor.succeeded("expiry")

    async def _watch_commits(self) -> None:
        """Report a commit that hangs."""
        now = self._machine.clock.monotonic()
        since = self._commits.since
        if since is not None and now - since > STUCK:
            self._supervisor.failed("commits", TimeoutError(f"a commit has been running for {now - since:.0f} s"))

    def birth(self) -> Birth:
        """The origin of a hull or fence that is created now."""
        return Birth(self._machine.token(), self._machine.clock.wall())

    def _live_hull(self, hull: Hull) -> LiveHull:
        live = self._live.get(hull)
        if live is None:
            if hull.divided and self.divisions is not None:
                live = DividedHull(self, hull, self._recalls, self.divisions.of(hull))
            else:
                live = LiveHull(self, hull, self._recalls)
            if not hull.ended:
                self._live[hull] = live
        return live
