"""A hull as it was, for the asyncio client."""

from collections.abc import AsyncIterator, Callable, Coroutine
from datetime import datetime
from typing import Any, Concatenate, ParamSpec, TypeVar

from . import _calls as calls
from . import _layers as peeling
from . import _quarantine as quarantine
from . import _uses as uses
from ._calls import Call, Pages
from ._methods import answer_of, described
from ._past import AsOf, without_name

P = ParamSpec("P")
Result = TypeVar("Result")


def _asking(
    describe: Callable[Concatenate[str, P], Call[Result]],
) -> Callable[Concatenate["AsyncPast", P], Coroutine[Any, Any, Result]]:
    """The coroutine that asks about one revision of a hull."""

    async def method(self: "AsyncPast", /, *arguments: P.args, **options: P.kwargs) -> Result:
        answer: Result = await self._connection.answer(self._call(describe, arguments, options))
        return answer

    without_name(method, describe, answer_of(describe))
    return method


def _reading(
    describe: Callable[Concatenate[str, P], Call[Result]],
) -> Callable[Concatenate["AsyncPast", P], AsyncIterator[Result]]:
    """The method that reads one revision of a hull part by part."""

    def method(self: "AsyncPast", /, *arguments: P.args, **options: P.kwargs) -> AsyncIterator[Result]:
        parts: AsyncIterator[Result] = self._connection.parts(self._call(describe, arguments, options))
        return parts

    without_name(method, describe, f"AsyncIterator[{answer_of(describe)}]")
    return method


def _listing(
    describe: Callable[Concatenate[str, P], Pages[Result]],
) -> Callable[Concatenate["AsyncPast", P], AsyncIterator[Result]]:
    """The method that returns a list of one revision of a hull, one after the other."""

    async def method(self: "AsyncPast", /, *arguments: P.args, **options: P.kwargs) -> AsyncIterator[Result]:
        page, token = described(describe, self.name, *arguments, **options), ""
        while True:
            found, token = await self._connection.answer(self._of_then(page(token)))
            for each in found:
                yield each
            if not token:
                return

    without_name(method, describe, f"AsyncIterator[{answer_of(describe)}]")
    return method


class AsyncPast(AsOf):
    """A hull at one revision of the past, which `AsyncHullClient.at` has found: the reading methods, without the name.

    Attributes:
        name: the name of the hull.
        revision: the revision.
        time: when it was committed; of revision 0, when the hull was created; None where that is not known.
    """

    name: str
    revision: int
    time: datetime | None

    get_hull = _asking(calls.get_hull)
    locate = _asking(calls.locate)
    support = _asking(calls.support)
    distance = _asking(calls.distance)
    tangents = _asking(calls.tangents)
    intersect_lines = _asking(calls.intersect_lines)
    get_measures = _asking(uses.get_measures)
    count = _asking(calls.count)
    positions = _asking(calls.positions)
    entities = _asking(calls.entities)
    read_points = _reading(calls.read_points)
    list_held = _listing(quarantine.list_held)
    sample_points = _asking(calls.sample_points)
    layers = _asking(peeling.layers)
    influence = _asking(peeling.influence)
    phase_diagram = _asking(uses.phase_diagram)
    frontier = _asking(uses.frontier)
    verify = _asking(calls.verify)
