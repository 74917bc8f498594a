"""A gRPC server with the hull service, health and reflection."""

from dataclasses import dataclass

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from ..engine.hulls import Engine
from .calls import Calls
from .hull_service import HullService
from .methods import DESCRIPTOR, method_handlers

SERVICE = DESCRIPTOR.full_name

# Seconds for statuses to reach clients. A client that has stopped reading does not hold up the end.
LAST_WORDS = 1.0


@dataclass(frozen=True, slots=True)
class Settings:
    """How to serve.

    Attributes:
        host: address to listen on.
        port: 0 for a free one.
        max_message_bytes: the largest message taken or sent.
        max_hulls: how many hulls there may be.
    """

    host: str
    port: int
    max_message_bytes: int
    max_hulls: int


class Server:
    """Serves from `start` until `drain` has returned.

    Attributes:
        address: host:port it listens on, once started.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._engine = Engine(settings.max_hulls)
        self._calls = Calls()
        self._health = health.aio.HealthServicer()
        # Without so_reuseport=0 a second server on the port would start, and take half of the calls.
        self._server = grpc.aio.server(
            options=[
                ("grpc.max_receive_message_length", settings.max_message_bytes),
                ("grpc.max_send_message_length", settings.max_message_bytes),
                ("grpc.so_reuseport", 0),
            ]
        )
        self.address = ""

    async def start(self) -> None:
        """Listen. Raises RuntimeError where the address is taken or is none of this machine's."""
        self._server.add_generic_rpc_handlers((method_handlers(HullService(self._engine, self._calls)),))
        health_pb2_grpc.add_HealthServicer_to_server(self._health, self._server)
        reflection.enable_server_reflection((SERVICE, health.SERVICE_NAME, reflection.SERVICE_NAME), self._server)
        port = self._server.add_insecure_port(f"{self._settings.host}:{self._settings.port}")
        self.address = f"{self._settings.host}:{port}"
        await self._health.set(SERVICE, health_pb2.HealthCheckResponse.SERVING)
        await self._server.start()

    async def drain(self, grace: float) -> None:
        """Refuse new calls, end those that wait, and give the others `grace` seconds to finish."""
        await self._health.enter_graceful_shutdown()
        await self._calls.drain(grace)
        await self._server.stop(LAST_WORDS)
        self._engine.close()
