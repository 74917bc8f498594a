"""A worker of a cluster: a process that owns some of the partitions, each with a server and ports of its own.

It looks at the tables, takes what it should have and is free, and lets go of what another worker should have. A
partition is moved only while all of them are served, so that one at a time is away.
"""

import asyncio
import logging
import time
from collections.abc import Coroutine, Iterator
from typing import Any

from prometheus_client import CollectorRegistry
from prometheus_client.core import GaugeMetricFamily
from prometheus_client.metrics_core import Metric
from prometheus_client.registry import Collector

from dynhull_server.app import Server, end_process
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock
from dynhull_server.settings import Settings
from dynhull_server.state.errors import words
from dynhull_server.storage.port import StorageError, TakenOverError

from ..journal import database_of
from ..metrics import merged
from ..postgres.ownership import is_known_dead
from ..postgres.storage import PostgresStorage
from ..worker import own_settings
from .board import Board, Cluster, Tables, join
from .claims import shares
from .entrance import PartitionEntrance

# Seconds before a partition that could not be taken is tried again: at first, and at most.
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 30.0
# Seconds that gateways get to receive what their calls have ended with, before another worker may have the partition.
LAST_STATUSES = 0.03

log = logging.getLogger(__name__)


class Member:
    """Serves partitions from `start` until `drain` has returned.

    Args:
        settings: the settings.
        worker: its name in the tables.

    Attributes:
        address: the address for the cluster.
        registry: its metrics: those of each partition, with a label.
    """

    def __init__(self, settings: Settings, worker: str) -> None:
        self._settings = settings
        self._worker = worker
        self._database = database_of(settings)
        self._board = Board(self._database, self._decide, worker)
        self._supervisor = Supervisor(Clock(), lambda _: None, end_process)
        self._cluster = Cluster(0, "")
        self._served: dict[int, Server] = {}
        self._busy: dict[int, asyncio.Task[None]] = {}
        self._failed: dict[int, tuple[float, float]] = {}
        self._looked = asyncio.Event()
        self._settled = asyncio.Event()
        self.address = settings.cluster_host
        self.registry = CollectorRegistry(auto_describe=False)
        self.registry.register(_Collector(self._served))

    async def start(self) -> None:
        """Join the cluster, and take what is free.

        Raises:
            StorageError: the database cannot be used.
        """
        self._cluster = await asyncio.to_thread(join, self._database, self._settings.partitions)
        self._supervisor.every(0.0, "board", self._board.run)
        await self._looked.wait()
        while self._busy:  # what was free
            await asyncio.wait(self._busy.values())
        log.info("serving", extra={"worker": self._worker, "partitions": len(self._served)})

    async def drain(self) -> None:
        """Have the other workers take the partitions over, if there are any; then stop."""
        self._board.leaving = True
        if self._others():
            log.info("the other workers take over", extra={"partitions": len(self._served)})
            try:
                async with asyncio.timeout(self._settings.grace):
                    while self._served or self._busy:
                        self._settled.clear()
                        await self._settled.wait()
            except TimeoutError:
                log.warning("partitions are left behind", extra={"partitions": len(self._served)})
        await self._supervisor.stop()
        await asyncio.gather(*self._busy.values(), return_exceptions=True)
        await asyncio.gather(*(server.drain() for server in self._served.values()))
        if self._looked.is_set():
            await self._board.leave()

    def _others(self) -> list[str]:
        """The other workers that can take partitions."""
        return [each for each, draining in self._board.tables.workers.items() if not draining and each != self._worker]

    def _decide(self, tables: Tables) -> None:
        """Begin to take and to let go, after each look at the tables."""
        count = self._cluster.partitions
        holders = self._board.holders(count)
        leaving = self._board.leaving or tables.workers.get(self._worker, False)
        workers = self._others() + ([] if leaving else [self._worker])
        wanted = shares(holders, workers, tables.wishes)
        for number in range(count):
            if wanted[number] == self._worker and number not in self._served and self._is_free(number):
                self._begin(number, self._take(number))
        if all(holders) and all(tables.owners[each].address for each in range(count)) and not self._busy:
            to_go = (each for each in self._served if wanted[each] not in ("", self._worker))
            if (gone := next(to_go, None)) is not None:
                self._begin(gone, self._let_go(gone, wanted[gone]))
        self._looked.set()
        self._settled.set()

    def _is_free(self, number: int) -> bool:
        """Whether a partition can be taken at once, and there is no reason to wait before it is tried again."""
        if number in self._busy or time.monotonic() < self._failed.get(number, (0.0, 0.0))[0]:
            return False
        owner = self._board.tables.owners.get(number)
        free = owner is None or owner.free or self._board.lapsed(number) is not None
        return free or (owner is not None and is_known_dead(owner.process))

    def _begin(self, number: int, work: Coroutine[Any, Any, None]) -> None:
        task = self._busy[number] = asyncio.get_running_loop().create_task(work)

        def ended(_: "asyncio.Task[None]") -> None:
            del self._busy[number]
            self._settled.set()

        task.add_done_callback(ended)

    async def _take(self, number: int) -> None:
        """Own a partition, and serve it; if that fails, others may, and this worker tries again later."""
        begun = time.monotonic()
        entrance = PartitionEntrance(self._settings, number, self._cluster.secret)
        storage = PostgresStorage(
            self._database,
            end_process,
            self._settings.durability,
            partition=number,
            partitions=self._cluster.partitions,
            worker=self._worker,
            lapsed=self._board.lapsed(number),
        )
        server = Server(own_settings(self._settings), entrance, storage)
        try:
            await server.start()
            await asyncio.to_thread(storage.announce, entrance.address)
        except (StorageError, OSError, RuntimeError) as error:
            await server.drain()
            _, pause = self._failed.get(number, (0.0, FIRST_PAUSE))
            self._failed[number] = time.monotonic() + pause, min(2 * pause, LONGEST_PAUSE)
            if isinstance(error, TakenOverError):
                end_process(words(error))
            log.error("a partition cannot be served", extra={"partition": number, "reason": words(error)})
            return
        self._failed.pop(number, None)
        self._served[number] = server
        seconds = round(time.monotonic() - begun, 3)
        log.info("a partition is served", extra={"partition": number, "seconds": seconds})

    async def _let_go(self, number: int, worker: str) -> None:
        """Stop to serve a partition, so that another worker can take it."""
        log.info("a partition is let go", extra={"partition": number, "to": worker})
        await self._served.pop(number).drain(LAST_STATUSES)


class _Collector(Collector):
    """The metrics of all partitions of a process."""

    def __init__(self, served: dict[int, Server]) -> None:
        self._served = served

    def describe(self) -> Iterator[Metric]:
        """Nothing: the names are those that the partitions have."""
        return iter(())

    def collect(self) -> Iterator[Metric]:
        """The metrics of each partition, and how many there are."""
        served = dict(self._served)
        yield GaugeMetricFamily("dynhull_partitions", "Partitions that the process serves.", value=len(served))
        yield from merged({str(number): list(each.registry.collect()) for number, each in served.items()}, "partition")
