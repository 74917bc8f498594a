"""Links of gateways to workers, in the process of the test."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from patience import PATIENCE

from dynhull_cluster.worker_link import WorkerLink


@asynccontextmanager
async def running(link: WorkerLink) -> AsyncIterator[WorkerLink]:
    """The link while it connects to its worker, and connects anew."""
    task = asyncio.create_task(link.run())
    try:
        async with asyncio.timeout(PATIENCE):
            yield link
    finally:
        task.cancel()
        await asyncio.wait([task])
        await link.close()
