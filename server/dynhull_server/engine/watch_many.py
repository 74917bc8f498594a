"""Watching many hulls: a picture of all of them, then what changes.

A watcher has no queue. It remembers how far it is in a roster, and sends the newest states of what has changed since. A
slow client therefore gets newer states, and memory does not grow.
"""

import asyncio
from collections.abc import AsyncGenerator
from contextlib import aclosing
from dataclasses import dataclass
from enum import Enum, auto

from .positions import NOWHERE, Position, encode_position
from .roster import Roster, RosterEntry, RosterMessage

# Seconds between positions.
MARK_SECONDS = 1.0


class Picture(Enum):
    """Where a part is in a picture of all hulls."""

    BEGINS = auto()
    BEGINS_ANEW = auto()
    COMPLETE = auto()


@dataclass(frozen=True, slots=True)
class ManyPart:
    """What is sent at once.

    Attributes:
        states: a message with states.
        picture: where it is in a picture.
        position: that of what was sent so far, at times.
    """

    states: bytes = b""
    picture: Picture | None = None
    position: bytes = b""


async def watch_many(roster: Roster, position: Position | None, interval: float) -> AsyncGenerator[ManyPart, None]:
    """The states of the hulls of a roster, or of those that are not as at a position, then of all that change.

    Args:
        roster: the hulls.
        position: how far the watcher is; None for one that has nothing.
        interval: the least number of seconds between two states of a hull.

    Raises:
        LimitExceededError: there are too many hulls, or their states are too large.
    """
    with roster.following() as key:
        while True:
            async with aclosing(_until_anew(roster, key, position, interval)) as parts:
                async for part in parts:
                    yield part
            position = NOWHERE


async def _until_anew(
    roster: Roster, key: object, position: Position | None, interval: float
) -> AsyncGenerator[ManyPart, None]:
    """A picture and what changes after it, until all is to be pictured anew."""
    loop = asyncio.get_running_loop()
    follower = _Follower(roster)
    async with aclosing(follower.picture(position)) as parts:
        async for part in parts:
            yield part
    unpictured, complete, marked_at = follower.late.copy(), False, loop.time()
    while not follower.begins_anew:
        if not complete and unpictured.isdisjoint(follower.late):
            complete, marked_at = True, loop.time()
            yield ManyPart(picture=Picture.COMPLETE, position=follower.position())
        roster.heard(key, follower.version)
        async with aclosing(follower.news(interval, marked_at + MARK_SECONDS)) as parts:
            async for part in parts:
                yield part
        if loop.time() < marked_at + MARK_SECONDS or follower.begins_anew:
            continue
        marked_at = loop.time()
        if complete:
            yield ManyPart(position=follower.position())


class _Follower:
    """How far a watcher is in a roster, from a picture on.

    Attributes:
        generation: of the roster, at the picture.
        version: that of what it has been sent last.
        late: what it has to be sent yet of what changed before.
    """

    def __init__(self, roster: Roster) -> None:
        self.generation, self.version = roster.generation, roster.version
        self.late: set[RosterEntry] = set()
        self._roster = roster
        self._slot = -1
        self._standings = roster.standings()

    @property
    def begins_anew(self) -> bool:
        """Whether all is to be pictured anew."""
        return self._roster.generation != self.generation

    async def picture(self, position: Position | None) -> AsyncGenerator[ManyPart, None]:
        """All hulls, but for those that are late."""
        self._roster.require_within_limits()
        entries = self._roster.entries()
        goes_on = position is not None and position.precedes(self._standings)
        yield ManyPart(picture=Picture.BEGINS if goes_on or position is None else Picture.BEGINS_ANEW)
        changed, same = _apart(entries, position if goes_on else None)
        async for part in self._sent(self._roster.states(changed)):
            yield part
        async with aclosing(self._roster.names(same)) as messages:
            async for message in messages:
                yield ManyPart(message)

    async def news(self, interval: float, until: float) -> AsyncGenerator[ManyPart, None]:
        """What has changed since; nothing if nothing does so until then, or if all is to be pictured anew."""
        loop = asyncio.get_running_loop()
        try:
            async with asyncio.timeout_at(until):
                await self._roster.beyond(self.version, self.generation)
                # Once in each slot of time: those who are equally far share what they get.
                await asyncio.sleep((self._slot + 1) * interval - loop.time())
        except TimeoutError:
            return
        if self.begins_anew:
            return
        self._slot = int(loop.time() // interval)
        standings, version = self._roster.standings(), self._roster.version
        async for part in self._sent(self._roster.changes(self.version)):
            yield part
        self._standings, self.version = standings, version

    async def _sent(self, messages: AsyncGenerator[RosterMessage, None]) -> AsyncGenerator[ManyPart, None]:
        async with aclosing(messages):
            async for message in messages:
                self.late.difference_update(message.entries)
                self.late.update(message.late)
                if message.states:
                    yield ManyPart(message.states)

    def position(self) -> bytes:
        """How far it is: of what it has been sent, and of what it has to be sent yet."""
        if self.version == self._roster.version:
            self._standings = self._roster.standings()
        standings = list(self._standings)
        for entry in self.late:
            standings[entry.partition] = standings[entry.partition].before(entry.commit)
        return encode_position(standings)


def _apart(entries: list[RosterEntry], position: Position | None) -> tuple[list[RosterEntry], list[RosterEntry]]:
    """What has changed since a position, and the rest."""
    if position is None:
        return entries, []
    changed: list[RosterEntry] = []
    same: list[RosterEntry] = []
    for entry in entries:
        as_before = not entry.new and position.standings[entry.partition].has(entry.commit)
        (same if as_before else changed).append(entry)
    return changed, same
