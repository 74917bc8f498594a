"""A gateway of a cluster."""

import asyncio

from dynhull_server.settings import Settings

from ..gateway import Gateway
from ..postgres.database import Database
from ..postgres.ownership import Leases
from .addresses import Addresses
from .board import Board, Cluster, Tables, join


class ClusterGateway(Gateway):
    """A gateway to the partitions of a database, wherever they are served.

    Args:
        settings: the settings.
        database: the database.
        cluster: the cluster.
        server: the server that it is a gateway of; without --cluster, it calls the workers of no other one.
    """

    def __init__(self, settings: Settings, database: Database, cluster: Cluster, server: str) -> None:
        self._database = database
        self._cluster = cluster
        self._only = "" if settings.cluster else server
        self._addresses = self._addresses_of(settings)
        self._split = asyncio.Event()
        self._board = Board(database, self._learn, Leases())
        super().__init__(settings, cluster.partitions, self._addresses)

    async def start(self) -> None:
        """Listen, and follow the owners of the partitions."""
        self._supervisor.every(0.0, "board", self._board.run)
        self._supervisor.every(0.0, "split", self._follow_split)
        await super().start()

    def _addresses_of(self, settings: Settings) -> Addresses:
        return Addresses(self._cluster.secret, settings.cluster_ca, settings.peer_ping_interval, self._only)

    def _learn(self, tables: Tables) -> None:
        if tables.partitions == self._cluster.partitions:
            self._addresses.learn(tables)
        else:
            self._split.set()

    async def _follow_split(self) -> None:
        """Have a link to each partition when the database was split."""
        await self._split.wait()
        self._split.clear()
        if self._board.tables.partitions == self._cluster.partitions:  # looks before it was followed have said so, too
            return
        self._cluster = await asyncio.to_thread(join, self._database, self._cluster.partitions)
        self._addresses = self._addresses_of(self._settings)
        self._addresses.learn(self._board.tables)
        self.divide(self._cluster.partitions, self._addresses)
