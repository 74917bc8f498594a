"""How gateways and the owners of other partitions reach the owner of a partition."""

import hmac
import ipaddress
import socket
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import grpc

from dynhull_server.certificates import require_accepted, server_context
from dynhull_server.entrance import grpc_credentials
from dynhull_server.listening import why_not
from dynhull_server.rpc.access import Caller, TokenFile
from dynhull_server.rpc.calls import Context
from dynhull_server.rpc.methods import RunHandler
from dynhull_server.rpc.status import StartingError
from dynhull_server.settings import Settings

from ..callers import PROOF, authenticator
from ..frame_server import FrameContext, FrameServer
from ..ways import keep_alive


def proof_of(partition: int, worker: str, secret: str) -> str:
    """What a connection begins with: who knows the secret, and means this partition of this worker.

    Ports are used again, also by a worker of the database of which this is a copy, with the same secret.
    """
    return f"{partition}/{worker}/{secret}"


def checked_certificate(settings: Settings) -> tuple[Path, Path] | None:
    """The certificate and the key of this server for the others of its cluster; None where they do without TLS.

    Raises:
        ValueError: the others would not connect, so that nobody but callers of this server reached what it has.
    """
    if settings.cluster_ca is None:
        return None
    assert settings.tls_cert is not None  # the settings require both
    assert settings.tls_key is not None
    require_accepted(settings.tls_cert, settings.tls_key, settings.cluster_ca, settings.cluster_host)
    return settings.tls_cert, settings.tls_key


def require_own_address(settings: Settings) -> None:
    """Refuse an address that this machine does not have. A name may get one later, and is tried with each partition.

    Raises:
        OSError: nothing can listen there.
    """
    host = settings.cluster_host
    try:
        ipaddress.ip_address(host.strip("[]"))
    except ValueError:
        return
    _require_listening(host)


def _require_listening(host: str) -> None:
    if reason := why_not(host, 0):
        raise OSError(f"cannot listen on --cluster-host {host}: {reason}")


class PartitionEntrance:
    """The ports of a partition, for as long as this process owns it.

    Args:
        settings: the settings.
        partition: the partition.
        worker: the worker.
        secret: what processes of the cluster know each other by.
        letters: the handler of what other partitions send.

    Attributes:
        address: the host, the port for gRPC and that for frames, once it listens.
    """

    def __init__(
        self, settings: Settings, partition: int, worker: str, secret: str, letters: grpc.GenericRpcHandler
    ) -> None:
        self._settings = settings
        self._letters = letters
        self._proof = proof_of(partition, worker, secret)
        self._frames: FrameServer | None = None
        self.address = ""

    def authenticator(self, tokens: TokenFile | None) -> Callable[[Context], Caller]:
        """Callers are who a gateway says they are, if it proves to be one."""
        authenticate = authenticator(tokens)

        def proven(context: Context) -> Caller:
            if not isinstance(context, FrameContext):  # frames have begun with a greeting
                shown = str(dict(context.invocation_metadata() or ()).get(PROOF, ""))
                if not hmac.compare_digest(shown.encode(), self._proof.encode()):
                    raise StartingError("this worker does not own the partition")
            return authenticate(context)

        return proven

    async def listen(
        self, server: grpc.aio.Server, handlers: Sequence[grpc.GenericRpcHandler], runs: Mapping[str, RunHandler]
    ) -> str:
        """Listen on two free ports of the address for the cluster."""
        settings = self._settings
        host = settings.cluster_host
        _require_listening(host)
        credentials, tls = None, None
        if (files := checked_certificate(settings)) is not None:
            credentials, tls = grpc_credentials(*files, None), server_context(*files, None)
        place = f"[{host}]:0" if ":" in host else f"{host}:0"
        port = server.add_insecure_port(place) if credentials is None else server.add_secure_port(place, credentials)
        family, kind, protocol, _, address = socket.getaddrinfo(host, 0, type=socket.SOCK_STREAM)[0]
        bound = socket.socket(family, kind, protocol)
        bound.bind(address)
        keep_alive(bound)  # connections inherit it
        self._frames = FrameServer((self._letters, *handlers), runs, self._proof.encode())
        await self._frames.listen_on(bound, tls)
        self.address = f"{host} {port} {bound.getsockname()[1]}"
        return self.address

    def say_goodbye(self) -> None:
        """Have gateways and other workers go to the next owner."""
        if self._frames is not None:
            self._frames.say_goodbye()

    async def close(self) -> None:
        """Close the port for frames."""
        if self._frames is not None:
            await self._frames.close()
