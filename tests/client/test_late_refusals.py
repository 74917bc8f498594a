"""A refusal that comes while a client still writes reaches its caller as it is, once.

gRPC's asyncio reports an internal error when a call ends during a write (github.com/grpc/grpc/issues/36066).
"""

import asyncio
import gc
from contextlib import suppress

import numpy as np
import pytest
from complaints import Complaint, complaints_of

from dynhull_client import AsyncHullClient, HullNotFoundError, PointMissingError

POINTS = np.random.default_rng(7).normal(size=(5000, 2))
BATCHES, TIMES = 10, 10


async def write(client: AsyncHullClient, name: str) -> None:
    """Write batches of 80 kB; the hull is deleted while they are under way."""
    async with client.writer(name, batch_points=len(POINTS)) as writer:
        outcomes = [await writer.put(insert=POINTS) for _ in range(BATCHES)]
        await outcomes[0]
        deleting = asyncio.create_task(client.delete_hull(name))
        with suppress(HullNotFoundError):  # from the writer, which has ended
            outcomes += [await writer.put(insert=POINTS) for _ in range(BATCHES)]
        await deleting
        await asyncio.gather(*outcomes, return_exceptions=True)


def test_a_hull_that_is_deleted_meanwhile_is_said_to_be_missing(address: str, name: str) -> None:
    async def run() -> None:
        async with AsyncHullClient(address) as client:
            for i in range(TIMES):
                await client.create_hull(f"{name}{i}")
                with pytest.raises(HullNotFoundError):
                    await write(client, f"{name}{i}")

    asyncio.run(run())


def test_a_refused_batch_is_raised_and_not_logged_as_well(address: str, name: str) -> None:
    """Nobody looks at the futures: `flush` says what was refused."""

    async def run() -> list[Complaint]:
        complaints = complaints_of(asyncio.get_running_loop())
        async with AsyncHullClient(address) as client:
            await client.create_hull(name)
            async with client.writer(name, batch_points=1) as writer:
                for i in range(20):
                    await (writer.put(delete=[[-1, i]]) if i % 10 == 5 else writer.put(insert=[[i, i]]))
                with pytest.raises(PointMissingError):
                    await writer.flush()
            await client.delete_hull(name)
            writer = client.writer(name, batch_points=1)
            with pytest.raises(HullNotFoundError):
                await writer.put(insert=[[1, 1]])
        gc.collect()
        return complaints

    assert asyncio.run(run()) == []
