"""Who else is at work while keys are erased from the past of a hull. An engine without a server around it."""

import asyncio
import errno
import gc
import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from complaints import complaints_of
from live_engine import LIMITS
from patience import PATIENCE

from dynhull.keys import PackedKeys
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.live_hull import LiveHull
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.records import FOREVER, HullSettings
from dynhull_server.storage.segments.archive import Archive
from dynhull_server.storage.sqlite.storage import SQLiteStorage

GONE, NOBODY = PackedKeys.pack(["who is gone"]), PackedKeys.pack([])


@asynccontextmanager
async def served(
    storage: SQLiteStorage, changed: Callable[[str | None], None] = lambda _: None
) -> AsyncIterator[tuple[Engine, LiveHull]]:
    """An engine with a hull."""
    machine = Machine()
    supervisor = Supervisor(machine.clock, changed, pytest.fail)
    engine = Engine(LIMITS, storage, supervisor, machine)
    await engine.start(lambda *_: None)
    await engine.hulls.create("fleet", HullSettings("str", history=FOREVER))
    yield engine, engine.hulls.get("fleet")
    await supervisor.stop()
    await engine.close()


async def write(engine: Engine, keys: PackedKeys, removes: PackedKeys) -> None:
    batch = KeyedBatch("str", keys, np.zeros((len(keys), 2)), removes)
    await engine.hulls.apply(Write("fleet", batch, engine.driver.time()), create=False)


def traces(folder: Path) -> list[Path]:
    return [each for each in folder.iterdir() if each.is_file() and b"who is gone" in each.read_bytes()]


class Full(SQLiteStorage):
    """Keys are erased when that is permitted, and then the disk is full."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, archive=Archive(folder / "history"))
        self.erased: list[Any] = []
        self.begun, self.may_go_on = threading.Event(), threading.Event()

    def erase(self, number: int, requests: Any, until: int, now: int) -> Iterator[Any]:
        del number, until, now
        self.erased.append([list(each.keys) for each in requests])
        self.begun.set()
        assert self.may_go_on.wait(PATIENCE)
        raise OSError(errno.ENOSPC, "No space left on device", "a file of the server")
        yield


def test_who_goes_before_their_turn_has_asked_for_nothing_and_no_failure_is_left_over(tmp_path: Path) -> None:
    async def life() -> None:
        complaints = complaints_of(asyncio.get_running_loop())
        async with served(storage := Full(tmp_path)) as (engine, hull):
            loop = asyncio.get_running_loop()

            def caller(key: str) -> "asyncio.Task[Any]":
                return loop.create_task(engine.hulls.filing.erase(hull, PackedKeys.pack([key])))

            first = caller("a")
            assert await asyncio.to_thread(storage.begun.wait, PATIENCE)
            second, third, fourth = map(caller, ("b", "c", "d"))
            await asyncio.sleep(0)
            for gone in (second, first):
                gone.cancel()
                with pytest.raises(asyncio.CancelledError):
                    await gone
            storage.may_go_on.set()
            for left in (third, fourth):
                with pytest.raises(Exception, match=r"^No space left on device$"):
                    await left
            del first, second, third, fourth, gone, left
            gc.collect()
            assert not complaints
            assert storage.erased == [[["a"]], [["c"], ["d"]]]

    asyncio.run(life())


class Late(SQLiteStorage):
    """The first snapshot is written when that is permitted."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, archive=Archive(folder / "history"))
        self.begun, self.may_go_on = threading.Event(), threading.Event()
        self.snapshots = 0

    def snapshot(self, number: int, kept: Any) -> Iterator[Any]:
        self.snapshots += 1
        if not self.begun.is_set():
            self.begun.set()
            assert self.may_go_on.wait(PATIENCE)
        yield from super().snapshot(number, kept)


def test_a_snapshot_that_is_under_way_brings_nothing_back(tmp_path: Path) -> None:
    async def life() -> None:
        async with served(storage := Late(tmp_path), pytest.fail) as (engine, hull):
            loop = asyncio.get_running_loop()
            await write(engine, GONE, NOBODY)
            snapshot = loop.create_task(engine.hulls.filing.snapshot(hull))
            assert await asyncio.to_thread(storage.begun.wait, PATIENCE)
            await write(engine, NOBODY, GONE)
            erasing = loop.create_task(engine.hulls.filing.erase(hull, GONE))
            for _ in range(3):  # it would have begun before these
                await engine.driver.on_disk(bool)
            assert storage.snapshots == 1
            storage.may_go_on.set()
            await snapshot
            erased = await erasing
            assert erased is not None
            assert erased.moves == 2
            assert not traces(tmp_path)

    asyncio.run(life())


class Unwiped(SQLiteStorage):
    """The disk is full when free pages are written over for the first time."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder, archive=Archive(folder / "history"))
        self.full = True

    def _write_over_free_pages(self) -> Iterator[Any]:
        if self.full:
            raise OSError(errno.ENOSPC, "No space left on device")
        yield from super()._write_over_free_pages()


def test_what_is_erased_is_not_refused_and_its_traces_go_once_that_is_possible(tmp_path: Path) -> None:
    async def life() -> None:
        async with served(storage := Unwiped(tmp_path)) as (engine, hull):
            await write(engine, GONE, NOBODY)
            await write(engine, NOBODY, GONE)
            erased = await engine.hulls.filing.erase(hull, GONE)
            assert erased is not None
            assert erased.moves == 2
            assert engine.driver.supervisor.fails("history")
            assert traces(tmp_path)
            for again in (engine.hulls.filing.round(), engine.hulls.filing.erase(hull, GONE)):
                with pytest.raises(Exception, match="No space left"):
                    await again
            storage.full = False
            await engine.hulls.filing.round()
            assert not traces(tmp_path)

    asyncio.run(life())
