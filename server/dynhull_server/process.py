"""The process of the server: it serves until SIGTERM or SIGINT."""

import asyncio
import logging
import os
import resource
import signal
import socket
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from typing import Protocol

from dynhull import set_threads

from . import event_loop, logs
from .failure import code_of, fail, text_of
from .garbage import few_collections
from .malloc import return_large_blocks
from .progress import progress_bar
from .setting_sources import warn_of_service_links
from .settings import Settings
from .starting import started
from .storage.port import Progress, StorageError

log = logging.getLogger(__name__)

SIGNALS = signal.SIGTERM, signal.SIGINT


class Alone(Protocol):
    """What serves in the only process of a server, from `start` until `drain` has returned."""

    @property
    def address(self) -> str:
        """The host:port it listens on, once started."""

    @property
    def metrics_url(self) -> str:
        """The URL of the metrics page; empty for none."""

    async def start(self, progress: Progress) -> None:
        """Listen, load the stored hulls, then serve.

        Args:
            progress: called with the number of hulls loaded so far and the total.

        Raises:
            RuntimeError, OSError: the address is in use, or does not belong to this machine.
            StorageError: the stored data cannot be used.
        """

    async def drain(self) -> None:
        """End the calls in progress, and stop; also after a start that has failed."""


def run(settings: Settings, make: Callable[[], Awaitable[Alone]]) -> None:
    """Serve, then return; an error of the settings, the storage or the operating system ends the process.

    Args:
        settings: the settings.
        make: makes what serves, another one for each attempt to start.
    """
    logs.configure(settings.log_level, settings.log_format)
    warn_of_service_links()
    return_large_blocks()
    share_processors(settings)
    allow_connections(settings.max_connections)
    try:
        event_loop.run(_serve(settings, make))
    except (OSError, RuntimeError, ValueError, StorageError) as error:
        fail(f"cannot serve: {text_of(error)}", code_of(error))


def share_processors(settings: Settings) -> None:
    """Set the threads of a batch: by default the processors, divided by the workers, less one for other work.

    That is the fences of the batch, too, where one thread is left for it.
    """
    processors = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    share = processors // (settings.workers or 1)
    set_threads(settings.threads or min(64, max(1, share - 1)), beside=settings.threads is None and share > 1)


def allow_connections(most: int) -> None:
    """Raise the limit on open files as far as the system permits, and warn if the connections can exceed it."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard <= most:
        log.warning("--max-connections %d is not below the limit on open files, %d: see `ulimit -Hn`", most, hard)
    elif soft != resource.RLIM_INFINITY and soft <= most:
        resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))


async def _serve(settings: Settings, make: Callable[[], Awaitable[Alone]]) -> None:
    with stop_signal() as stop, few_collections():
        with progress_bar("hulls read") as progress:
            server = await started(make, lambda made: made.start(progress), stop, settings.start_patience)
        if server is None:
            return
        try:
            print(f"dynhull serving on {server.address}", flush=True)  # noqa: T201  # output of the command
            if server.metrics_url:
                print(f"metrics on {server.metrics_url}", flush=True)  # noqa: T201  # likewise
            await stop.wait()
        finally:
            await server.drain()


@contextmanager
def stop_signal(again: asyncio.Event | None = None) -> Iterator[asyncio.Event]:
    """An event set by SIGTERM and SIGINT, which are ignored from the end of the block to the end of the process.

    With `again`, SIGHUP sets that event.

    The signal arrives as a byte through a socket. A handler alone could run too late, if the event loop has just gone
    to sleep or another thread was interrupted. The handlers of the event loop do the same, but only until it is closed;
    after that a second signal would kill the process.
    """
    loop = asyncio.get_running_loop()
    stop = asyncio.Event()
    wake, signalled = socket.socketpair()
    with wake, signalled:

        def received() -> None:
            numbers = wake.recv(64)
            if any(number in numbers for number in SIGNALS):
                stop.set()
            if again is not None and signal.SIGHUP in numbers:
                again.set()

        for end in (wake, signalled):
            end.setblocking(False)
        loop.add_reader(wake, received)
        signal.set_wakeup_fd(signalled.fileno())
        handled = SIGNALS if again is None else (*SIGNALS, signal.SIGHUP)
        for number in handled:
            signal.signal(number, lambda *_: None)
        try:
            yield stop
        finally:
            for number in handled:
                signal.signal(number, signal.SIG_IGN)
            signal.set_wakeup_fd(-1)
            loop.remove_reader(wake)
