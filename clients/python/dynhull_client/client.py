"""The synchronous client."""

import time
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import Concatenate, ParamSpec, Self, TypeVar

import grpc

from . import calls, uses
from .calls import Call
from .connection import Connection
from .errors import error_of
from .ingest import Ingest
from .messages import HullInfo
from .methods import documented, opening
from .watch import Watch
from .writer import Writer

P = ParamSpec("P")
Result = TypeVar("Result")


def _answering(describe: Callable[P, Call[Result]]) -> Callable[Concatenate["HullClient", P], Result]:
    """The method that makes a call and returns its answer."""

    def method(self: "HullClient", /, *arguments: P.args, **options: P.kwargs) -> Result:
        return self._answer(describe(*arguments, **options))

    documented(method, describe)
    return method


class HullClient(Connection):
    """A connection to a dynhull server; arguments and errors as of `Connection`.

    Safe to share between threads. A context manager, closed on leaving.
    """

    create_hull = _answering(calls.create_hull)
    delete_hull = _answering(calls.delete_hull)
    apply = _answering(calls.apply)
    last_sequence = _answering(calls.last_sequence)
    locate = _answering(calls.locate)
    count = _answering(calls.count)
    support = _answering(calls.support)
    tangents = _answering(calls.tangents)
    distance = _answering(calls.distance)
    intersect_lines = _answering(calls.intersect_lines)
    get_hull = _answering(calls.get_hull)
    sample_points = _answering(calls.sample_points)
    verify = _answering(calls.verify)
    get_measures = _answering(uses.get_measures)
    separate = _answering(uses.separate)
    phase_diagram = _answering(uses.phase_diagram)
    frontier = _answering(uses.frontier)
    ingest = opening(Ingest, calls.ingest)
    watch = opening(Watch, calls.watch)
    writer = opening(Writer, calls.writer)

    def list_hulls(self, prefix: str = "", *, timeout: float | None = None) -> Iterator[HullInfo]:
        """The hulls whose names begin with `prefix`, in the order of their names, fetched as they are wanted."""
        following: str | None = ""
        while following is not None:
            hulls, token = self._answer(calls.list_page(prefix, following, timeout))
            yield from hulls
            following = token or None

    def close(self) -> None:
        """Close the connection; calls under way end."""
        self._closed = True
        self.channel.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.close()

    def _answer(self, call: Call[Result]) -> Result:
        attempts = self.attempts(call)
        while True:
            try:
                return call.decode(self.begin(getattr(self.stub, call.method), call.request, attempts.timeout()))
            except grpc.RpcError as failure:
                pause = attempts.pause_after(error_of(failure))
            time.sleep(pause)
