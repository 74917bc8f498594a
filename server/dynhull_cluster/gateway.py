"""A gateway: it takes the calls of the public address, and passes them to the workers."""

import asyncio
import logging
from contextlib import suppress
from functools import partial
from typing import Any

import grpc
from google.protobuf.descriptor import MethodDescriptor, ServiceDescriptor
from grpc_health.v1 import health_pb2

from dynhull_server.app import SCRUB, SERVICES, end_process, token_file
from dynhull_server.engine.supervisor import Supervisor
from dynhull_server.engine.threads import Clock
from dynhull_server.entrance import PublicEntrance, grpc_server
from dynhull_server.rpc.access import LOOK_SECONDS
from dynhull_server.rpc.calls import Calls, UnaryHandler, Work
from dynhull_server.rpc.health import Health
from dynhull_server.rpc.many import ManyQuotas
from dynhull_server.rpc.methods import (
    FINISHED,
    OWN_SERVICES,
    UnknownMethods,
    health_handlers,
    reflection_handlers,
)
from dynhull_server.rpc.metrics import CallCollector, Metrics
from dynhull_server.rpc.places import Places, Unread
from dynhull_server.settings import Settings

from . import worker_link
from .composed import Composed
from .merged_consumers import MergedConsumers
from .merged_feeds import FEED, MergedFeeds
from .relay import Relay, Route, within
from .shared_fences import WATCH_FENCE, SharedFences
from .shared_many import WATCH_MANY, SharedMany
from .shared_watches import WATCH, SharedWatches
from .ways import Ways
from .worker_link import WorkerLink

# The health of one worker is that of the service with this name and its number.
WORKER = "dynhull.v1.worker"
# Seconds that a worker may be away, as when it is restarted, before the health of the whole says so.
AWAY_SECONDS = 30.0
# Seconds that a gateway looks for all workers before it serves some.
FIRST_SECONDS = 5.0
# Seconds at a shutdown for clients to hear of it. What they send before is refused as not begun, so that they send it
# elsewhere; when gRPC ends a connection before that, they cannot know. Others serve meanwhile.
GOODBYES = 5.0
WHOLE = ""

SERVING = health_pb2.HealthCheckResponse.SERVING
NOT_SERVING = health_pb2.HealthCheckResponse.NOT_SERVING

log = logging.getLogger(__name__)


class Gateway:
    """Serves from `start` until `drain` has returned.

    Args:
        settings: the settings; the port is one that gateways share.
        workers: the number of the workers.
        ways: where they are.

    Attributes:
        address: the host:port it listens on, once started.
        registry: its metrics.
    """

    def __init__(self, settings: Settings, workers: int, ways: Ways) -> None:
        self._settings = settings
        self._clock = Clock()
        self._supervisor = Supervisor(self._clock, lambda _: self._update_health(), end_process)
        self._tokens = token_file(settings)
        self._entrance = PublicEntrance(settings, shared_port=True)
        metrics = self._metrics = Metrics()
        self.registry = metrics.registry
        streams = Places("max_streams", settings.max_streams, settings.max_streams_per_caller)
        unread = Unread(settings.max_unread_bytes_per_caller)
        authenticate = self._entrance.authenticator(self._tokens)
        self._calls = Calls(authenticate, metrics, settings.max_message_bytes, streams, unread)
        self._health = Health(
            Places("max_health_calls", settings.max_health_calls, settings.max_health_calls_per_caller)
        )
        self._away_since: dict[int, float | None] = dict.fromkeys(range(workers))
        self._relay = Relay(self._links_to(workers, ways), settings.max_watch_lag)
        self._composed = Composed(self._relay, settings.max_fence_corners)
        self._watches = SharedWatches(self._relay, metrics)
        self._many = SharedMany(self._relay, metrics, ManyQuotas(settings))
        self._fences = SharedFences(self._relay, metrics)
        self._feeds = MergedFeeds(self._relay, metrics)
        self._consumers = MergedConsumers(self._relay)
        self._server = grpc_server(settings, shared_port=True)
        self._serving = False
        self._all_well = asyncio.Event()
        self.address = ""

    async def start(self) -> None:
        """Listen, and look for the workers. Calls to a worker that is away get UNAVAILABLE.

        Raises:
            OSError: it cannot listen.
        """
        handlers = (
            *(self._handlers(service) for service in OWN_SERVICES),
            health_handlers(self._health, self._calls),
            reflection_handlers(self._calls),
            UnknownMethods(self._calls),
        )
        self._server.add_generic_rpc_handlers(handlers)
        self.address = await self._entrance.listen(self._server, handlers, {})
        self.registry.register(CallCollector(self._metrics, asyncio.get_running_loop()))
        self._health.set(NOT_SERVING, WHOLE, *SERVICES, SCRUB)
        self._calls.ready()
        self._serving = True
        self._run_links()
        self._supervisor.every(1.0, "health", self._look)
        if self._tokens is not None:
            self._tokens.changed = partial(self._calls.recheck, self._tokens.known)
            self._supervisor.every(LOOK_SECONDS, "tokens", self._tokens.run)
        await self._server.start()
        with suppress(TimeoutError):  # a gateway that is restarted serves without a worker that is away
            async with asyncio.timeout(FIRST_SECONDS):
                await self._all_well.wait()
        log.info("serving", extra={"address": self.address})

    def divide(self, workers: int, ways: Ways) -> None:
        """Have another number of workers from now on. Calls that wait for those before go to the new ones."""
        before, self._relay.links = self._relay.links, self._links_to(workers, ways)
        # They have half a minute to come, as workers that have served.
        self._away_since = dict.fromkeys(range(workers), self._clock.monotonic())
        for link in before:
            link.retire()
        self._run_links()

    async def drain(self) -> None:
        """Refuse new calls, end waiting ones, and give the others the configured grace period to finish."""
        served, self._serving = self._serving, False
        if served:  # one that could not start has its error to say, and nothing else
            log.info("draining")
        self._health.stop()
        # At once, so that callers connect to another gateway, and not when the last call has ended.
        stopping = asyncio.create_task(self._server.stop(self._settings.grace + GOODBYES))
        await self._calls.drain(self._settings.grace)
        await self._server.stop(GOODBYES)
        await stopping
        await self._supervisor.stop()
        for link in self._relay.links:
            await link.close()
        if served:
            log.info("stopped")

    def _links_to(self, workers: int, ways: Ways) -> list[WorkerLink]:
        return [WorkerLink(number, ways, (WHOLE, SCRUB), self._update_health) for number in range(workers)]

    def _run_links(self) -> None:
        for link in self._relay.links:
            self._supervisor.every(worker_link.LOOK_SECONDS, f"worker-{link.number}", link.run)

    def _handlers(self, service: ServiceDescriptor) -> grpc.GenericRpcHandler:
        handlers = {}
        for method in service.methods:
            handle = self._calls.handler(method.name, self._calls.admit, self._work(service, method))
            received = within(self._settings.max_message_bytes)
            if method.client_streaming or method.server_streaming:  # the relay writes what the worker answers
                made: Any = grpc.stream_stream_rpc_method_handler(handle, request_deserializer=received)
            else:
                made = grpc.stream_unary_rpc_method_handler(UnaryHandler(handle), request_deserializer=received)
            handlers[method.name] = made
        return grpc.method_handlers_generic_handler(service.full_name, handlers)

    def _work(self, service: ServiceDescriptor, method: MethodDescriptor) -> Work:
        path = f"/{service.full_name}/{method.name}"
        if path in self._composed.works:
            return self._composed.works[path]
        if path in self._consumers.works:
            return self._consumers.works[path]
        if path == WATCH:
            return self._watches.watch
        if path == WATCH_MANY:
            return self._many.watch
        if path == FEED:
            return self._feeds.feed
        if path == WATCH_FENCE:
            return self._fences.watch
        if method.client_streaming:
            return partial(self._relay.write, path)
        if method.server_streaming:
            return partial(self._relay.read, path)
        route: Route = self._composed.routes.get(path, self._relay.route)
        return partial(self._relay.ask, path, method.name in FINISHED, route)

    async def _look(self) -> None:
        """Notice that a worker has been away for too long."""
        self._update_health()

    def _update_health(self) -> None:
        if not self._serving:
            return
        well = self._supervisor.reason is None
        scrubbed = True
        for link in self._relay.links:
            self._health.set(link.health[WHOLE] or NOT_SERVING, f"{WORKER}/{link.number}")
            well &= self._well(link)
            scrubbed &= link.health[SCRUB] != NOT_SERVING
        self._health.set(SERVING if well else NOT_SERVING, WHOLE, *SERVICES)
        if well:
            self._all_well.set()
        self._health.set(SERVING if scrubbed else NOT_SERVING, SCRUB)

    def _well(self, link: WorkerLink) -> bool:
        """Whether a worker serves, or did so half a minute ago and is away since."""
        now = self._clock.monotonic()
        if link.health[WHOLE] == SERVING:
            self._away_since[link.number] = now
            return True
        served = self._away_since[link.number]
        return not link.present and served is not None and now - served < AWAY_SECONDS
