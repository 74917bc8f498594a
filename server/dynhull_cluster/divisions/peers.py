"""The way from one worker to the others, for what roots and shards say to each other."""

import asyncio
from functools import partial
from typing import Any

import grpc

from dynhull_server.rpc.status import RelayedError

from ..sockets import Sockets
from ..worker_link import AskingFrames

SERVICE, METHOD = "dynhull.Shards", "Send"
PATH = f"/{SERVICE}/{METHOD}"


class PeerAwayError(Exception):
    """A worker cannot be reached, or has ended before it answered."""


class Peers:
    """Connections to the other workers, made when they are needed.

    Args:
        sockets: where the workers listen.
    """

    def __init__(self, sockets: Sockets) -> None:
        self._sockets = sockets
        self._connections: dict[int, asyncio.Future[AskingFrames]] = {}

    async def ask(self, worker: int, letter: bytes) -> bytes:
        """The answer to a letter. Raises PeerAwayError."""
        try:
            frames = await self._connected(worker)
            if not frames.connected:  # it is lost, and nobody would say so any more
                raise PeerAwayError(f"worker {worker} has ended")
            return await frames.ask(PATH, b" ", letter)
        except (OSError, RelayedError) as error:
            raise PeerAwayError(f"worker {worker} is away: {error}") from None

    async def _connected(self, worker: int) -> AskingFrames:
        connecting = self._connections.get(worker)
        if connecting is None:
            connecting = self._connections[worker] = asyncio.ensure_future(self._connect(worker))
            connecting.add_done_callback(lambda done: self._forget(worker, done) if _failed(done) else None)
        return await asyncio.shield(connecting)

    async def _connect(self, worker: int) -> AskingFrames:
        lost: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        lost.add_done_callback(lambda _: self._forget(worker))
        return await self._sockets.connect(worker, partial(AskingFrames, lost))

    def _forget(self, worker: int, which: Any = None) -> None:
        if which is None or self._connections.get(worker) is which:
            self._connections.pop(worker, None)

    def close(self) -> None:
        """Close the connections."""
        for each in list(self._connections.values()):
            if each.done() and not _failed(each):
                each.result().close()
            else:
                each.cancel()


def _failed(done: "asyncio.Future[AskingFrames]") -> bool:
    return done.cancelled() or done.exception() is not None


def peer_handler(receive: Any) -> grpc.GenericRpcHandler:
    """The handler of letters, for the socket that only processes of this server reach.

    Args:
        receive: returns the answer to a letter.
    """

    async def send(_: object, context: Any) -> bytes:
        answer: bytes = await receive(await context.read())
        return answer

    handler: Any = grpc.stream_unary_rpc_method_handler(send, request_deserializer=bytes)
    return grpc.method_handlers_generic_handler(SERVICE, {METHOD: handler})
