"""What waits for a server ends when it is cancelled or closed, whatever has become of the server.

Everything of the SDK that waits, beside a server that is reset, stopped, dark or shut, is cancelled or closed after
each number of steps of the event loop. Nothing else ends it: the calls have no timeout. `make ends` tries more steps,
prints how long the ends took, and allows them a second.
"""

import asyncio
import gc
import itertools
import os
import socket
import sys
import threading
import time
from collections import defaultdict
from collections.abc import Awaitable, Callable, Iterator
from concurrent.futures import CancelledError
from contextlib import closing
from dataclasses import dataclass, field
from functools import partial
from types import NoneType
from typing import Any

import pytest
from client_kinds import loop
from complaints import complaints_of
from faulty_way import WAYS, FaultyWay
from patience import PATIENCE, wait_until
from server_process import Server, server_process

from dynhull_client import AsyncHullClient, DynhullError, HullClient, UnavailableError

ALL = os.environ.get("CLIENT_CASES") == "all"
STEPS = range(41) if ALL else (0, 1, 3, 8)
LIMIT = 1.0 if ALL else PATIENCE  # seconds
HULL, KEYED, FENCE = "ends/hull", "ends/keyed", "ends/fence"
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
# What may come of a wait for something that is closed.
ERRORS = DynhullError, RuntimeError, StopAsyncIteration, StopIteration, NoneType


@pytest.fixture(scope="module")
def server() -> Iterator[Server]:
    many = ("--max-producers-per-caller", "100000")  # each writer without a name is one
    with server_process(*many, complaints=None) as running, HullClient(running.address) as client:
        client.create_hull(HULL)
        client.apply(HULL, insert=SQUARE)
        client.create_hull(KEYED, keyed="int")
        client.put(KEYED, [1, 2, 3], SQUARE[:3])
        client.create_fence(FENCE, area=SQUARE, subjects=KEYED)
        yield running


@dataclass
class Waiting:
    """Something that waits, of an asyncio client.

    Attributes:
        client: the client.
        begin: what waits, to be run in a task.
        close: what ends it from another task; None where only the client does.
    """

    client: AsyncHullClient
    begin: Callable[[], Awaitable[Any]]
    close: Callable[[], Awaitable[Any]] | None = None


def call(method: str, *arguments: Any, **options: Any) -> Callable[[AsyncHullClient], Awaitable[Waiting]]:
    async def prepare(client: AsyncHullClient) -> Waiting:
        return Waiting(client, lambda: getattr(client, method)(*arguments, **options))

    return prepare


async def listing(client: AsyncHullClient) -> Waiting:
    return Waiting(client, lambda: anext(client.list_hulls("ends/")))


async def reading_points(client: AsyncHullClient) -> Waiting:
    return Waiting(client, lambda: anext(client.read_points(HULL)))


async def watching(client: AsyncHullClient) -> Waiting:
    watch = client.watch(HULL)
    await anext(watch)
    return Waiting(client, lambda: anext(watch), watch.close)


async def watching_a_fence(client: AsyncHullClient) -> Waiting:
    watch = client.watch_fence(FENCE, after=0)
    return Waiting(client, lambda: _all(watch), watch.close)


async def _all(watch: Any) -> None:
    async for _ in watch:
        pass


def leave(context: Any) -> Callable[[], Awaitable[Any]]:
    error = ZeroDivisionError()
    return lambda: context.__aexit__(ZeroDivisionError, error, None)


async def opening_a_writer(client: AsyncHullClient) -> Waiting:
    writer = client.writer(HULL)
    return Waiting(client, lambda: writer.put(insert=[[1, 1]]), leave(writer))


def writing(what: str) -> Callable[[AsyncHullClient], Awaitable[Waiting]]:
    async def prepare(client: AsyncHullClient) -> Waiting:
        writer = client.writer(HULL, in_flight=1, batch_points=1)
        await writer.put(insert=[[1, 1]])
        await writer.flush()

        async def wait() -> None:
            await writer.put(insert=[[1, 2]])
            if what == "put":
                for _ in range(20):
                    await writer.put(insert=[[1, 2]])
            await getattr(writer, "close" if what == "close" else "flush")()

        return Waiting(client, wait, leave(writer))

    return prepare


def piping(what: str) -> Callable[[AsyncHullClient], Awaitable[Waiting]]:
    async def prepare(client: AsyncHullClient) -> Waiting:
        pipeline = client.pipeline()
        await pipeline.locate(HULL, [[1, 1]])

        async def wait() -> None:
            answer = pipeline.locate(HULL, [[1, 1]])
            answer.add_done_callback(lambda _: answer.cancelled() or answer.exception())
            await (answer if what == "answer" else getattr(pipeline, what)())

        return Waiting(client, wait, leave(pipeline))

    return prepare


async def ingesting(client: AsyncHullClient) -> Waiting:
    stream = client.ingest(HULL)
    await stream.__aenter__()
    await stream.apply(insert=[[1, 1]])

    async def wait() -> None:
        for _ in range(40):
            await stream.apply(insert=[[1, 1]] * 1000)
        await stream.__aexit__(None, None, None)

    return Waiting(client, wait, leave(stream))


KINDS: dict[str, Callable[[AsyncHullClient], Awaitable[Waiting]]] = {
    "read": call("get_hull", HULL),
    "parts": call("entities", KEYED),
    "write": call("put", KEYED, [9], [[1, 1]]),
    "numbered": call("put", KEYED, [9], [[1, 1]], producer="p", sequence=1),
    "hull awaited": call("wait_for_hull", "ends/none"),
    "list": listing,
    "points": reading_points,
    "watch": watching,
    "fence": watching_a_fence,
    "writer's start": opening_a_writer,
    "writer.put": writing("put"),
    "writer.flush": writing("flush"),
    "writer.close": writing("close"),
    "pipeline": piping("answer"),
    "pipeline.flush": piping("flush"),
    "pipeline.close": piping("close"),
    "ingest": ingesting,
}
LASTING = "hull awaited", "watch", "fence"  # whose waits have not ended when the server fails
READS_ARE_CANCELLED = tuple(f"{how} pipeline, close" for how in WAYS)  # as documented, where a pipeline is left
ENDS = "cancel", "cancel twice", "close", "client"
Task = asyncio.Future[Any]


@dataclass
class Cells:
    """How long the ends took, in seconds, and what did not end as it should."""

    took: dict[str, list[float]] = field(default_factory=lambda: defaultdict(list))
    wrong: list[str] = field(default_factory=list)

    def note(self, name: str, seconds: float) -> None:
        """How long the end of a cell took. The name of its row ends at the comma."""
        self.took[name.partition(",")[0]].append(seconds)
        if seconds > LIMIT:
            self.wrong.append(f"{name}: took {seconds:.2f} s")

    def __str__(self) -> str:
        rows = [f"{name:24} {len(each):6} {max(each):8.3f}" for name, each in sorted(self.took.items())]
        return "\n".join([f"\n{'':24} {'cells':>6} {'longest':>8}", *rows, *self.wrong])


async def end_after(steps: int, end: str, waiting: Waiting, task: Task | None, cells: Cells, name: str) -> None:
    """One cell, begun now unless there is a task already."""
    task = task or asyncio.ensure_future(waiting.begin())
    for _ in range(steps):
        await asyncio.sleep(0)
    over = task.done()
    begun = time.monotonic()
    if end.startswith("cancel"):
        task.cancel()
        if end == "cancel twice":  # also what cleans up after the first
            await asyncio.sleep(0)
            task.cancel()
        ending = {task}
    elif end == "close" and waiting.close is not None:
        ending = {task, asyncio.ensure_future(waiting.close())}
    else:
        ending = {task, asyncio.ensure_future(waiting.client.close())}
    _, late = await asyncio.wait(ending, timeout=PATIENCE)
    cells.note(name, time.monotonic() - begun)
    for each in late:
        cells.wrong.append(f"{name}: {each} goes on")
        each.cancel()
    for each in ending - late:
        error = None if each.cancelled() else each.exception()
        if each is task and end.startswith("cancel"):
            if not over and not each.cancelled():
                cells.wrong.append(f"{name}: cancelled, but ended with {error!r}")
        elif each is task and each.cancelled() and not (over or name.startswith(READS_ARE_CANCELLED)):
            cells.wrong.append(f"{name}: nobody cancelled it, but it ended so")
        elif not isinstance(error, ERRORS if each is task else NoneType):
            cells.wrong.append(f"{name}: ended with {error!r}")
    begun = time.monotonic()
    if waiting.close is not None:
        await asyncio.wait_for(waiting.close(), PATIENCE)
    await asyncio.wait_for(waiting.client.close(), PATIENCE)
    cells.note(f"{name}, at last", time.monotonic() - begun)


async def end_all(server: Server, how: str, kind: str, cells: Cells) -> None:
    """All cells of something that waits, begun after the server has failed or, where it lasts, before."""
    running = asyncio.get_running_loop()
    before = asyncio.all_tasks()
    complaints = complaints_of(running)
    early = (False, True) if kind in LASTING else (False,)
    cases = [*itertools.product(ENDS, STEPS, early)]
    with closing(FaultyWay(server)) as way:
        clients = [AsyncHullClient(way.address, timeout=None) for _ in cases]
        waits = await asyncio.gather(*(KINDS[kind](each) for each in clients))
        begun = [asyncio.ensure_future(each.begin()) if c[-1] else None for c, each in zip(cases, waits, strict=True)]
        WAYS[how](way)
        async with asyncio.TaskGroup() as group:
            for (end, steps, _), each, task in zip(cases, waits, begun, strict=True):
                name = f"{how} {kind}, {end} after {steps} steps"
                group.create_task(end_after(steps, end, each, task, cells, name))
        del each, task, begun, waits, clients
        if left := asyncio.all_tasks() - before:  # of gRPC, for calls that have just been cancelled
            await asyncio.wait(left, timeout=PATIENCE)
    cells.wrong += [f"{how} {kind}: {each} is left" for each in asyncio.all_tasks() - before]
    gc.collect()
    await asyncio.sleep(0)
    cells.wrong += [f"{how} {kind}: {each}" for each in complaints]
    running.set_exception_handler(None)


def checked(cells: Cells) -> None:
    if ALL:
        print(cells)
    assert not cells.wrong, str(cells)


@pytest.mark.every(2)
@pytest.mark.parametrize("how", WAYS)
def test_async_waits_end(server: Server, how: str) -> None:
    cells = Cells()
    for kind in KINDS:
        asyncio.run_coroutine_threadsafe(end_all(server, how, kind, cells), loop()).result()
    checked(cells)


@pytest.mark.parametrize("kind", KINDS)
def test_a_task_that_was_cancelled_before_it_waits(server: Server, kind: str) -> None:
    async def begin(waiting: Waiting) -> None:
        running = asyncio.current_task()
        assert running is not None
        running.cancel()  # as asyncio does for an interrupt while the main task runs
        await waiting.begin()

    async def end() -> None:
        async with AsyncHullClient(server.address, timeout=PATIENCE) as client:
            waiting = await KINDS[kind](client)
            with pytest.raises(asyncio.CancelledError):
                await asyncio.ensure_future(begin(waiting))
            if waiting.close is not None:
                await waiting.close()

    asyncio.run_coroutine_threadsafe(end(), loop()).result()


def test_a_stream_that_was_left_has_no_thread(server: Server) -> None:
    async def use() -> Any:
        async with AsyncHullClient(server.address) as client, client.ingest(HULL) as stream:
            await stream.apply(insert=[[1, 1]])
        return stream

    stream = asyncio.run_coroutine_threadsafe(use(), loop()).result()
    wait_until(lambda: not [each for each in threading.enumerate() if each.name.startswith("ingest to")])
    assert stream.summary.batches == 1
    with pytest.raises(RuntimeError, match="was left"):
        asyncio.run_coroutine_threadsafe(stream.apply(insert=[[1, 1]]), loop()).result()


def exit_by_error(context: Any) -> None:
    context.__exit__(ZeroDivisionError, ZeroDivisionError(), None)


Work = Callable[[], Any]


def only_client(method: str, *arguments: Any) -> Callable[[HullClient], tuple[Work, Work]]:
    return lambda client: (lambda: getattr(client, method)(*arguments), client.close)


def watched(client: HullClient) -> tuple[Work, Work]:
    watch = client.watch(HULL)
    next(watch)
    return lambda: next(watch), watch.close


def watched_fence(client: HullClient) -> tuple[Work, Work]:
    watch = client.watch_fence(FENCE, after=0)
    return lambda: [*watch], watch.close


def started(client: HullClient) -> tuple[Work, Work]:
    writer = client.writer(HULL)
    return lambda: writer.put(insert=[[1, 1]]), lambda: exit_by_error(writer)


def full(client: HullClient) -> tuple[Work, Work]:
    writer = client.writer(HULL, in_flight=1, batch_points=1)
    writer.put(insert=[[1, 1]]).result()
    return lambda: [writer.put(insert=[[1, 1]]) for _ in range(20)], lambda: exit_by_error(writer)


def flushed(client: HullClient) -> tuple[Work, Work]:
    writer = client.writer(HULL)
    writer.put(insert=[[1, 1]]).result()
    return lambda: [writer.put(insert=[[1, 1]]), writer.flush()], lambda: exit_by_error(writer)


def piped(client: HullClient) -> tuple[Work, Work]:
    pipeline = client.pipeline()
    pipeline.locate(HULL, [[1, 1]]).result()
    return lambda: pipeline.locate(HULL, [[1, 1]]).result(), lambda: exit_by_error(pipeline)


def ingested(client: HullClient) -> tuple[Work, Work]:
    stream = client.ingest(HULL)
    stream.__enter__()
    stream.apply(insert=[[1, 1]])
    return lambda: [stream.apply(insert=[[1, 1]] * 1000) for _ in range(40)], lambda: exit_by_error(stream)


# What waits in a thread, and what ends it from another one.
BLOCKING: dict[str, Callable[[HullClient], tuple[Work, Work]]] = {
    "read": only_client("get_hull", HULL),
    "parts": only_client("entities", KEYED),
    "watch": watched,
    "fence": watched_fence,
    "writer.put": full,
    "writer.flush": flushed,
    "pipeline": piped,
    "ingest": ingested,
    "list": lambda client: (lambda: next(client.list_hulls("ends/")), client.close),
    "points": lambda client: (lambda: next(client.read_points(HULL)), client.close),
    "hull awaited": only_client("wait_for_hull", "ends/none"),
    "writer's start": started,
}


class Blocked(threading.Thread):
    """A thread that waits."""

    def __init__(self, work: Callable[[], Any]) -> None:
        super().__init__(daemon=True)
        self.error: BaseException | None = None
        self._work = work
        self.start()

    def run(self) -> None:
        try:
            self._work()
        except BaseException as error:
            self.error = error

    def waits(self) -> bool:
        """Whether it waits for another thread, or is over."""
        frame = sys._current_frames().get(self.ident)
        return not self.is_alive() or (frame is not None and frame.f_code.co_name in ("wait", "_blocking", "_next"))


@pytest.mark.parametrize("end", ["close", "client"])
@pytest.mark.parametrize("how", WAYS)
def test_blocked_threads_end(server: Server, how: str, end: str) -> None:
    cells = Cells()
    with closing(FaultyWay(server)) as way:
        clients = {kind: HullClient(way.address, timeout=None) for kind in BLOCKING}
        works = {kind: BLOCKING[kind](client) for kind, client in clients.items()}
        WAYS[how](way)
        threads = {kind: Blocked(work) for kind, (work, _) in works.items()}
        for kind, thread in threads.items():
            name = f"{how} {kind} in a thread, {end}"
            wait_until(thread.waits)
            begun = time.monotonic()
            (clients[kind].close if end == "client" else works[kind][1])()
            thread.join(PATIENCE)
            cells.note(name, time.monotonic() - begun)
            if thread.is_alive():
                cells.wrong.append(f"{name}: it goes on")
            if not isinstance(thread.error, (*ERRORS, CancelledError)):
                cells.wrong.append(f"{name}: it ended with {thread.error!r}")
            clients[kind].close()
    checked(cells)


def test_calls_that_begin_while_the_client_is_closed() -> None:
    def work(client: HullClient, refused: threading.Semaphore) -> None:
        while True:
            try:
                client.get_hull(HULL)
            except UnavailableError:
                refused.release()

    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        host, port = unused.getsockname()
        for _ in range(20):
            refused = threading.Semaphore(0)
            client = HullClient(f"{host}:{port}", retries=0)
            threads = [Blocked(partial(work, client, refused)) for _ in range(4)]
            for _ in range(8):
                refused.acquire()
            client.close()
            for each in threads:
                each.join(PATIENCE)
                assert type(each.error) is DynhullError
