"""The newest states of many hulls, in the order in which they last changed.

Whoever follows them remembers how far it is, and takes what has changed since: the newest state of each. So there are
no queues, and a state is encoded once, however many follow. A hull that is busy, as with a long batch, is left out: its
state comes when it may be read, and the others do not wait for it.
"""

import asyncio
from collections import OrderedDict
from collections.abc import AsyncGenerator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple, Protocol

from ..state.errors import LimitExceededError
from ..state.records import CommitStamp
from .positions import Standing
from .steps import Slices

# Bytes of the states in one message, unless there is but one, and seconds of encoding after which it is sent: a state
# that is not there by then comes later.
MESSAGE_BYTES, MESSAGE_SECONDS = 2**18, 0.05
# Names that are gone, and kept for those who have yet to hear of it, before it is looked who has.
SOME_GONE = 1_000
# Messages that are kept for others who are equally far.
SHARED = 4


@dataclass(frozen=True, slots=True)
class RosterLimits:
    """Limits on what is followed at once; error messages use the names of the settings.

    Attributes:
        hulls: the number of hulls.
        size: the bytes of their states.
    """

    hulls: int
    size: int

    def require_hulls(self, number: int) -> None:
        """Raise LimitExceededError if these are too many hulls."""
        if number > self.hulls:
            raise LimitExceededError("max_watched_hulls", self.hulls, "watch fewer hulls, as by a longer prefix")

    def require_size(self, size: int) -> None:
        """Raise LimitExceededError if these are too many bytes."""
        if size > self.size:
            what = "watch fewer hulls, fewer of their vertices, or summaries"
            raise LimitExceededError("max_watched_bytes", self.size, what)


@dataclass(slots=True, eq=False)
class RosterEntry:
    """One name.

    Attributes:
        name: the name.
        version: a number that is greater than those of all that changed before it.
        partition: the one that has it.
        commit: the commit of its last change; None where that is not known.
        new: whether it has never had a batch.
        gone: whether it is there no more.
        state: the encoded state, None until it is asked for.
    """

    name: str
    version: int
    partition: int = 0
    commit: CommitStamp | None = None
    new: bool = False
    gone: bool = False
    state: bytes | None = None


class RosterMessage(NamedTuple):
    """States that are sent at once.

    Attributes:
        states: the states.
        entries: those whose states these are, and those that are late.
        late: those whose states come later: they get a new version with it.
    """

    states: bytes
    entries: Sequence[RosterEntry]
    late: Sequence[RosterEntry]


class Source(Protocol):
    """Where the states come from."""

    def standings(self) -> list[Standing]:
        """How far each partition is: what its commits up to there have changed is in the roster."""

    async def encode(self, entry: RosterEntry) -> bytes:
        """The state of an entry as a message that has only this one: the bytes of several are those of one with all."""

    def unchanged(self, entry: RosterEntry) -> bytes:
        """The same of an entry that a follower has."""


class Roster:
    """The newest states.

    Args:
        source: where they come from.
        limits: how much may be followed at once.

    Attributes:
        version: that of what has changed last.
        generation: the number of times that everything began anew.
    """

    def __init__(self, source: Source, limits: RosterLimits) -> None:
        self.version = 0
        self.generation = 0
        self._source = source
        self._limits = limits
        self._size = 0
        self._entries: OrderedDict[str, RosterEntry] = OrderedDict()
        self._gone = 0
        self._most_gone = SOME_GONE
        self._moved = asyncio.Event()
        self._encoding = asyncio.Lock()
        self._heard: dict[object, int] = {}
        self._shared: OrderedDict[tuple[int, int, int], RosterMessage] = OrderedDict()
        self._late: dict[RosterEntry, asyncio.Task[None]] = {}

    def get(self, name: str) -> RosterEntry | None:
        """The entry of a name that is there."""
        entry = self._entries.get(name)
        return None if entry is None or entry.gone else entry

    def entries(self) -> list[RosterEntry]:
        """Those that are there, the one that has changed last at the end."""
        return [entry for entry in self._entries.values() if not entry.gone]

    def change(
        self,
        name: str,
        commit: CommitStamp | None,
        *,
        partition: int = 0,
        new: bool = False,
        state: bytes | None = None,
    ) -> None:
        """Note that a hull has changed, or is there. O(1)."""
        entry = self._at_end(name)
        self._gone -= entry.gone
        entry.partition, entry.commit, entry.new, entry.gone = partition, commit, new, False
        self._keep(entry, state)

    def end(self, name: str) -> None:
        """Note that a hull is gone. O(1)."""
        if self.get(name) is None:
            return
        entry = self._at_end(name)
        entry.gone = True
        self._keep(entry, None)
        self._gone += 1
        if self._gone > self._most_gone:
            self._forget_gone()

    def close(self) -> None:
        """Wait for no states any more."""
        for waiting in self._late.values():
            waiting.cancel()

    def begin_anew(self) -> None:
        """Note that states may have gone back: all who follow begin anew."""
        self.generation += 1
        self._moved.set()

    def require_within_limits(self) -> None:
        """Raise LimitExceededError if there are too many hulls, or their states are too large. O(1)."""
        self._limits.require_hulls(len(self._entries) - self._gone)
        self._limits.require_size(self._size)

    def _keep(self, entry: RosterEntry, state: bytes | None) -> None:
        self._size += len(state or b"") - len(entry.state or b"")
        entry.state = state

    def _at_end(self, name: str) -> RosterEntry:
        self.version += 1
        entry = self._entries.get(name)
        if entry is None:
            entry = self._entries[name] = RosterEntry(name, self.version)
        else:
            entry.version = self.version
            self._entries.move_to_end(name)
        self._moved.set()
        return entry

    def _forget_gone(self) -> None:
        """Forget the names that are gone, and of which all have heard. O(names)."""
        heard = min(self._heard.values(), default=self.version)
        for entry in [each for each in self._entries.values() if each.gone and each.version <= heard]:
            del self._entries[entry.name]
            self._gone -= 1
        self._most_gone = 2 * self._gone + SOME_GONE

    # Those who follow

    def standings(self) -> list[Standing]:
        """How far each partition is."""
        return self._source.standings()

    @contextmanager
    def following(self) -> Iterator[object]:
        """One who follows, and has to hear of all that is gone from now on."""
        follower = object()
        self._heard[follower] = self.version
        try:
            yield follower
        finally:
            del self._heard[follower]

    def heard(self, follower: object, version: int) -> None:
        """Note that a follower has what has changed up to a version."""
        self._heard[follower] = version

    async def beyond(self, version: int, generation: int) -> None:
        """Wait until something has changed after a version, or everything has begun anew."""
        while self.version <= version and self.generation == generation:
            self._moved.clear()
            await self._moved.wait()

    def after(self, version: int) -> list[RosterEntry]:
        """What has changed after a version, in order. O(its number)."""
        found = []
        for entry in reversed(self._entries.values()):
            if entry.version <= version:
                break
            found.append(entry)
        found.reverse()
        return found

    async def changes(self, since: int) -> AsyncGenerator[RosterMessage, None]:
        """The states of what has changed after a version, many to a message.

        Those who are equally far share the messages. A hull that changes meanwhile is sent as it is then, and again.
        """
        until, entries = self.version, self.after(since)
        first = 0
        while first < len(entries):
            key = since, until, first
            async with self._encoding:
                message = self._shared.get(key)
                if message is None:
                    message = self._shared[key] = await self._message(entries, first)
                    while len(self._shared) > SHARED:
                        self._shared.popitem(last=False)
            first += len(message.entries)
            yield message

    async def states(self, entries: Sequence[RosterEntry]) -> AsyncGenerator[RosterMessage, None]:
        """The states of some entries, many to a message."""
        first = 0
        while first < len(entries):
            async with self._encoding:
                message = await self._message(entries, first)
            first += len(message.entries)
            yield message

    async def names(self, entries: Sequence[RosterEntry]) -> AsyncGenerator[bytes, None]:
        """The names of entries that a follower has, many to a message."""
        waiting: list[bytes] = []
        size = 0
        for entry in entries:
            waiting.append(self._source.unchanged(entry))
            size += len(waiting[-1])
            if size > MESSAGE_BYTES:
                yield b"".join(waiting)
                waiting, size = [], 0
        if waiting:
            yield b"".join(waiting)

    async def _message(self, entries: Sequence[RosterEntry], first: int) -> RosterMessage:
        """The next message, which begins with an entry. Raises LimitExceededError."""
        loop = asyncio.get_running_loop()
        begun = loop.time()
        slices = Slices()
        size, number = 0, first
        states: list[bytes] = []
        late: list[RosterEntry] = []
        while number < len(entries) and not (number > first and loop.time() - begun > MESSAGE_SECONDS):
            entry = entries[number]
            state = entry.state
            if state is None:
                state = await self._encoded(entry, begun + MESSAGE_SECONDS)
                await slices.others()
            if state is None:
                late.append(entry)
            else:
                if states and size + len(state) > MESSAGE_BYTES:
                    break
                states.append(state)
                size += len(state)
            number += 1
        self.require_within_limits()
        return RosterMessage(b"".join(states), entries[first:number], late)

    async def _encoded(self, entry: RosterEntry, until: float) -> bytes | None:
        """The state of an entry; None if it is not there at a time: it comes later."""
        if entry in self._late:
            return None
        version = entry.version
        try:
            async with asyncio.timeout_at(until):
                state = await self._source.encode(entry)
        except TimeoutError:
            self._late[entry] = asyncio.create_task(self._come_later(entry))
            return None
        if entry.version == version:  # otherwise it comes again, with what has changed meanwhile
            self._keep(entry, state)
        return state

    async def _come_later(self, entry: RosterEntry) -> None:
        """Have all who follow get the state of an entry as soon as it is there."""
        try:
            newest = False
            while not newest and not entry.gone:
                version = entry.version
                state = await self._source.encode(entry)
                newest = entry.version == version
                if not entry.gone:
                    self._keep(self._at_end(entry.name), state)
        except Exception:  # those who follow get it when they ask for the state again
            if not entry.gone:
                self._at_end(entry.name)
        finally:
            del self._late[entry]
