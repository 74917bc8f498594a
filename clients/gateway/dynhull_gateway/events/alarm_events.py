"""The events of an alarm, each once and in order."""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from functools import partial

from dynhull_cli.alarms.shown import event_members
from dynhull_client import AlarmReplacedError, AsyncHullClient

from .messages import COMMENT, message
from .shared import over_restarts, told


@dataclass(slots=True)
class AlarmReading:
    """What is read, and how far.

    Attributes:
        name: the alarm.
        consumer: a durable consumer that knows its place; None for `uid` and `after`.
        uid: the uid of the alarm; empty if it is not known yet.
        after: the sequence of the last event that the reader has; None for new events only.
        told: whether the reader has an id that says where it is.
    """

    name: str
    consumer: str | None
    uid: str
    after: int | None
    told: bool = False


def alarm_events(client: AsyncHullClient, reading: AlarmReading, keepalive: float) -> AsyncIterator[bytes]:
    """The events as text, over restarts of the server; a comment when there is none for long."""
    return over_restarts(partial(_read, client, reading, keepalive), reading, "alarm", AlarmReplacedError)


async def _read(client: AsyncHullClient, reading: AlarmReading, keepalive: float) -> AsyncIterator[bytes]:
    """One watch, which continues over lost connections itself once it has begun."""
    if reading.consumer is None and not (reading.uid and reading.told):
        yield await told(reading, client.get_alarm)
    after = None if reading.consumer else reading.after
    async with client.watch_alarm(
        reading.name, reading.consumer, after, uid=reading.uid, progress_interval=keepalive
    ) as watch:
        async for event in watch:
            if event.type == "progress":
                yield COMMENT
                continue
            reading.uid, reading.after = event.uid, event.sequence
            yield message(event.type, f"{event.uid}:{event.sequence}", event_members(event))
