"""A gateway of a cluster."""

from dynhull_server.settings import Settings

from ..gateway import Gateway
from ..postgres.database import Database
from .addresses import Addresses
from .board import Board, Cluster


class ClusterGateway(Gateway):
    """A gateway to the partitions of a database, wherever they are served.

    Args:
        settings: the settings.
        database: the database.
        cluster: the cluster.
        server: the server that it is a gateway of; without --cluster, it calls the workers of no other one.
    """

    def __init__(self, settings: Settings, database: Database, cluster: Cluster, server: str) -> None:
        only = "" if settings.cluster else server
        addresses = Addresses(cluster.secret, settings.cluster_ca, settings.peer_ping_interval, only)
        self._board = Board(database, addresses.learn)
        super().__init__(settings, cluster.partitions, addresses)

    async def start(self) -> None:
        """Listen, and follow the owners of the partitions."""
        self._supervisor.every(0.0, "board", self._board.run)
        await super().start()
