"""Whose events a relay delivers: fences and alarms."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from dynhull_client import (
    AlarmEvent,
    AlarmNotFoundError,
    AsyncAlarmWatch,
    AsyncFenceWatch,
    AsyncHullClient,
    FenceConsumer,
    FenceEvent,
    FenceNotFoundError,
)

Kind = Literal["fence", "alarm"]
KINDS: tuple[Kind, ...] = "fence", "alarm"
Event = FenceEvent | AlarmEvent
OF_ALARMS = "alarm:"
NOT_FOUND = FenceNotFoundError, AlarmNotFoundError


@dataclass(frozen=True, slots=True)
class Source:
    """A fence or an alarm.

    Attributes:
        kind: which of them.
        name: its name. A fence and an alarm may have the same.
    """

    kind: Kind
    name: str

    def __str__(self) -> str:
        return f"{OF_ALARMS}{self.name}" if self.kind == "alarm" else self.name

    def watch(self, client: AsyncHullClient, consumer: str) -> AsyncFenceWatch | AsyncAlarmWatch:
        """The events that a durable consumer has not acknowledged, and those to come."""
        if self.kind == "alarm":
            return client.watch_alarm(self.name, consumer)
        return client.watch_fence(self.name, consumer)

    async def acknowledge(self, client: AsyncHullClient, consumer: str, event: Event) -> FenceConsumer:
        """Acknowledge the events up to this one."""
        ack = client.ack_alarm if self.kind == "alarm" else client.ack_fence
        return await ack(self.name, consumer, event.sequence, uid=event.uid)

    async def consumers(self, client: AsyncHullClient) -> Sequence[FenceConsumer]:
        """Its durable consumers; one of NOT_FOUND if the server does not have it."""
        found = await (client.get_alarm(self.name) if self.kind == "alarm" else client.get_fence(self.name))
        return found.consumers


def read_source(text: str) -> Source:
    """What `str` of a source gives: the name of a fence, or alarm: and that of an alarm."""
    if text.startswith(OF_ALARMS):
        return Source("alarm", text.removeprefix(OF_ALARMS))
    return Source("fence", text)
