"""The process of the supervisor: it starts gateways and workers, keeps them alive, and stops them."""

import asyncio
import logging
import socket
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager

from dynhull_server import logs
from dynhull_server.app import metrics_page, token_file
from dynhull_server.entrance import tls_context
from dynhull_server.failure import code_of, fail, text_of
from dynhull_server.listening import listening_error, why_not
from dynhull_server.process import stop_signal
from dynhull_server.rpc.call_counts import CallCounts
from dynhull_server.rpc.calls import refusals_elsewhere
from dynhull_server.rpc.metrics import BUCKETS
from dynhull_server.rpc.refusal_log import RefusalLog
from dynhull_server.setting_sources import warn_of_service_links
from dynhull_server.settings import Settings
from dynhull_server.storage.port import StorageError

from .child_process import ChildProcess, StartFailedError, prepare
from .machines.entrance import checked_certificate, require_own_address
from .metrics import registry_of
from .storages.choice import storage_kind
from .storages.kind import StorageKind

# The name of the task that restarts all processes.
RESTART = "restart"

log = logging.getLogger(__name__)


def run(settings: Settings) -> None:
    """Serve with several processes, then return; what prevents that ends the process."""
    logs.configure(settings.log_level, settings.log_format, "supervisor")
    warn_of_service_links()
    try:
        kind = storage_kind(settings)
        prepare(kind.preloads)
        asyncio.run(_serve(settings, kind))
    except StartFailedError as error:  # that process has said why
        raise SystemExit(error.code) from None
    except (OSError, RuntimeError, ValueError, StorageError) as error:
        fail(f"cannot serve: {text_of(error)}", code_of(error))


async def _serve(settings: Settings, kind: StorageKind) -> None:
    again = asyncio.Event()
    with ExitStack() as opened, stop_signal(again) as stop:
        tokens = token_file(settings)
        tls_context(settings)
        checked_certificate(settings)
        if settings.cluster:
            require_own_address(settings)
        port = opened.enter_context(_reserved_port(settings.host, settings.port))
        workers, gateways = settings.workers or 1, settings.gateways or 1
        shared = opened.enter_context(kind.shared())
        own = settings.model_copy(update={"port": port})
        begin = {"settings": own.model_dump(mode="json"), **shared.begin}
        processes = Processes(
            [ChildProcess(f"worker-{i}", begin, settings.grace) for i in range(workers)],
            [ChildProcess(f"gateway-{i}", begin, settings.grace) for i in range(gateways)],
        )
        refusals, calls = RefusalLog(), CallCounts(BUCKETS)
        opened.callback(refusals.flush)
        registry = registry_of(processes.all, calls, asyncio.get_running_loop())
        page = metrics_page(settings, registry, tokens, refusals_elsewhere(refusals, calls))
        if page is not None:
            opened.callback(page.close)
        try:
            if await processes.start(stop):
                shared.complete()
                print(f"dynhull serving on {processes.address}", flush=True)  # noqa: T201  # output of the command
                if page is not None:
                    print(f"metrics on {page.url}", flush=True)  # noqa: T201  # likewise
                await processes.keep(stop, again)
        finally:
            await processes.stop()


class Processes:
    """The workers and the gateways, from `start` until `stop`."""

    def __init__(self, workers: Sequence[ChildProcess], gateways: list[ChildProcess]) -> None:
        self._workers = workers
        self._gateways = gateways
        self.all = [*workers, *gateways]
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def address(self) -> str:
        """The address of the gateways."""
        return self._gateways[0].address

    async def start(self, stop: asyncio.Event) -> bool:
        """Start all, and wait until they serve; False if `stop` was set before.

        Raises:
            StartFailedError: one of them has ended before it served.
        """
        for group in (self._workers, self._gateways):  # a gateway that serves has its workers
            self._tasks |= {asyncio.create_task(each.run(), name=each.name) for each in group}
            if not await self._wait(stop, *(each.serving for each in group)):
                return False
        return True

    async def keep(self, stop: asyncio.Event, again: asyncio.Event) -> None:
        """Keep them alive until `stop`, and restart them, one at a time, whenever `again` is set.

        If it is set while they are restarted, they are restarted once more, however often it was.
        """
        self._tasks.add(asyncio.create_task(self._restart_whenever(again), name=RESTART))
        while await self._wait(stop, stop):  # a gateway has been replaced
            continue

    async def stop(self) -> None:
        """Stop the gateways, which end their calls, and then the workers."""
        for task in self._tasks:
            if task.get_name() == RESTART:
                task.cancel()
        for group in (self._gateways, self._workers):
            await asyncio.gather(*(each.stop() for each in group))
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _restart_whenever(self, again: asyncio.Event) -> None:
        while True:
            await again.wait()
            again.clear()
            for each in list(self.all):
                log.info("a process is restarted", extra={"restarted": each.name})
                if each in self._gateways:
                    await self._replace(each)
                else:
                    await each.restart()
            log.info("all processes are restarted")

    async def _replace(self, gateway: ChildProcess) -> None:
        """Restart a gateway, which ends only when its heir serves on the same port: there may be no other one."""
        heir = gateway.heir()
        self._gateways.append(heir)
        self._tasks.add(asyncio.create_task(heir.run(), name=heir.name))
        await heir.serving.wait()
        self.all[self.all.index(gateway)] = heir
        await gateway.stop()
        self._gateways.remove(gateway)

    async def _wait(self, stop: asyncio.Event, *events: asyncio.Event) -> bool:
        """Wait for all of the events, or for `stop`; returns False for that.

        Raises the error of a process or of a restart that has failed.
        """
        waits = [asyncio.create_task(_all(events)), asyncio.create_task(stop.wait())]
        try:
            await asyncio.wait([*waits, *self._tasks], return_when=asyncio.FIRST_COMPLETED)
        finally:
            for each in waits:
                each.cancel()
        for task in [each for each in self._tasks if each.done()]:
            task.result()
            self._tasks.remove(task)
        return not stop.is_set()


async def _all(events: Sequence[asyncio.Event]) -> None:
    for each in events:
        await each.wait()


@contextmanager
def _reserved_port(host: str, port: int) -> Iterator[int]:
    """Keep a port for the gateways during the block; yields its number. OSError if another program uses it."""
    if port and (reason := why_not(host, port)):
        raise OSError(f"cannot listen on {host}:{port}: {reason}")
    try:
        family, kind, protocol, _, address = socket.getaddrinfo(
            host.strip("[]"), port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )[0]
        reserved = socket.socket(family, kind, protocol)
    except OSError as error:
        raise OSError(f"cannot listen on {host}:{port}: {listening_error(error)}") from None
    with reserved:
        # Without listening, it gets no connections; with it, no other program can listen without sharing the port.
        reserved.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        try:
            reserved.bind(address)
        except OSError as error:
            raise OSError(f"cannot listen on {host}:{port}: {listening_error(error)}") from None
        yield reserved.getsockname()[1]
