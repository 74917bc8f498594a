"""Points to a hull in numbered batches, each applied exactly once."""

import threading
from collections.abc import Iterator
from concurrent.futures import Future
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

import grpc
import numpy.typing as npt

from dynhull_proto.v1 import hull_service_pb2 as pb

from .batch import encode_batch
from .calls import Writing
from .errors import DynhullError, error_of
from .window import Window, settle

if TYPE_CHECKING:
    from .client import HullClient
    from .messages import Applied


class Writer:
    """Gathers points into batches, sends several ahead, and sends them again where the connection or the server broke.

    A context manager for one use. Entering it asks the server which batch of the producer was the last. Leaving it
    waits until everything is acknowledged; leaving it with an exception of one's own waits for nothing.

    A batch that the server refuses reports its error where it is asked for: the futures of all points in it. The first
    such error is also raised by the next `flush`, or on leaving. Safe to share between threads.
    """

    def __init__(self, client: "HullClient", writing: Writing) -> None:
        self._client = client
        self._writing = writing
        self._turn = threading.Condition()
        self._connections = 0
        self._closed = False
        self._call: Any = None
        self._window: Window[Future[Applied]] | None = None
        self._thread = threading.Thread(target=self._run, name=f"writer to {writing.name}", daemon=True)

    @property
    def sequence(self) -> int:
        """The number of the producer's last batch that was acknowledged."""
        return self._opened().sequence

    def put(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> "Future[Applied]":
        """Add points to the next batch, all to the same one; waits where too many are under way.

        Returns:
            What the batch did, once it is acknowledged, or the error that it was refused with. Several calls may share
            a batch: the rows in it, and in its error, are those of all of them. A callback must not put.

        Raises:
            ValueError, TypeError: an argument is no array of finite points; nothing was added.
            DynhullError: the writer has ended: nothing after its error was applied.
            RuntimeError: the context has not been entered, or has been left.
        """
        batch = encode_batch(insert, delete, move, self._writing.missing)
        window = self._opened()
        with self._turn:
            self._turn.wait_for(lambda: not window.full or window.failure or self._closed)
            if self._closed:
                raise RuntimeError("the writer's context has been left")
            outcome = window.put(batch, monotonic())
            self._turn.notify_all()
        return outcome

    def flush(self) -> None:
        """Wait until everything put so far is acknowledged; raises the first error of a batch since the last flush."""
        window = self._opened()
        with self._turn:
            window.hurry(monotonic())
            self._turn.notify_all()
            begun = window.begun
            self._turn.wait_for(lambda: window.settled >= begun or window.failure or self._closed)
            window.raise_refusal()

    def __enter__(self) -> Self:
        if self._window is not None:
            raise RuntimeError("a writer is used once")
        begin = self._client.last_sequence(self._writing.name, self._writing.producer)
        self._window = Window(self._writing, begin, _new_outcome)
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if error is None:
                self.flush()
        finally:
            self._close()

    def _opened(self) -> Window["Future[Applied]"]:
        if self._window is None:
            raise RuntimeError("use a writer as a context manager")
        return self._window

    def _close(self) -> None:
        window = self._opened()
        with self._turn:
            self._closed = True
            left = window.abandon()
            self._turn.notify_all()
            if self._call is not None:
                self._call.cancel()
        for outcome in left:
            outcome.cancel()
        self._thread.join()

    def _run(self) -> None:
        """One connection after another, until the writer is closed or has failed."""
        window = self._opened()
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
            with self._turn:
                if self._turn.wait_for(lambda: self._closed, pause):
                    return

    def _connect(self, window: Window["Future[Applied]"]) -> DynhullError:
        """Send batches and read acknowledgements; returns what ended the connection."""
        requests = self._requests(window, self._connections)
        try:
            with self._turn:
                self._call = call = self._client.begin(self._client.stub.Stream, requests, None)
                if self._closed:
                    call.cancel()
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
            return error_of(failure)
        return DynhullError("the server has ended the stream", call.code(), "", {})

    def _requests(self, window: Window["Future[Applied]"], connection: int) -> Iterator[pb.StreamRequest]:
        """What is to be sent on a connection; runs in a thread of gRPC's."""
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


def _new_outcome() -> "Future[Applied]":
    return Future()
