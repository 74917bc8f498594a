"""One life of the real engine, with its supervisor, housekeeping, recalls and watches, on a simulated machine."""

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import aclosing, contextmanager
from typing import Any

from dynhull.arrays import Points
from dynhull_server.engine.batch_stream import BatchStream
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import TRANSIENT, Supervisor
from dynhull_server.engine.views import Change, Progress, Snapshot, VerticesView
from dynhull_server.engine.watch import watch
from dynhull_server.engine.watch_fence import watch_fence
from dynhull_server.rpc.writing import gap_explained, require_present
from dynhull_server.state.admission import TICK
from dynhull_server.state.alarms.rule import marked, unmarked
from dynhull_server.state.alarms.status import AlarmStatus
from dynhull_server.state.batch import Applied, Write
from dynhull_server.state.errors import AlarmNotFoundError, FenceNotFoundError, HullNotFoundError, PartRefusedError
from dynhull_server.state.fences.model.config import FenceConfig
from dynhull_server.state.fences.model.fence import Fence
from dynhull_server.state.fences.model.records import Consumer, Inside
from dynhull_server.state.hull_state import Counts
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import Center, HullSettings

from .clients import Client, Outline, outline
from .cluster_plan import Operation
from .core_life import compare
from .fence_model import PREFIX
from .machine import Loop, SimulatedClock, SimulatedThreads, simulated_machine
from .model import Finding, Model
from .past_plan import OF_PAST, OF_PREFIXES
from .past_reader import PastReader
from .prefix_reader import PrefixReader
from .queries import Queries
from .schedule import Schedule
from .store import FaultyStorage, KilledError

# Simulated seconds within which every waiting actor has to be answered, once nothing fails.
FOREVER = 600.0
# Turns, too: time may pass much faster than threads get on.
MANY_TURNS = 40_000
# Turns after which a wait is given up whatever the time is: somebody goes on without a pause.
ENDLESS = 5 * MANY_TURNS

SNAPSHOT_POINTS = 2
SYNC_SECONDS = 0.5


class WatchedSupervisor(Supervisor):
    """The real one; errors that it takes for a bug are findings."""

    def __init__(self, model: Model, loop: Loop) -> None:
        super().__init__(SimulatedClock(loop, model), lambda _: None, self._process_ends)
        self._model, self._loop_of_life = model, loop

    def failed(self, name: str, error: BaseException) -> None:
        if not isinstance(error, TRANSIENT):
            raise self._model.finds(f"{name} fails: {error!r}") from error
        if not self._model.faulty and not isinstance(error, TimeoutError):  # a thread of this life may be slow
            raise self._model.finds(f"{name} fails without a fault: {error!r}") from error
        super().failed(name, error)

    def _process_ends(self, reason: str) -> None:
        if not self._loop_of_life.dead:
            raise self._model.finds(f"the process ends: {reason}")

    def ended(self) -> list[str]:
        """The periodic work that has ended."""
        return [task.get_name() for task in self._tasks if task.done()]

    def failing(self) -> list[str]:
        """The work that has not succeeded since it failed."""
        return [name for name, health in self.works.items() if health.failing_since is not None]


@contextmanager
def calling_them_fences() -> Iterator[None]:
    """Have refusals speak of fences, as the model does."""
    try:
        yield
    except AlarmNotFoundError as error:
        raise FenceNotFoundError(marked(error.name)) from None


class ShellServer:
    """Drives an Engine."""

    loop_type = Loop

    def __init__(self, limits: Limits, storage: FaultyStorage, model: Model, schedule: Schedule) -> None:
        self.model = model
        self.schedule = schedule
        self._storage = storage
        self.loop = self.loop_type(model, schedule)
        self._threads = SimulatedThreads(model, schedule)
        self.loop.executor(self._threads.pool("to_thread", 4).submit)
        storage.give_way, storage.threads = self._threads.give_way, self._threads
        self._supervisor = WatchedSupervisor(model, self.loop)
        machine = simulated_machine(self.loop, self._threads, model)
        self._engine = Engine(limits, storage, self._supervisor, machine)
        self._clients: list[ClientActor] = []
        self._news: dict[BatchStream, asyncio.Event] = {}
        self._closed = False
        try:
            self._drive(self._start(), "the start")
        except BaseException:
            self.end()
            raise
        model.clock = lambda: self.time()

    async def _start(self) -> None:
        await self._engine.start(lambda *_: None)
        self._engine.keep_house(SNAPSHOT_POINTS, SYNC_SECONDS)

    def _drive(self, work: Coroutine[Any, Any, None], name: str) -> None:
        """Let all actors take turns until the work is done."""
        task = self.loop.create_task(work)
        self._until(task.done, name)
        task.result()

    def _until(self, done: Callable[[], object], name: str) -> None:
        deadline, begun = self.loop.now + FOREVER, self.schedule.turns
        while not done():
            turned, turns = self.turn(), self.schedule.turns - begun
            if not turned or (self.loop.now > deadline and turns > MANY_TURNS):
                raise self.model.finds(f"{name} waits for ever")
            if turns > ENDLESS:
                raise self.model.finds(f"{name} waits for ever, while somebody goes on without a pause")

    def turn(self) -> bool:
        """One turn; a promise that it broke is raised here."""
        went_on = self.schedule.turn()
        if self._storage.killing:
            raise KilledError
        if self.model.finding is not None:
            raise Finding(self.model.finding)
        return went_on

    # What clients ask for

    def time(self) -> int:
        return self._engine.driver.time()

    async def create(self, name: str, settings: HullSettings) -> str:
        return (await self._engine.hulls.create(name, settings)).uid

    async def delete(self, name: str) -> None:
        await self._engine.hulls.delete(name)

    async def recenter(self, name: str, center: Center | None, _: int) -> Counts:
        return (await self._engine.hulls.get(name).recenter(center))[0]

    async def delete_at_once(self, name: str, times: int) -> None:
        await asyncio.gather(*(self._engine.hulls.delete(name) for _ in range(times)), return_exceptions=True)

    async def apply(self, write: Write, *, create: bool, uid: str = "") -> Applied:
        try:
            if uid and self._engine.hulls.has(write.name):
                await require_present(self._engine.hulls.get(write.name), write.producer, uid)
            return await self._engine.hulls.apply(write, create=create)
        except Exception as error:
            raise gap_explained(error, self._engine.hulls, write.name, uid) from None

    async def apply_together(self, writes: Sequence[Write], rows: int) -> list[Applied]:
        try:
            return await self._engine.hulls.apply_together(writes, rows)
        except PartRefusedError as refusal:
            raise refusal.reason from None

    def stream(self, name: str, *, create: bool) -> BatchStream:
        event = asyncio.Event()
        stream = self._engine.hulls.stream(name, event.set, create=create)
        self._news[stream] = event
        return stream

    async def news(self, stream: BatchStream) -> None:
        event = self._news[stream]
        while not stream.applied and stream.refusal is None:
            event.clear()
            await event.wait()

    async def vertices(self, name: str, rows: int) -> tuple[str, int, Outline]:
        hull = self._engine.hulls.get(name)
        counts, seen = await hull.read(outline, rows)
        return hull.uid, counts.revision, seen

    async def recall(self, name: str, uid: str, revision: int) -> Points | None:
        async with self._engine.hulls.get(name).recalled(uid, revision) as vertices:
            return vertices

    async def last(self, name: str, producer: str) -> int:
        return await self._engine.hulls.get(name).last_sequence(producer)

    # What clients ask of fences

    def fence(self, name: str) -> Fence:
        return self._engine.fences.get(name).fence

    async def create_fence(self, name: str, config: FenceConfig, _: int) -> Fence:
        return (await self._engine.fences.create(name, config)).fence

    async def replace_fence(self, name: str, config: FenceConfig, _: int) -> Fence:
        return (await self._engine.fences.replace(name, config)).fence

    async def delete_fence(self, name: str) -> None:
        await self._engine.fences.delete(name)

    async def acknowledge(self, name: str, consumer: str, sequence: int | None, uid: str) -> Consumer:
        return await self._engine.fences.get(name).acknowledge(consumer, sequence, uid)

    async def drop_consumer(self, name: str, consumer: str) -> None:
        await self._engine.fences.get(name).drop_consumer(consumer)

    async def who_is_inside(self, name: str, _: int) -> tuple[Fence, Inside]:
        live = self._engine.fences.get(name)
        return live.fence, await live.waiting()

    async def acknowledge_alarm(self, name: str, hull: str) -> AlarmStatus:
        with calling_them_fences():
            return await self._engine.alarms.acknowledge(unmarked(name), hull)

    async def mute_alarm(self, name: str, hull: str, until: int) -> AlarmStatus:
        with calling_them_fences():
            return await self._engine.alarms.mute(unmarked(name), hull, until)

    async def follow(self, client: Client, op: Operation, after: int) -> None:
        """Watch a fence for a few responses."""
        live = self._engine.fences.get(op["name"])
        async with aclosing(watch_fence(live, after, progress_interval=1.0)) as responses:
            async for sent in responses:
                asked = self.model.ask(PREFIX + op["name"])
                client.followed(asked, live.fence, after, sent, complete=False)
                after = sent.sequence
                op = op | {"most": op["most"] - 1}
                if not op["most"] or after >= live.fence.last:
                    return

    async def special(self, client: Client, op: Operation) -> None:
        """Let time pass, set the clock, make a backup, read the past, send a stream of reads, or watch a hull."""
        if op["do"] == "rest":
            await asyncio.sleep(op["seconds"])
            return
        if op["do"] == "backup":
            self._storage.back_up()
            return
        if op["do"] == "clock":
            self.model.wall += op["seconds"]
            return
        if op["do"] in OF_PAST:
            await PastReader(self._engine, self.model, self.schedule).ask(client, op)
            return
        if op["do"] in OF_PREFIXES:
            past = PastReader(self._engine, self.model, self.schedule)
            await PrefixReader(self._engine, self.model, past).ask(client, op)
            return
        if op["do"] == "query":
            await Queries(self._engine, self.model).ask(client, op)
            return
        asked = self.model.ask(op["name"])
        try:
            await self._watch(client, op)
        except Exception as error:
            client.refused(asked, error, (HullNotFoundError,))

    async def _watch(self, client: Client, op: Operation) -> None:
        hull = self._engine.hulls.get(op["name"])
        view = VerticesView(hull, keys=hull.settings.identity != "multiset")
        async with aclosing(watch(hull, view, progress_interval=1.0)) as events:
            held: tuple[Points, Any] | None = None
            for _ in range(1 + op["back"]):
                asked = self.model.ask(op["name"])
                event = await anext(events)
                match event:
                    case Snapshot() | Change():
                        held = event.vertices, None if event.keys is None else event.keys.tolist()
                    case Progress():
                        pass
                assert held is not None
                client.saw(asked, hull.uid, event.counts.revision, (*held, event.counts.center))

    # Its life

    def begin(self) -> None:
        """Do nothing: the engine has looked at the clock."""

    def client(self, client: Client, operations: list[Operation]) -> None:
        """Add a client."""
        actor = ClientActor(self, client, operations)
        self._clients.append(actor)
        self.schedule.actor(client.producer, actor.ready, actor.act)

    def rest(self) -> None:
        """Let all clients finish."""
        for actor in self._clients:
            self._until(actor.finished, f"the client {actor.client.producer}")
        self._until(lambda: not self._engine.driver.core.busy, "the core")

    def waiting(self) -> list[str]:
        """The work that has ended, and should not have."""
        return [] if self._closed else self._supervisor.ended()

    def probe(self, probe: Coroutine[Any, Any, None]) -> None:
        """Run a probe to its end."""
        self._drive(probe, "a probe")

    def look_at_past(self) -> None:
        """The past of each hull is as it was, and has the files that it needs, and no others."""
        self._until(lambda: not len(self._engine.hulls.filing._erasing), "erasures whose callers have gone")
        self._until(lambda: self._storage.files_are_needed(self.time()), "what is to be filed")
        for name in sorted(self.model.alive):
            self.probe(PastReader(self._engine, self.model, self.schedule).probe(name))

    def let_leave(self) -> None:
        """Whoever should have left by now leaves, and who has been inside for long makes an event."""
        time = self.time() - TICK
        self._until(lambda: not self.model.overdue(time), "what should leave")
        self._until(lambda: not self.model.fences.overdue(time), "who has been inside for long")

    def check(self) -> None:
        """Compare what is in memory with the truth, and let background work succeed again."""
        self._until(lambda: not self._engine.driver.core.busy, "the core")  # points may just be leaving
        hulls = self._engine.hulls
        self._until(lambda: not (hulls._changing or hulls.filing.unsure), "settings that are changed")
        compare(self._engine.driver.core, self.model)
        # Of a commit that failed the supervisor hears when the next one succeeds.
        self._until(lambda: not set(self._supervisor.failing()) - {"commits", "examination"}, "the background work")

    def kill(self) -> None:
        """End the life without a shutdown, as a kill does."""
        self.end()
        self.model.finding = None  # the answers of a killed server reach no client

    def end(self) -> None:
        """Let nothing of it go on; what is found stays."""
        finding, self._storage.dead = self.model.finding, True
        self.loop.kill()
        self._threads.kill()
        self.model.finding = finding

    def stop(self) -> None:
        """End the server as the process does: background work first, then its callers, then the engine."""
        self.model.stopping = True
        self._closed = True
        self._drive(self._drain(), "the end")

    async def _drain(self) -> None:
        await self._supervisor.stop()
        for actor in self._clients:
            actor.leave()
        await self._engine.close()


class ClientActor:
    """The turns of a client: it begins an operation, or disconnects."""

    def __init__(self, server: ShellServer, client: Client, operations: list[Operation]) -> None:
        self.client = client
        self._server = server
        self._left = deque(operations)
        self._task: asyncio.Task[None] | None = None
        self._patience: int | None = None

    def finished(self) -> bool:
        return self._task is None and not self._left

    def ready(self) -> object:
        return self._left if self._task is None else self._patience is not None

    def act(self) -> None:
        if self._task is None:
            op = self._left.popleft()
            self._patience = op.get("leave")
            self._task = self._server.loop.create_task(self.client.do(op))
            self._task.add_done_callback(self._done)
        elif self._patience:
            self._patience -= 1
        else:
            self._patience = None
            self._task.cancel()

    def leave(self) -> None:
        """The server ends its calls."""
        self._left.clear()
        if self._task is not None:
            self._task.cancel()

    def _done(self, task: "asyncio.Task[None]") -> None:
        self._task = None
        self._server.schedule.note((self.client.producer, task.cancelled()))
        if not task.cancelled() and (error := task.exception()) is not None and not isinstance(error, Finding):
            self._server.model.finds(f"a client gets {error!r}")
