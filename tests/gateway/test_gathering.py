"""Requests that are gathered into calls are answered, whenever they arrive and however the calls end."""

import asyncio
from typing import cast

import numpy as np
import pytest

from dynhull_client import AsyncHullClient, Located
from dynhull_gateway.gathering import IN_FLIGHT, Gatherer

POINTS = [[1.0, 2.0]]


class Calls:
    """A server whose answers to locates come when the test says so."""

    def __init__(self) -> None:
        self.open: list[asyncio.Future[Located]] = []

    async def locate(self, *_: object) -> Located:
        self.open.append(asyncio.get_running_loop().create_future())
        return await self.open[-1]

    def answer(self, revision: int) -> None:
        for call in self.open:
            call.set_result(Located(revision, np.array([-1], np.int8)))
        self.open.clear()


def locate(gatherer: Gatherer, calls: Calls) -> asyncio.Task[bytes]:
    return asyncio.create_task(gatherer.locate(cast("AsyncHullClient", calls), None, "a", POINTS))


async def all_in_flight(gatherer: Gatherer, calls: Calls) -> list[asyncio.Task[bytes]]:
    """As many requests as can be on their way, each in a call of its own."""
    asked = []
    for number in range(IN_FLIGHT):
        asked.append(locate(gatherer, calls))
        while len(calls.open) <= number:
            await asyncio.sleep(0)
    return asked


@pytest.mark.parametrize("turns", range(4))
def test_who_asks_in_the_turn_in_which_all_calls_end_is_answered(turns: int) -> None:
    async def main() -> None:
        gatherer, calls = Gatherer(), Calls()
        asked = await all_in_flight(gatherer, calls)
        calls.answer(1)
        for _ in range(turns):
            await asyncio.sleep(0)
        late = locate(gatherer, calls)
        while not calls.open and not late.done():
            await asyncio.wait([late], timeout=0)
        calls.answer(2)
        for each, revision in zip([*asked, late], [1] * IN_FLIGHT + [2], strict=True):
            assert f'"revision":{revision}'.encode() in await each

    asyncio.run(asyncio.wait_for(main(), 5))


def test_a_call_that_ends_in_an_unforeseen_way_ends_no_other() -> None:
    async def main() -> None:
        gatherer, calls = Gatherer(), Calls()
        asked = await all_in_flight(gatherer, calls)
        waiting = locate(gatherer, calls)
        await asyncio.sleep(0)
        for call in calls.open:
            call.set_exception(RuntimeError("unforeseen"))
        calls.open.clear()
        for each in asked:
            with pytest.raises(RuntimeError, match="unforeseen"):
                await each
        while not calls.open:
            await asyncio.sleep(0)
        calls.answer(3)
        assert b'"revision":3' in await waiting

    asyncio.run(asyncio.wait_for(main(), 5))


def test_all_who_wait_are_told_that_the_gateway_stops() -> None:
    async def main() -> None:
        gatherer, calls = Gatherer(), Calls()
        asked = [*await all_in_flight(gatherer, calls), locate(gatherer, calls)]
        await asyncio.sleep(0)
        for task in asyncio.all_tasks():
            if task.get_name() == "gathered requests":
                task.cancel()
        for each in asked:
            with pytest.raises(Exception, match="the gateway stops"):
                await each

    asyncio.run(asyncio.wait_for(main(), 5))
