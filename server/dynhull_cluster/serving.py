"""What each process of a server serves: a worker or a gateway, on a folder or on a database."""

import asyncio
from pathlib import Path
from typing import Any, Protocol

from prometheus_client import CollectorRegistry

from dynhull_server.settings import Settings

from .gateway import Gateway
from .journal import database_of
from .sockets import Sockets
from .worker import worker_server


class Serving(Protocol):
    """Serves from `start` until `drain` has returned."""

    address: str
    registry: CollectorRegistry

    async def start(self) -> None:
        """Serve."""

    async def drain(self) -> None:
        """End the calls in progress, and stop."""


async def serving(settings: Settings, begin: dict[str, Any]) -> Serving:
    """What a process is to serve.

    Args:
        settings: the settings.
        begin: the first message of the supervisor.

    Raises:
        StorageError: the database cannot be used.
        ValueError: the package for PostgreSQL is missing.
    """
    role, _, number = begin["process"].partition("-")
    if settings.journal is not None:
        database = database_of(settings)  # before what needs its package
        from .machines.board import join, partitions_of_new
        from .machines.member import Member
        from .machines.public import ClusterGateway

        if not settings.cluster:  # nobody else reaches its workers
            settings = settings.model_copy(update={"cluster_host": "127.0.0.1", "cluster_ca": None})
        if role == "worker":
            return Member(settings, f"{begin['site']}/{number}")
        cluster = await asyncio.to_thread(join, database, partitions_of_new(settings))
        return ClusterGateway(settings, database, cluster, begin["site"])
    sockets = Sockets(Path(begin["sockets"]))
    if role == "worker":
        return worker_server(settings, int(number), sockets)
    return Gateway(settings, settings.workers or 1, sockets)
