"""How callers reach a server: where it listens, and who its callers are."""

import math
import ssl
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Protocol

import grpc

from .certificates import server_context
from .listening import why_not
from .rpc.access import ANONYMOUS, Caller, TokenFile
from .rpc.calls import Context
from .rpc.methods import RunHandler
from .settings import Settings

# Milliseconds between pings on an idle connection, and until a connection that does not answer them is closed.
KEEPALIVE, KEEPALIVE_TIMEOUT = 60_000, 20_000
# Bytes of each call that a client may send before the server reads them.
LOOKAHEAD = 2**20
# Milliseconds that a new connection has for the HTTP/2 handshake.
HANDSHAKE_TIMEOUT = 10_000

# Calls that may wait to be taken up, or twice those of a connection if that is more. gRPC refuses some of more than
# that, and all of more than twice as many, without a reason; by default already some of a thousand.
PENDING = 20_000

# Calls that a connection may have at a time beside all streams, which may be those of a gateway; its client holds the
# others back. With a limit gRPC counts calls that were reset and are not yet forgotten, too, and so bounds what one
# connection has waiting.
CALLS_OF_A_CONNECTION = 2_500

# Messages up to this many bytes beyond the limit are read, so that the refusal can have details.
REFUSED_BYTES = 64 * 2**20


class Entrance(Protocol):
    """The way in, of a server that has its handlers."""

    def authenticator(self, tokens: TokenFile | None) -> Callable[[Context], Caller]:
        """What returns the caller of a call, or raises UnauthenticatedError."""

    async def listen(
        self, server: grpc.aio.Server, handlers: Sequence[grpc.GenericRpcHandler], runs: Mapping[str, RunHandler]
    ) -> str:
        """Listen, before `server` is started. Returns the address.

        Args:
            server: the server.
            handlers: the handlers of all methods.
            runs: those of runs of calls, by the paths of their methods.

        Raises:
            OSError: it cannot listen there.
        """

    def say_goodbye(self) -> None:
        """Take no more requests beside those of the server, which refuses its own from now on."""

    async def close(self) -> None:
        """Close what `listen` has opened beside the server, after the last call, and before the server stops."""


class PublicEntrance:
    """The address of the settings, with their certificates and tokens.

    Args:
        settings: the settings.
        shared_port: whether other processes may listen on the same port; each gets some of the connections.

    Raises:
        ValueError: the certificates cannot be used.
    """

    def __init__(self, settings: Settings, *, shared_port: bool = False) -> None:
        tls_context(settings)  # gRPC does not say what is wrong with the files
        self._settings = settings
        self._shared_port = shared_port

    def authenticator(self, tokens: TokenFile | None) -> Callable[[Context], Caller]:
        """Callers are known by their tokens, or without tokens by their addresses."""
        return _anonymous if tokens is None else _bearer(tokens)

    async def listen(self, server: grpc.aio.Server, _handlers: object, _runs: object) -> str:
        """Listen on the host and the port."""
        settings = self._settings
        address = f"{settings.host}:{settings.port}"
        # gRPC does not give the operating system's reason.
        if not self._shared_port and (reason := why_not(settings.host, settings.port)):
            raise OSError(f"cannot listen on {address}: {reason}")
        credentials = _server_credentials(settings)
        port = (
            server.add_insecure_port(address) if credentials is None else server.add_secure_port(address, credentials)
        )
        return f"{settings.host}:{port}"

    def say_goodbye(self) -> None:
        """Nothing beside the server is open."""

    async def close(self) -> None:
        """Nothing beside the server is open."""


def grpc_server(settings: Settings, *, shared_port: bool = False) -> grpc.aio.Server:
    """A server with the limits of the settings, which does not listen yet."""
    calls = settings.max_streams + CALLS_OF_A_CONNECTION
    pending = max(PENDING, 2 * calls)
    return grpc.aio.server(
        options=[
            # gRPC's own refusal of a large message has no details, so its limit is higher than ours.
            ("grpc.max_receive_message_length", settings.max_message_bytes + REFUSED_BYTES),
            ("grpc.max_send_message_length", -1),
            # Otherwise a second server could start on the same port, and receive half of the calls.
            ("grpc.so_reuseport", int(shared_port)),
            ("grpc.keepalive_time_ms", KEEPALIVE),
            ("grpc.keepalive_timeout_ms", KEEPALIVE_TIMEOUT),
            ("grpc.keepalive_permit_without_calls", 1),
            ("grpc.http2.min_ping_interval_without_data_ms", math.ceil(settings.min_ping_interval * 1000)),
            ("grpc.http2.bdp_probe", 0),
            ("grpc.http2.lookahead_bytes", LOOKAHEAD),
            ("grpc.server_handshake_timeout_ms", HANDSHAKE_TIMEOUT),
            ("grpc.max_connection_idle_ms", math.ceil(settings.max_connection_idle * 1000)),
            ("grpc.max_allowed_incoming_connections", settings.max_connections),
            ("grpc.max_concurrent_streams", calls),
            ("grpc.server.max_pending_requests", pending),
            ("grpc.server.max_pending_requests_hard_limit", 2 * pending),
        ]
    )


def tls_context(settings: Settings) -> ssl.SSLContext | None:
    """The certificates of the settings, for servers other than gRPC; None without TLS. Raises ValueError."""
    if settings.tls_cert is None or settings.tls_key is None:
        return None
    return server_context(settings.tls_cert, settings.tls_key, settings.tls_client_ca)


def _server_credentials(settings: Settings) -> grpc.ServerCredentials | None:
    """The certificates of the settings; None without TLS."""
    if settings.tls_cert is None or settings.tls_key is None:
        return None
    return grpc_credentials(settings.tls_cert, settings.tls_key, settings.tls_client_ca)


def grpc_credentials(certificate: Path, key: Path, client_ca: Path | None) -> grpc.ServerCredentials:
    """Certificates as gRPC takes them."""
    authority = None if client_ca is None else client_ca.read_bytes()
    return grpc.ssl_server_credentials(
        [(key.read_bytes(), certificate.read_bytes())], authority, require_client_auth=authority is not None
    )


def _anonymous(_: Context) -> Caller:
    return ANONYMOUS


def _bearer(tokens: TokenFile) -> Callable[[Context], Caller]:
    return lambda context: tokens.authenticate(context.invocation_metadata() or ())
