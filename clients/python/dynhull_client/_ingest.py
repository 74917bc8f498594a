"""Many batches in one call."""

from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Self

import grpc

from ._home import Home
from ._messages import Ingested, decode_ingested

if TYPE_CHECKING:
    from collections.abc import Iterator
    from datetime import timedelta
    from types import TracebackType

    import numpy.typing as npt

    from dynhull_proto.v1 import hull_service_pb2 as pb

    from ._batch import Only
    from ._calls import Ingesting
    from ._connection import BlockingConnection

# Batches that wait to be sent. A longer queue is no faster, and a stalled server must not fill the memory.
LONGEST_QUEUE = 16


class Ingest:
    """A stream of batches to one hull, applied in order, each as its own revision. A context manager for one use.

    `apply` returns once the batch waits to be sent, and blocks while too many do. Leaving the context waits until all
    batches are applied. The next `apply`, or leaving the context, raises an error of the server; the batches before the
    one at fault stay applied. Leaving the context with an exception cancels the call: some of the batches that were
    sent may be applied.

    Attributes:
        summary: the effect of all batches; None until the context was left without an error.
    """

    summary: Ingested | None

    def __init__(self, connection: BlockingConnection, ingesting: Ingesting) -> None:
        self.summary = None
        self._connection = connection
        self._home = Home("ingest")
        self._ingesting = ingesting
        self._queue = deque([ingesting.first()])
        self._turn = threading.Condition()
        self._closed = False
        self._call: Any = None

    def __enter__(self) -> Self:
        if self._call is not None:
            raise RuntimeError("an Ingest can be used once: open a new one")
        self._home.require()
        self._call = self._connection.begin(
            self._connection.stub.Ingest.future, self._requests(), self._ingesting.timeout
        )
        self._home.begin()
        self._call.add_done_callback(lambda _: self._close())
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._call is None:
            raise RuntimeError("this Ingest was not entered: use it in a with statement")
        if error is not None:
            if not self._home.left():
                self._call.cancel()
            return
        self._home.require()
        self._close()
        self.summary = decode_ingested(self._result())

    def apply(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
        *,
        keys: Any = None,
        points: npt.ArrayLike | None = None,
        times: Any = None,
        remove: Any = None,
        only: Only | None = None,
        ttl: float | timedelta | str | None = None,
        expire_times: Any = None,
        accuracies: Any = None,
    ) -> None:
        """Send a batch; arguments as for `HullClient.apply` or, in a keyed hull, `HullClient.put`.

        Raises:
            ValueError, TypeError: an argument has a bad value; nothing was sent.
            DynhullError: the server refused an earlier batch.
            RuntimeError: the context was not entered, or was left; or this process was forked in it.
        """
        self._home.require()
        request = self._ingesting.batch(
            insert=insert,
            delete=delete,
            move=move,
            keys=keys,
            points=points,
            times=times,
            remove=remove,
            only=only,
            ttl=ttl,
            expire_times=expire_times,
            accuracies=accuracies,
        )
        if self._call is None:
            raise RuntimeError("an Ingest works only inside its context: write `with client.ingest(...) as stream:`")
        with self._turn:
            self._turn.wait_for(lambda: self._closed or len(self._queue) < LONGEST_QUEUE)
            if not self._closed:
                self._queue.append(request)
                self._turn.notify_all()
                return
        self._result()
        raise RuntimeError("the context of this Ingest was left: open a new one")

    def __repr__(self) -> str:
        return f"<Ingest to {self._ingesting.name!r}>"

    def _requests(self) -> Iterator[pb.IngestRequest]:
        """The messages to send; runs in a thread of gRPC."""
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
        self._home.end()

    def _result(self) -> Any:
        try:
            return self._call.result()
        except (grpc.RpcError, grpc.FutureCancelledError):
            raise self._connection.error_of(self._call, "Ingest") from None
