"""A shard in this process whose root does not wait any more, because it has sent another message or has ended."""

import asyncio
import gc
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

from patience import PATIENCE

from dynhull_cluster.divisions.local_shard import LocalShard
from dynhull_server.storage.port import StorageError


async def leave(begun: threading.Event, shard: LocalShard, go_on: threading.Event) -> None:
    waiting = asyncio.create_task(shard.epoch())
    await asyncio.to_thread(begun.wait, PATIENCE)
    waiting.cancel()
    with suppress(asyncio.CancelledError):
        await waiting
    go_on.set()
    await shard.close()
    gc.collect()


def test_an_error_that_nobody_waits_for_is_not_logged_as_forgotten() -> None:
    begun, go_on = threading.Event(), threading.Event()

    def read(_: int) -> None:
        begun.set()
        assert go_on.wait(PATIENCE)
        raise StorageError("the database is away")

    store: Any = SimpleNamespace(keeps=True, read=read)
    row: Any = SimpleNamespace(number=1)
    said: list[Any] = []

    async def run() -> None:
        asyncio.get_running_loop().set_exception_handler(lambda _, context: said.append(context["message"]))
        await leave(begun, LocalShard(ThreadPoolExecutor(1), store, row), go_on)

    asyncio.run(run())
    gc.collect()
    assert said == []
