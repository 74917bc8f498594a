"""Points to a hull in numbered batches, each applied exactly once, with asyncio."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from time import monotonic
from types import TracebackType
from typing import TYPE_CHECKING, Self

import grpc
import numpy.typing as npt

from dynhull_proto.v1 import hull_service_pb2 as pb

from .batch import encode_batch
from .calls import Writing
from .errors import DynhullError, error_of
from .window import Window, settle

if TYPE_CHECKING:
    from .async_client import AsyncHullClient
    from .messages import Applied


class AsyncWriter:
    """`Writer` for asyncio: an async context manager for one use, whose `put` and `flush` are awaited."""

    def __init__(self, client: "AsyncHullClient", writing: Writing) -> None:
        self._client = client
        self._writing = writing
        self._turn = asyncio.Condition()
        self._connections = 0
        self._closed = False
        self._window: Window[asyncio.Future[Applied]] | None = None
        self._task: asyncio.Task[None] | None = None

    @property
    def sequence(self) -> int:
        """The number of the producer's last batch that was acknowledged."""
        return self._opened().sequence

    async def put(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> "asyncio.Future[Applied]":
        """Add points to the next batch, all to the same one; waits where too many are under way.

        Returns the future of what the batch did. Arguments and errors as of `Writer.put`.
        """
        batch = encode_batch(insert, delete, move, self._writing.missing)
        window = self._opened()
        async with self._turn:
            await self._turn.wait_for(lambda: not window.full or window.failure or self._closed)
            if self._closed:
                raise RuntimeError("the writer's context has been left")
            outcome = window.put(batch, monotonic())
            self._turn.notify_all()
        return outcome

    async def flush(self) -> None:
        """Wait until everything put so far is acknowledged; raises the first error of a batch since the last flush."""
        window = self._opened()
        async with self._turn:
            window.hurry(monotonic())
            self._turn.notify_all()
            begun = window.begun
            await self._turn.wait_for(lambda: window.settled >= begun or window.failure or self._closed)
            window.raise_refusal()

    async def __aenter__(self) -> Self:
        if self._window is not None:
            raise RuntimeError("a writer is used once")
        begin = await self._client.last_sequence(self._writing.name, self._writing.producer)
        self._window = Window(self._writing, begin, asyncio.get_running_loop().create_future)
        self._task = asyncio.create_task(self._run(), name=f"writer to {self._writing.name}")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        try:
            if error is None:
                await self.flush()
        finally:
            await self._close()

    def _opened(self) -> Window["asyncio.Future[Applied]"]:
        if self._window is None:
            raise RuntimeError("use a writer as a context manager")
        return self._window

    async def _close(self) -> None:
        async with self._turn:
            self._closed = True
            left = self._opened().abandon()
            self._turn.notify_all()
        for outcome in left:
            outcome.cancel()
        assert self._task is not None  # there is one with the window
        self._task.cancel()
        with suppress(asyncio.CancelledError):
            await self._task

    async def _run(self) -> None:
        """One connection after another, until the writer is closed or has failed."""
        window = self._opened()
        while True:
            lost = await self._connect(window)
            async with self._turn:
                if window.failure:
                    return
                self._connections += 1
                settled, pause = window.lost(lost, monotonic())
                self._turn.notify_all()
            settle(settled)
            if pause is None:
                return
            await asyncio.sleep(pause)

    async def _connect(self, window: Window["asyncio.Future[Applied]"]) -> DynhullError:
        """Send batches and read acknowledgements; returns what ended the connection."""
        requests = self._requests(window, self._connections)
        try:
            call = self._client.begin(self._client.stub.Stream, requests, None)
        except DynhullError as error:
            return error
        try:
            while (response := await call.read()) is not grpc.aio.EOF:
                async with self._turn:
                    settled = window.acknowledge(response)
                    self._turn.notify_all()
                settle(settled)
                if window.failure:
                    break
        except grpc.RpcError as failure:
            return error_of(failure)
        finally:
            call.cancel()
        return DynhullError("the server has ended the stream", await call.code(), "", {})

    async def _requests(
        self, window: Window["asyncio.Future[Applied]"], connection: int
    ) -> AsyncIterator[pb.StreamRequest]:
        """What is to be sent on a connection."""
        yield window.first()
        while True:
            async with self._turn:
                request = None
                while request is None:
                    if self._closed or window.failure or self._connections != connection:
                        return
                    request = window.take(monotonic())
                    if request is None:
                        with suppress(TimeoutError):
                            async with asyncio.timeout(window.due_in(monotonic())):
                                await self._turn.wait()
                self._turn.notify_all()
            yield request
