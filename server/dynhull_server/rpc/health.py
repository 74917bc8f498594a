"""Health by gRPC's own protocol, which needs no token: so it must cost nothing."""

import asyncio
import time
from typing import Any
from weakref import WeakValueDictionary

from grpc_health.v1 import health_pb2

from ..state.errors import LimitExceededError
from .calls import Call
from .places import Places
from .status import ServiceUnknownError

# A request is a name. gRPC tells no message's size before it has all of it in memory: so of each address one request is
# read at a time, and what is not there at once is refused.
MAX_BYTES = 4096
READ_SECONDS = 0.025
# A loop that was late may not have looked for the message: so many times it gets the time again.
LATE = 20


class Health:
    """What is told of each service, and those who are told when it changes.

    Args:
        places: for calls that wait.
    """

    def __init__(self, places: Places) -> None:
        self._places = places
        self._statuses: dict[str, health_pb2.HealthCheckResponse.ServingStatus] = {}
        self._changed = asyncio.Event()
        self._reading: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()

    def set(self, status: health_pb2.HealthCheckResponse.ServingStatus, *services: str) -> None:
        """Tell this of the services from now on."""
        self._statuses.update(dict.fromkeys(services, status))
        self._changed.set()
        self._changed = asyncio.Event()

    def stop(self) -> None:
        """Tell of all services that they do not serve."""
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
            told = None
            while True:
                changed = self._changed
                status = self._statuses.get(service, health_pb2.HealthCheckResponse.SERVICE_UNKNOWN)
                if status != told:
                    await call.write(health_pb2.HealthCheckResponse(status=status))
                told = status
                await changed.wait()

    async def _request(self, call: Call) -> Any:
        async with self._reading.setdefault(call.owner, asyncio.Lock()):
            reading = asyncio.create_task(call.receive())
            try:
                for _ in range(LATE):
                    begun = time.monotonic()
                    # Not `timeout`: a request may be there at the same moment as the time is over.
                    await asyncio.wait([reading], timeout=READ_SECONDS)
                    if reading.done():
                        return reading.result()
                    if time.monotonic() - begun < 2 * READ_SECONDS:
                        break
                raise LimitExceededError("max_message_bytes", MAX_BYTES)
            finally:
                reading.cancel()
