"""The interface of what serves hulls in one kind of storage."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, NamedTuple, Protocol

from prometheus_client import CollectorRegistry

from dynhull_server.process import Alone

# The first message of the supervisor to a process.
Begin = Mapping[str, Any]


class Serving(Protocol):
    """Serves from `start` until `drain` has returned."""

    address: str
    registry: CollectorRegistry

    async def start(self) -> None:
        """Serve."""

    async def drain(self) -> None:
        """End the calls in progress, and stop."""


class Shared(NamedTuple):
    """What the processes of a server share.

    Attributes:
        begin: what each of them has to know.
        complete: called when all of them serve.
    """

    begin: dict[str, Any]
    complete: Callable[[], None] = lambda: None


class StorageKind(Protocol):
    """Makes what the processes of a server serve, for the settings it was made with.

    Attributes:
        preloads: the modules that workers and gateways run; what is not installed is left out.
    """

    preloads: Sequence[str]

    def alone(self) -> Alone:
        """What the only process of a server serves.

        Raises:
            StorageError: the storage cannot be used.
            ValueError: the address is invalid, or a package is missing.
        """

    def shared(self) -> AbstractContextManager[Shared]:
        """Hold, in the supervisor, what workers and gateways are about to share.

        Raises:
            StorageError: the storage cannot be used.
        """

    async def worker(self, number: int, begin: Begin) -> Serving:
        """What a worker serves. Raises as `alone`."""

    async def gateway(self, begin: Begin) -> Serving:
        """What a gateway serves. Raises as `alone`."""
