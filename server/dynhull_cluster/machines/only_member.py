"""The server of one process on a database: a cluster of a single worker, which callers reach without a gateway."""

import asyncio

from dynhull_server.app import Server, end_process
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock
from dynhull_server.history_folder import archive_of, claim_history
from dynhull_server.settings import Settings
from dynhull_server.storage.port import Progress
from dynhull_server.storage.segments.owner import owner_of_database

from ..divisions.divisions import ServedDivisions
from ..postgres.database import Database
from ..postgres.marks import DatabaseMarks
from ..postgres.ownership import Leases
from ..postgres.processes import this_server
from ..postgres.schema import divided_otherwise
from ..postgres.storage import PostgresStorage
from .board import Board, Tables, join
from .joining import admit, watch_clock


class OnlyMember:
    """Has the only partition of a database, from `start` until `drain` has returned.

    Nobody else takes it from a living worker without --cluster, so it is never read ahead, moved or shared.

    Args:
        settings: the settings.
        database: the database.
    """

    def __init__(self, settings: Settings, database: Database) -> None:
        self._settings = settings
        self._database = database
        self._worker = this_server()
        self._leases = Leases()
        self._supervisor = Supervisor(Clock(), self._turn_health, end_process)
        self._board = Board(database, self._look, self._leases, self._worker)
        self._archive = archive_of(settings)
        storage = PostgresStorage(
            database,
            end_process,
            settings.durability,
            worker=self._worker,
            leases=self._leases,
            archive=self._archive,
        )
        self._server = Server(settings, storage, divisions=ServedDivisions(settings))
        self._joined = False

    @property
    def address(self) -> str:
        """The host:port it listens on, once started."""
        return self._server.address

    @property
    def metrics_url(self) -> str:
        """The URL of the metrics page; empty for none."""
        return self._server.metrics_url

    async def start(self, progress: Progress) -> None:
        """Listen, join the cluster once it is that of nobody else, load the stored hulls, then serve.

        Args:
            progress: called with the number of hulls loaded so far and the total.

        Raises:
            RuntimeError, OSError: the address is in use, or does not belong to this machine.
            StorageError: the database cannot be used, or another server has it.
        """
        limit = self._settings.max_clock_difference
        await self._server.listen()
        cluster = await asyncio.to_thread(join, self._database, 1)
        if cluster.partitions != 1:
            raise divided_otherwise(self._database, cluster.partitions)
        owner = owner_of_database(cluster.secret, str(self._database), DatabaseMarks(self._database))
        if self._archive is not None:
            self._archive.owner = owner
        await asyncio.to_thread(claim_history, self._settings, owner)
        await asyncio.to_thread(admit, self._database, self._worker, "", limit, self._leases)
        self._joined = True
        self._supervisor.every(0.0, "board", self._board.run)
        await self._server.start(progress)

    async def drain(self) -> None:
        """Stop, and let another server have the database."""
        await self._server.drain()
        await self._supervisor.stop()
        if self._joined:
            await self._board.leave()

    def _look(self, _: Tables) -> None:
        watch_clock(self._supervisor, self._board.clock_difference, self._settings.max_clock_difference)

    def _turn_health(self, reason: str | None) -> None:
        self._server.set_machine_well(reason is None)
