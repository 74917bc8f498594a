"""A gRPC server with the hull service, health, reflection, metrics and the background scrub."""

import asyncio
import logging
import os
import sys
from collections.abc import Callable
from functools import partial

import grpc
from grpc_health.v1 import health, health_pb2, health_pb2_grpc
from grpc_reflection.v1alpha import reflection
from prometheus_client import start_http_server

from .engine.engine import Engine
from .engine.live_hull import LiveHull
from .engine.scrub import Scrub
from .engine.supervisor import Supervisor
from .engine.threads import Machine
from .engine.verification import Verification
from .rpc.access import EVERYTHING, Access, TokenFile
from .rpc.calls import Calls, Context
from .rpc.hull_service import HullService
from .rpc.methods import DESCRIPTOR, method_handlers
from .rpc.metrics import Metrics, StateCollector
from .settings import Settings
from .state.limits import Limits
from .storage.durability import Durability
from .storage.memory import MemoryStorage
from .storage.port import Storage
from .storage.sqlite.storage import SQLiteStorage

SERVICE = DESCRIPTOR.full_name
# SERVING until the scrub finds a hull that differs from Chan's algorithm.
SCRUB = "dynhull.v1.scrub"

SERVING = health_pb2.HealthCheckResponse.SERVING
NOT_SERVING = health_pb2.HealthCheckResponse.NOT_SERVING

# Seconds for statuses to reach clients. A client that has stopped reading does not hold up the end.
LAST_WORDS = 1.0
# Milliseconds between signs of life on a quiet connection, and until one without an answer is given up.
KEEPALIVE, KEEPALIVE_TIMEOUT = 60_000, 20_000

# A message of so many bytes beyond the limit is read, to be refused with details.
REFUSED_BYTES = 64 * 2**20

# Seconds between syncs where commits are not durable by themselves: with the sync itself, less than the tenth of a
# second after which an acknowledged batch survives a power failure.
SYNC_SECONDS = 0.05

log = logging.getLogger(__name__)


class Server:
    """Serves from `start` until `drain` has returned.

    Attributes:
        address: host:port it listens on, once started.
        metrics_address: host:port for Prometheus; empty for none.
    """

    def __init__(self, settings: Settings) -> None:
        self._settings = settings
        self._machine = machine = Machine()
        self._supervisor = Supervisor(machine.clock, self._well_or_not, _end_process)
        limits = Limits(
            max_hulls=settings.max_hulls,
            max_points=settings.max_points,
            max_producers=settings.max_producers,
            max_producers_per_caller=settings.max_producers_per_caller,
            history_bytes=settings.history_bytes,
        )
        self._engine = Engine(limits, _storage(settings), self._supervisor, machine)
        self._metrics = Metrics()
        authenticate = _anonymous if settings.tokens is None else _bearer(TokenFile(settings.tokens))
        self._calls = Calls(authenticate, self._metrics, settings.max_message_bytes, settings.max_streams)
        self._health = health.aio.HealthServicer()
        self._server = grpc.aio.server(
            options=[
                # gRPC's own refusal of a message has no details. So ours comes first, but for the very largest.
                ("grpc.max_receive_message_length", settings.max_message_bytes + REFUSED_BYTES),
                ("grpc.max_send_message_length", -1),
                # Otherwise a second server on the port would start, and take half of the calls.
                ("grpc.so_reuseport", 0),
                ("grpc.keepalive_time_ms", KEEPALIVE),
                ("grpc.keepalive_timeout_ms", KEEPALIVE_TIMEOUT),
            ]
        )
        self._telling: asyncio.Task[None] | None = None
        self._stop_metrics: Callable[[], None] = lambda: None
        self._serving = False
        self._well = True
        self.address = ""
        self.metrics_address = ""

    async def start(self, progress: Callable[[int, int], None]) -> None:
        """Listen, take up what is stored, then serve. Meanwhile calls are told so, and health is NOT_SERVING.

        Args:
            progress: called with the hulls taken up and the hulls in all.

        Raises:
            RuntimeError: the address is taken or is none of this machine's.
            StorageError: the stored data cannot be used.
        """
        service = HullService(
            self._engine,
            self._metrics,
            create_on_write=self._settings.create_on_write,
            max_watch_lag=self._settings.max_watch_lag,
        )
        self._server.add_generic_rpc_handlers((method_handlers(service, self._calls),))
        health_pb2_grpc.add_HealthServicer_to_server(self._health, self._server)
        reflection.enable_server_reflection((SERVICE, health.SERVICE_NAME, reflection.SERVICE_NAME), self._server)
        port = self._listen()
        self.address = f"{self._settings.host}:{port}"
        self._serve_metrics()
        await self._health.set("", NOT_SERVING)
        await self._health.set(SERVICE, NOT_SERVING)
        await self._server.start()
        for note in await self._engine.start(progress):
            log.warning("lost", extra={"what": note})
        self._calls.ready()
        await self._health.set(SCRUB, SERVING)
        self._serving = True
        self._well_or_not(None)
        if not self._settings.in_memory:
            interval = SYNC_SECONDS if self._settings.durability is Durability.INTERVAL else None
            self._engine.keep_house(self._settings.snapshot_points, interval)
        if self._settings.scrub_cpu:
            scrub = Scrub(self._engine, self._machine.clock, self._settings.scrub_cpu, self._compared)
            self._supervisor.every(self._settings.scrub_pause, "scrub", partial(self._scrub, scrub))
        log.info("serving", extra={"address": self.address})

    async def drain(self) -> None:
        """Refuse new calls, end those that wait, and give the others the settings' grace to finish."""
        log.info("draining")
        await self._health.enter_graceful_shutdown()
        self._serving = False
        await self._supervisor.stop()
        await self._calls.drain(self._settings.grace)
        await self._server.stop(LAST_WORDS)
        self._stop_metrics()
        await self._engine.close()
        log.info("stopped")

    async def _scrub(self, scrub: Scrub) -> None:
        await scrub.round()
        self._metrics.scrub_round()

    def _well_or_not(self, reason: str | None) -> None:
        """Tell health checks. Only the last word counts, and words come one after the other."""
        self._well = reason is None
        if self._telling is None or self._telling.done():
            self._telling = asyncio.get_running_loop().create_task(self._tell_health())

    async def _tell_health(self) -> None:
        told = None
        while self._serving and told is not self._well:
            told = self._well
            for name in ("", SERVICE):
                await self._health.set(name, SERVING if told else NOT_SERVING)

    def _listen(self) -> int:
        address = f"{self._settings.host}:{self._settings.port}"
        settings = self._settings
        if settings.tls_cert is None or settings.tls_key is None:
            return self._server.add_insecure_port(address)
        client_ca = None if settings.tls_client_ca is None else settings.tls_client_ca.read_bytes()
        credentials = grpc.ssl_server_credentials(
            [(settings.tls_key.read_bytes(), settings.tls_cert.read_bytes())],
            client_ca,
            require_client_auth=client_ca is not None,
        )
        return self._server.add_secure_port(address, credentials)

    def _serve_metrics(self) -> None:
        if self._settings.metrics_port is None:
            return
        registry = self._metrics.registry
        registry.register(StateCollector(self._engine, self._metrics, self._supervisor, asyncio.get_running_loop()))
        host, port = self._settings.metrics_host, self._settings.metrics_port
        try:
            server, thread = start_http_server(port, host, registry)
        except OSError as error:
            raise OSError(f"no metrics on {host}:{port}: {error.strerror}") from None
        self.metrics_address = f"{host}:{server.server_port}"

        def stop() -> None:
            server.shutdown()
            server.server_close()
            thread.join()

        self._stop_metrics = stop

    def _compared(self, hull: LiveHull, outcome: Verification) -> None:
        equal = outcome.difference is None
        self._metrics.verified("scrub", equal, outcome.seconds)
        if not equal:
            log.error(
                "a hull differs from Chan's algorithm", extra={"hull": hull.name, "difference": outcome.difference}
            )
            asyncio.get_running_loop().create_task(self._health.set(SCRUB, NOT_SERVING))


def _storage(settings: Settings) -> Storage:
    if settings.in_memory:
        return MemoryStorage(forgets=True)
    return SQLiteStorage(settings.data, settings.durability)


def _end_process(reason: str) -> None:
    """What is acknowledged is kept. The rest cannot be relied on: whoever runs the server starts it again."""
    print(f"the server ends: {reason}", file=sys.stderr, flush=True)  # noqa: T201  # logging may be what is broken
    os._exit(os.EX_SOFTWARE)


def _anonymous(_: Context) -> Access:
    return EVERYTHING


def _bearer(tokens: TokenFile) -> Callable[[Context], Access]:
    return lambda context: tokens.access(dict(context.invocation_metadata() or ()))
