"""What a server may hold many of, each made over the wire: to be measured by benchmarks, and counted by a test."""

import asyncio
from collections.abc import Awaitable, Callable
from contextlib import AsyncExitStack

import numpy as np

from dynhull_client import AsyncHullClient

LIMITED = "alarm-hulls", "streams", "streams-per-caller", "producers", "producers-per-caller", "fence-consumers"
LIMITS = [word for name in (*LIMITED, "many-watches-per-caller") for word in (f"--max-{name}", "100000")]
OPTIONS = ["--port", "0", "--in-memory", "--log-level", "warning", *LIMITS]
AT_ONCE = 50
BATCH = 10_000
CORNERS = 8
POINTS = 100

ANGLES = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
OCTAGON = np.stack((np.cos(ANGLES), np.sin(ANGLES)), axis=1)

Hold = Callable[[AsyncHullClient, AsyncExitStack, int, int], Awaitable[None]]
KINDS: dict[str, tuple[int, Hold]] = {}


def kind(name: str, count: int) -> Callable[[Hold], Hold]:
    """Names what is held, and how many of it are enough to measure one."""

    def add(hold: Hold) -> Hold:
        KINDS[name] = count, hold
        return hold

    return add


async def each(numbers: range, do: Callable[[int], Awaitable[object]]) -> None:
    for first in range(numbers.start, numbers.stop, AT_ONCE):
        await asyncio.gather(*(do(number) for number in range(first, min(first + AT_ONCE, numbers.stop))))


def places(first: int, end: int) -> np.ndarray:
    return np.random.default_rng(first).random((end - first, 2))


@kind("point", 400_000)
async def _point(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await client.create_hull("points", exist_ok=True)
    for row in range(first, end, BATCH):
        await client.apply("points", insert=places(row, min(row + BATCH, end)))


async def _keys(client: AsyncHullClient, name: str, keyed: str, first: int, end: int) -> None:
    await client.create_hull(name, keyed=keyed, exist_ok=True)
    for row in range(first, end, BATCH):
        keys = range(row, min(row + BATCH, end))
        await client.put(
            name, list(keys) if keyed == "int" else [f"vehicle-{key}" for key in keys], places(row, keys.stop)
        )


@kind("key, an integer", 400_000)
async def _integers(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await _keys(client, "integers", "int", first, end)


@kind("key, a string", 400_000)
async def _strings(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await _keys(client, "strings", "str", first, end)


@kind("hull, empty", 2_000)
async def _empty(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await each(range(first, end), lambda number: client.create_hull(f"empty-{number}"))


@kind("hull of 100 points", 2_000)
async def _hulls(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    async def make(number: int) -> None:
        await client.create_hull(f"hull-{number}")
        await client.apply(f"hull-{number}", insert=places(number, number + POINTS))

    await each(range(first, end), make)


@kind("hull of 100 keys, strings", 2_000)
async def _keyed(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await each(range(first, end), lambda number: _keys(client, f"keyed-{number}", "str", number, number + POINTS))


@kind("fence of 8 corners", 2_000)
async def _fences(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await client.create_hull("fenced", keyed="int", exist_ok=True)
    await each(range(first, end), lambda number: client.create_fence(f"fence-{number}", OCTAGON + number, "fenced"))


@kind("hull, empty, that an alarm watches", 2_000)
async def _alarm(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    if not first:
        await client.create_alarm("spread", prefix="empty-", when="count > 5")
    await _empty(client, _, first, end)


@kind("consumer of a fence", 10_000)
async def _consumers(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await _fences(client, _, first, first + 1)

    await each(range(first, end), lambda number: client.ack_fence("fence-0", f"consumer-{number}", 1))


@kind("producer, of numbered batches", 20_000)
async def _producers(client: AsyncHullClient, _: AsyncExitStack, first: int, end: int) -> None:
    await client.create_hull("produced", exist_ok=True)
    await each(
        range(first, end), lambda n: client.apply("produced", insert=[(n, n)], producer=f"sensor-{n}", sequence=1)
    )


@kind("watch of a hull", 500)
async def _watches(client: AsyncHullClient, stack: AsyncExitStack, first: int, end: int) -> None:
    await client.create_hull("watched", exist_ok=True)
    for _ in range(first, end):
        await anext(await stack.enter_async_context(client.watch("watched", reconnect=False)))


@kind("watch of a fence", 500)
async def _fence_watches(client: AsyncHullClient, stack: AsyncExitStack, first: int, end: int) -> None:
    if not first:
        await _fences(client, stack, 0, 1)
        await client.put("fenced", [1], [(0, 0)])
    for _ in range(first, end):
        await anext(await stack.enter_async_context(client.watch_fence("fence-0", after=0, reconnect=False)))


@kind("watch of a prefix without hulls", 500)
async def _many(client: AsyncHullClient, stack: AsyncExitStack, first: int, end: int) -> None:
    for _ in range(first, end):
        await anext(await stack.enter_async_context(client.watch_many("none/", reconnect=False)))
