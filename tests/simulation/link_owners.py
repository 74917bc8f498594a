"""Owners of hulls behind the links of gateways, one after the other, with the past of these in a store that they share.

What is real are the engine of each owner, its housekeeping and its handlers, `Ownership`, the links and the frames, the
rows, the segments and the claims of the store. The network goes dark, the store is away, owners stand still while they
send, lose the database and are replaced; and a copy of the database may be served with the store of the original.
"""

import asyncio
import heapq
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any, cast
from unittest.mock import patch

from dynhull_cluster.frame_server import FrameServer
from dynhull_cluster.postgres.marks import DatabaseMarks
from dynhull_cluster.worker_link import WorkerLink
from dynhull_proto.v1 import hull_pb2
from dynhull_proto.v1 import hull_service_pb2 as pb
from dynhull_server import history_folder
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.threads import Machine
from dynhull_server.history_folder import claim_history
from dynhull_server.rpc.calls import Calls
from dynhull_server.rpc.encode import encode_history
from dynhull_server.state.errors import HullNotFoundError, HullReplacedError, PastDamagedError, RevisionForgottenError
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.port import DamagedError, StorageError
from dynhull_server.storage.segments.owner import Claimant, OccupiedError, owner_of_database

from .clients import Client, content, probe
from .cluster_life import Process, Site, World
from .cluster_plan import Operation, Plan
from .core_life import EPOCH
from .globe import points
from .link_life import PARTITION, PING, SECRET, Asking, Ways, disturb, listen
from .machine import Loop, SimulatedClock
from .model import Model
from .network import Network, Wire, greeted
from .queries import _outline, _read
from .schedule import Schedule
from .shell_life import SNAPSHOT_POINTS, SYNC_SECONDS, ClientActor, WatchedSupervisor

if TYPE_CHECKING:
    from dynhull_server.settings import Settings

# Turns until everything is served again: engines do much, and each connection moves byte by byte.
MANY_TURNS = 200_000
# Seconds that calls get to end before an owner leaves.
GRACE = 1.0


class OwnLoop(Loop):
    """The event loop of a process in the time of its world."""

    def __init__(self, world: "LinkWorld", model: Model, schedule: Any) -> None:
        self._world = world
        super().__init__(model, schedule)

    @property
    def now(self) -> float:  # type: ignore[override]
        """The time of the world."""
        return self._world.now

    def _may_pass(self) -> object:
        return False  # the world has it pass

    def _is_ready(self) -> object:
        while self._timers and self._timers[0][0] <= self.now:
            self._ready.append(heapq.heappop(self._timers)[2])
        return self._ready

    def call_at(self, when: float, callback: Any, *args: Any, context: Any = None) -> asyncio.TimerHandle:
        self._world.alarm(max(0.0, when - self.now))
        return super().call_at(when, callback, *args, context=context)

    async def create_connection(self, make: Any, _: str, port: int, **__: Any) -> Any:  # type: ignore[override]
        return await self._world.network.connect(self, make, port)

    def accept(self, make: Any) -> Any:
        """What takes connections: in this loop, whoever makes them."""

        def accept(wire: Wire) -> None:
            self.call_soon(lambda: greeted(wire, make()))

        return accept


class OwnerLoop(OwnLoop):
    """That of a server, which listens at the port of its process."""

    process: "OwnerProcess"

    async def create_server(self, make: Any, *_: Any, **__: Any) -> Any:  # type: ignore[override]
        self._world.network.listen(self, self.accept(make), self.process.port)
        return self

    def close(self) -> None:
        """As of the server that listens: take no more connections."""
        self._world.network.stop_listening(self)


class _OwnerSupervisor(WatchedSupervisor):
    """The end of a process that owns its hulls is a finding, and so is damage that it finds."""

    def __init__(self, process: "OwnerProcess", loop: Loop) -> None:
        super().__init__(process.site.model, loop)
        self._process = process

    def failed(self, name: str, error: BaseException) -> None:
        past = self._process.site.past
        if isinstance(error, DamagedError) and self._process.owns and not (past and past.lost):
            raise self._model.finds(f"{name} of an owner finds damage: {error}") from error
        super().failed(name, error)

    def _process_ends(self, reason: str) -> None:
        if self._process.owns:
            raise self._model.finds(f"an owner ends: {reason}")
        self._process.lost(reason)


class _Served:
    """What the world asks of the engine of a process."""

    def __init__(self, engine: Engine) -> None:
        self._engine = engine

    @property
    def core(self) -> Any:
        return self._engine.driver.core

    def time(self) -> int:
        return self._engine.driver.time()


class OwnerProcess(Process):
    """A server with the real engine. It claims the place of its past before it owns anything."""

    world: "LinkWorld"
    _loop: OwnerLoop | None = None
    _frames: FrameServer | None = None
    _calls: Calls

    @property
    def owns(self) -> bool:
        """Whether it is the owner for the database, too, and has not begun to leave."""
        row = self.site.database.owners.get(PARTITION)
        return row is not None and row.epoch == self.ownership.epoch and self.ownership.holds() and not self.leaves

    def claimant(self) -> Claimant:
        """The database, of which a copy has the same name."""
        return owner_of_database(SECRET, self.site.name, DatabaseMarks(cast("Any", self.database)))

    def lost(self, reason: str) -> None:
        """The server must end."""
        self._lost(reason)

    def _serve(self) -> None:
        try:
            claim_history(cast("Settings", None), self.claimant())
        except OccupiedError as error:
            if self.site.past is not None and not self.site.past.others:
                raise self.site.model.finds(f"the only one in its place is refused: {error}") from error
            self._lost(str(error))
            return
        super()._serve()

    def _served(self) -> Any:
        model, threads = self.site.model, self._threads
        self._loop = OwnerLoop(self.world, model, self)
        self._loop.process = self
        self._loop.executor(threads.pool("to_thread", 4).submit)
        faulty = self.storage._store
        faulty.give_way, faulty.threads = threads.give_way, threads
        self._supervisor = _OwnerSupervisor(self, self._loop)
        clock = _Clock(self._loop, model, self.random.uniform(0, 10))
        self._engine = Engine(self.world.limits, self.storage, self._supervisor, Machine(clock, threads, model.uid))
        self._finish(self._engine.start(lambda *_: None))
        return _Served(self._engine)

    def _listen(self) -> None:
        super()._listen()

        async def begin() -> None:
            self._engine.keep_house(SNAPSHOT_POINTS, SYNC_SECONDS)
            self._frames, self._calls = await listen(self._engine, self.proof, self.storage.entitled)

        self._finish(begin())

    def _finish(self, work: Any) -> None:
        """Have the loop do something, and wait in a thread until it is done."""
        task = self._loop.create_task(work)
        self.waits(task.done)
        task.result()

    def _fails(self, error: BaseException) -> None:
        if isinstance(error, StorageError | OSError) and not (isinstance(error, DamagedError) and self.owns):
            self._lost(str(error))  # it could not begin
        else:
            super()._fails(error)

    def leave(self) -> None:
        """End as planned, as a server does."""
        self.leaves = True
        self.world.stop_listening(self)

        def release() -> None:
            if self._frames is not None:
                self._finish(self._drain())
            self.ownership.release()
            self._lost("it has ended")

        self.spawn("end", release)

    async def _drain(self) -> None:
        await self._supervisor.stop()
        self._frames.say_goodbye()
        await self._calls.drain(GRACE)
        await self._frames.close()
        await self._engine.close()

    def end(self) -> None:
        """It is killed, or ends itself."""
        if not self.alive:
            return
        if self._loop is not None:
            finding = self.site.model.finding
            self._loop.kill()
            self.world.network.leave(self._loop)
            super().end()
            self.site.model.finding = finding  # of what goes on while it is killed nobody hears
        else:
            super().end()


class _Clock(SimulatedClock):
    """The clock of a server, which is ahead of others by some seconds."""

    def __init__(self, loop: Loop, model: Model, ahead: float) -> None:
        super().__init__(loop, model)
        self._ahead = ahead

    def wall(self) -> float:
        return super().wall() + self._ahead


class LinkGateway(Asking):
    """What clients of a site call: it asks the owner through its link."""

    def __init__(self, world: "LinkWorld", site: Site) -> None:
        self.model, self.schedule = site.model, world.schedule
        self._world, self._site = world, site
        self.loop = OwnLoop(world, site.model, world.schedule)
        self._link = WorkerLink(PARTITION, site.addresses, (), lambda: None)
        self.loop.create_task(self._link.run())

    def time(self) -> int:
        """Microseconds since 1970."""
        return int((EPOCH + self._world.now) * 1e6)

    async def create(self, name: str, settings: HullSettings) -> str:
        config = hull_pb2.HullConfig(history=encode_history(settings))
        response = await self._ask("CreateHull", pb.CreateHullRequest(name=name, config=config), pb.CreateHullResponse)
        uid: str = response.hull.uid
        return uid

    async def delete(self, name: str) -> None:
        await self._ask("DeleteHull", pb.DeleteHullRequest(name=name), pb.DeleteHullResponse)

    async def special(self, client: Client, op: Operation) -> None:
        """Many calls at once, what becomes of the network, time that passes, or a read of the past."""
        if await disturb(self._world.network, client, op):
            return
        if op["do"] == "rest":
            await asyncio.sleep(op["seconds"])
        else:
            await self._as_of(client, op)

    async def _as_of(self, client: Client, op: Operation) -> None:
        """Read a hull at a revision that somebody has seen."""
        name, asked = op["name"], self.model.ask(op["name"])
        truth = self.model.alive.get(name)
        if truth is None or asked.floor[0] != truth.row.number:
            return
        request = _read({"name": name}).get_hull
        request.at_revision, request.at_uid = int(op["at"] * asked.floor[1]), truth.row.uid
        try:
            response = await self._ask("GetHull", request, pb.GetHullResponse)
        except RevisionForgottenError as error:
            if truth.past.whole and not truth.deleted:
                raise self.model.finds(f"the past of {name} was to be kept for ever: {error}") from error
        except Exception as error:
            past = self._site.past
            assert past is not None
            damaged = (PastDamagedError,) if truth.row.uid in past.lost else ()
            client.refused(asked, error, (HullNotFoundError, HullReplacedError, *damaged))
        else:
            vertices, _, _ = _outline(response)
            found = response.hull.uid, response.hull.revision, content(points(name, vertices))
            if found != (truth.row.uid, request.at_revision, truth.contents[request.at_revision]):
                raise self.model.finds(f"{name} is {found} at {request.at_revision}: {truth.contents}")


class _Actor(ClientActor):
    """The turns of a client."""

    @property
    def waiting(self) -> bool:
        """Whether it has not been answered."""
        return self._task is not None


class LinkWorld(World):
    """One plan."""

    process = OwnerProcess
    most_turns = MANY_TURNS

    def __init__(self, plan: Plan, model: Model, schedule: Schedule) -> None:
        self.network = Network(schedule)
        self._gateways: dict[Site, LinkGateway] = {}
        self._due = 0.0
        schedule.brisk = True
        super().__init__(plan, model, schedule)

    def _add(self, site: Site, clients: list[list[Operation]]) -> None:
        """A site with its gateway and its clients."""
        self.sites.append(site)
        site.addresses = Ways(SECRET, None, PING)
        site.model.repeats = True
        self.schedule.actor("gateway", lambda: site.database.told() != site.told, site.look)
        gateway = self._gateways[site] = LinkGateway(self, site)
        for operations in clients:
            client = Client(len(self._clients), gateway, site.model)  # type: ignore[arg-type]
            actor = _Actor(gateway, client, operations)  # type: ignore[arg-type]
            self._clients.append(actor)
            self.schedule.actor(client.producer, actor.ready, actor.act)

    def _is_fated(self) -> object:
        """The next fate comes after some time: most turns are those of periodic work."""
        return self.now >= self._due and super()._is_fated()

    def _fate(self) -> None:
        self._due = self.alarm(self._fates[-1]["after"])
        super()._fate()
        self._rest = 0

    def play(self) -> None:
        """Everything that is planned, and then a look at all promises. Raises Finding."""
        try:
            super().play()
        finally:
            for gateway in self._gateways.values():
                gateway.loop.kill()

    def _look(self) -> None:
        """Once nothing fails any more: who has not the place of its past gets one of its own, as its server says."""
        self.network.dark = [False, False]
        for site in self.sites:
            past = site.past
            assert past is not None
            if not past.has_place:
                for process in self.processes:
                    if process.site is site:
                        process.end()
                past.move()
        super()._look()

    def _probe(self, site: Site, name: str) -> None:
        gateway: Any = self._gateways[site]
        self._until(gateway.is_linked, "the link")
        task = gateway.loop.create_task(probe(gateway, site.model, name, anew=self.schedule.random.random() < 0.3))
        self._until(task.done, "a probe")
        task.result()

    def _machine(self) -> ExitStack:
        stack = super()._machine()
        stack.enter_context(patch.object(history_folder, "archive_of", lambda _, owner: self._archive(owner)))
        return stack

    def _archive(self, owner: Claimant) -> Any:
        process = self._acting
        assert process.site.past is not None
        archive = process.site.past.claimed_by(process)
        archive.owner = owner
        return archive
