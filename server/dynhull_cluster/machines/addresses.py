"""How the owners of partitions are reached, by gateways and by each other: at the addresses that the tables have."""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol, cast

import grpc

from dynhull_server.certificates import peer_context
from dynhull_server.rpc.status import RelayedError
from dynhull_server.state.errors import words

from ..callers import PROOF, Metadata
from ..versions import Versions, apart, own_versions
from ..ways import OPTIONS, PATIENCE, F, keep_alive, pings
from .board import Owner, Tables
from .entrance import proof_of
from .joining import server_of

# Seconds to connect to an owner.
CONNECT_SECONDS = 2.0
# Seconds until the log says why an owner cannot be reached: longer than a lease of one that has died.
NOTE_SECONDS = 8.0

log = logging.getLogger(__name__)


@dataclass(slots=True)
class _Failed:
    """Since when an owner cannot be reached, and the last reason that the log has."""

    since: float
    reason: str = ""


class _Place(NamedTuple):
    """Where the owner of an epoch is reached: at a host, with a port for gRPC and one for frames."""

    epoch: int
    worker: str
    host: str
    port: int
    frames_port: int


class VersionsApartError(OSError):
    """An owner and this server have no version of their protocol in common."""


class _Greets(Protocol):
    theirs: Versions

    async def greet(self, greeting: bytes) -> None: ...

    def ping(self, seconds: float) -> None: ...


class Addresses:
    """The ways to all partitions.

    Args:
        secret: what processes of the cluster know each other by.
        ca: the certificate that has signed those of the workers; None where they have none.
        ping_interval: seconds between questions whether an owner is still there.
        server: the server whose owners are called, and no others; empty for those of all.
    """

    takeover = PATIENCE

    def __init__(self, secret: str, ca: Path | None, ping_interval: float, server: str = "") -> None:
        self._secret = secret
        self._server = server
        self._ping_interval = ping_interval
        self._options = [*OPTIONS, *pings(ping_interval)]
        self._tls = None if ca is None else peer_context(ca)
        self._credentials = None if ca is None else grpc.ssl_channel_credentials(ca.read_bytes())
        self._known: dict[int, _Place] = {}
        self._moved: dict[int, Callable[[], None]] = {}
        self._failed: dict[int, _Failed] = {}

    def learn(self, tables: Tables) -> None:
        """Follow the owners; one that is away for the moment keeps its address, until another one has the partition.

        One that is not connected to the database is not called: it may be the owner in the one that this is a copy of.
        """
        for partition, owner in tables.owners.items():
            place = None if self._server not in ("", server_of(owner.worker)) else _place_of(owner)
            if place is None or not owner.connected or self._known.get(partition) == place:
                continue
            self._known[partition] = place
            if partition in self._moved:
                self._moved[partition]()

    async def connect(self, worker: int, make: Callable[[], F]) -> F:
        """Connect to the owner of a partition, and prove to be of the cluster. Raises OSError."""
        place = self._at(worker)
        try:
            frames = await self._connect(worker, make, place)
        except OSError as error:
            self._note_failure(worker, error)
            raise
        if (failed := self._failed.pop(worker, None)) is not None and failed.reason:
            log.info("the owner of a partition can be reached again", extra={"partition": worker})
        return frames

    async def _connect(self, worker: int, make: Callable[[], F], place: _Place) -> F:
        name = place.host if self._tls is not None else None
        async with asyncio.timeout(CONNECT_SECONDS):
            transport, frames = await asyncio.get_running_loop().create_connection(
                make, place.host, place.frames_port, ssl=self._tls, server_hostname=name
            )
            keep_alive(transport.get_extra_info("socket"))
            greets = cast("_Greets", frames)
            try:
                await greets.greet(proof_of(worker, place.worker, self._secret).encode())
            except BaseException as error:
                transport.abort()
                if not own_versions().meet(greets.theirs):
                    raise VersionsApartError(apart(place.worker, greets.theirs)) from None
                if isinstance(error, RelayedError):
                    raise OSError("another one listens there now") from None
                raise
        if self._at(worker) != place:
            transport.abort()
            raise OSError(f"partition {worker} has moved meanwhile")
        greets.ping(self._ping_interval)
        return frames

    def _note_failure(self, partition: int, error: OSError) -> None:
        """Say why the owner of a partition cannot be reached, once that is not for a moment."""
        now = asyncio.get_running_loop().time()
        failed = self._failed.setdefault(partition, _Failed(now))
        lasts = now > failed.since + NOTE_SECONDS or isinstance(error, VersionsApartError)
        if lasts and words(error) != failed.reason:
            failed.reason = words(error)
            place = self._known[partition]
            address = f"{bracketed(place.host)}:{place.frames_port}"
            extra = {"partition": partition, "address": address, "reason": failed.reason}
            log.warning("the owner of a partition cannot be reached", extra=extra)

    def channel(self, worker: int) -> Any:
        """A new channel to the owner of a partition."""
        place = self._at(worker)
        address = f"{bracketed(place.host)}:{place.port}"
        if self._credentials is None:
            return grpc.aio.insecure_channel(address, options=self._options)
        return grpc.aio.secure_channel(address, self._credentials, options=self._options)

    def proof(self, worker: int) -> Metadata:
        """What proves to the owner of a partition that this is a gateway."""
        return ((PROOF, proof_of(worker, self._at(worker).worker, self._secret)),)

    def when_moved(self, worker: int, moved: Callable[[], None]) -> None:
        """Have a function called when a partition has another owner, or its owner another address."""
        self._moved[worker] = moved

    def _at(self, partition: int) -> _Place:
        """Where the owner of a partition is reached. Raises OSError."""
        if partition not in self._known:
            raise OSError(f"nobody serves partition {partition}")
        return self._known[partition]


def _place_of(owner: Owner) -> _Place | None:
    """Where an owner is reached; None of one that has gone, or does not listen for others, or not yet."""
    if owner.free or " " not in owner.address:  # one address is that for callers, of a server of before
        return None
    host, port, frames_port = owner.address.rsplit(" ", 2)
    return _Place(owner.epoch, owner.worker, host, int(port), int(frames_port))


def bracketed(host: str) -> str:
    """A host as it stands before a colon and a port."""
    return f"[{host}]" if ":" in host and not host.startswith("[") else host
