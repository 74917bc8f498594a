"""A gRPC server with the services of hulls and fences, health, reflection, metrics and the background scrub."""

import asyncio
import logging
import os
import sys
from collections.abc import Callable, Sequence
from functools import partial

from grpc_health.v1 import health_pb2
from prometheus_client import CollectorRegistry

from .engine.division import Divisions
from .engine.engine import Engine
from .engine.fence_verification import FenceVerification
from .engine.fences import LiveFence
from .engine.live_hull import LiveHull
from .engine.scrub import Scrub
from .engine.supervisor import Supervisor
from .engine.threads import Machine
from .engine.verification import Verification
from .entrance import Entrance, PublicEntrance, grpc_server, tls_context
from .failure import text_of
from .listening import listening_error
from .rpc.access import LOOK_SECONDS, TokenFile
from .rpc.alarm_service import AlarmService
from .rpc.calls import Calls
from .rpc.fence_service import FenceService
from .rpc.health import Health
from .rpc.hull_families import HullFamilies
from .rpc.hull_service import HullService
from .rpc.many import ManyQuotas
from .rpc.methods import (
    OWN_SERVICES,
    UnknownMethods,
    alarm_handlers,
    fence_handlers,
    health_handlers,
    hull_handlers,
    reflection_handlers,
    run_handlers,
)
from .rpc.metrics import Metrics, StateCollector
from .rpc.metrics_page import MetricsPage
from .rpc.places import Places, Unread
from .settings import Settings, is_loopback
from .state.fences.model.faults import FenceFault
from .state.limits import FenceLimits, Limits
from .storage.durability import Durability
from .storage.port import FollowedStorage, Progress, Storage, StorageError

SERVICES = tuple(service.full_name for service in OWN_SERVICES)
# SERVING until the scrub finds a hull that differs from Chan's algorithm, or a fence that differs from a recomputation.
SCRUB = "dynhull.v1.scrub"

SERVING = health_pb2.HealthCheckResponse.SERVING
NOT_SERVING = health_pb2.HealthCheckResponse.NOT_SERVING

# Seconds for statuses to reach clients at shutdown; a client that does not read must not delay it.
LAST_STATUSES = 1.0
# Of the faults that the scrub finds in a fence, those that are logged.
LOGGED_FAULTS = 10
# Seconds between syncs with `--durability interval`. With the duration of a sync this stays below the tenth of a second
# after which an acknowledged batch survives a power failure.
SYNC_SECONDS = 0.05
# Seconds between looks whether the storage is still this server's.
ENTITLED_SECONDS = 1.0

log = logging.getLogger(__name__)


def _unseen(_done: int, _total: int) -> None:
    """Show no progress."""


class Server:
    """Serves from `start` until `drain` has returned.

    Args:
        settings: the settings.
        storage: what keeps the hulls.
        entrance: how callers reach it; by default, as the settings say.
        divisions: runs hulls over shards; None for a server that has none.

    Attributes:
        address: the host:port it listens on, once started.
        metrics_url: the URL of the metrics page; empty for none.
        registry: its metrics; other threads may read them once it has started.
    """

    def __init__(
        self,
        settings: Settings,
        storage: Storage,
        entrance: Entrance | None = None,
        divisions: Divisions | None = None,
    ) -> None:
        self._settings = settings
        self._entrance = PublicEntrance(settings) if entrance is None else entrance
        self._machine = machine = Machine()
        self._supervisor = Supervisor(machine.clock, lambda _: self._update_health(), end_process)
        limits = Limits(
            max_hulls=settings.max_hulls,
            max_points=settings.max_points,
            max_producers=settings.max_producers,
            max_producers_per_caller=settings.max_producers_per_caller,
            resume_bytes=settings.resume_bytes,
            max_past_rows=settings.max_past_rows,
            max_feed_consumers=settings.max_feed_consumers,
            fences=FenceLimits(
                max_fences=settings.max_fences,
                max_alarms=settings.max_alarms,
                max_alarm_hulls=settings.max_alarm_hulls,
                max_fence_consumers=settings.max_fence_consumers,
                max_fence_events=settings.max_fence_events,
                max_fence_event_age=settings.max_fence_event_age,
                fence_event_bytes=settings.fence_event_bytes,
            ),
        )
        self._storage = storage
        self._engine = Engine(limits, storage, self._supervisor, machine, divisions)
        self._metrics = Metrics()
        self.registry = self._metrics.registry
        self._tokens = token_file(settings)
        authenticate = self._entrance.authenticator(self._tokens)
        streams = Places("max_streams", settings.max_streams, settings.max_streams_per_caller)
        unread = Unread(settings.max_unread_bytes_per_caller)
        self._calls = Calls(authenticate, self._metrics, settings.max_message_bytes, streams, unread, storage.entitled)
        self._health = Health(
            Places("max_health_calls", settings.max_health_calls, settings.max_health_calls_per_caller)
        )
        self._server = grpc_server(settings)
        self._stop_metrics: Callable[[], None] = lambda: None
        self._serving = False
        self._machine_well = True
        self.address = ""
        self.metrics_url = ""

    async def read_ahead(self, storage: FollowedStorage, progress: Progress = _unseen) -> None:
        """Load the hulls while another server owns them; again to load what has come since. `start` is then short.

        Args:
            storage: the storage of this server.
            progress: called with the amount read so far and the total; what it raises ends this.

        Raises:
            RuntimeError, OSError: the address is in use, or does not belong to this machine.
            StorageError: the stored data cannot be used.
        """
        await self.listen()
        await self._engine.read_ahead(storage, progress)

    async def start(self, progress: Progress = _unseen) -> None:
        """Listen, load the stored hulls, then serve. Until then calls get UNAVAILABLE, and health is NOT_SERVING.

        Args:
            progress: called with the number of hulls loaded so far and the total.

        Raises:
            RuntimeError: the address is in use, or does not belong to this machine.
            StorageError: the stored data cannot be used.
        """
        await self.listen()
        for note in await self._engine.start(progress):
            log.warning("lost", extra={"what": note})
        self._calls.ready()
        self._health.set(SERVING, SCRUB)
        self._serving = True
        self._update_health()
        if self._tokens is not None:
            self._tokens.changed = partial(self._calls.recheck, self._tokens.known)
            self._supervisor.every(LOOK_SECONDS, "tokens", self._tokens.run)
        if self._storage.keeps:
            interval = SYNC_SECONDS if self._settings.durability is Durability.INTERVAL else None
            self._engine.keep_house(self._settings.snapshot_points, interval)
        self._engine.let_rest()
        if self._storage.epoch:
            self._supervisor.every(ENTITLED_SECONDS, "lease", self._look_at_lease)
        if self._settings.series_kept and self._settings.series_bytes:
            self._engine.keep_series(self._settings.series_kept, self._settings.series_bytes)
        if self._settings.scrub_cpu:
            engine, cpu = self._engine, self._settings.scrub_cpu
            scrub = Scrub(engine.driver, engine.hulls, engine.fences, cpu, self._compared, self._followed)
            self._supervisor.every(self._settings.scrub_pause, "scrub", partial(self._scrub, scrub))
        log.info("serving", extra={"address": self.address})

    async def listen(self) -> None:
        """Listen, if that has not been done. Until the start, calls get UNAVAILABLE, and health is NOT_SERVING.

        Raises:
            RuntimeError, OSError: the address is in use, or does not belong to this machine.
        """
        if self.address:
            return
        settings = self._settings
        pasts = Places("max_past_reads", settings.max_past_reads, settings.max_past_reads_per_caller)
        service = HullService(
            self._engine.driver,
            self._engine.hulls,
            self._metrics,
            ManyQuotas(self._settings),
            pasts,
            Places("max_replays", self._settings.max_replays, self._settings.max_replays_per_caller),
            Places("max_feeds", self._settings.max_feeds, self._settings.max_feeds_per_caller),
            create_on_write=self._settings.create_on_write,
            max_watch_lag=self._settings.max_watch_lag,
        )
        fences = FenceService(
            self._engine.fences,
            self._engine.past_fences,
            pasts,
            self._metrics,
            max_corners=self._settings.max_fence_corners,
            max_watch_lag=self._settings.max_watch_lag,
        )
        alarms = AlarmService(self._engine.alarms, self._metrics, max_watch_lag=self._settings.max_watch_lag)
        handlers = (
            hull_handlers(service, self._calls),
            fence_handlers(fences, self._calls),
            alarm_handlers(alarms, self._calls),
            health_handlers(self._health, self._calls),
            reflection_handlers(self._calls),
            UnknownMethods(self._calls),
        )
        self._server.add_generic_rpc_handlers(handlers)
        runs = run_handlers(service, self._calls)
        self.address = await self._entrance.listen(self._server, handlers, runs)
        self._serve_metrics()
        self._health.set(NOT_SERVING, "", *SERVICES)
        await self._server.start()

    async def drain(self, last_statuses: float = LAST_STATUSES) -> None:
        """Refuse new calls, end waiting ones, and give the others the configured grace period to finish.

        Args:
            last_statuses: the seconds that callers get to receive what their calls have ended with.
        """
        served, self._serving = self._serving, False
        if served:  # one that could not start has its error to say, and nothing else
            log.info("draining")
        self._health.stop()
        await self._supervisor.stop()
        self._entrance.say_goodbye()
        await self._calls.drain(self._settings.grace)
        await self._entrance.close()
        await self._server.stop(last_statuses)
        self._stop_metrics()
        await self._engine.close()
        if served:
            log.info("stopped")

    async def _look_at_lease(self) -> None:
        if not self._storage.entitled():
            raise StorageError("the lease on the database has ended; until it is renewed, calls get UNAVAILABLE")

    async def _scrub(self, scrub: Scrub) -> None:
        await scrub.round()
        self._metrics.scrub_round()

    @property
    def entitled(self) -> bool:
        """Whether it may answer reads: no other server owns what it has, for all that it knows."""
        return self._storage.entitled()

    def set_machine_well(self, well: bool) -> None:
        """Say whether what this server has in common with others of its process is well; else it is NOT_SERVING."""
        self._machine_well = well
        self._update_health()

    def _update_health(self) -> None:
        if self._serving:
            well = self._machine_well and self._supervisor.reason is None
            self._health.set(SERVING if well else NOT_SERVING, "", *SERVICES)

    def _serve_metrics(self) -> None:
        registry, engine = self.registry, self._engine
        settings = self._settings
        hulls = HullFamilies(engine.driver, engine.hulls, settings.metrics_prefix, settings.metrics_hulls)
        registry.register(
            StateCollector(engine.driver, hulls, engine.fences, self._metrics, asyncio.get_running_loop())
        )
        page = metrics_page(self._settings, registry, self._tokens, self._calls.refused_elsewhere())
        if page is not None:
            self.metrics_url, self._stop_metrics = page.url, page.close

    def _compared(self, hull: LiveHull, outcome: Verification) -> None:
        self._metrics.verified("scrub", outcome.equal, outcome.seconds)
        if outcome.difference is not None or not outcome.keys_equal:
            log.error(
                "a hull differs from Chan's algorithm, or its keys from its points",
                extra={"hull": hull.name, "difference": outcome.difference, "keys_equal": outcome.keys_equal},
            )
            self._health.set(NOT_SERVING, SCRUB)
        self._complain(outcome.fence_faults)

    def _followed(self, _: LiveFence, outcome: FenceVerification) -> None:
        self._metrics.verified("scrub", outcome.equal, outcome.seconds)
        self._complain(outcome.faults)

    def _complain(self, faults: Sequence[FenceFault]) -> None:
        for fault in faults[:LOGGED_FAULTS]:
            log.error("a fence differs from its recomputation", extra=fault._asdict())
        if faults:
            self._health.set(NOT_SERVING, SCRUB)


def metrics_page(
    settings: Settings, registry: CollectorRegistry, tokens: TokenFile | None, refused: Callable[[str, str, str], None]
) -> MetricsPage | None:
    """The page for Prometheus that the settings ask for, with tokens and TLS if other machines can reach it.

    Raises:
        OSError: it cannot listen there.
    """
    if settings.metrics_port is None:
        return None
    host, port = settings.metrics_host, settings.metrics_port
    open_to_others = not is_loopback(host)
    tls = tls_context(settings) if open_to_others else None
    bearer = tokens.bearer if open_to_others and tokens is not None else None
    try:
        return MetricsPage(host, port, registry, bearer, tls, refused)
    except OSError as error:
        raise OSError(f"cannot listen on {host}:{port} for metrics: {listening_error(error)}") from None


def token_file(settings: Settings) -> TokenFile | None:
    """The tokens of the settings; None without. Raises ValueError if they cannot be read."""
    if settings.tokens is None:
        return None
    try:
        return TokenFile(settings.tokens)
    except (OSError, ValueError) as error:
        raise ValueError(f"--tokens {text_of(error)}") from None


def end_process(reason: str) -> None:
    """End the process at once, because its state is not reliable. All acknowledged batches are stored."""
    print(f"the server stops: {reason}", file=sys.stderr, flush=True)  # noqa: T201  # logging itself may have failed
    os._exit(os.EX_SOFTWARE)
