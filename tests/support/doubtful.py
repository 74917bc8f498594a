"""An engine with commits of which it is not known at first whether they have taken place."""

import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from live_engine import LIMITS

from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.records import Append, CommitStamp, HullRow
from dynhull_server.storage.sqlite.storage import SQLiteStorage

PATIENCE = 60


class Doubtful(SQLiteStorage):
    """Commits with batches of one hull raise, kept or not; and whoever looks at the hull has to wait, or is refused."""

    number, keeps_it = 0, True

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.looked, self.may_look, self.broken = threading.Event(), threading.Event(), False

    def commit(self, changes: Any, now: int = 0) -> CommitStamp:
        doubted = any(isinstance(each, Append) and each.number == self.number for each in changes)
        if doubted and not self.keeps_it:
            raise OSError("an input/output error, as planned")
        commit = super().commit(changes, now)
        if doubted:
            raise OSError("an input/output error, as planned")
        return commit

    def row(self, number: int) -> HullRow | None:
        if number == self.number:
            self.looked.set()
            assert self.may_look.wait(PATIENCE)
            if self.broken:
                raise OSError("the disk is away, as planned")
        return super().row(number)


@asynccontextmanager
async def doubtful_engine(folder: Path) -> AsyncIterator[tuple[Engine, Doubtful]]:
    """An engine, and its storage."""
    storage, machine = Doubtful(folder), Machine()
    supervisor = Supervisor(machine.clock, lambda _: None, pytest.fail)
    engine = Engine(LIMITS, storage, supervisor, machine)
    await engine.start(lambda *_: None)
    try:
        yield engine, storage
    finally:
        storage.may_look.set()
        await supervisor.stop()
        await engine.close()
