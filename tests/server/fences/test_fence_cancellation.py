"""Callers of fences that go away, at each of the places where they wait: nothing is left half done, or waiting."""

import asyncio
import types
from collections.abc import AsyncIterator, Callable, Coroutine, Generator
from contextlib import AbstractContextManager, aclosing, asynccontextmanager, nullcontext, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_engine import LIMITS
from patience import PATIENCE

from dynhull.keys import PackedKeys
from dynhull_proto.v1 import fence_pb2
from dynhull_proto.v1 import fence_service_pb2 as fs
from dynhull_server.engine.engine import Engine
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Machine
from dynhull_server.engine.watch_fence import watch_fence
from dynhull_server.rpc.access import EVERYTHING, Rights
from dynhull_server.rpc.fence_service import FenceService
from dynhull_server.rpc.metrics import Metrics
from dynhull_server.rpc.places import Places
from dynhull_server.state.batch import KeyedBatch, Write
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.records import EventType
from dynhull_server.state.limits import FenceLimits
from dynhull_server.state.records import HullSettings
from dynhull_server.storage.sqlite.storage import Durability, SQLiteStorage

CIRCLE = FenceConfig(CircleArea(0.0, 0.0, 5.0), "hull", "fleet")
LARGER = replace(CIRCLE, area=CircleArea(0.0, 0.0, 9.0))
# Old events are always read from the disk.
FENCE_LIMITS = FenceLimits(fence_event_bytes=0)
SUSPENSIONS = 20  # more than any of these calls has


@types.coroutine
def _leaving(call: Coroutine[Any, Any, Any], at: int) -> Generator[Any, Any, Any]:
    """Await a call, and cancel it while it is suspended for the `at`th time."""
    task = asyncio.current_task()
    assert task is not None
    seen, steps = 0, call.__await__()
    send: Callable[[], Any] = lambda: next(steps)  # noqa: E731
    while True:
        try:
            waits_for = send()
        except StopIteration as done:
            return done.value
        seen += 1
        if seen == at:
            asyncio.get_running_loop().call_soon(task.cancel)
        try:
            value = yield waits_for
        except BaseException as error:
            send = lambda error=error: steps.throw(error)  # noqa: E731
        else:
            send = lambda value=value: steps.send(value)  # noqa: E731


async def left_at(call: Coroutine[Any, Any, Any], at: int) -> bool:
    """Whether the call was cancelled: False if it has fewer suspensions."""

    async def run() -> None:
        await _leaving(call, at)

    task = asyncio.create_task(run())
    with suppress(asyncio.CancelledError):
        await task
    return task.cancelled()


@asynccontextmanager
async def engine_on(folder: Path) -> AsyncIterator[Engine]:
    machine = Machine()
    supervisor = Supervisor(machine.clock, pytest.fail, pytest.fail)
    engine = Engine(replace(LIMITS, fences=FENCE_LIMITS), SQLiteStorage(folder, Durability.NONE), supervisor, machine)
    await engine.start(lambda *_: None)
    yield engine
    await supervisor.stop()
    await engine.close()


async def put(engine: Engine, key: str, x: float) -> None:
    batch = KeyedBatch("str", PackedKeys.pack([key]), np.array([[x, 0.0]]), PackedKeys.pack([]))
    await engine.hulls.apply(Write("fleet", batch, engine.driver.time()), create=False)


async def settled(engine: Engine) -> None:
    """Wait until what callers have begun is over, and nobody waits."""
    while engine.driver.core.busy:
        await asyncio.sleep(0)
    engine.driver.core.check()


async def watched(engine: Engine, after: int, last: int) -> list[int]:
    """The sequences that a watch sends up to the last one."""
    found: list[int] = []
    async with aclosing(watch_fence(engine.fences.get("fence"), after)) as watch:
        async for sent in watch:
            found += [event.sequence for event in sent.events]
            if sent.sequence >= last:
                return found
    return found


async def waited(engine: Engine) -> None:
    """Wait for an event that does not come."""
    fence = engine.fences.get("fence")
    with suppress(TimeoutError):
        async with asyncio.timeout(0.05):
            await fence.reached(fence.fence.last + 1)


class Caller:
    """A call of the service whose client is slow: each message takes a turn of the loop."""

    access = Rights(EVERYTHING)
    owner = "somebody"

    def __init__(self) -> None:
        self.sent: list[Any] = []

    def cutoff(self) -> AbstractContextManager[None]:
        return nullcontext()

    def require_entitled(self) -> None:
        """It is: these engines have no lease that could end."""

    async def write_within(self, _: float, message: Any) -> None:
        await asyncio.sleep(0)
        self.sent.append(message)


async def served(engine: Engine, method: str, request: Any) -> Any:
    """The answer of the service, or what it has sent."""
    pasts = Places("max_past_reads", 1, 1)
    service = FenceService(engine.fences, engine.past_fences, pasts, Metrics(), max_corners=100, max_watch_lag=PATIENCE)
    caller = Caller()
    answer = await getattr(service, method)(request, caller)
    return caller.sent if answer is None else answer


async def watched_by_consumer(engine: Engine) -> None:
    """A watch of a new consumer that waits for an event that does not come."""
    request = fs.WatchFenceRequest(name="fence", consumer="mail", progress_interval={"seconds": 60})
    with suppress(TimeoutError):
        async with asyncio.timeout(0.05):
            await served(engine, "WatchFence", request)


SETTINGS = fence_pb2.FenceConfig(circle_area={"radius": 5}, subject_hull="fleet")

SERVED: dict[str, tuple[str, Any]] = {
    "create": ("CreateFence", fs.CreateFenceRequest(name="other", config=SETTINGS)),
    "replace": ("ReplaceFence", fs.ReplaceFenceRequest(name="fence", config=SETTINGS)),
    "delete": ("DeleteFence", fs.DeleteFenceRequest(name="other")),
    "get": ("GetFence", fs.GetFenceRequest(name="fence")),
    "list": ("ListFences", fs.ListFencesRequest()),
    "inside": ("ReadInside", fs.ReadInsideRequest(name="fence")),
    "between": ("FenceEventsBetween", fs.FenceEventsBetweenRequest(config=SETTINGS)),
    "acknowledge": ("AckFence", fs.AckFenceRequest(name="fence", consumer="mail", sequence=1)),
    "drop consumer": ("DeleteConsumer", fs.DeleteConsumerRequest(name="fence", consumer="mail")),
}

CALLS: dict[str, Callable[[Engine], Coroutine[Any, Any, Any]]] = {
    "create": lambda engine: engine.fences.create("other", CIRCLE),
    "delete": lambda engine: engine.fences.delete("other"),
    "replace": lambda engine: engine.fences.replace("fence", LARGER),
    "replace back": lambda engine: engine.fences.replace("fence", CIRCLE),
    "acknowledge": lambda engine: engine.fences.get("fence").acknowledge("mail", 1),
    "drop consumer": lambda engine: engine.fences.get("fence").drop_consumer("mail"),
    "inside": lambda engine: engine.fences.get("fence").inside(),
    "old events": lambda engine: engine.fences.get("fence").events(0, 10),
    "watch": lambda engine: watched(engine, 0, engine.fences.get("fence").fence.last),
    "wait": waited,
    "served watch": watched_by_consumer,
    **{
        f"served {name}": partial(lambda method, request, engine: served(engine, method, request), *call)
        for name, call in SERVED.items()
    },
}


@pytest.mark.parametrize("name", CALLS)
def test_a_caller_may_leave_wherever_it_waits(tmp_path: Path, name: str) -> None:
    left = asyncio.run(_life(tmp_path, name))
    assert left >= 1
    asyncio.run(_next_life(tmp_path))


async def _life(folder: Path, name: str) -> int:
    left = 0
    async with engine_on(folder) as engine:
        await engine.hulls.create("fleet", HullSettings("str"))
        await engine.fences.create("fence", replace(CIRCLE, initial="none"))
        fence = engine.fences.get("fence")
        for at in range(1, SUSPENSIONS):
            if name.endswith("delete") and "other" not in engine.driver.core.fences:
                await engine.fences.create("other", CIRCLE)
            if name.endswith("create") and "other" in engine.driver.core.fences:
                await engine.fences.delete("other")
            if name.endswith(("drop consumer", "served get", "served list")):
                await fence.acknowledge("mail", 0)
            await put(engine, "a", 1.0)
            await put(engine, "a", 99.0)
            before = fence.fence.last
            writing = asyncio.create_task(put(engine, "c", 50.0))  # the call waits for its turn, too
            await asyncio.sleep(0)
            cancelled = await left_at(CALLS[name](engine), at)
            await writing
            await settled(engine)
            assert fence._moved is None or not fence._moved._waiters
            # Whoever comes next finds the call made or not made, and nothing in between.
            async with asyncio.timeout(PATIENCE):
                await put(engine, "b", 1.0)
                await put(engine, "b", 99.0)
            assert fence.fence.last == before + 2
            assert await watched(engine, 0, before + 2) == list(range(1, before + 3))
            assert fence.fence.consumers.keys() <= {"mail"}
            if not cancelled:
                break
            left += 1
        else:
            raise AssertionError("it has more suspensions than were tried")
        engine.driver.core.check()
        return left


async def _next_life(folder: Path) -> None:
    """What was stored is whole: events alternate, and go on."""
    async with engine_on(folder) as engine:
        fence = engine.fences.get("fence")
        events = await fence.events(0, 1000)
        for key in "ab":
            kinds = [event.type for event in events if event.key == key]
            assert kinds == [EventType.ENTER, EventType.EXIT] * (len(kinds) // 2)
        assert [event.sequence for event in events] == list(range(1, fence.fence.last + 1))
        await put(engine, "a", 1.0)
        assert fence.fence.last == len(events) + 1
