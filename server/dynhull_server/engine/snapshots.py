"""Snapshots in the background: a restart replays a bounded number of batches."""

import asyncio
import logging

from ..state.errors import HullNotFoundError, StorageError
from .hulls import Engine

PAUSE = 1.0  # seconds between two looks

log = logging.getLogger(__name__)


async def keep_snapshots(engine: Engine, least_points: int) -> None:
    """Write a snapshot of every hull that is due, one after the other.

    A hull is due once its batches since the last one hold as many points as it does itself, and at least so many.
    """
    while True:
        await asyncio.sleep(PAUSE)
        for hull in engine:
            if hull.unsaved < max(least_points, hull.counts.points):
                continue
            try:
                await hull.snapshot()
            except HullNotFoundError:
                continue
            except StorageError as error:
                log.warning("no snapshot", extra={"hull": hull.name, "reason": str(error)})
