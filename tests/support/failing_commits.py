"""An engine on a storage whose next commit fails, in each of the ways in which one can."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from live_engine import LIMITS

from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.storage.port import NotCommittedError, StorageError
from dynhull_server.storage.sqlite.storage import Durability, SQLiteStorage


class Failing(SQLiteStorage):
    """A storage whose next commit fails: it says that nothing was kept, or does not say so, or has kept it."""

    fault = ""

    def commit(self, *args: Any) -> Any:
        fault, self.fault = self.fault, ""
        if fault == "refused":
            raise NotCommittedError("the disk is full", full=True)
        if fault == "before":
            raise StorageError("the disk does not answer")
        stamp = super().commit(*args)
        if fault == "after":
            raise OSError("the disk does not answer")
        return stamp


@asynccontextmanager
async def engine_on(folder: Path) -> AsyncIterator[tuple[Engine, Failing]]:
    machine = Machine()
    supervisor, storage = Supervisor(machine.clock, pytest.fail, pytest.fail), Failing(folder, Durability.NONE)
    engine = Engine(LIMITS, storage, supervisor, machine)
    await engine.start(lambda *_: None)
    yield engine, storage
    await supervisor.stop()
    await engine.close()
