"""Health checks by gRPC's protocol. They need no token, so they must be cheap."""

import asyncio
import time
from typing import Any
from weakref import WeakValueDictionary

from grpc_health.v1 import health_pb2

from ..state.errors import LimitExceededError
from .calls import Call
from .places import Places
from .status import ServiceUnknownError

# A request is a name. gRPC reads a whole message into memory before its size is known. Therefore only one request per
# address is read at a time, and a request that does not arrive soon is refused: a probe on a busy machine may be late.
MAX_BYTES = 4096
READ_SECONDS = 0.5
# A delayed event loop may not have read a message that has arrived: it gets the time again, at most this many times.
LATE = 20


class Health:
    """The status of each service, and the calls that watch it.

    Args:
        places: limits the calls in progress.
    """

    def __init__(self, places: Places) -> None:
        self._places = places
        self._statuses: dict[str, health_pb2.HealthCheckResponse.ServingStatus] = {}
        self._changed = asyncio.Event()
        self._reading: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()

    def set(self, status: health_pb2.HealthCheckResponse.ServingStatus, *services: str) -> None:
        """Set the status of services."""
        self._statuses.update(dict.fromkeys(services, status))
        self._changed.set()
        self._changed = asyncio.Event()

    def stop(self) -> None:
        """Set all services to NOT_SERVING."""
        self.set(health_pb2.HealthCheckResponse.NOT_SERVING, *self._statuses)

    async def check(self, call: Call) -> bytes:
        """The method Check."""
        with self._places.take(call.owner):
            service = (await self._request(call)).service
        if service not in self._statuses:
            raise ServiceUnknownError(service)
        return call.serialize(health_pb2.HealthCheckResponse(status=self._statuses[service]))

    async def watch(self, call: Call) -> None:
        """The method Watch."""
        with self._places.take(call.owner):
            service = (await self._request(call)).service
            sent = None
            while True:
                changed = self._changed
                status = self._statuses.get(service, health_pb2.HealthCheckResponse.SERVICE_UNKNOWN)
                if status != sent:
                    await call.write(health_pb2.HealthCheckResponse(status=status))
                sent = status
                await changed.wait()

    async def _request(self, call: Call) -> Any:
        async with self._reading.setdefault(call.owner, asyncio.Lock()):
            reading = asyncio.create_task(call.receive())
            try:
                for _ in range(LATE):
                    begun = time.monotonic()
                    # Not asyncio.timeout: the request may arrive at the moment when the time is over.
                    await asyncio.wait([reading], timeout=READ_SECONDS)
                    if reading.done():
                        return reading.result()
                    if time.monotonic() - begun < 2 * READ_SECONDS:
                        break
                raise LimitExceededError("max_message_bytes", MAX_BYTES)
            finally:
                reading.cancel()
