"""Hulls in memory, which are gone when the server stops."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from dynhull_server.app import Server
from dynhull_server.process import Alone
from dynhull_server.settings import Settings
from dynhull_server.storage.memory import MemoryStorage

from ..divisions.divisions import ServedDivisions
from ..sockets import Sockets, socket_folder
from .kind import Begin, Serving, Shared


class MemoryKind:
    """Serves hulls in memory."""

    preloads: Sequence[str] = (__name__, "dynhull_cluster.gateway", "dynhull_cluster.worker")

    def __init__(self, settings: Settings) -> None:
        self._settings = settings

    def alone(self) -> Alone:
        """The server."""
        return Server(self._settings, MemoryStorage(keeps=False), divisions=ServedDivisions(self._settings))

    @contextmanager
    def shared(self) -> Iterator[Shared]:
        """Private sockets."""
        with socket_folder() as sockets:
            yield Shared({"sockets": str(sockets)})

    async def worker(self, number: int, begin: Begin) -> Serving:
        """The server of a worker."""
        from ..worker import worker_server

        return worker_server(self._settings, number, Sockets(Path(begin["sockets"])), MemoryStorage(keeps=False))

    async def gateway(self, begin: Begin) -> Serving:
        """A gateway to the sockets."""
        from ..gateway import Gateway

        return Gateway(self._settings, self._settings.workers or 1, Sockets(Path(begin["sockets"])))
