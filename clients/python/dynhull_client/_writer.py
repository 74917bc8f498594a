"""Sends points to a hull in numbered batches, each applied exactly once."""

from __future__ import annotations

import threading
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, Any, Self

import grpc

from ._calls import Known, Writing, known
from ._errors import DynhullError
from ._gathering import put_parts, remove_parts
from ._home import Home
from ._outcomes import Outcome, settle
from ._window import InFlight

if TYPE_CHECKING:
    from collections.abc import Iterator
    from concurrent.futures import Future
    from datetime import timedelta
    from types import TracebackType

    import numpy.typing as npt

    from dynhull_proto.v1 import hull_service_pb2 as pb

    from ._batch import Only
    from ._connection import BlockingConnection
    from ._gathering import Part
    from ._messages import Applied


CLOSED = "the writer is closed: open a new one"


class Writer:
    """Gathers points into batches, sends several ahead, and sends them again after the connection or the server failed.

    A context manager for one use: leaving it closes the writer; leaving it with an exception drops what is not
    acknowledged. Outside a with statement, call `close`. The first `put`, or entering the context, asks the server for
    the producer's last batch.

    The futures of all points of a refused batch carry its error. The next `flush` or `close` also raises the first such
    error. Threads may share a writer. A process that is forked later cannot use it: its methods raise
    RuntimeError there.
    """

    def __init__(self, connection: BlockingConnection, writing: Writing) -> None:
        self._connection = connection
        self._writing = writing
        self._home = Home("writer")
        self._opening = threading.Lock()
        self._turn = threading.Condition()
        self._connections = 0
        self._closed = False
        self._call: Any = None
        self._window: InFlight[Future[Applied]] | None = None
        self._thread: threading.Thread | None = None

    @property
    def sequence(self) -> int:
        """The number of the producer's last acknowledged batch. RuntimeError before the writer has started."""
        if self._window is None:
            raise RuntimeError("the writer has not started: put points, or use it in a with statement")
        return self._window.sequence

    @property
    def uid(self) -> str:
        """The uid of the hull, for a later writer. RuntimeError before the writer has started."""
        if self._window is None:
            raise RuntimeError("the writer has not started: put points, or use it in a with statement")
        return self._window.uid

    def put(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        *,
        keys: Any = None,
        points: npt.ArrayLike | None = None,
        times: Any = None,
        only: Only | None = None,
        ttl: float | timedelta | str | None = None,
        expire_times: Any = None,
        accuracies: Any = None,
        sequence: int | None = None,
    ) -> Future[Applied]:
        """Add points to the next batch; waits while too many are not acknowledged.

        A batch holds a key once. Where a key comes again, a new batch begins, so that no position is lost; with
        `coalesce="last"` the last position replaces the ones before it in the same batch. All other points of a call go
        into the same batch.

        Args:
            insert: (n, 2) points to insert, in a hull without keys.
            delete: (n, 2) points to delete.
            move: origins and destinations, (n, 2) each.
            keys: n keys to put, in a keyed hull; as for `HullClient.put`.
            points: (n, 2) positions of the keys.
            times: (n,) event times of the keys or of the points to insert.
            only: the keys to put, only new or only known ones; as for `HullClient.put`.
            ttl: the time after which the keys leave; as for `HullClient.put`.
            expire_times: (n,) the times at which the keys leave; as for `HullClient.put`.
            accuracies: (n,) how far the positions may be from where the keys really are; as for `HullClient.put`.
            sequence: with `may_skip`, the number of these changes, greater than all before; without it, None.

        Returns:
            The effect of the batch, or of the last one of several, once it is acknowledged; or the error of a refused
            batch. Several calls may share a batch: its counts, and the row in its error, refer to all of them. A
            callback must not put.

        Raises:
            ValueError, TypeError: an argument has a bad value; nothing was added.
            DynhullError: the writer has ended: nothing after its error was applied.
            RuntimeError: the writer is closed, or belongs to the process that this one was forked from.
        """
        columns = times, only, ttl, expire_times, accuracies
        parts = put_parts(self._writing, insert, delete, move, keys, points, *columns)
        return self._add(parts, sequence)

    def remove(self, keys: Any, *, sequence: int | None = None) -> Future[Applied]:
        """Remove keys in the next batch, as `put` adds points. Removing a key that was put before is a new batch."""
        return self._add(remove_parts(self._writing, keys), sequence)

    def flush(self) -> None:
        """Wait until everything put so far is acknowledged; raises the first error of a batch since the last flush."""
        self._home.require()
        window = self._window
        if window is None:
            return
        with self._turn:
            window.hurry(monotonic())
            self._turn.notify_all()
            begun = window.begun
            self._turn.wait_for(lambda: window.settled >= begun or window.failure or self._closed)
            window.raise_refusal()
            if window.settled < begun:
                raise RuntimeError(CLOSED)

    def close(self) -> None:
        """Wait like `flush`, then end the writer. A second call does nothing."""
        if self._closed:
            return
        try:
            self.flush()
        finally:
            self._end()

    def __enter__(self) -> Self:
        self._home.require()
        self._open()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if error is None:
            self.close()
        else:
            self._end()

    def __repr__(self) -> str:
        return f"<Writer to {self._writing.name!r} as producer {self._writing.producer!r}>"

    def _add(self, parts: list[Part], sequence: int | None) -> Future[Applied]:
        self._home.require()
        window = self._window
        if window is None or self._closed:
            window = self._open()
        number = window.number(parts, sequence)
        with self._turn:
            for part in parts:
                if not window.admits(part):
                    self._turn.wait_for(partial(self._may_put, window, part))
                if self._closed:
                    raise RuntimeError(CLOSED)
                outcome = window.put(part, monotonic(), number)
            if window.ready:  # otherwise each put would wake the sender in vain
                self._turn.notify_all()
        return outcome

    def _may_put(self, window: InFlight[Future[Applied]], part: Part) -> bool:
        return window.admits(part) or window.failure is not None or self._closed

    def _open(self) -> InFlight[Future[Applied]]:
        with self._opening:
            if self._window is None:
                try:
                    begin = self._connection.answer(known(self._writing), self._hold, lambda: self._closed)
                except DynhullError:
                    if self._closed:
                        raise RuntimeError(CLOSED) from None
                    raise
                with self._turn:
                    if not self._closed:
                        self._begin(begin)
            if self._window is None or self._closed:
                raise RuntimeError(CLOSED)
            return self._window

    def _begin(self, begin: Known) -> None:
        window: InFlight[Future[Applied]] = InFlight(self._writing, begin, Outcome)
        name = f"writer to {self._writing.name}"
        self._thread = self._home.served_by(threading.Thread(target=self._run, args=(window,), name=name, daemon=True))
        self._window = window  # only now: without a thread, what is put would wait for ever

    def _hold(self, call: Any) -> None:
        """Have the end of the writer cancel a call."""
        with self._turn:
            self._call = call
            if self._closed:
                call.cancel()

    def _end(self) -> None:
        if self._home.left():
            return
        with self._turn:
            self._closed = True
            left = [] if self._window is None else self._window.abandon()
            self._turn.notify_all()
            if self._call is not None:
                self._call.cancel()
        self._connection.wake()
        for outcome in left:
            outcome.cancel()
        if self._thread is not None:
            self._thread.join()
        self._home.end()

    def _run(self, window: InFlight[Future[Applied]]) -> None:
        """One connection after another, until the writer is closed or has failed."""
        while True:
            lost = self._connect(window)
            with self._turn:
                if self._closed or window.failure:
                    return
                self._connections += 1
                settled, pause = window.lost(lost, monotonic())
                self._turn.notify_all()
            settle(settled)
            if pause is None:
                return
            self._connection.pause(pause, lambda: self._closed)

    def _connect(self, window: InFlight[Future[Applied]]) -> DynhullError:
        """Send batches and read acknowledgements; returns the error that ended the connection."""
        requests = self._requests(window, self._connections)
        try:
            self._hold(call := self._connection.begin(self._connection.stub.Stream, requests, None))
            for response in call:
                with self._turn:
                    settled = window.acknowledge(response)
                    self._turn.notify_all()
                settle(settled)
                if window.failure:
                    call.cancel()
        except DynhullError as error:
            return error
        except grpc.RpcError as failure:
            return self._connection.error_of(failure, "Stream")
        return DynhullError("the server ended the stream", call.code(), "", {})

    def _requests(self, window: InFlight[Future[Applied]], connection: int) -> Iterator[pb.StreamRequest]:
        """The messages to send on a connection; runs in a thread of gRPC."""
        yield window.first()
        while True:
            with self._turn:
                request = None
                while request is None:
                    if self._closed or window.failure or self._connections != connection:
                        return
                    request = window.take(monotonic())
                    if request is None:
                        self._turn.wait(window.due_in(monotonic()))
                self._turn.notify_all()
            yield request
