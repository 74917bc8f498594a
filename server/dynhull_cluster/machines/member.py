"""A worker on a database: a process that owns some of the partitions, each with a server and ports of its own.

It looks at the tables, takes what it should have and is free, and lets go of what another worker should have, once that
has read it. A partition is moved only while all of them are served, so that one at a time is away.

A move, from both ends: the worker that should have the partition reads it while the other one serves it (`ahead`), and
says so in the tables. The other one then lets go, when its last commit is complete, and the first takes the partition
and reads what has come since. If either dies or fails in between, the tables say so, and the partition is free for the
other one or a third: whoever takes it raises the epoch, so that there are never two owners.
"""

import asyncio
import logging
import time
from collections.abc import Coroutine, Iterable, Iterator
from typing import Any

from prometheus_client import CollectorRegistry
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from dynhull_server.app import Server, end_process
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock
from dynhull_server.history_folder import archive_of, claim_history
from dynhull_server.settings import Settings
from dynhull_server.state.errors import words
from dynhull_server.storage.port import LockedError, StorageError, TakenOverError
from dynhull_server.storage.segments.owner import Claimant, owner_of_database

from ..divisions.divisions import ServedDivisions
from ..divisions.peers import Peers, peer_handler
from ..merged_metrics import merged
from ..postgres.database import Database
from ..postgres.marks import DatabaseMarks
from ..postgres.ownership import Leases
from ..postgres.processes import is_known_dead
from ..postgres.storage import PostgresStorage
from ..versions import apart
from ..worker import own_settings
from .addresses import Addresses
from .ahead import FAILURES, Ahead, Served
from .board import SPLITS, Board, Cluster, Tables, join, partitions_of_new
from .claims import shares
from .entrance import PartitionEntrance
from .joining import admit, require_right_clock, server_of, watch_clock

# Seconds before a partition that could not be taken is tried again: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 30.0
# What may fail.
READ_AHEAD, TAKE = "a partition cannot be read ahead", "a partition cannot be served"
# What a copy of a database says that was made while it was served.
APART = (
    "owners of partitions are not connected to this database: they have died, or it is a copy of theirs. They are not "
    "called, and are replaced here. To join them, give --journal the database that they serve"
)
# What a worker says that has nothing to do.
ALONE = "nothing to serve: a server without --cluster has it, until that is stopped"
UNDIVIDED = (
    "nothing to serve: the database has a single partition, which another worker has, until that is stopped; to divide "
    "it among several, run `dynhull cluster split N`"
)
LEFT_OUT = (
    "nothing to serve: each partition has another worker, and this one takes over what becomes free; a new database "
    "gets more of them with --partitions"
)
# What a worker says of one of another version.
STRANGER = (
    "a worker is of another version: it gets no partitions from here, and what it has cannot be reached from here"
)
# The number of the work that concerns all partitions.
ALL = -1
# Seconds that gateways get to receive what their calls have ended with, before another worker may have the partition.
LAST_STATUSES = 0.03

log = logging.getLogger(__name__)


class Member:
    """Serves partitions from `start` until `drain` has returned.

    Args:
        settings: the settings.
        database: the database.
        worker: its name in the tables.

    Attributes:
        address: the address for the cluster.
        registry: its metrics: those of each partition, with a label.
    """

    def __init__(self, settings: Settings, database: Database, worker: str) -> None:
        self._settings = settings
        self._worker = worker
        self._database = database
        self._host = settings.cluster_host if settings.cluster else ""
        self._leases = Leases()
        self._board = Board(self._database, self._decide, self._leases, worker, self._host)
        self._supervisor = Supervisor(Clock(), self._turn_health, end_process)
        self._cluster = Cluster(0, "")
        self._addresses = Addresses("", None, settings.peer_ping_interval)
        self._peers = Peers(self._addresses)
        self._served: dict[int, Server] = {}
        self._busy: dict[int, asyncio.Task[None]] = {}
        self._ahead: dict[int, Ahead] = {}
        self._failed: dict[tuple[str, int], tuple[float, float]] = {}
        self._idle = ""
        self._strangers: set[str] = set()
        self._looked = asyncio.Event()
        self._settled = asyncio.Event()
        self.address = settings.cluster_host
        self.registry = CollectorRegistry(auto_describe=False)
        self.registry.register(_PartitionCollector(self._served, self._board))

    async def start(self) -> None:
        """Join the cluster, and take what is free.

        Raises:
            StorageError: the database cannot be used, or the machine may not join.
        """
        settings = self._settings
        self._join(await asyncio.to_thread(join, self._database, partitions_of_new(settings)))
        await asyncio.to_thread(claim_history, settings, self._owner())
        await asyncio.to_thread(
            admit, self._database, self._worker, self._host, settings.max_clock_difference, self._leases
        )
        self._supervisor.every(0.0, "board", self._board.run)
        await self._looked.wait()
        apart = self._board.tables.apart().items()
        if owners := sorted(worker for worker, process in apart if not is_known_dead(process)):
            log.warning(APART, extra={"owners": ", ".join(owners)})
        await self._settle()  # what was free
        log.info("serving", extra={"worker": self._worker, "partitions": len(self._served)})

    async def drain(self) -> None:
        """Have the other workers take the partitions over, if there are any; then stop."""
        self._board.leaving = True
        if self._others():
            log.info("the other workers take over", extra={"partitions": len(self._served)})
            try:
                async with asyncio.timeout(self._settings.grace):
                    while (self._served or self._busy) and self._others():  # who may leave as well
                        self._settled.clear()
                        await self._settled.wait()
            except TimeoutError:
                log.warning("partitions are left behind", extra={"partitions": len(self._served)})
        await self._supervisor.stop()
        await asyncio.gather(*(each.drop() for each in self._ahead.values()))
        await asyncio.gather(*self._busy.values(), return_exceptions=True)
        await asyncio.gather(*(server.drain() for server in self._served.values()))
        self._peers.close()
        if self._looked.is_set():
            await self._board.leave()

    async def _settle(self) -> None:
        """Wait until all that has begun is done."""
        while self._busy:
            await asyncio.wait(self._busy.values())

    def _is_neighbour(self, worker: str) -> bool:
        """Whether a worker shares partitions with this one: without --cluster, only those of the same server do."""
        if server_of(worker) == server_of(self._worker):
            return True
        present = self._board.tables.workers.get(worker)
        return self._settings.cluster and present is not None and present.host != ""

    def _is_of_neighbour(self, holder: str) -> bool:
        """Whether a partition is held by another worker that this one may take it over from."""
        return holder != self._worker and not holder.startswith(SPLITS) and self._is_neighbour(holder)

    def _others(self) -> list[str]:
        """The other workers that can take partitions, and that callers of this one could reach there."""
        workers, strangers = self._board.tables.workers, self._board.tables.strangers()
        can = (name for name, each in workers.items() if not each.draining and name != self._worker)
        return [name for name in can if self._is_neighbour(name) and name not in strangers]

    def _decide(self, tables: Tables) -> None:
        """Begin to take, to read ahead and to let go, after each look at the tables."""
        if tables.partitions != self._cluster.partitions or ALL in self._busy:
            if ALL not in self._busy:
                self._begin(ALL, self._follow_split())
                self._busy[ALL].add_done_callback(lambda _: self._decide(self._board.tables))
            return
        self._addresses.learn(tables)
        watch_clock(self._supervisor, self._board.clock_difference, self._settings.max_clock_difference)
        self._notice_strangers()
        if not self._settings.cluster or not (alone := tables.alone()):
            self._share(tables)
        else:
            self._notice_idle(ALONE, alone)
        self._looked.set()
        self._settled.set()

    def _share(self, tables: Tables) -> None:
        """Begin to take, to read ahead and to let go what is this worker's, or not."""
        count = self._cluster.partitions
        holders = self._board.holders(count)
        own = tables.workers.get(self._worker)
        leaving = self._board.leaving or (own is not None and own.draining)
        workers = self._others() + ([] if leaving else [self._worker])
        expected = [holder or self._board.heir(number) for number, holder in enumerate(holders)]
        wanted = shares(expected, workers, tables.wishes)
        for number in range(count):
            if self._board.forsaken(number, wanted[number]) and len(workers) > 1:
                left = [each for each in workers if each != wanted[number]]
                wanted[number] = shares(expected, left, tables.wishes)[number]
        if not leaving and not any(each.startswith(SPLITS) for each in wanted):
            left_out = UNDIVIDED if self._cluster.partitions == 1 else LEFT_OUT
            self._notice_idle("" if self._worker in wanted else left_out, wanted)
        for number, ahead in self._ahead.items():
            if wanted[number] != self._worker:
                ahead.give_up()
        for number in range(count):
            if wanted[number] != self._worker or number in self._served or number in self._busy:
                continue
            if self._board.is_free(number):
                if self._may_try(TAKE, number):
                    self._begin(number, self._take(number))
            elif not self._ahead and self._is_of_neighbour(holders[number]) and self._may_try(READ_AHEAD, number):
                self._read_ahead(number)
        if all(holders) and all(tables.owners[each].address for each in range(count)) and not self._busy:
            to_go = (each for each in self._served if wanted[each] not in ("", self._worker))
            ready = (each for each in to_go if self._board.heir(each) == wanted[each])
            if (gone := next(ready, None)) is not None:
                self._begin(gone, self._let_go(gone, wanted[gone]))

    def _notice_idle(self, idle: str, owners: Iterable[str]) -> None:
        """Say it once when there is nothing to serve, which looks as if the server were broken."""
        if idle and idle != self._idle:
            log.warning(idle, extra={"served_by": ", ".join(sorted(set(owners)))})
        self._idle = idle

    def _notice_strangers(self) -> None:
        """Say it once of each worker of another version, which joins though it would be refused here."""
        strangers = self._board.tables.strangers()
        for worker in strangers.keys() - self._strangers:
            log.error(STRANGER, extra={"reason": apart(worker, strangers[worker])})
        self._strangers = set(strangers)

    def _turn_health(self, reason: str | None) -> None:
        for server in self._served.values():
            server.set_machine_well(reason is None)

    def _require_right_clock(self) -> None:
        require_right_clock(self._board.clock_difference, self._settings.max_clock_difference)

    def _may_try(self, what: str, number: int) -> bool:
        """Whether there is no reason to wait before something that has failed is tried again."""
        return time.monotonic() >= self._failed.get((what, number), (0.0, 0.0))[0]

    def _begin(self, number: int, work: Coroutine[Any, Any, None]) -> None:
        task = self._busy[number] = asyncio.get_running_loop().create_task(work)

        def ended(_: "asyncio.Task[None]") -> None:
            del self._busy[number]
            self._settled.set()
            self._require_well(number, task)

        task.add_done_callback(ended)

    def _read_ahead(self, number: int) -> None:
        ahead = self._ahead[number] = Ahead(number, self._make, self._board)
        log.info("a partition is read ahead", extra={"partition": number})

        def ended(_: "asyncio.Task[None]") -> None:
            del self._ahead[number]
            if ahead.failure is not None:
                self._note_failure(READ_AHEAD, number, ahead.failure)
            self._require_well(number, ahead.task)

        ahead.task.add_done_callback(ended)

    def _require_well(self, number: int, task: "asyncio.Task[None]") -> None:
        """End the process if work has failed in a way that nobody has foreseen: its partition would not be served."""
        if not task.cancelled() and (error := task.exception()) is not None:
            self._supervisor.died(f"partition {number}", error)

    def _note_failure(self, what: str, number: int, error: BaseException) -> None:
        """Try it again later."""
        if isinstance(error, LockedError):  # that is no failure
            self._failed[what, number] = time.monotonic() + FIRST_PAUSE, FIRST_PAUSE
            log.info("another worker has taken a partition", extra={"partition": number})
            return
        _, pause = self._failed.get((what, number), (0.0, FIRST_PAUSE))
        self._failed[what, number] = time.monotonic() + pause, min(2 * pause, LONGEST_PAUSE)
        if isinstance(error, TakenOverError):
            end_process(words(error))
        log.error(what, extra={"partition": number, "reason": words(error)})

    def _make(self, number: int) -> Served:
        """A server for a partition. It goes on with the clock of this machine, which has to be right."""
        self._require_right_clock()
        divisions = ServedDivisions(self._settings, number, self._cluster.partitions, self._peers)
        entrance = PartitionEntrance(
            self._settings, number, self._worker, self._cluster.secret, peer_handler(divisions.receive)
        )
        storage = PostgresStorage(
            self._database,
            end_process,
            self._settings.durability,
            partition=number,
            partitions=self._cluster.partitions,
            worker=self._worker,
            leases=self._leases,
            archive=archive_of(self._settings, owner=self._owner()),
        )
        return Served(Server(own_settings(self._settings), storage, entrance, divisions), storage, entrance)

    async def _take(self, number: int) -> None:
        """Own a partition, and serve it; if that fails, others may, and this worker tries again later."""
        begun = time.monotonic()
        ahead = self._ahead.get(number)
        served = None if ahead is None else await ahead.finish()
        try:
            served = served or self._make(number)
            await served.server.start()
            await asyncio.to_thread(served.storage.announce, served.entrance.address)
        except FAILURES as error:
            if served is not None:
                await served.server.drain()
            self._note_failure(TAKE, number, error)
            return
        for what in (READ_AHEAD, TAKE):
            self._failed.pop((what, number), None)
        self._served[number] = served.server
        served.server.set_machine_well(self._supervisor.reason is None)
        seconds = round(time.monotonic() - begun, 3)
        log.info("a partition is served", extra={"partition": number, "seconds": seconds})

    async def _follow_split(self) -> None:
        """Begin anew with the partitions of a database that was split, which nobody has had yet."""
        others = [task for number, task in self._busy.items() if number != ALL]
        await asyncio.gather(*(each.drop() for each in self._ahead.values()))
        await asyncio.gather(*others, return_exceptions=True)
        await asyncio.gather(*(server.drain() for server in self._served.values()))  # one that takes no part any more
        self._served.clear()
        try:
            cluster = await asyncio.to_thread(join, self._database, self._cluster.partitions)
        except StorageError as error:
            log.warning("the cluster of a split database cannot be joined", extra={"reason": words(error)})
            await asyncio.sleep(FIRST_PAUSE)
            return
        self._join(cluster)
        self._failed.clear()
        log.info("the database was split", extra={"partitions": cluster.partitions})

    def _join(self, cluster: Cluster) -> None:
        settings = self._settings
        self._peers.close()
        self._cluster = cluster
        only = "" if settings.cluster else server_of(self._worker)
        self._addresses = Addresses(cluster.secret, settings.cluster_ca, settings.peer_ping_interval, only)
        self._peers = Peers(self._addresses)

    def _owner(self) -> Claimant:
        return owner_of_database(self._cluster.secret, str(self._database), DatabaseMarks(self._database))

    async def _let_go(self, number: int, worker: str) -> None:
        """Stop to serve a partition, so that another worker can take it."""
        log.info("a partition is let go", extra={"partition": number, "to": worker})
        await self._served.pop(number).drain(LAST_STATUSES)


class _PartitionCollector(Collector):
    """The metrics of all partitions of a process."""

    def __init__(self, served: dict[int, Server], board: Board) -> None:
        self._served = served
        self._board = board

    def describe(self) -> Iterator[Metric]:
        """Nothing: the names are those that the partitions have."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """The metrics of each partition, and how many there are."""
        served = dict(self._served)
        entitled = sum(each.entitled for each in served.values())
        yield GaugeMetricFamily("dynhull_partitions", "Partitions that the process serves.", value=entitled)
        yield GaugeMetricFamily(
            "dynhull_clock_difference_seconds",
            "Seconds by which the clock of the machine is ahead of that of the database, at the least.",
            value=self._board.clock_difference,
        )
        yield from merged({str(number): list(each.registry.collect()) for number, each in served.items()}, "partition")
