"""How a gateway reaches a worker: through a socket on its machine, or through the network."""

import asyncio
import math
import socket
from collections.abc import Callable
from typing import Any, Protocol, TypeVar

from .callers import Metadata

# Seconds that a call waits for a worker that is away: somewhat longer than a lease lasts, and most restarts.
PATIENCE = 10.0
OPTIONS = [
    ("grpc.max_receive_message_length", -1),
    ("grpc.max_send_message_length", -1),
    ("grpc.initial_reconnect_backoff_ms", 50),
    ("grpc.min_reconnect_backoff_ms", 2000),  # the time that an attempt has at least
    ("grpc.max_reconnect_backoff_ms", 500),
    ("grpc.http2.lookahead_bytes", 2**20),
    ("grpc.http2.bdp_probe", 0),
    ("grpc.use_local_subchannel_pool", 1),
]
# With them the operating system notices a machine that does not answer any more within some seconds.
SOCKET_OPTIONS = [
    (socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1),
    *(
        (socket.IPPROTO_TCP, getattr(socket, name), value)
        for name, value in {
            "TCP_KEEPIDLE": 5,
            "TCP_KEEPINTVL": 2,
            "TCP_KEEPCNT": 3,
            "TCP_USER_TIMEOUT": 10_000,
        }.items()
        if hasattr(socket, name)
    ),
]

F = TypeVar("F", bound=asyncio.Protocol)


class Ways(Protocol):
    """The ways to all workers, by number.

    Attributes:
        takeover: the seconds in which a worker that has ended is replaced by another one; 0 where there is no other.
    """

    takeover: float

    async def connect(self, worker: int, make: Callable[[], F]) -> F:
        """Connect for frames. Raises OSError."""

    def channel(self, worker: int) -> Any:
        """A new channel for gRPC, to where `connect` has just led."""

    def proof(self, worker: int) -> Metadata:
        """The metadata that let the worker believe what a gateway says of its callers."""

    def when_moved(self, worker: int, moved: Callable[[], None]) -> None:
        """Have a function called whenever the worker is elsewhere."""


def pings(seconds: float) -> list[tuple[str, int]]:
    """The options of channels that ping at this interval, and are lost when a ping has no answer for as long."""
    milliseconds = math.ceil(seconds * 1000)
    return [
        ("grpc.keepalive_time_ms", milliseconds),
        ("grpc.keepalive_timeout_ms", milliseconds),
        ("grpc.http2.ping_timeout_ms", milliseconds),
        ("grpc.keepalive_permit_without_calls", 1),
        ("grpc.http2.max_pings_without_data", 0),
    ]


def keep_alive(connected: socket.socket) -> None:
    """Notice a machine that does not answer any more within some seconds."""
    for level, option, value in SOCKET_OPTIONS:
        connected.setsockopt(level, option, value)
