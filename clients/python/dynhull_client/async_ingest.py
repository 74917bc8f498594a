"""Many batches in one call, with asyncio."""

import asyncio
from types import TracebackType
from typing import Any, Self

import grpc
import numpy.typing as npt

from dynhull_proto.v1 import hull_service_pb2 as pb

from .calls import Ingesting
from .connection import Connection
from .errors import error_of
from .messages import Ingested, decode_ingested


class AsyncIngest:
    """`Ingest` for asyncio: an async context manager for one use, whose `apply` is awaited.

    Attributes:
        summary: what was done, once the context has been left without an error.
    """

    def __init__(self, connection: Connection, ingesting: Ingesting) -> None:
        self.summary: Ingested | None = None
        self._connection = connection
        self._ingesting = ingesting
        self._closed = False
        self._call: Any = None

    async def __aenter__(self) -> Self:
        if self._call is not None:
            raise RuntimeError("an Ingest is used once")
        self._call = self._connection.begin(self._connection.stub.Ingest, None, self._ingesting.timeout)
        await self._send(self._ingesting.first())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._call is None:
            raise RuntimeError("an Ingest is left that was not entered")
        self._closed = True
        if error is not None:
            self._call.cancel()
            return
        await self._call.done_writing()
        self.summary = decode_ingested(await self._result())

    async def apply(
        self,
        insert: npt.ArrayLike | None = None,
        delete: npt.ArrayLike | None = None,
        move: tuple[npt.ArrayLike, npt.ArrayLike] | None = None,
    ) -> None:
        """Send a batch; arguments and errors as of `Ingest.apply`."""
        request = self._ingesting.batch(insert, delete, move)
        if self._call is None:
            raise RuntimeError("use an Ingest as a context manager")
        if self._closed:
            raise RuntimeError("the Ingest's context has been left")
        await self._send(request)

    async def _send(self, request: pb.IngestRequest) -> None:
        try:
            await self._call.write(request)
        except (asyncio.InvalidStateError, grpc.RpcError):  # the call has ended: its result tells why
            await self._result()

    async def _result(self) -> Any:
        try:
            return await self._call
        except grpc.RpcError as error:
            raise error_of(error) from None
