"""A gRPC server with the hull service, health and reflection."""

from dataclasses import dataclass

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection

from dynhull_proto.v1 import hull_service_pb2, hull_service_pb2_grpc

from ..engine.hulls import Engine
from .calls import Calls
from .hull_service import HullService

SERVICE: str = hull_service_pb2.DESCRIPTOR.services_by_name["HullService"].full_name


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
        hull_service_pb2_grpc.add_HullServiceServicer_to_server(HullService(self._engine, self._calls), self._server)
        health_pb2_grpc.add_HealthServicer_to_server(self._health, self._server)
        reflection.enable_server_reflection((SERVICE, health.SERVICE_NAME, reflection.SERVICE_NAME), self._server)
        port = self._server.add_insecure_port(f"{self._settings.host}:{self._settings.port}")
        self.address = f"{self._settings.host}:{port}"
        await self._health.set(SERVICE, health_pb2.HealthCheckResponse.SERVING)
        await self._server.start()

    async def drain(self, grace: float) -> None:
        """Refuse new calls, end those that wait, and give the others `grace` seconds to finish."""
        await self._health.enter_graceful_shutdown()
        self._calls.drain()
        await self._server.stop(grace)
        self._engine.close()
