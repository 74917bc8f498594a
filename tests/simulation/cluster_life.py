"""Lives of clusters: servers that own the hulls of a database one after the other, and others on a living copy of it.

What is real are the core and the group commit of each server, `Ownership` with its threads, what it can know of other
processes, and the rules by which a gateway calls an owner. What is simulated are PostgreSQL (`postgres`), processes
(`hidden`), time, and everything between them. Servers are killed, stopped for any time and lose their connections. All
clocks run equally fast. Each database has a model of its own, with which its clients compare their answers: so a batch
that a server of the original writes for a client of the copy, or the reverse, is not kept in the one model, and was
never sent in the other.
"""

import copy
import heapq
from collections.abc import Callable, Coroutine, Generator, Sequence
from contextlib import ExitStack
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

from dynhull_cluster.machines.addresses import Addresses
from dynhull_cluster.machines.board import Owner, Tables
from dynhull_cluster.machines.entrance import proof_of
from dynhull_cluster.postgres import ownership, processes
from dynhull_cluster.postgres.ownership import LOOK, REQUIRE, Leases, Ownership, taken_over, writer_name
from dynhull_server.state.admission import TICK
from dynhull_server.state.errors import NotStoredError, OutcomeUnknownError
from dynhull_server.state.fences.model.fence import Fence
from dynhull_server.state.limits import Limits
from dynhull_server.state.records import CommitStamp
from dynhull_server.storage.memory import MemoryStorage
from dynhull_server.storage.port import NotCommittedError, Progress, StorageError, StoredContents, TakenOverError
from dynhull_server.storage.segments.owner import Claimant

from .clients import Client, probe, probe_fence
from .cluster_past import Filer, SharedPast, SharedRows, read_past
from .cluster_plan import Operation, Plan
from .core_life import EPOCH, MOMENT, ClientActor, Condition, CoreServer, StoppedClock, Wait, compare
from .hidden import Entry, Place, Proc, System
from .machine import SimulatedThreads
from .model import Model
from .past_archive import simulated_reading
from .past_plan import small_segments
from .postgres import Postgres, Session
from .schedule import Schedule
from .store import FaultyStorage

PARTITION, SECRET, HOST = 0, "secret", "machine"
# Seconds that a gateway waits for an owner.
PATIENCE = 10.0
# The most turns until everything is served again, once nothing fails any more.
MANY_TURNS = 20_000
# The numbers of processes: the least that is free is used again.
NUMBERS = range(10, 100)


class Site:
    """A database, what is on it, and the gateway and the servers that know its address."""

    def __init__(
        self,
        name: str,
        database: Postgres,
        store: FaultyStorage,
        model: Model,
        commits: int = 0,
        past: SharedPast | None = None,
    ) -> None:
        self.name = name
        self.database = database
        self.store = store
        self.past = past
        self.model = model
        self.commits = commits
        self.addresses = Addresses(SECRET, None, 1.0)
        self.told: list[tuple[Any, ...]] = []
        self._epoch = 0

    def begins(self, process: "Process") -> None:
        """Whoever is the owner is about to commit. With the first one of an epoch, a life of its alarms begins."""
        if process.ownership.epoch != self._epoch:
            assert process.core is not None  # it commits
            core, self._epoch = process.core, process.ownership.epoch
            self.model.clock = lambda: core.time()
            self.model.fences.new_life()

    def copied(self, name: str, *, shares: bool = False) -> "Site":
        """The same, as of the last commits: nothing tells the two apart but who is connected.

        If it `shares`, the past of both is in one store.
        """
        memory, other = self.store._inner, MemoryStorage()
        state = {key: value for key, value in vars(memory).items() if key != "_turn"}
        vars(other).update(copy.deepcopy(state))
        model = copy.deepcopy(self.model)
        model.new_life()
        model.faulty = True
        past = None if self.past is None else self.past.copied(shares=shares)
        return Site(name, self.database.copied(), _store(other, model), model, self.commits, past)

    def look(self) -> None:
        """The gateway follows the owners."""
        self.told = self.database.told()
        owners = {partition: Owner(*rest) for partition, *rest in self.told}
        self.addresses.learn(Tables(owners, {}, {}, {}, PARTITION + 1))


def _store(memory: MemoryStorage, model: Model) -> FaultyStorage:
    return FaultyStorage(memory, model, [], immediate=False)


class OwnedStorage:
    """The store of a site for one owner: each commit takes place only while it is one, as in `PostgresStorage`."""

    keeps, immediate = True, False

    def __init__(self, process: "Process") -> None:
        self._process, self._site = process, process.site
        self._store = self._site.store
        self._rows: SharedRows | None = None
        if self._site.past is not None:
            self._store = self._site.past.of_owner(process, self._site.model)
            rows = self._store._inner
            assert isinstance(rows, SharedRows)
            self._rows = rows
        self._session: Session | None = None
        self._commits = 0
        self.epoch = process.ownership.epoch

    def __getattr__(self, name: str) -> Any:
        return getattr(self._store, name)

    def entitled(self) -> bool:
        """Whether this server may answer reads."""
        return self._process.ownership.holds()

    def open(self, progress: Progress) -> StoredContents:
        """Take up everything."""
        self._commits = self._site.commits
        return self._store.open(progress)

    def commit(self, changes: Sequence[Any], now: int = 0) -> CommitStamp:
        """Keep the changes, unless another server owns them, or the connection is lost before."""
        try:
            session = self._begun()
        except TakenOverError:
            raise
        except StorageError as error:
            raise NotCommittedError(str(error)) from error
        self._process.give_way()
        if session.open:
            self._site.begins(self._process)
            commit = self._store.commit(changes, now)
            self._site.commits += 1
            self._site.database.carry_out(session, "COMMIT", [])
        self._process.give_way()
        if not session.open:
            if self._rows is not None:
                self._rows.doubt()
            raise StorageError("the connection is lost while a commit is under way, as planned")
        self._commits += 1
        return commit

    def settle(self) -> CommitStamp:
        """Decide what was left undecided: connect again, and look."""
        session = self._begun(own=None)
        self._commits = self._site.commits
        commit = self._store._inner.settle()
        session.execute("COMMIT")
        return commit

    def _begun(self, own: int | None = -1) -> Session:
        """A session with a transaction in which this server is the owner, and has made all commits."""
        if self._session is None or not self._session.open:
            name = writer_name(PARTITION, self.epoch)
            self._session = self._process.connect(name)
        session = self._session
        try:
            session.execute("BEGIN")
            owned = session.execute(REQUIRE, self._process.ownership.own).rowcount
            if not owned or (own is not None and self._commits != self._site.commits):
                raise taken_over(self._process, PARTITION)  # type: ignore[arg-type]
        except StorageError:
            session.close()
            raise
        return session


class Process:
    """A server: it waits until it may own the hulls, and serves them until it is no longer the owner, or is killed.

    Attributes:
        alive: whether it has not ended.
        stopped: whether it stands still, as after SIGSTOP.
        dark: whether it cannot reach the database.
        leaves: whether it has begun to end as planned.
        core: its hulls, once it serves them.
        storage: where they are kept.
        reads: its threads that read the past.
        port: where it listens.
    """

    def __init__(self, world: "World", site: Site, worker: str, entry: Entry) -> None:
        self.world, self.site, self.worker, self.entry = world, site, worker, entry
        self.alive, self.stopped, self.leaves, self.dark = True, False, False, False
        self.core: CoreServer | None = None
        self.storage: Any = None
        self.port = 0
        self._doomed = False
        self._threads = SimulatedThreads(site.model, self)  # type: ignore[arg-type]  # it is the schedule, too
        self.reads: Any = self._threads.pool("reads", 2) if site.past is not None else None
        self.proof = proof_of(PARTITION, worker, SECRET)
        world.current = self
        self.database: Any = SimpleNamespace(connect=self.connect, end_silent=lambda _: None)
        self.ownership = Ownership(self.database, PARTITION, self._lost, worker)
        self.spawn("server", self._serve)
        world.schedule.actor("reaper", lambda: self.alive and self._doomed, self.end)

    def __str__(self) -> str:
        return self.worker

    @property
    def runs(self) -> bool:
        return self.alive and not self.stopped and not self._doomed

    # What its threads see

    @property
    def random(self) -> Any:
        return self.world.schedule.random

    @property
    def brisk(self) -> bool:
        return self.world.schedule.brisk

    def note(self, what: object) -> None:
        self.world.schedule.note(what)

    def actor(self, name: str, ready: Callable[[], object], act: Callable[[], None]) -> None:
        """Add an actor of this process."""

        def acts() -> None:
            self.world.current = self
            act()

        self.world.schedule.actor(name, lambda: self.runs and ready(), acts)

    def spawn(self, name: str, run: Callable[[], None]) -> Any:
        return self._threads.spawn(name, run, self._fails)

    def give_way(self) -> None:
        self._threads.give_way()

    def wait(self, condition: Callable[[], object], seconds: float | None) -> bool:
        """Let others go on, and wait, perhaps not for ever. Whether the condition holds."""
        self._threads.give_way()
        until = self.world.alarm(seconds)
        self._threads.wait(lambda: condition() or self.world.now >= until)
        return bool(condition())

    def waits(self, condition: Callable[[], object]) -> None:
        """Wait until a condition holds."""
        self._threads.wait(condition)

    def require_light(self) -> None:
        """Raise StorageError where the database cannot be reached."""
        if self.dark:
            raise StorageError("the database cannot be reached, as planned")

    def connect(self, name: str) -> Session:
        self.require_light()
        return self.site.database.connect(self.wait, name, self)

    # Its life

    def _serve(self) -> None:
        leases = Leases()
        while True:
            try:
                self.ownership.take(leases)
                break
            except StorageError:  # as long as another server renews its lease, too
                self.wait(lambda: False, LOOK)
        self.storage = OwnedStorage(self)
        self.core = self._served()
        self._listen()
        while True:
            try:
                self.ownership.announce(f"{HOST} 1 {self.port}")
                return
            except TakenOverError as error:
                self._lost(str(error))
                return
            except StorageError:
                self.wait(lambda: False, LOOK)

    def _served(self) -> CoreServer:
        """What serves the hulls of the storage."""
        clock = WorldClock(self.world, self.random.uniform(0, 10))
        core = CoreServer(self.world.limits, self.storage, self.site.model, self, self._threads, clock)  # type: ignore[arg-type]
        if self.world.alarmed:
            core.look()
            self.actor("clock", core.is_behind, core.look)
        if self.site.past is not None:
            self.spawn("history", Filer(self, self.storage).run)
        return core

    def _listen(self) -> None:
        """Take calls."""
        self.port = self.world.listen(self)

    def claimant(self) -> Claimant | None:
        """Whose past alone is in the store; None where that is nobody's concern."""
        return None

    def leave(self) -> None:
        """End as planned: nothing begins any more, then the partition is free."""
        self.leaves = True
        self.world.stop_listening(self)

        def release() -> None:
            core = self.core
            if core is not None:
                self.wait(lambda: not core.core.busy, None)
            self.ownership.release()
            self._lost("it has ended")

        self.spawn("end", release)

    def _lost(self, _: str) -> None:
        """The server must end."""
        self._doomed = True

    def _fails(self, error: BaseException) -> None:
        if not isinstance(error, TakenOverError):
            raise self.site.model.finds(f"a thread of {self.worker} fails: {error!r}") from error
        self._lost(str(error))

    def end(self) -> None:
        """It is killed, or ends itself."""
        if self.alive:
            self.alive = False
            self.world.stop_listening(self)
            self.entry.end()
            self.site.database.end_all_of(self)
            self._threads.kill()


class WorldClock(StoppedClock):
    """The clock of a server, which is ahead of others by some seconds."""

    def __init__(self, world: "World", begun: float) -> None:
        self._world, self._begun = world, begun

    @property
    def now(self) -> float:  # type: ignore[override]
        """The time of the world: when it passes for one, it does for all."""
        return self._world.now

    @now.setter
    def now(self, now: float) -> None:
        self._world.now = now


class Gateway:
    """What clients of a site call: passes each request on to the server that it takes for the owner."""

    def __init__(self, world: "World", site: Site) -> None:
        self._world, self._site = world, site

    def time(self) -> int:
        """Microseconds since 1970."""
        return int((EPOCH + self._world.now) * 1e6)

    def fence(self, name: str) -> Fence:
        """What the owner has."""
        process = self._owner()
        if process is None or not process.runs or process.core is None or not process.ownership.holds():
            raise NotStoredError("nobody serves the partition")
        return process.core.fence(name)

    async def special(self, _: Client, op: Operation) -> None:
        """Time passes, for everybody; or the past of a hull is read."""
        if op["do"] != "past":
            self._world.now += op["seconds"]
            return
        process = self._owner()
        if process is not None and process.runs and process.core is not None and process.ownership.holds():
            await read_past(process, self._site.model, op["name"])

    def __getattr__(self, name: str) -> Any:
        async def call(*arguments: Any, **named: Any) -> Any:
            until = self._world.alarm(PATIENCE)
            await Wait(lambda: self._owner() is not None or self._world.now >= until)
            process = self._owner()
            if process is None:
                raise NotStoredError("nobody serves the partition")
            await Wait(lambda: process.runs or not process.alive)
            if not process.runs or process.core is None or not process.ownership.holds():
                raise NotStoredError("the server waits for its database, or has ended")
            return await _Answered(getattr(process.core, name)(*arguments, **named), process)

        return call

    def _owner(self) -> Process | None:
        """Who listens where the owner should be, if it is the one that is meant."""
        try:
            place = self._site.addresses._at(PARTITION)
        except OSError:
            return None
        process = self._world.listening.get(place.frames_port)
        meant = process is not None and process.proof == proof_of(PARTITION, place.worker, SECRET)
        return process if meant else None


class _Answered:
    """Awaited by a client: what a process answers, unless it ends before."""

    def __init__(self, work: Coroutine[Condition, None, Any], process: Process) -> None:
        self._work, self._process = work, process

    def __await__(self) -> Generator[Condition, None, Any]:
        work, process = self._work, self._process
        while True:
            try:
                condition = work.send(None)
            except StopIteration as end:
                return end.value
            try:
                yield lambda condition=condition: (process.runs and condition()) or not process.alive  # type: ignore[misc]
            except BaseException as gone:
                if process.runs:
                    work.throw(gone)
                work.close()
                raise
            if not process.alive:
                work.close()
                raise OutcomeUnknownError("the server has ended")


class World:
    """One plan.

    Attributes:
        process: what servers are.
        most_turns: the most turns until everything is served again.
        now: the time in seconds, by all clocks.
        alarmed: whether there may be alarms.
        current: the process whose turn it is.
        listening: who listens, by port.
    """

    process: type[Process] = Process
    most_turns = MANY_TURNS

    def __init__(self, plan: Plan, model: Model, schedule: Schedule) -> None:
        self.limits, self.schedule = Limits(**plan["limits"]), schedule
        self.now = 0.0
        self.listening: dict[int, Process] = {}
        self.current: Process | None = None
        self.calm, self.alarmed = False, plan.get("alarms", False)
        self._alarms: list[float] = []
        self._plan = plan
        self._places = [Place(f"boot{each}", "1") for each in range(plan["machines"])]
        self._begun = 0
        self._fates = list(reversed(plan["fates"]))
        self._rest = 0
        self._clients: list[ClientActor] = []
        self.processes: list[Process] = []
        self.sites: list[Site] = []
        schedule.actor("time", self._hurries, self._pass)
        schedule.actor("fates", self._is_fated, self._fate)
        model.new_life()
        model.faulty = True
        past = SharedPast(plan["faults"], lambda: self.now) if "faults" in plan else None
        self._add(Site("north", Postgres(), _store(MemoryStorage(), model), model, past=past), plan["clients"])

    def _add(self, site: Site, clients: list[list[Operation]]) -> None:
        """A site with its gateway and its clients."""
        self.sites.append(site)
        self.schedule.actor("gateway", lambda: site.database.told() != site.told, site.look)
        gateway: Any = Gateway(self, site)
        for operations in clients:
            client = Client(len(self._clients), gateway, site.model)
            actor = ClientActor(client, operations)
            self._clients.append(actor)
            self.schedule.actor(client.producer, actor.ready, actor.act)

    # Time

    def alarm(self, seconds: float | None) -> float:
        """The time in so many seconds, at which somebody has to act."""
        until = float("inf") if seconds is None else self.now + seconds
        if seconds is not None:
            heapq.heappush(self._alarms, until)
        return until

    def _hurries(self) -> object:
        return self._alarms and not self.calm and self.schedule.random.random() < self._plan["haste"]

    def _pass(self) -> None:
        self.now = max(self.now, heapq.heappop(self._alarms))

    # What happens to processes

    def listen(self, process: Process) -> int:
        """A free port, which one that has ended may have had before."""
        port = next(each for each in range(1, 100) if each not in self.listening)
        self.listening[port] = process
        return port

    def stop_listening(self, process: Process) -> None:
        """Its port is free, for whoever comes next."""
        self.listening = {port: each for port, each in self.listening.items() if each is not process}

    def _is_fated(self) -> object:
        return self._fates and not self.calm

    def _fate(self) -> None:
        if self._rest:
            self._rest -= 1
            return
        fate = self._fates.pop()
        self._rest = fate["after"]
        if fate["do"] == "copy":
            self._add(self.sites[0].copied("south", shares=fate.get("shares", False)), self._plan["copied"])
        elif fate["do"] == "start":
            self._start(fate["site"])
        elif alive := [each for each in self.processes if each.alive]:
            process = alive[fate["who"] % len(alive)]
            match fate["do"]:
                case "kill":
                    process.end()
                case "stop":
                    process.stopped = True
                case "go on":
                    process.stopped = False
                case "dark":
                    process.dark = True
                    process.site.database.end_all_of(process)
                case "light":
                    process.dark = False
                case "cut":
                    process.site.database.end_all_of(process)
                case "away" if process.site.past is not None:
                    process.site.past.away = fate["kind"]
                case "back" if process.site.past is not None:
                    process.site.past.away = None
                case "leave" if process.runs:
                    process.leave()

    def _start(self, number: int) -> None:
        """One more server of a site."""
        site = self.sites[number % len(self.sites)]
        draw, self._begun = self.schedule.random, self._begun + 1
        place = draw.choice(self._places)
        number = next(each for each in NUMBERS if each not in place.processes)
        user, hides, reaped = draw.choice("ab"), draw.random() < 0.5, draw.random() < 0.8
        entry = Entry(place, number, self._begun, user, hides, reaped)
        place.processes[entry.number] = entry
        self.processes.append(self.process(self, site, f"{site.name}/{draw.randrange(2)}", entry))

    # The end

    def play(self) -> None:
        """Everything that is planned, and then a look at all promises. Raises Finding."""
        with self._machine():
            try:
                self._live()
                self._look()
            finally:
                for process in self.processes:
                    process.end()
                for site in self.sites:
                    if site.past is not None:
                        site.past.remove()

    def _live(self) -> None:
        for _ in range(2):
            self._start(0)
        while self._fates and self._turn():
            pass

    def _look(self) -> None:
        """Once nothing fails any more, all are answered, and each site has one owner, which has what is kept."""
        self.calm = True
        for process in self.processes:
            process.stopped = process.dark = False
        for site in self.sites:
            if site.past is not None:
                site.past.calm = True
        for number in range(len(self.sites)):
            self._start(number)
        for actor in self._clients:
            self._until(lambda actor=actor: not actor.ready() and not actor.waiting, actor.client.producer)
        for site in self.sites:
            owner = self._settled(site)
            compare(owner.core.core, site.model)
            for name in sorted({*site.model.alive, "a"}):
                self._probe(site, name)
            for name in sorted(site.model.fences.alive):
                self._probe_fence(site, name)
            if self.alarmed:
                self._pass_alarms(site)
            if site.past is not None:
                self._look_at_past(site, site.past)
            compare(self._settled(site).core.core, site.model)

    def _pass_alarms(self, site: Site) -> None:
        """Time passes, and raises the alarms that it should."""
        self.now += MOMENT
        core = self._settled(site).core
        self._until(lambda: not core.is_behind(), "the clock")
        if late := site.model.fences.overdue(self._settled(site).core.time() - TICK):
            raise site.model.finds(f"{late} should have been raised by time")

    def _look_at_past(self, site: Site, past: SharedPast) -> None:
        """All of the past is there, and the store has nothing else."""
        rows = self._settled(site).storage._rows
        self._until(lambda: past.needs_all(rows), "what is to be filed")
        for name in sorted(site.model.alive):
            self._finish(read_past(self._settled(site), site.model, name))

    def _settled(self, site: Site) -> Process:
        """Who serves a site, and has nothing left to do, once those that leave have ended."""
        found: list[Process] = []

        def is_settled() -> bool:
            served = [each for each in self.listening.values() if each.site is site and each.ownership.holds()]
            known = [each for each in served if site.addresses._known.get(PARTITION, (0,) * 5)[4] == each.port]
            found[:] = [each for each in known if each.runs and each.core is not None and not each.core.core.busy]
            ending = any(each.alive and each.leaves and each.site is site for each in self.processes)
            return len(found) == len(served) == 1 and not ending

        self._until(is_settled, f"an owner of {site.name}")
        return found[0]

    def _probe(self, site: Site, name: str) -> None:
        gateway: Any = Gateway(self, site)
        self._finish(probe(gateway, site.model, name, anew=self.schedule.random.random() < 0.3))

    def _probe_fence(self, site: Site, name: str) -> None:
        gateway: Any = Gateway(self, site)
        self._finish(probe_fence(gateway, site.model, name, anew=self.schedule.random.random() < 0.3))

    def _finish(self, work: Any) -> None:
        condition: Condition | None = None
        while True:
            try:
                condition = work.send(None)
            except StopIteration:
                return
            self._until(condition, "a probe")

    def _until(self, condition: Callable[[], object], who: str) -> None:
        bound = self.schedule.turns + self.most_turns
        while not condition():
            if not self._turn() or self.schedule.turns > bound:
                raise self.sites[0].model.finds(f"{who} waits for ever")

    def _turn(self) -> bool:
        """One turn; while nothing fails, time passes only when nobody can act before. Whether anybody did anything."""
        if not self.schedule.turn():
            if not self._alarms:
                return False
            self._pass()
        for site in self.sites:
            if site.model.finding is not None:
                raise site.model.finds(site.model.finding)
        return True

    # What Ownership takes for the machine

    def _machine(self) -> ExitStack:
        """A block in which the modules of ownership have simulated time, threads and processes."""
        stack = ExitStack()

        def of_current(name: str) -> Any:
            return lambda *arguments: getattr(System(self._acting.entry), name)(*arguments)

        def proc() -> Any:
            return Proc(self._acting.entry)

        stack.enter_context(small_segments(self._plan.get("segment_rows")))
        stack.enter_context(simulated_reading(lambda: self._acting._threads, lambda: self.now))
        clock = SimpleNamespace(
            CLOCK_BOOTTIME=0,
            clock_gettime=lambda _: self.now,
            monotonic=lambda: self.now,
        )
        threads = SimpleNamespace(
            Thread=lambda *, target, name, daemon: _Thread(self._acting, target, name),  # noqa: ARG005
            Lock=lambda: _Lock(self._acting),
            Event=lambda: _Event(self._acting),
        )
        stack.enter_context(
            patch.multiple(processes, os=SimpleNamespace(getpid=of_current("getpid"), kill=of_current("kill")))
        )
        stack.enter_context(
            patch.multiple(
                ownership,
                time=clock,
                threading=threads,
                this_process=lambda: processes.this_process(proc()),
                is_known_dead=lambda process: processes.is_known_dead(process, proc()),
            )
        )
        return stack

    @property
    def _acting(self) -> Process:
        assert self.current is not None  # a thread of it acts, or it begins
        return self.current


class _Thread:
    def __init__(self, process: Process, run: Callable[[], None], name: str) -> None:
        self._process, self._run, self._name = process, run, name
        self._done = False

    def start(self) -> None:
        def run() -> None:
            try:
                self._run()
            finally:
                self._done = True

        self._process.spawn(self._name, run)

    def join(self, seconds: float) -> None:
        self._process.wait(lambda: self._done, seconds)


class _Lock:
    def __init__(self, process: Process) -> None:
        self._process = process
        self._taken = False

    def acquire(self, timeout: float | None = None) -> bool:
        if not self._process.wait(lambda: not self._taken, timeout):
            return False
        self._taken = True
        return True

    def release(self) -> None:
        self._taken = False

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()


class _Event:
    def __init__(self, process: Process) -> None:
        self._process = process
        self._set = False

    def set(self) -> None:
        self._set = True

    def wait(self, seconds: float) -> bool:
        return self._process.wait(lambda: self._set, seconds)
