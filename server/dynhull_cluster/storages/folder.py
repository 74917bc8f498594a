"""Hulls in a folder, or in one folder for each worker."""

import logging
import time
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path

from dynhull_server.app import Server
from dynhull_server.history_folder import archive_of, claim_history
from dynhull_server.process import Alone
from dynhull_server.settings import Settings
from dynhull_server.storage.port import LockedError
from dynhull_server.storage.segments.owner import Claimant
from dynhull_server.storage.sqlite.disk import Disk
from dynhull_server.storage.sqlite.folder import Folder
from dynhull_server.storage.sqlite.owner import owner_of_folder
from dynhull_server.storage.sqlite.storage import SQLiteStorage
from dynhull_server.storage.worker_folders import (
    begin_anew_if_copied,
    divide,
    require_one_process,
    worker_folder,
    write_manifest,
)

from ..divisions.divisions import ServedDivisions
from ..sockets import Sockets, socket_folder
from .kind import Begin, Serving, Shared

# Seconds in which the processes of a supervisor that was killed have ended, too.
LOCK_SECONDS = 5.0

log = logging.getLogger(__name__)


class FolderKind:
    """Serves hulls in the data folder."""

    preloads: Sequence[str] = (__name__, "dynhull_cluster.gateway", "dynhull_cluster.worker")

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._data = settings.data

    def alone(self) -> Alone:
        """The server. Raises StorageError if the folder is divided among workers."""
        require_one_process(self._data)
        archive = archive_of(self._settings, self._data, self._owner())
        storage = SQLiteStorage(self._data, self._settings.durability, archive=archive)
        return Server(self._settings, storage, divisions=ServedDivisions(self._settings))

    def _owner(self) -> Claimant | None:
        """Who has its past in the place that the settings name, once nobody else has; None if they name none."""
        if self._settings.history_dir is None:
            return None
        owner = owner_of_folder(self._data)
        claim_history(self._settings, owner)
        return owner

    @contextmanager
    def shared(self) -> Iterator[Shared]:
        """The folder, divided among the workers and locked, with private sockets.

        Raises:
            StorageError: it is the folder of one process, or of another number of workers.
            LockedError: another server uses it.
        """
        workers = self._settings.workers or 1
        divide(self._data, workers)
        with _locked(self._data):
            for number in range(workers):
                with _locked(worker_folder(self._data, number)):
                    pass
            self._owner()
            for note in begin_anew_if_copied(self._data, workers):
                log.warning("lost", extra={"what": note})
            with socket_folder(self._data) as sockets:
                yield Shared({"sockets": str(sockets)}, partial(write_manifest, self._data, workers, complete=True))

    async def worker(self, number: int, begin: Begin) -> Serving:
        """The server of a worker, on its own part of the folder."""
        from ..worker import worker_server

        data = worker_folder(self._data, number)
        owner = None if self._settings.history_dir is None else owner_of_folder(self._data)
        archive = archive_of(self._settings, data, owner)
        storage = SQLiteStorage(data, self._settings.durability, archive=archive)
        return worker_server(self._settings, number, Sockets(Path(begin["sockets"])), storage)

    async def gateway(self, begin: Begin) -> Serving:
        """A gateway to the sockets."""
        from ..gateway import Gateway

        return Gateway(self._settings, self._settings.workers or 1, Sockets(Path(begin["sockets"])))


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder; wait for processes that are about to end. Raises LockedError."""
    folder.mkdir(parents=True, exist_ok=True)
    deadline = time.monotonic() + LOCK_SECONDS
    with ExitStack() as held:
        while True:
            try:
                held.enter_context(Folder(folder, Disk()).held())
                break
            except LockedError:
                if time.monotonic() > deadline:
                    raise
                time.sleep(0.05)
        yield
