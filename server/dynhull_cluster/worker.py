"""A worker on a folder or in memory: the server of one process, reached through private sockets."""

from collections.abc import Callable, Mapping, Sequence

import grpc

from dynhull_server.app import Server
from dynhull_server.rpc.access import Caller, TokenFile
from dynhull_server.rpc.calls import Context
from dynhull_server.rpc.methods import RunHandler
from dynhull_server.settings import Settings
from dynhull_server.storage.port import Storage

from .callers import authenticator
from .divisions.divisions import ServedDivisions
from .divisions.peers import Peers, peer_handler
from .frame_server import FrameServer
from .sockets import Sockets

# Each gateway watches the health of each worker; all of them have one address.
HEALTH_CALLS = 1024


def worker_server(settings: Settings, number: int, sockets: Sockets, storage: Storage) -> Server:
    """The server of a worker, on its own storage."""
    peers = Peers(sockets)
    divisions = ServedDivisions(settings, number, settings.workers or 1, peers)
    entrance = PrivateEntrance(number, sockets, peer_handler(divisions.receive), peers)
    return Server(own_settings(settings), storage, entrance, divisions)


def own_settings(settings: Settings) -> Settings:
    """The settings of a server that only gateways reach."""
    return settings.model_copy(
        update={
            "tls_cert": None,
            "tls_key": None,
            "tls_client_ca": None,
            "metrics_port": None,
            "max_health_calls": HEALTH_CALLS,
            "max_health_calls_per_caller": HEALTH_CALLS,
            "max_many_watches_per_caller": settings.max_streams,  # gateways count them: of many callers one comes here
        }
    )


class PrivateEntrance:
    """The sockets of a worker, which gateways and other workers reach, and its connections to those of other workers.

    Args:
        number: the number of the worker.
        sockets: where it listens.
        letters: the handler of what other workers send.
        peers: the other workers.
    """

    def __init__(self, number: int, sockets: Sockets, letters: grpc.GenericRpcHandler, peers: Peers) -> None:
        self._number = number
        self._sockets = sockets
        self._letters = letters
        self._peers = peers
        self._frames: FrameServer | None = None

    def authenticator(self, tokens: TokenFile | None) -> Callable[[Context], Caller]:
        """Callers are who a gateway says they are."""
        return authenticator(tokens)

    async def listen(
        self, server: grpc.aio.Server, handlers: Sequence[grpc.GenericRpcHandler], runs: Mapping[str, RunHandler]
    ) -> str:
        """Listen on both sockets."""
        address = f"unix:{self._sockets.grpc(self._number)}"
        server.add_insecure_port(address)
        self._frames = FrameServer((self._letters, *handlers), runs)
        await self._frames.listen(self._sockets.frames(self._number))
        return address

    def say_goodbye(self) -> None:
        """Have gateways and other workers go to the next process."""
        if self._frames is not None:
            self._frames.say_goodbye()

    async def close(self) -> None:
        """Close the socket for frames, and the connections."""
        if self._frames is not None:
            await self._frames.close()
        self._peers.close()
