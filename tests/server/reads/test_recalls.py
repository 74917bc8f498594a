"""Earlier revisions read from the storage: shared, and a few at a time."""

import asyncio

import numpy as np
import pytest
from live_engine import engine_in_memory, insert

from dynhull_server.engine import recalls

REVISIONS = 20


def test_recalled_revisions_are_held_a_few_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recalls, "MOST_BYTES", 1)  # there is room for one revision
    held: list[int] = []
    most = 0

    async def recall_all() -> None:
        nonlocal most
        async with engine_in_memory(resume_bytes=0) as engine:
            for x in range(REVISIONS):
                await insert(engine, "h", np.array([[x, x * x]], float))
                hull = engine.hulls.get("h")
                await hull.vertices()  # which is remembered until the next

            async def recall(revision: int) -> None:
                nonlocal most
                async with hull.recalled(hull.uid, revision) as vertices:
                    held.append(revision)
                    most = max(most, len(set(held)))
                    assert vertices is not None
                    assert len(vertices) == revision
                    await asyncio.sleep(0)  # others may go on
                    held.remove(revision)

            left = asyncio.create_task(recall(REVISIONS - 1))
            await asyncio.sleep(0)
            left.cancel()  # must not keep the room
            await asyncio.gather(*(recall(revision) for revision in [*range(1, REVISIONS)] * 2))

    asyncio.run(recall_all())
    assert most == 1
