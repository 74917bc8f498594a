"""An ingest: the feeds of a URL, each with a pump, until a signal or the end."""

import asyncio
import signal
from collections.abc import Sequence
from time import monotonic

import structlog

from dynhull_client import AsyncHullClient, RestoredError
from dynhull_surface.counts import COUNTS

from ..waiting import SERVER_AWAY, Absence, growing_pauses, unless
from .bad import BadMessages, TooManyBadError
from .feed import DoubtfulError, Feed, FeedError
from .feeds import Find
from .figures import IngestFigures
from .lane import NotCreatedError
from .pump import BROKER_AWAY, DOUBT, FIRST_PAUSE, LONGEST_PAUSE, GapError, Pump, Settings

log = structlog.get_logger("dynhull_ingest")


class IngestError(Exception):
    """The ingest cannot go on; the message says why."""


async def run(
    client: AsyncHullClient,
    server: str,
    find: Find,
    settings: Settings,
    bad: BadMessages,
    *,
    metrics: tuple[str, int] | None,
    grace: float,
    report: float,
) -> bool:
    """Move the messages of all feeds that `find` returns until a signal, or the end if that is asked for.

    Returns:
        Whether the end was reached.

    Raises:
        DynhullError: the server refuses to take points, or has been away for too long.
        FeedError: the broker has been away for too long.
        DoubtfulError: it has denied for some seconds what is to be read.
        IngestError: points cannot be sent, messages are gone, or too many are bad.
    """
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    figures = IngestFigures()
    if metrics is not None:
        log.info("metrics", port=figures.serve(*metrics))
    feeds = await unless(stop, _found(find, settings.patience)) or ()
    away = Absence(SERVER_AWAY, settings.patience, server=server)
    pumps = [Pump(client, away, each, settings, bad, figures) for each in feeds]
    running = asyncio.gather(*(each.run(stop) for each in pumps))
    ending = asyncio.create_task(_end(stop, running, pumps, grace))
    reporting = asyncio.create_task(_report(pumps, bad, report))
    try:
        await running
    except ExceptionGroup as group:
        error = _first(group)
        if isinstance(error, (GapError, NotCreatedError, TooManyBadError)):
            raise IngestError(str(error)) from None
        if isinstance(error, RestoredError):
            raise IngestError(f"{error}. {_after_a_restore(settings, feeds)}") from None
        raise error from None
    except asyncio.CancelledError:
        if not stop.is_set():
            raise
        log.warning("what is under way took longer than --grace: it is read again by the next ingest")
    finally:
        ending.cancel()
        reporting.cancel()
        bad.close()
    points = sum(each.points for each in pumps)
    ended, begun = [each.ended for each in pumps], [each.begun for each in pumps]
    seconds = max(ended, default=0.0) - min(begun, default=0.0)
    known = sum(each.known for each in pumps)
    lost = sum(each.lost for each in pumps)
    counts = {name: sum(each.counts[name] for each in pumps) for name in COUNTS}
    more = {name: count for name, count in {**counts, "lost": lost, "known_before": known}.items() if count}
    log.info("stopped", points=points, seconds=round(max(0.0, seconds), 3), bad=bad.count, **more)
    return bool(pumps) and all(each.at_end for each in pumps)


def _after_a_restore(settings: Settings, feeds: Sequence[Feed]) -> str:
    """What to do about the messages that a restored hull lacks."""
    if any(each.producer is None for each in feeds):
        return "The broker does not keep what came since the backup. Start the ingest again for what comes from now on"
    if settings.mapping.hull is None:
        return (
            "The broker has the place after what is gone. Start the ingest with another --producer, to read all again"
        )
    return "Start the ingest again: it reads what comes after that"


async def _found(find: Find, patience: float | None) -> Sequence[Feed]:
    """The feeds, once the broker says which there are."""
    away, doubt = Absence(BROKER_AWAY, patience), Absence(BROKER_AWAY, DOUBT)
    pauses = growing_pauses(FIRST_PAUSE, LONGEST_PAUSE)
    while True:
        away.begins()
        pause = next(pauses)
        try:
            return await find()
        except DoubtfulError as error:
            doubt.lasts(error, pause)
            pause = doubt.pause(pause)
        except FeedError as error:
            doubt.ends()
            away.lasts(error, pause)
            pause = away.pause(pause)
        await asyncio.sleep(pause)


async def _end(stop: asyncio.Event, running: "asyncio.Future[list[None]]", pumps: Sequence[Pump], grace: float) -> None:
    """After a signal, let what is under way finish, within the grace period."""
    await stop.wait()
    if under_way := sum(each.under_way for each in pumps):
        log.info("stopping when what is under way is done", messages=under_way, grace=grace)
    await asyncio.sleep(grace)
    running.cancel()


async def _report(pumps: Sequence[Pump], bad: BadMessages, every: float) -> None:
    """Log the progress now and then, while there is any."""
    before, then = 0, monotonic()
    while True:
        await asyncio.sleep(every)
        points, now = sum(each.points for each in pumps), monotonic()
        if points != before:
            log.info("taken", points=points, per_second=round((points - before) / (now - then)), bad=bad.count)
        before, then = points, now


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    """The first error in a group of groups."""
    error = group.exceptions[0]
    return _first(error) if isinstance(error, BaseExceptionGroup) else error
