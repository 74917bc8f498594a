"""Many reads in few messages."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, Self, TypeVar

import grpc

from . import _calls as calls
from . import _layers as peeling
from . import _uses as uses
from ._errors import DynhullError
from ._home import Home
from ._methods import answer_of, described, documented
from ._outcomes import Outcome, settle
from ._questions import Questions

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from concurrent.futures import Future
    from types import TracebackType

    from dynhull_proto.v1 import hull_service_pb2 as pb

    from ._calls import Call, Piping
    from ._connection import BlockingConnection
    from ._questions import Answered

P = ParamSpec("P")
Answer = TypeVar("Answer")

CLOSED = "the pipeline is closed: open a new one"


def _asking(describe: Callable[P, Call[Answer]]) -> Callable[Concatenate[Pipeline, P], Future[Answer]]:
    """The method that adds a read."""

    def method(self: Pipeline, /, *arguments: P.args, **options: P.kwargs) -> Future[Answer]:
        return self._add(described(describe, *arguments, **options))

    documented(method, describe, f"Future[{answer_of(describe)}]", without=("timeout",))
    return method


class Pipeline:
    """Sends reads without waiting for the answers of those before them, by the methods of `HullClient` that read.

    Each returns a `concurrent.futures.Future` of the answer; `result()` waits for it, and raises the error of a refused
    read, which does not affect the others. Reads are answered in order, each at one revision. One that waits for a
    `min_revision` delays those after it. A method waits while too many reads are not answered.

    A context manager for one use: leaving it waits for all answers; leaving it with an exception cancels the reads that
    are not answered. After a lost connection, the reads that are not answered are sent again, as often as the client
    repeats calls; so are a read whose hull is away for the moment, and those after it. Threads may share a pipeline. A
    process that is forked later cannot use it: its methods raise RuntimeError there.
    """

    def __init__(self, connection: BlockingConnection, piping: Piping) -> None:
        self._connection = connection
        self._home = Home("pipeline")
        self._questions: Questions[Future[Any]] = Questions(piping, connection.retries, Outcome)
        self._turn = threading.Condition()
        self._connections = 0
        self._closed = False
        self._call: Any = None
        self._thread: threading.Thread | None = None

    locate = _asking(calls.locate)
    count = _asking(calls.count)
    positions = _asking(calls.positions)
    support = _asking(calls.support)
    tangents = _asking(calls.tangents)
    distance = _asking(calls.distance)
    intersect_lines = _asking(calls.intersect_lines)
    get_hull = _asking(calls.get_hull)
    sample_points = _asking(calls.sample_points)
    verify = _asking(calls.verify)
    last_sequence = _asking(calls.last_sequence)
    layers = _asking(peeling.layers)
    influence = _asking(peeling.influence)
    get_measures = _asking(uses.get_measures)
    separate = _asking(uses.separate)
    phase_diagram = _asking(uses.phase_diagram)
    frontier = _asking(uses.frontier)

    def flush(self) -> None:
        """Wait until every read so far is answered. Errors stay with the futures of their reads."""
        self._home.require()
        with self._turn:
            added = self._questions.added
            self._turn.wait_for(lambda: self._questions.settled >= added or self._closed)

    def close(self) -> None:
        """Wait like `flush`, then end the pipeline. A second call does nothing."""
        self.flush()
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._end()

    def __repr__(self) -> str:
        return f"<Pipeline to {self._connection.address}>"

    def _add(self, call: Call[Answer]) -> Future[Answer]:
        self._home.require()
        with self._turn:
            if self._questions.full:
                self._turn.wait_for(lambda: self._closed or not self._questions.full)
            if self._closed:
                raise RuntimeError(CLOSED)
            if self._thread is None:
                name = f"pipeline to {self._connection.address}"
                self._thread = self._home.served_by(threading.Thread(target=self._run, name=name, daemon=True))
            outcome = self._questions.add(call)
            self._turn.notify_all()
        return outcome

    def _end(self) -> None:
        if self._home.left():
            return
        with self._turn:
            self._closed = True
            left = self._questions.give_up(DynhullError(CLOSED, grpc.StatusCode.CANCELLED, "", {}))
            self._turn.notify_all()
            if self._call is not None:
                self._call.cancel()
        self._connection.wake()
        for outcome, _ in left:
            outcome.cancel()
        if self._thread is not None:
            self._thread.join()
        self._home.end()

    def _run(self) -> None:
        """One connection after another, each begun when there is something to ask."""
        pause = 0.0
        while True:
            self._connection.pause(pause, lambda: self._closed)
            with self._turn:
                self._turn.wait_for(lambda: self._closed or not self._questions.empty)
                if self._closed:
                    return
            lost = self._connect()
            with self._turn:
                self._connections += 1
                answered, pause = self._questions.lost(lost)
            self._settle(answered)

    def _connect(self) -> DynhullError:
        """Send reads and receive answers; returns the error that ended the connection."""
        requests = self._requests(self._connections)
        try:
            with self._turn:
                if self._closed:
                    return DynhullError(CLOSED, grpc.StatusCode.CANCELLED, "", {})
                self._call = call = self._connection.begin(self._connection.stub.Query, requests, None)
            for response in call:
                with self._turn:
                    answered = self._questions.answer(response)
                self._settle(answered)
                if self._questions.refusal is not None:
                    call.cancel()
                    return self._questions.refusal
        except DynhullError as error:
            return error
        except grpc.RpcError as failure:
            return self._connection.error_of(failure, "Query")
        return DynhullError("the server ended the call", call.code(), "", {})

    def _settle(self, answered: Answered) -> None:
        settle(answered)  # without the lock, because futures call back
        with self._turn:
            self._questions.settled += len(answered)
            self._turn.notify_all()

    def _requests(self, connection: int) -> Iterator[pb.QueryRequest]:
        """The messages to send on a connection; runs in a thread of gRPC."""
        while True:
            with self._turn:
                message = None
                while message is None:
                    if self._closed or self._connections != connection:
                        return
                    message = self._questions.take()
                    if message is None:
                        self._turn.wait()
                self._turn.notify_all()
            yield message
