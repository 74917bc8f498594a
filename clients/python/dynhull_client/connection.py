"""Channels to a server."""

from collections.abc import Sequence
from typing import Any

import grpc

MAX_MESSAGE_BYTES = 2**31 - 1


def open_channel(address: str, token: str | None, tls: grpc.ChannelCredentials | None) -> grpc.Channel:
    """A channel that shows the token, if any, with each call."""
    # The server's limit is the one that counts.
    options = [
        ("grpc.max_receive_message_length", MAX_MESSAGE_BYTES),
        ("grpc.max_send_message_length", MAX_MESSAGE_BYTES),
    ]
    channel = grpc.insecure_channel(address, options) if tls is None else grpc.secure_channel(address, tls, options)
    return channel if token is None else grpc.intercept_channel(channel, _ShowToken(token))


class _Details(grpc.ClientCallDetails):
    def __init__(self, details: Any, metadata: Sequence[tuple[str, str]]) -> None:
        self.method = details.method
        self.timeout = details.timeout
        self.metadata = tuple(metadata)
        self.credentials = details.credentials
        self.wait_for_ready = details.wait_for_ready
        self.compression = details.compression


class _ShowToken(
    grpc.UnaryUnaryClientInterceptor,
    grpc.UnaryStreamClientInterceptor,
    grpc.StreamUnaryClientInterceptor,
    grpc.StreamStreamClientInterceptor,
):
    """Call credentials would do the same, but gRPC sends them over TLS only, and a local server needs none of that."""

    def __init__(self, token: str) -> None:
        self._entry = ("authorization", f"Bearer {token}")

    def _intercept(self, continuation: Any, client_call_details: Any, request: Any) -> Any:
        details = _Details(client_call_details, [*(client_call_details.metadata or ()), self._entry])
        return continuation(details, request)

    intercept_unary_unary: Any = _intercept
    intercept_unary_stream: Any = _intercept
    intercept_stream_unary: Any = _intercept
    intercept_stream_stream: Any = _intercept
