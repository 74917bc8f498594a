"""An ingest: the feeds of a URL, each with a pump, until a signal or the end."""

import asyncio
import signal
from collections.abc import Sequence
from time import monotonic
from urllib.parse import urlsplit

import structlog

from dynhull_client import AsyncHullClient

from .bad import BadMessages, TooManyBadError
from .feed import Feed, FeedError
from .figures import Figures
from .lane import NotCreatedError
from .pump import Pump, Settings

log = structlog.get_logger("dynhull_ingest")


class IngestError(Exception):
    """The ingest cannot go on; the message says why."""


async def feeds_of(url: str, hull: str, producer: str | None, *, keyed: bool) -> Sequence[Feed]:
    """The feeds that a URL stands for.

    Raises:
        ValueError: there are none, or an option does not suit them.
        IngestError: the broker does not answer.
    """
    match urlsplit(url).scheme:
        case "mqtt" | "mqtts":
            from .mqtt import Mqtt

            if not keyed:
                raise ValueError(
                    "MQTT has no numbers: a message that comes twice would be two points. Give --key, whose point it "
                    "moves to the same place again"
                )
            if producer is not None:
                raise ValueError("--producer is for NATS and Kafka, which number their messages")
            return [Mqtt(url, hull)]
        case "nats" | "tls":
            from .jetstream import JetStream

            stream = JetStream(url)
            stream.producer = producer or stream.producer
            return [stream]
        case "kafka":
            from .kafka import partitions_of

            try:
                partitions = await partitions_of(url)
            except FeedError as error:
                raise IngestError(str(error)) from None
            for each in partitions:
                each.producer = f"{producer}/{each.number}" if producer else each.producer
            return partitions
        case scheme:
            raise ValueError(f"the URL begins with {scheme!r}: must be mqtt, mqtts, nats, tls or kafka")


async def run(
    client: AsyncHullClient,
    feeds: Sequence[Feed],
    settings: Settings,
    bad: BadMessages,
    *,
    metrics: tuple[str, int] | None,
    grace: float,
    report: float,
) -> None:
    """Move the messages of all feeds until a signal, or the end if that is asked for.

    Raises:
        DynhullError: the server refuses to take points.
        IngestError: they cannot be sent, or there are too many bad messages.
    """
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        loop.add_signal_handler(number, stop.set)
    figures = Figures()
    if metrics is not None:
        log.info("metrics", port=figures.serve(*metrics))
    pumps = [Pump(client, each, settings, bad, figures) for each in feeds]
    running = asyncio.gather(*(each.run(stop) for each in pumps))
    ending = asyncio.create_task(_end(stop, running, grace))
    reporting = asyncio.create_task(_report(pumps, bad, settings, report))
    try:
        await running
    except ExceptionGroup as group:
        error = _first(group)
        if isinstance(error, (NotCreatedError, TooManyBadError)):
            raise IngestError(str(error)) from None
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
    seconds = max(each.ended for each in pumps) - min(each.begun for each in pumps)
    log.info("stopped", points=points, seconds=round(max(0.0, seconds), 3), bad=bad.count)


async def _end(stop: asyncio.Event, running: "asyncio.Future[list[None]]", grace: float) -> None:
    """After a signal, let what is under way finish, within the grace period."""
    await stop.wait()
    await asyncio.sleep(grace)
    running.cancel()


async def _report(pumps: Sequence[Pump], bad: BadMessages, settings: Settings, every: float) -> None:
    """Log the progress now and then, while there is any."""
    before, then, noted = 0, monotonic(), False
    while True:
        await asyncio.sleep(every)
        times = settings.mapping.times
        if times.note is not None and not noted:
            log.info(times.note)
            noted = True
        points, now = sum(each.points for each in pumps), monotonic()
        if points != before:
            log.info("taken", points=points, per_second=round((points - before) / (now - then)), bad=bad.count)
        before, then = points, now


def _first(group: BaseExceptionGroup[BaseException]) -> BaseException:
    """The first error in a group of groups."""
    error = group.exceptions[0]
    return _first(error) if isinstance(error, BaseExceptionGroup) else error
