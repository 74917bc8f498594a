"""How a gateway reaches a worker: through a socket on its machine, or through the network."""

import asyncio
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
