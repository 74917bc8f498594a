"""All hulls over shards whose roots or shards are in this process."""

import asyncio
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from dynhull_server.engine.division import DividedReads, StoredShard
from dynhull_server.engine.driver import Driver
from dynhull_server.engine.shard_store import ShardStore
from dynhull_server.settings import Settings
from dynhull_server.state.errors import HullNotFoundError
from dynhull_server.state.hull import Hull
from dynhull_server.state.records import HullRow, HullSettings
from dynhull_server.state.requests import Expire, WriteBatch

from ..placement import worker_of, worker_of_shard
from ..shards import messages as say
from ..shards.placement import ShardAddress
from .letters import Answer, Greeted, Greeting, IsWanted, Letter, Wanted
from .local_shard import LocalShard
from .peers import PeerAwayError, Peers
from .served_root import ServedRoot
from .wire import pack, unpack

# Seconds between looks at what waits, and between looks whether the hulls of shards are still there.
LOOK_SECONDS, WANTED_SECONDS = 0.25, 5.0
# Seconds that requests wait for a shard whose worker is away, where no other one takes its place.
AWAY_SECONDS = 3.0

# The name of the work that other processes ask for.
SHARDS = "shards"
# Between the name of a hull and what distinguishes a shard, in the names of rows: no name of a hull has it.
MARK = "#"


def name_of_shard(name: str, uid: str, place: ShardAddress) -> str:
    """The name of a shard in the storage: others of the hull, and of a deleted one of its name, may be there."""
    return f"{name}{MARK}{uid}.{place.generation}.{place.number}"


def place_of(settings: HullSettings) -> ShardAddress:
    """The place of a shard with these settings."""
    assert settings.shard is not None  # they are those of one
    return ShardAddress(settings.generation, settings.shard)


def hull_of_shard(name: str) -> str:
    """The name of the hull of a shard with this name in the storage."""
    return name.rpartition(MARK)[0]


class ServedDivisions:
    """The hulls over shards of a process.

    Args:
        settings: the settings of the server.
        worker: the number of the worker that has them; in a cluster, of the partition.
        workers: the number of all workers, or partitions.
        peers: the way to the others; None in a server of one process.
    """

    def __init__(self, settings: Settings, worker: int = 0, workers: int = 1, peers: Peers | None = None) -> None:
        self._in_memory = settings.in_memory
        self._workers = workers
        self._worker = worker
        self._peers = peers
        self._patience = (0.0 if peers is None else peers.takeover) or AWAY_SECONDS
        self._driver: Driver | None = None
        self._roots: dict[str, ServedRoot] = {}
        self._shards: dict[tuple[str, ShardAddress], LocalShard] = {}
        self._ending: set[asyncio.Task[None]] = set()
        self._closed = False

    # What the engine asks

    def why_not(self, settings: HullSettings) -> tuple[str, str] | None:
        """The field for which no hull with these settings can be divided, and the reason; None if it can be."""
        if settings.geographic:
            return "config.frame", "is geographic, so it cannot be divided: all of its points share one centre"
        if settings.window is not None and settings.window.max_points:
            reason = "has a window by number, so it cannot be divided: no shard knows the oldest points of all"
            return "config.window.max_points", reason
        if settings.quarantine is not None:
            reason = "has a quarantine, so it cannot be divided: its rules compare with the whole hull"
            return "config.quarantine", reason
        if self._in_memory and self._workers > 1:
            reason = "cannot be divided: workers that keep their data in memory would lose a shard alone"
            return "config.shards", reason
        return None

    async def start(self, driver: Driver, store: ShardStore, shards: Sequence[HullRow], roots: Sequence[Hull]) -> None:
        """Begin, with the shards and the roots that the storage has."""
        self._driver, self._store = driver, store
        for row in shards:
            self._shards[row.uid, place_of(row.settings)] = self._shard(row)
        for hull in roots:
            self.begin(hull)
        driver.supervisor.every(LOOK_SECONDS, "waiting for shards", self._look)
        driver.supervisor.every(WANTED_SECONDS, "shards that are not needed", self._drop_unwanted)

    def begin(self, hull: Hull) -> None:
        """Begin with the root of a hull, unless it has begun."""
        if hull.uid not in self._roots:
            greet, deliver = partial(self._greet, hull), partial(self._deliver, hull)
            root = self._roots[hull.uid] = ServedRoot(
                self._started, self._store.epoch, hull, greet, deliver, self._patience
            )
            if self._closed:  # its creation has just been committed
                self._end(root)

    def end(self, hull: Hull) -> None:
        """The hull is deleted: end its root. Its shards notice."""
        root = self._roots.pop(hull.uid, None)
        if root is not None:
            root.end()
            self._end(root)

    def carry_out(self, hull: Hull, requests: Sequence[WriteBatch | Expire]) -> None:
        """Carry out requests in this order, and answer them."""
        self._roots[hull.uid].carry_out(requests)

    def of(self, hull: Hull) -> DividedReads:
        """The shards of a hull."""
        root = self._roots.get(hull.uid)
        if root is None:
            raise HullNotFoundError(hull.name)
        return root

    def shards(self) -> Sequence[StoredShard]:
        """The shards in this process."""
        return list(self._shards.values())

    async def close(self) -> None:
        """Refuse what waits, and stop."""
        self._closed = True
        await asyncio.gather(*(root.close() for root in self._roots.values()), *self._ending)
        await asyncio.gather(*(shard.close() for shard in self._shards.values()))

    # What other processes ask

    async def receive(self, data: bytes) -> bytes:
        """The answer to a letter of another process."""
        try:
            answer = pack(await self._answer(unpack(data)))
            self._started.supervisor.succeeded(SHARDS)
            return answer
        except Exception as error:
            if self._driver is not None and not isinstance(error, PeerAwayError):
                self._driver.supervisor.failed(SHARDS, error)
            raise

    async def _answer(self, letter: Any) -> Any:
        if self._driver is None or self._closed:
            raise PeerAwayError("this worker is starting or stopping")
        match letter:
            case Greeting():
                shard = await self._found(letter)
                return Greeted(await shard.epoch())
            case Letter():
                known = self._shards.get((letter.uid, ShardAddress(letter.generation, letter.shard)))
                if known is None or not known.stored:
                    raise PeerAwayError("there is no such shard")
                return Answer(await known.receive(letter.message))
            case Wanted():
                wanted = self._has(letter)
                if not self._store.entitled():  # another one may have the hull, and the shard is deleted if nobody has
                    raise PeerAwayError("this worker may not own the partition any more")
                return IsWanted(wanted)
            case _:
                raise TypeError(f"not a letter: {letter}")

    async def _found(self, greeting: Greeting) -> LocalShard:
        """The shard of a root, a new one if there is none."""
        settings = greeting.settings
        key = greeting.uid, place_of(settings)
        shard = self._shards.get(key)
        if shard is None:
            name, number = name_of_shard(greeting.name, *key), self._started.core.number_of_shard()
            row = HullRow(number, name, greeting.uid, greeting.created, settings)
            shard = self._shards[key] = self._shard(row, stored=False)
        await shard.store()
        return shard

    # What roots and shards ask of each other

    @property
    def _started(self) -> Driver:
        assert self._driver is not None  # nothing begins before
        return self._driver

    async def _greet(self, hull: Hull, place: ShardAddress) -> int:
        row = hull.row
        settings = replace(row.settings, shard=place.number, generation=place.generation)
        greeting = Greeting(row.name, row.uid, row.created, settings)
        greeted = await self._send(self._worker_of(row.name, place), greeting)
        epoch: int = greeted.epoch
        return epoch

    async def _deliver(self, hull: Hull, place: ShardAddress, message: say.Request) -> say.Reply | None:
        answer = await self._send(self._worker_of(hull.name, place), Letter(hull.uid, *place, message))
        reply: say.Reply | None = answer.reply
        return reply

    def _shard(self, row: HullRow, *, stored: bool = True) -> LocalShard:
        return LocalShard(self._started.machine.threads.pool("shard", 1), self._store, row, stored=stored)

    def _worker_of(self, name: str, place: ShardAddress) -> int:
        return worker_of_shard(name, place.number, self._workers)

    async def _send(self, worker: int, letter: Any) -> Any:
        """The answer to a letter. Raises PeerAwayError if the worker is away."""
        if self._peers is None or worker == self._worker:
            return await self._answer(letter)
        return unpack(await self._peers.ask(worker, pack(letter)))

    def _has(self, letter: Wanted) -> bool:
        hull = self._started.core.hulls.get(letter.name)
        if hull is None or hull.uid != letter.uid:
            return False
        root = self._roots.get(hull.uid)
        return root is None or root.needs(letter.generation)

    # Background work

    async def _look(self) -> None:
        for root in list(self._roots.values()):
            root.look()

    async def _drop_unwanted(self) -> None:
        """Delete the shards of hulls that are deleted, or divided in another way."""
        for key, shard in list(self._shards.items()):
            row, name = shard.row, hull_of_shard(shard.row.name)
            try:
                found = await self._send(worker_of(name, self._workers), Wanted(name, row.uid, row.settings.generation))
            except PeerAwayError:
                continue
            if not found.wanted:
                del self._shards[key]
                await shard.close()
                try:
                    await self._store.drop(row.number)
                except Exception:  # it is still there, so it has to be asked about again
                    self._shards[key] = self._shard(row)
                    raise

    def _end(self, root: ServedRoot) -> None:
        task = asyncio.create_task(root.close())
        self._ending.add(task)
        task.add_done_callback(self._ending.discard)
