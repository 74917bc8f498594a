"""Many batches in one call."""

import threading
from collections import deque
from collections.abc import Iterator
from types import TracebackType
from typing import Any, Self

import grpc
import numpy.typing as npt

from dynhull_proto.v1 import hull_service_pb2 as pb

from .calls import Ingesting
from .connection import Connection
from .errors import error_of
from .messages import Ingested, decode_ingested

# Batches handed over and not yet sent. A longer queue is no faster, and a stalled server must not fill the memory.
LONGEST_QUEUE = 16


class Ingest:
    """A stream of batches to one hull, applied in order, each its own revision. A context manager for one use.

    `apply` returns once the batch is on its way, and waits while the server is behind. Leaving the context waits until
    all are applied. An error of the server is raised by the next `apply` or on leaving, whichever comes first; the
    batches before the one at fault stay applied. Leaving with an exception of one's own cancels the call: of the
    batches on their way some may be applied.

    Attributes:
        summary: what was done, once the context has been left without an error.
    """

    def __init__(self, connection: Connection, ingesting: Ingesting) -> None:
        self.summary: Ingested | None = None
        self._connection = connection
        self._ingesting = ingesting
        self._queue = deque([ingesting.first()])
        self._turn = threading.Condition()
        self._closed = False
        self._call: Any = None

    def __enter__(self) -> Self:
        if self._call is not None:
            raise RuntimeError("an Ingest is used once")
        self._call = self._connection.begin(
            self._connection.stub.Ingest.future, self._requests(), self._ingesting.timeout
        )
        self._call.add_done_callback(lambda _: self._close())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._call is None:
            raise RuntimeError("an Ingest is left that was not entered")
        if error is not None:
            self._call.cancel()
            return
        self._close()
        self.summary = decode_ingested(_result(self._call))

    def apply(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> None:
        """Send a batch; arguments as for `HullClient.apply`.

        Raises:
            ValueError, TypeError: an argument is no array of finite points; nothing was sent.
            DynhullError: the server has refused an earlier batch.
            RuntimeError: the context has not been entered, or has been left.
        """
        request = self._ingesting.batch(insert, delete, move)
        if self._call is None:
            raise RuntimeError("use an Ingest as a context manager")
        with self._turn:
            self._turn.wait_for(lambda: self._closed or len(self._queue) < LONGEST_QUEUE)
            if not self._closed:
                self._queue.append(request)
                self._turn.notify_all()
                return
        _result(self._call)
        raise RuntimeError("the Ingest's context has been left")

    def _requests(self) -> Iterator[pb.IngestRequest]:
        """What is to be sent; runs in a thread of gRPC's."""
        while True:
            with self._turn:
                self._turn.wait_for(lambda: self._queue or self._closed)
                if not self._queue:
                    return
                request = self._queue.popleft()
                self._turn.notify_all()
            yield request

    def _close(self) -> None:
        with self._turn:
            self._closed = True
            self._turn.notify_all()


def _result(call: Any) -> Any:
    try:
        return call.result()
    except grpc.RpcError:
        raise error_of(call) from None
