"""One life of a server that is the core and the group commit alone: no event loop, no threads.

What the engine does with threads are actors here: one commits, one reads the disk, one computes, one lets pauses pass;
and what they have done is news, which the core hears of one event at a time.
"""

from asyncio import CancelledError
from collections import deque
from collections.abc import Callable, Coroutine, Generator, Sequence
from functools import partial
from typing import Any, TypeVar

from dynhull.arrays import Points
from dynhull.keys import key_list
from dynhull_server.engine.batch_stream import BatchStream
from dynhull_server.engine.fences import who_waits
from dynhull_server.engine.group_commit import GroupCommit
from dynhull_server.engine.server_time import ServerTime
from dynhull_server.engine.threads import Clock, Threads
from dynhull_server.engine.watch_fence import Sent, following
from dynhull_server.state import dormant
from dynhull_server.state.admission import TICK
from dynhull_server.state.alarms.status import AlarmStatus
from dynhull_server.state.alarms.watched import WatchedHulls
from dynhull_server.state.batch import Applied, Write
from dynhull_server.state.core import Core, Written
from dynhull_server.state.errors import (
    HullNotFoundError,
    HullReplacedError,
    NotStoredError,
    RefusedError,
    StoppingError,
)
from dynhull_server.state.events import (
    Commit,
    Committed,
    Compute,
    Computed,
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
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.fence import Fence
from dynhull_server.state.fences.model.records import Consumer, FenceEvent, Inside
from dynhull_server.state.fences.model.requests import (
    Acknowledge,
    AcknowledgeAlarm,
    CreateFence,
    DeleteConsumer,
    DeleteFence,
    MuteAlarm,
    ReadFence,
    ReplaceFence,
    TrimEvents,
)
from dynhull_server.state.hull_state import Counts, HullState
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import NO_TIME, Center, CommitStamp, HullSettings, QuarantineRules
from dynhull_server.state.requests import (
    Birth,
    CreateHull,
    DeleteHull,
    ReadHull,
    Recenter,
    Request,
    Stream,
    WriteBatch,
    WriteTogether,
)
from dynhull_server.state.schedule import LOOK_AGAIN
from dynhull_server.state.trip import Trip
from dynhull_server.storage.port import Storage

from .alarm_model import alike
from .alarm_model import kept as kept_of_alarm
from .clients import Client, Outline, content, outline
from .cluster_plan import Operation
from .entities import loaded
from .fence_model import PREFIX, FenceTruth
from .globe import points
from .model import SKIPS, Model, Truth
from .quarantine_model import waiting_of
from .schedule import LONGEST, Schedule

DAY = 90_000.0
MICROSECOND = 1e-6
# Seconds within which everything leaves that has to.
MOMENT = 0.5
EPOCH = 1e9

T = TypeVar("T")

Condition = Callable[[], object]


class Wait:
    """Awaited by a client: goes on at a turn at which the condition holds."""

    def __init__(self, condition: Condition) -> None:
        self._condition = condition

    def __await__(self) -> Generator[Condition, None, None]:
        yield self._condition


class Answer:
    """A caller of the core."""

    __slots__ = ("answered",)

    def __init__(self) -> None:
        self.answered = False

    def answer(self, _: Request) -> None:
        self.answered = True

    def is_answered(self) -> bool:
        return self.answered


class StoppedClock(Clock):
    """Time passes when somebody says so. In each life the wall clock begins at another time, perhaps an earlier one."""

    def __init__(self, begun: float) -> None:
        self.now = 0.0
        self._begun = begun

    def monotonic(self) -> float:
        return self.now

    def wall(self) -> float:
        return EPOCH + self._begun + self.now


class NoThreads:
    """Threads for GroupCommit: its thread runs when there is work, and until there is none."""

    def __init__(self) -> None:
        self.items: list[Any] = []
        self.run: Callable[[], None] = lambda: None

    def inbox(self) -> "NoThreads":
        return self

    def spawn(self, _: str, run: Callable[[], None], __: object) -> "NoThreads":
        self.run = run
        return self

    def put(self, item: Any) -> None:
        self.items.append(item)

    def take(self, *, wait: bool = True) -> list[Any]:  # noqa: ARG002
        items, self.items = self.items, []
        return items


class CoreServer:
    """Drives a Core as Engine does, an event a turn. Commits take one turn, unless there are `threads` for them."""

    def __init__(
        self,
        limits: Limits,
        storage: Storage,
        model: Model,
        schedule: Schedule,
        threads: Threads | None = None,
        clock: StoppedClock | None = None,
    ) -> None:
        self.model = model
        self.schedule = schedule
        self._limits = limits
        self._storage = storage
        contents = storage.open(lambda *_: None)
        self.core = Core(limits, contents.next_number, immediate=storage.immediate)
        numbers = [row.number for row in contents.hulls]
        for row, kept in zip(contents.hulls, storage.read_each(numbers), strict=True):
            self.core.restore(row, dormant.loaded(limits, row.settings, kept, now=0.0), len(kept.records))
        fences = storage.read_fences([row.number for row in contents.fences])
        self.core.restore_fences([each for each in fences if each is not None])
        turns: Any = NoThreads()
        self._commits = GroupCommit(
            storage, threads or turns, Clock(), lambda: self._commit_time.now(), lambda _: None, lambda _: None
        )
        self._events: deque[Event] = deque()
        self._stepping = False
        self._published: CommitStamp | None = None
        self._clock = clock or StoppedClock(schedule.random.uniform(0, 10))
        self._looked = self._clock.now
        latest = self.core.latest_time
        self._time = ServerTime(self._clock, latest)
        self._commit_time = ServerTime(self._clock, max(latest or 0, contents.committed))
        model.clock = lambda: self.time()
        self._news: deque[Callable[[], None]] = deque()
        self._examining: deque[Examine] = deque()
        self._computing: deque[Trip] = deque()
        self._pauses: deque[Trip] = deque()
        self._clients: list[ClientActor] = []
        if threads is None:
            schedule.actor("commits", lambda: turns.items, lambda: turns.run())
        schedule.actor("news", lambda: self._news, lambda: self._news.popleft()())
        schedule.actor("disk", lambda: self._examining, self._examine)
        schedule.actor("turns", lambda: self._computing, self._compute)
        schedule.actor("pauses", lambda: self._pauses, lambda: self.dispatch(Retried(self._pauses.popleft())))

    # Events

    def dispatch(self, event: Event) -> None:
        """Hand an event to the core, and carry out what it asks for."""
        self._events.append(event)
        if self._stepping:
            return
        self._stepping = True
        while self._events:
            for effect in self.core.step(self._events.popleft()):
                self._carry_out(effect)
        self._stepping = False

    def at_once(self, apply: "Callable[[Stream, T], Written | None]", stream: Stream, batch: T) -> Applied | None:
        """The result of a batch that the core applies without a request, as the driver has it; None if it takes one."""
        written = None if self._stepping else apply(stream, batch)
        if written is None:
            return None
        hull, applied, changes = written
        if changes:
            self._commit(None, changes)
        self._carry_out(Reply([], () if applied.duplicate else (hull,)))
        self.schedule.note(("at once", applied.revision))
        return applied

    def _carry_out(self, effect: Effect) -> None:
        match effect:
            case Reply():
                for hull in effect.moved:
                    if self._published is not None:
                        hull.committed = max(hull.committed or self._published, self._published)
                    self.schedule.note((hull.uid, hull.counts.revision))
                for request in effect.requests:
                    self.schedule.note((type(request).__name__, str(request.error)))
                    request.to.answer(request)
            case Commit():
                self._commit(effect.ticket, effect.changes)
            case Compute():
                self._computing.append(effect.ticket)
            case Examine():
                self._settle(effect)
            case WakeFences():
                made = {} if effect.events is None else effect.events.by_fence()
                for fence in effect.fences:
                    events = made.get(fence.number, ())
                    self.schedule.note((fence.row.uid, [event[:5] for event in events]))
            case Retry():
                self._pauses.append(effect.ticket)

    def _commit(self, trip: Trip | None, changes: list[Any]) -> None:
        if trip is None:
            self._published = self._storage.commit(changes, self._commit_time.now())
            return

        def done(error: Exception | None, unknown: bool) -> None:
            event = Committed(trip, self._commits.latest) if error is None else Failed(trip, error, unknown)
            self._news.append(partial(self._hear, event, self._commits.latest))

        self._commits.submit(changes, done)

    def _hear(self, event: Event, commit: CommitStamp | None) -> None:
        """The core hears of a commit, which what it publishes now belongs to."""
        self._published = commit or self._published
        self.dispatch(event)

    def _compute(self) -> None:
        trip = self._computing.popleft()
        trip.run()
        self._news.append(partial(self.dispatch, Computed(trip)))

    def _settle(self, effect: Examine) -> None:
        def settled(error: Exception | None, _: bool) -> None:
            if error is None:
                self._news.append(partial(self._examining.append, effect))
            else:
                self._news.append(partial(self.dispatch, NotExamined(effect.ticket, error)))

        self._commits.settle(settled)

    def _examine(self) -> None:
        effect = self._examining.popleft()
        event: Event
        try:
            states = []
            for number, load in effect.hulls:
                row = self._storage.row(number)
                states.append(load(self._storage.read(number)) if row else None)
            fences = self._storage.read_fences(effect.fences)
            restored = None if effect.restore is None else effect.restore(states, fences)
            event = Examined(effect.ticket, states, fences, restored)
        except Exception as error:
            event = NotExamined(effect.ticket, error)
        self._news.append(partial(self.dispatch, event))

    # What clients ask for

    async def _ask(self, request: Request) -> Any:
        self.dispatch(request)
        if not request.to.answered:
            try:
                await Wait(request.to.is_answered)
            except CancelledError:
                self.dispatch(Gone(request))
                raise
        if request.error is not None:
            raise request.error.with_traceback(None)
        return request.result

    def birth(self) -> Birth:
        return Birth(self.model.uid(), 0.0)

    def time(self) -> int:
        return self._time.now()

    def commit_time(self) -> int:
        return self._commit_time.now()

    async def create(self, name: str, settings: HullSettings) -> str:
        uid: str = (await self._ask(CreateHull(Answer(), name, self.birth(), settings, self.time()))).uid
        return uid

    async def delete(self, name: str) -> None:
        await self._ask(DeleteHull(Answer(), name, self.time()))

    async def recenter(self, name: str, center: Center | None, rows: int) -> Counts:
        counts: Counts = (await self._ask(Recenter(Answer(), name, center, rows=rows)))[0]
        return counts

    async def delete_at_once(self, name: str, times: int) -> None:
        requests = [DeleteHull(Answer(), name, self.time()) for _ in range(times)]
        for request in requests:
            self.dispatch(request)
        await Wait(lambda: all(request.to.answered for request in requests))

    async def apply(self, write: Write, *, create: bool, uid: str = "") -> Applied:  # noqa: ARG002
        applied: Applied = await self._ask(WriteBatch(Answer(), write, self.birth() if create else None))
        return applied

    async def apply_together(self, writes: Sequence[Write], rows: int) -> list[Applied]:
        results: list[Applied] = await self._ask(WriteTogether(Answer(), writes, rows=rows))
        return results

    def stream(self, name: str, *, create: bool) -> BatchStream:
        hull = self.core.get(name) if name in self.core.hulls or not create else None
        driver: Any = self
        return BatchStream(driver, name, hull, lambda: None)

    async def news(self, stream: BatchStream) -> None:
        await Wait(lambda: stream.applied or stream.refusal is not None)

    async def vertices(self, name: str, rows: int) -> tuple[str, int, Outline]:
        hull = self.core.get(name)
        counts, seen = await self._ask(ReadHull(Answer(), hull, outline, rows=rows))
        return hull.uid, counts.revision, seen

    async def recall(self, name: str, uid: str, revision: int) -> Points | None:
        hull = self.core.get(name)
        if hull.uid != uid:
            raise HullReplacedError(name, hull.uid)
        _, vertices = await self._ask(ReadHull(Answer(), hull, lambda state: state.earlier_vertices(revision)))
        found: Points | None = vertices
        return found

    async def last(self, name: str, producer: str) -> int:
        hull = self.core.get(name)
        _, last = await self._ask(ReadHull(Answer(), hull, lambda state: state.last_sequence(producer)))
        return int(last)

    # What clients ask of fences

    def fence(self, name: str) -> Fence:
        return self.core.fence(name)

    async def create_fence(self, name: str, config: FenceConfig, rows: int) -> Fence:
        birth = self.birth()
        if config.rule is not None:
            birth = Birth(birth.uid, self._time.now() / 1e6)
            self._pass(0.0)  # the engine looks at the clock when it starts
        found: Fence = await self._ask(CreateFence(Answer(), name, self.time(), config, birth, rows=rows))
        return found

    async def replace_fence(self, name: str, config: FenceConfig, rows: int) -> Fence:
        found: Fence = await self._ask(ReplaceFence(Answer(), name, self.time(), config, rows=rows))
        return found

    async def delete_fence(self, name: str) -> None:
        await self._ask(DeleteFence(Answer(), name, self.time()))

    async def acknowledge(self, name: str, consumer: str, sequence: int | None, uid: str) -> Consumer:
        found: Consumer = await self._ask(Acknowledge(Answer(), name, self.time(), consumer, sequence, uid))
        return found

    async def drop_consumer(self, name: str, consumer: str) -> None:
        await self._ask(DeleteConsumer(Answer(), name, self.time(), consumer))

    async def who_is_inside(self, name: str, rows: int) -> tuple[Fence, Inside]:
        def read(fence: Fence, events: Sequence[FenceEvent]) -> tuple[Fence, Inside]:
            return fence, who_waits(fence, events)

        found: tuple[Fence, Inside] = await self._ask(ReadFence(Answer(), name, self.time(), read, rows=rows))
        return found

    async def acknowledge_alarm(self, name: str, hull: str) -> AlarmStatus:
        found: AlarmStatus = await self._ask(AcknowledgeAlarm(Answer(), name, self.time(), hull))
        return found

    async def mute_alarm(self, name: str, hull: str, until: int) -> AlarmStatus:
        found: AlarmStatus = await self._ask(MuteAlarm(Answer(), name, self.time(), hull, until))
        return found

    async def follow(self, client: Client, op: Operation, after: int) -> None:
        """Read events as a watch does."""
        fence = self.core.fence(op["name"])
        asked = self.model.ask(PREFIX + op["name"])
        events = fence.events(after, op["most"])
        if events is None:
            try:
                events = fence.published_among(self._storage.read_events(fence.number, after, op["most"]))
            except KeyError:  # deleted meanwhile
                events = fence.events(fence.oldest_recent - 1, op["most"]) or []
            except (OSError, MemoryError) as error:
                raise NotStoredError(str(error)) from error
        sent = following(after, events, fence.first)
        truth = self.model.fences.ever[fence.number]
        # What the storage has dropped may be about to be published; until then there is no answer.
        known = truth.deleted is None and truth.first == fence.first
        sent = sent or Sent(after)
        complete = len(events) < op["most"] and (known or max(after, sent.sequence) >= fence.last)
        client.followed(asked, fence, after, sent, complete=complete)

    async def _keep_fence(self, client: Client, op: Operation) -> None:
        """Store who is inside, and drop old events, as the engine does."""
        asked = self.model.ask(PREFIX + op["name"])
        try:
            fence, inside = await self.who_is_inside(op["name"], op["rows"])
            for step in self._storage.inside(fence.number, inside):
                failed: list[Exception | None] = []
                self._commits.submit([step], partial(_remember, failed))
                await Wait(partial(len, failed))
                if failed[0] is not None:
                    return
            fence.unsaved = max(fence.last - inside.sequence, 0)
            first = self._storage.boundary(fence.number, max(1, fence.last + 1 - op["back"]))
            self.model.fences.permit(fence.number, first)
            await self._ask(TrimEvents(Answer(), op["name"], self.time(), fence, first))
        except (KeyError, OSError, MemoryError) as error:  # deleted meanwhile, or the storage fails
            if not isinstance(error, KeyError) and not self.model.faulty:
                raise self.model.finds(f"without a reason: {error!r}") from error
        except Exception as error:
            client.fence_refused(op, asked, error)

    async def special(self, client: Client, op: Operation) -> None:
        """A snapshot, as housekeeping takes it, or time that passes."""
        if op["do"] == "keep":
            await self._keep_fence(client, op)
            return
        if op["do"] in ("day", "tick"):
            self.model.days |= op["do"] == "day"
            self._pass(DAY if op["do"] == "day" else op["seconds"])
            return
        asked = self.model.ask(op["name"])
        try:
            hull = self.core.get(op["name"])
            read = ReadHull(Answer(), hull, HullState.kept)
            _, kept = await self._ask(read)
        except (RefusedError, StoppingError) as error:
            client.refused(asked, error, (HullNotFoundError,))
            return
        for step in self._storage.snapshot(hull.row.number, kept):
            failed: list[Exception | None] = []
            self._commits.submit([step], partial(_remember, failed))
            await Wait(partial(len, failed))
            if failed[0] is not None:
                return

    # Its life

    def begin(self) -> None:
        """Look at the clock, as the engine does when it starts."""
        if self.model.fences.alarmed:
            self.look()

    def look(self) -> None:
        """Look at the clock."""
        self._pass(0.0)

    def is_behind(self) -> bool:
        """Whether time has passed since the last look."""
        return self._clock.now > self._looked

    def client(self, client: Client, operations: list[Operation]) -> None:
        """Add a client."""
        actor = ClientActor(client, operations)
        self._clients.append(actor)
        self.schedule.actor(client.producer, actor.ready, actor.act)

    def turn(self) -> bool:
        """One turn."""
        return self.schedule.turn()

    def rest(self) -> None:
        """Let all clients finish."""
        self.schedule.rest()

    def waiting(self) -> list[str]:
        """Who has not been answered, and what has not ended."""
        waiting = [actor.client.producer for actor in self._clients if actor.waiting]
        return [*waiting, "the core"] if self.core.busy else waiting

    def probe(self, probe: Coroutine[Any, Any, None]) -> None:
        """Run a probe to its end."""
        condition: Condition | None = None
        while True:
            try:
                condition = probe.send(None)
            except StopIteration:
                return
            bound = self.schedule.turns + LONGEST
            while not condition():
                if not self.schedule.turn() or self.schedule.turns > bound:
                    raise self.model.finds("a probe waits for ever")

    def check(self) -> None:
        """Compare what is in memory with the truth."""
        compare(self.core, self.model)

    def _pass(self, seconds: float) -> None:
        self._clock.now += seconds
        self._looked = self._clock.now
        self.dispatch(Tick(self._clock.now, self.time(), Answer()))

    def let_leave(self) -> None:
        """Time passes, and whoever should leave does."""
        self._pass(MOMENT)
        self.rest()
        if self.model.fences.overdue(self.time() - TICK):  # a request that was refused is repeated after a second
            self._pass(MICROSECOND * LOOK_AGAIN)
            self.rest()
        if late := self.model.fences.overdue(self.time() - TICK):
            raise self.model.finds(f"{late} have been inside for long, and have made no event")
        if overdue := self.model.overdue(self.time() - TICK):
            raise self.model.finds(f"{overdue} have not lost what should have left")

    def kill(self) -> None:
        """End the life without a shutdown, as a kill does."""
        for actor in self._clients:
            actor.abandon()

    def stop(self) -> None:
        """Begin nothing more; then nothing may be left under way."""
        self.model.stopping = True
        self.dispatch(Stopping())
        self.rest()


def compare(core: Core, model: Model) -> None:
    """Compare what a core holds with the truth."""
    if core.busy or core.ill:
        raise model.finds("a name is busy or its state unknown at rest")
    if list(core.hulls) != sorted(model.alive):
        raise model.finds(f"in memory there are the hulls {list(core.hulls)}, kept are {sorted(model.alive)}")
    compare_fences(core, model)
    for name, hull in core.hulls.items():
        truth, state = model.alive[name], hull.state
        if hull.row != truth.row:
            raise model.finds(f"in memory there is {hull.row}, kept is {truth.row}")
        held = (hull.counts.revision, state.counts.revision, content(points(name, state.hull.points())))
        if held != (truth.revision, truth.revision, truth.contents[-1]):
            raise model.finds(f"{name} is {held} in memory, kept is {truth.revision, truth.contents[-1]}")
        if (state.center, hull.counts.center) != (truth.center, truth.center):
            raise model.finds(f"the centre of {name} is {state.center, hull.counts.center}, kept is {truth.center}")
        if truth.timed:
            _compare_entities(name, state, truth, model)
        known = {name: last for name, last in truth.producers.items() if not model.days or name.endswith(SKIPS)}
        held_producers = state.kept().producers
        if not known.items() <= held_producers.items() <= truth.producers.items():
            raise model.finds(f"producers in memory: {held_producers}, kept: {truth.producers}")


def compare_fences(core: Core, model: Model) -> None:
    """Compare the fences that a core holds with the truth."""
    if list(core.fences) != sorted(model.fences.alive):
        raise model.finds(f"in memory are the fences {list(core.fences)}, kept are {sorted(model.fences.alive)}")
    for name, fence in core.fences.items():
        truth = model.fences.alive[name]
        if (fence.row, fence.last, fence.first, fence.consumers) != (
            truth.row,
            truth.last,
            truth.first,
            truth.consumers,
        ):
            raise model.finds(
                f"in memory is {fence.row, fence.last, fence.first, fence.consumers}, "
                f"kept is {truth.row, truth.last, truth.first, truth.consumers}"
            )
        inside = {
            (hull, key): None if fence.dwelling is None else fence.dwelling.times(hull, subjects.keys([key])).item()
            for hull, subjects in fence.subjects.items()
            for key in key_list(fence.keys_inside(subjects))
        }
        kept = {subject: NO_TIME if since is None else since for subject, since in truth.inside.items()}
        if fence.dwelling is None:
            kept = dict.fromkeys(kept)
        count, near = fence.inside, fence.pair is not None and fence.pair.near
        raised = sum(each.raised for each in truth.known.values())
        if (inside, count, near) != (kept, len(kept) + truth.near + raised, truth.near):
            raise model.finds(f"inside of {name} are {inside, count, near}, kept is {kept, truth.near}")
        if fence.watched is not None:
            _compare_alarm(name, fence.watched, truth, model)


def _compare_alarm(name: str, hulls: WatchedHulls, truth: FenceTruth, model: Model) -> None:
    if hulls.of.keys() != truth.known.keys():
        raise model.finds(f"{name} watches {list(hulls.of)}, known are {list(truth.known)}")
    for hull, watched in hulls.of.items():
        known = truth.known[hull]
        if watched.raised != known.raised or not alike(watched.standing, kept_of_alarm(known)):
            raise model.finds(f"{name} at {hull} is {watched.raised, watched.standing} in memory, kept is {known}")
        if watched.raised != (hull in hulls.raised):
            raise model.finds(f"{name} is raised for {list(hulls.raised)}, and {hull} is {watched.raised}")


def _compare_entities(name: str, state: HullState, truth: Truth, model: Model) -> None:
    kept, entities = state.kept(), truth.entities
    held = loaded(name, kept.contents)
    if (held, kept.clock) != (entities.held, entities.clock):
        raise model.finds(f"{name} holds {held} at {kept.clock}, kept is {entities.held} at {entities.clock}")
    out, quarantine = state.quarantine, entities.quarantine
    waiting = {} if out is None else waiting_of(out.stored())
    rules = QuarantineRules() if out is None else out.rules
    if (waiting, rules, state.counts.held) != (quarantine.waiting, quarantine.rules, len(quarantine.waiting)):
        raise model.finds(f"{name} holds out {waiting} by {rules}, kept is {quarantine.waiting} by {quarantine.rules}")
    if out is not None and not out.whole():
        raise model.finds(f"the quarantine of {name} is not as it was held")


def _remember(failed: list[Exception | None], error: Exception | None, _: bool) -> None:
    failed.append(error)


class ClientActor:
    """The turns of a client: it begins an operation, receives an answer, or disconnects."""

    def __init__(self, client: Client, operations: list[Operation]) -> None:
        self.client = client
        self._left = deque(operations)
        self._work: Coroutine[Condition, None, None] | None = None
        self._condition: Condition | None = None
        self._leave: int | None = None

    def ready(self) -> object:
        if self._condition is None:
            return self._left
        return self._leave is not None or self._condition()

    def act(self) -> None:
        if self._condition is None:
            op = self._left.popleft()
            self._leave = op.get("leave")
            self._work = self.client.do(op)  # type: ignore[assignment]
            self._advance()
        elif self._condition():
            self._advance()
        elif self._leave:
            self._leave -= 1
        else:
            self._advance(CancelledError())

    @property
    def waiting(self) -> bool:
        return self._condition is not None

    def abandon(self) -> None:
        """The server has been killed: no client waits any more."""
        if self._work is not None:
            self._work.close()

    def _advance(self, gone: CancelledError | None = None) -> None:
        assert self._work is not None
        try:
            self._condition = self._work.send(None) if gone is None else self._work.throw(gone)
        except (StopIteration, CancelledError):
            self._work = self._condition = None
