"""Watching many hulls: a picture of all of them, then what changes.

A watcher has no queue. It remembers how far it is in a roster, and sends the newest states of what has changed since. A
slow client therefore gets newer states, and memory does not grow.
"""

import asyncio
from collections.abc import AsyncGenerator, Sequence
from contextlib import aclosing, suppress
from dataclasses import dataclass
from enum import Enum, auto

from .positions import Standing, encode_position
from .roster import Roster, RosterEntry

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


async def watch_many(
    roster: Roster, position: Sequence[Standing] | None, interval: float
) -> AsyncGenerator[ManyPart, None]:
    """The states of the hulls of a roster, or of those that are not as at a position, then of all that change.

    Args:
        roster: the hulls.
        position: how far the watcher is; None for one that has nothing.
        interval: the least number of seconds between two states of a hull.
    """
    loop = asyncio.get_running_loop()
    with roster.following() as follower:
        while True:
            generation, version = roster.generation, roster.version
            standings = roster.standings()
            marked = encode_position(standings)
            entries = roster.entries()
            goes_on = position is not None and _go_on(position, standings)
            yield ManyPart(picture=Picture.BEGINS if goes_on or position is None else Picture.BEGINS_ANEW)
            changed, same = _apart(entries, position if goes_on else None)
            async with aclosing(roster.states(changed)) as messages:
                async for message in messages:
                    yield ManyPart(message)
            async with aclosing(roster.names(same)) as messages:
                async for message in messages:
                    yield ManyPart(message)
            del entries, changed, same
            yield ManyPart(picture=Picture.COMPLETE, position=marked)
            marked_at, slot = loop.time(), -1
            while roster.generation == generation:
                roster.heard(follower, version)
                due = False
                with suppress(TimeoutError):
                    async with asyncio.timeout_at(marked_at + MARK_SECONDS):
                        await roster.beyond(version, generation)
                        # Once in each slot of time: those who are equally far share what they get.
                        await asyncio.sleep((slot + 1) * interval - loop.time())
                        due = True
                if roster.generation != generation:
                    break
                if due:
                    slot = int(loop.time() // interval)
                    now, until = encode_position(roster.standings()), roster.version
                    async with aclosing(roster.changes(version)) as messages:
                        async for message in messages:
                            yield ManyPart(message)
                    marked, version = now, until
                elif version == roster.version:
                    marked = encode_position(roster.standings())
                if loop.time() >= marked_at + MARK_SECONDS:
                    yield ManyPart(position=marked)
                    marked_at = loop.time()
            position = ()


def _go_on(position: Sequence[Standing], standings: Sequence[Standing]) -> bool:
    """Whether what is there now follows what there was at a position."""
    return len(position) == len(standings) and all(
        before.incarnation == now.incarnation and before.number <= now.number
        for before, now in zip(position, standings, strict=True)
    )


def _apart(
    entries: list[RosterEntry], position: Sequence[Standing] | None
) -> tuple[list[RosterEntry], list[RosterEntry]]:
    """What has changed since a position, and the rest."""
    if position is None:
        return entries, []
    changed: list[RosterEntry] = []
    same: list[RosterEntry] = []
    for entry in entries:
        as_before = not entry.new and position[entry.partition].has(entry.commit)
        (same if as_before else changed).append(entry)
    return changed, same
