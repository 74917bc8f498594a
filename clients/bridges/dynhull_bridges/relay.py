"""A relay: a durable consumer of fences and alarms that delivers their events to one kind of receiver."""

import asyncio
import signal
from collections.abc import Sequence
from contextlib import suppress
from functools import partial

import structlog

from dynhull_cli.closed_pipe import when_pipe_closes
from dynhull_client import AlarmNotFoundError, AsyncHullClient, FenceNotFoundError

from .dead_letters import DeadLetter, StateFolder, gone_key
from .figures import Figures
from .lane import FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER, PASSING, Lane, Patience
from .sources import NOT_FOUND, Source
from .target import GoneError, NotDeliveredError, ReaderGoneError, Target
from .waiting import SERVER_AWAY, Absence, growing_pauses, unless

log = structlog.get_logger("dynhull_relay")


async def run(
    client: AsyncHullClient,
    server: str,
    sources: Sequence[Source],
    consumer: str,
    target: Target,
    to: str,
    patience: Patience,
    folder: StateFolder,
    *,
    enable: bool,
    metrics: tuple[str, int] | None,
    grace: float,
) -> bool:
    """Deliver the events of the sources until all are deleted, or a signal ends the relay.

    Unless the server has all of them, nothing is changed: not one of them gets the consumer.

    Returns:
        Whether every receiver wanted its events; False if one is gone.

    Raises:
        DynhullError: the server refuses to send the events, or has not all of the sources.
        ValueError: the receivers of all sources were gone earlier, and have not been enabled since then.
    """
    gone = {} if enable else folder.gone()
    wanted = [each for each in dict.fromkeys(sources) if gone_key(each, to) not in gone]
    if not wanted:
        raise ValueError(f"{to} answered {gone[gone_key(sources[0], to)]}: --enable delivers to it again")
    for source in set(sources).difference(wanted):
        log.error(
            "the receiver is gone: no deliveries; --enable delivers to it again", to=to, **{source.kind: source.name}
        )
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    if to == "-":
        when_pipe_closes(partial(_stop_from_thread, loop, stop))
    figures = Figures()
    port = {} if metrics is None else {"metrics_port": figures.serve(*metrics)}
    lanes = [Lane(client, each, consumer, target, to, patience, folder, figures, stop) for each in wanted]
    log.info("relaying", **_names(wanted), to=to, consumer=consumer, server=server, **port)
    await unless(stop, _require(client, server, wanted))
    if stop.is_set():
        log.info("stopped")
        return True
    if enable:
        folder.enable()
    running = [asyncio.create_task(lane.run()) for lane in lanes]
    ending = asyncio.create_task(_end(stop, running, grace))
    reporting = asyncio.create_task(_report_presence(client, server, figures))
    try:
        await asyncio.gather(*running)
    except ExceptionGroup as group:
        error = _first(group)
        if not isinstance(error, ReaderGoneError):
            raise error from None
    except asyncio.CancelledError:
        log.warning("a delivery took longer than --grace: it will be repeated")
    finally:
        ending.cancel()
        reporting.cancel()
        for each in running:
            each.cancel()
        await asyncio.gather(*running, return_exceptions=True)
    log.info("stopped")
    return len(wanted) == len(set(sources)) and not any(lane.disabled for lane in lanes)


async def send_again(letters: Sequence[DeadLetter], target: Target) -> tuple[int, str | None]:
    """Deliver dead letters and remove those that have arrived, until the first that does not.

    Returns:
        The number of letters that have arrived, and why the next one has not.
    """
    sent = 0
    try:
        for each in letters:
            await target.deliver([each.letter])
            each.remove()
            sent += 1
    except (NotDeliveredError, GoneError) as error:
        return sent, str(error)
    finally:
        await target.close()
    return sent, None


def _names(sources: Sequence[Source]) -> dict[str, list[str]]:
    """The names of sources, by their kinds, for the log."""
    found: dict[str, list[str]] = {}
    for each in sources:
        found.setdefault(f"{each.kind}s", []).append(each.name)
    return found


def _stop_from_thread(loop: asyncio.AbstractEventLoop, stop: asyncio.Event) -> None:
    with suppress(RuntimeError):  # the loop has ended
        loop.call_soon_threadsafe(stop.set)


async def _require(client: AsyncHullClient, server: str, sources: Sequence[Source]) -> None:
    """Ask the server, once it is there, for all sources; an error names those that it does not have."""
    away = Absence(SERVER_AWAY, server=server)
    pauses = growing_pauses(FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER)
    while True:
        missing: list[FenceNotFoundError | AlarmNotFoundError] = []
        try:
            for each in sources:
                try:
                    await each.consumers(client)
                except NOT_FOUND as error:
                    missing.append(error)
        except PASSING as error:
            away.lasts(error)
            await asyncio.sleep(next(pauses))
            continue
        if missing:
            first = missing[0]
            raise type(first)("\n".join(map(str, missing)), first.code, first.reason, first.metadata)
        return


async def _report_presence(client: AsyncHullClient, server: str, figures: Figures) -> None:
    """Log when the server is lost, as by a network that is silent, and when it is back."""
    async for connected in client.presence():
        seconds = figures.seconds_without_server
        figures.note_presence(connected)
        if not connected:
            log.warning("the server is lost: no events until it is back", server=server)
        elif seconds:
            log.info("the server is back", server=server, seconds=round(seconds, 3))


async def _end(stop: asyncio.Event, running: Sequence[asyncio.Task[None]], grace: float) -> None:
    """After a signal, let deliveries that are under way finish, within the grace period."""
    await stop.wait()
    log.info("stopping when the deliveries under way are done", grace=grace)
    with suppress(TimeoutError):
        async with asyncio.timeout(grace):
            await asyncio.wait(running)
    for each in running:
        each.cancel()


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    """The first error in a group of groups."""
    error = group.exceptions[0]
    return _first(error) if isinstance(error, BaseExceptionGroup) else error
