"""A relay: a durable consumer of fences that delivers their events to one kind of receiver."""

import asyncio
import signal
from collections.abc import Sequence
from contextlib import suppress
from functools import partial

import structlog

from dynhull_cli.closed_pipe import when_pipe_closes
from dynhull_client import AsyncHullClient, FenceNotFoundError

from .dead_letters import DeadLetter, StateFolder, gone_key
from .figures import Figures
from .lane import FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER, PASSING, Lane, Patience
from .target import GoneError, NotDeliveredError, ReaderGoneError, Target
from .waiting import SERVER_AWAY, Absence, growing_pauses, unless

log = structlog.get_logger("dynhull_relay")


async def run(
    client: AsyncHullClient,
    server: str,
    fences: Sequence[str],
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
    """Deliver the events of the fences until all are deleted, or a signal ends the relay.

    Unless the server has all fences, nothing is changed: not one of them gets the consumer.

    Returns:
        Whether every receiver wanted its events; False if one is gone.

    Raises:
        DynhullError: the server refuses to send the events, or has not all of the fences.
        ValueError: the receivers of all fences were gone earlier, and have not been enabled since then.
    """
    gone = {} if enable else folder.gone()
    wanted = [fence for fence in dict.fromkeys(fences) if gone_key(fence, to) not in gone]
    if not wanted:
        raise ValueError(f"{to} answered {gone[gone_key(fences[0], to)]}: --enable delivers to it again")
    for fence in set(fences).difference(wanted):
        log.error("the receiver is gone: no deliveries; --enable delivers to it again", fence=fence, to=to)
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    if to == "-":
        when_pipe_closes(partial(_stop_from_thread, loop, stop))
    figures = Figures()
    port = {} if metrics is None else {"metrics_port": figures.serve(*metrics)}
    lanes = [Lane(client, each, consumer, target, to, patience, folder, figures, stop) for each in wanted]
    log.info("relaying", fences=wanted, to=to, consumer=consumer, server=server, **port)
    await unless(stop, _require_fences(client, server, wanted))
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
    return len(wanted) == len(set(fences)) and not any(lane.disabled for lane in lanes)


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


def _stop_from_thread(loop: asyncio.AbstractEventLoop, stop: asyncio.Event) -> None:
    with suppress(RuntimeError):  # the loop has ended
        loop.call_soon_threadsafe(stop.set)


async def _require_fences(client: AsyncHullClient, server: str, fences: Sequence[str]) -> None:
    """Ask the server, once it is there, for all fences; FenceNotFoundError names those that it does not have."""
    away = Absence(SERVER_AWAY, server=server)
    pauses = growing_pauses(FIRST_PAUSE_FOR_THE_SERVER, LONGEST_PAUSE_FOR_THE_SERVER)
    while True:
        missing = []
        try:
            for each in fences:
                try:
                    await client.get_fence(each)
                except FenceNotFoundError as error:
                    missing.append(error)
        except PASSING as error:
            away.lasts(error)
            await asyncio.sleep(next(pauses))
            continue
        if missing:
            first = missing[0]
            raise FenceNotFoundError("\n".join(map(str, missing)), first.code, first.reason, first.metadata)
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
