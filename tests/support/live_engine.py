"""An engine without a server around it."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace

import numpy as np
import pytest

from dynhull_server.engine.division import Divisions
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.batch import Batch, Write
from dynhull_server.state.limits import Limits
from dynhull_server.storage.memory import MemoryStorage

LIMITS = Limits(max_hulls=10, max_points=10**9, max_producers=10, max_producers_per_caller=10, resume_bytes=10**6)
NONE = np.empty((0, 2))


@asynccontextmanager
async def engine_in_memory(
    resume_bytes: int = LIMITS.resume_bytes, divisions: Divisions | None = None
) -> AsyncIterator[Engine]:
    """An engine whose background work must not fail."""
    machine = Machine()
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(replace(LIMITS, resume_bytes=resume_bytes), MemoryStorage(), supervisor, machine, divisions)
    await engine.start(lambda *_: None)
    yield engine
    await supervisor.stop()
    await engine.close()


async def insert(engine: Engine, name: str, points: np.ndarray) -> None:
    """Insert points, into a new hull where there is none."""
    write = Write(name, Batch(points, NONE, 0, False), engine.driver.time(), len(points))
    await engine.hulls.apply(write, create=True)
