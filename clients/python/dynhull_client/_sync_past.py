"""A hull as it was, for the synchronous client."""

from collections.abc import Callable, Iterator
from datetime import datetime
from typing import Concatenate, ParamSpec, TypeVar

from . import _calls as calls
from . import _layers as peeling
from . import _quarantine as quarantine
from . import _uses as uses
from ._calls import Call, Pages
from ._methods import answer_of, described
from ._past import AsOf, without_name

P = ParamSpec("P")
Result = TypeVar("Result")


def _asking(describe: Callable[Concatenate[str, P], Call[Result]]) -> Callable[Concatenate["Past", P], Result]:
    """The method that asks about one revision of a hull."""

    def method(self: "Past", /, *arguments: P.args, **options: P.kwargs) -> Result:
        answer: Result = self._connection.answer(self._call(describe, arguments, options))
        return answer

    without_name(method, describe, answer_of(describe))
    return method


def _reading(
    describe: Callable[Concatenate[str, P], Call[Result]],
) -> Callable[Concatenate["Past", P], Iterator[Result]]:
    """The method that reads one revision of a hull part by part."""

    def method(self: "Past", /, *arguments: P.args, **options: P.kwargs) -> Iterator[Result]:
        parts: Iterator[Result] = self._connection.parts(self._call(describe, arguments, options))
        return parts

    without_name(method, describe, f"Iterator[{answer_of(describe)}]")
    return method


def _listing(
    describe: Callable[Concatenate[str, P], Pages[Result]],
) -> Callable[Concatenate["Past", P], Iterator[Result]]:
    """The method that returns a list of one revision of a hull, one after the other."""

    def method(self: "Past", /, *arguments: P.args, **options: P.kwargs) -> Iterator[Result]:
        page, token = described(describe, self.name, *arguments, **options), ""
        while True:
            found, token = self._connection.answer(self._of_then(page(token)))
            yield from found
            if not token:
                return

    without_name(method, describe, f"Iterator[{answer_of(describe)}]")
    return method


class Past(AsOf):
    """A hull at one revision of the past, which `HullClient.at` has found: the reading methods, without the name.

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
