"""Hulls in a PostgreSQL database, of one process, of several, or of several machines.

What needs the package for PostgreSQL is imported when it is used.
"""

import asyncio
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from dynhull_server.process import Alone
from dynhull_server.settings import Settings

from ..postgres.processes import this_server
from .kind import Begin, Serving, Shared

if TYPE_CHECKING:
    from ..postgres.database import Database


class PostgresKind:
    """Serves hulls in a database of PostgreSQL."""

    preloads: Sequence[str] = (__name__, "dynhull_cluster.machines.member", "dynhull_cluster.machines.public")

    def __init__(self, settings: Settings) -> None:
        if not settings.cluster:  # nobody else reaches its workers
            settings = settings.model_copy(update={"cluster_host": "127.0.0.1", "cluster_ca": None})
        self._settings = settings

    def alone(self) -> Alone:
        """The only worker of the database, which callers reach without a gateway."""
        database = self._database()
        from ..machines.only_member import OnlyMember

        return OnlyMember(self._settings, database)

    @contextmanager
    def shared(self) -> Iterator[Shared]:
        """Nothing but a name: whose workers they are."""
        yield Shared({"site": this_server()})

    async def worker(self, number: int, begin: Begin) -> Serving:
        """A worker of the cluster."""
        database = self._database()
        from ..machines.member import Member

        return Member(self._settings, database, f"{begin['site']}/{number}")

    async def gateway(self, begin: Begin) -> Serving:
        """A gateway of the cluster."""
        database = self._database()
        from ..machines.board import join, partitions_of_new
        from ..machines.public import ClusterGateway

        cluster = await asyncio.to_thread(join, database, partitions_of_new(self._settings))
        return ClusterGateway(self._settings, database, cluster, begin["site"])

    def _database(self) -> "Database":
        """The database of the settings, before what needs its package.

        Raises:
            ValueError: the address is invalid, or the package is missing.
        """
        assert self._settings.journal is not None
        try:
            from ..postgres.database import Database
        except ImportError as error:
            raise ValueError(f"--journal needs {error.name}: pip install 'dynhull[postgresql]'") from None
        try:
            return Database(self._settings.journal)
        except ValueError as error:
            raise ValueError(f"--journal: {error}") from None
