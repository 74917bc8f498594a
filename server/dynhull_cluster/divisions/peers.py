"""The way from one worker to the others, for what roots and shards say to each other."""

import asyncio
from functools import partial
from typing import Any

import grpc

from dynhull_server.rpc.status import RelayedError

from ..asking_frames import AskingFrames
from ..ways import Ways

SERVICE, METHOD = "dynhull.Shards", "Send"
PATH = f"/{SERVICE}/{METHOD}"


class PeerAwayError(Exception):
    """A worker cannot be reached, or has ended before it answered."""


class Peers:
    """Connections to the other workers, made when they are needed.

    Args:
        ways: where the workers are.
    """

    def __init__(self, ways: Ways) -> None:
        self._ways = ways
        self._connections: dict[int, asyncio.Future[AskingFrames]] = {}

    @property
    def takeover(self) -> float:
        """The seconds in which a worker that has ended is replaced by another one; 0 where there is no other."""
        return self._ways.takeover

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
            self._ways.when_moved(worker, partial(self._leave, worker))
            connecting = asyncio.create_task(self._ways.connect(worker, AskingFrames))
            self._connections[worker] = connecting
            connecting.add_done_callback(partial(self._follow, worker))
        return await asyncio.shield(connecting)

    def _follow(self, worker: int, connected: "asyncio.Future[AskingFrames]") -> None:
        """Forget a connection that has failed, or once the worker takes nothing more."""
        if _failed(connected):
            self._forget(worker, connected)
        else:
            frames = connected.result()
            frames.left.add_done_callback(partial(self._forget, worker, connected))
            frames.left.add_done_callback(lambda _: frames.leave())

    def _leave(self, worker: int) -> None:
        """End the connection: the worker is elsewhere, and who was it before may not answer any more."""
        connected = self._connections.get(worker)
        if connected is not None and connected.done() and not _failed(connected):
            connected.result().abort()

    def _forget(self, worker: int, which: "asyncio.Future[AskingFrames]", _: object = None) -> None:
        if self._connections.get(worker) is which:
            del self._connections[worker]

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
    """The handler of letters, for frames that only processes of this server send.

    Args:
        receive: returns the answer to a letter.
    """

    async def send(_: object, context: Any) -> bytes:
        answer: bytes = await receive(await context.read())
        return answer

    handler: Any = grpc.stream_unary_rpc_method_handler(send, request_deserializer=bytes)
    return grpc.method_handlers_generic_handler(SERVICE, {METHOD: handler})
