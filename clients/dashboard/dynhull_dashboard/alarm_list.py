"""The alarms of the server, watched once for all viewers."""

import asyncio
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta

from dynhull_client import Alarm, AlarmNotFoundError, AsyncHullClient, DynhullError, PermissionDeniedError

from .repeating import log, repeat

LIST_SECONDS, READ_SECONDS, RETRY_SECONDS = 1.0, 1.0, 1.0
TIMEOUT_SECONDS = 2.0
# Each has a watch. Of more alarms those with the first names are shown.
MOST_ALARMS = 50
# An alarm that is cleared is seen for a while.
CLEARED_SECONDS = 30.0


class AlarmFeed:
    """An alarm and the hulls for which it is raised, kept up to date until closed.

    Attributes:
        name: the name of the alarm.
        alarm: what is known of it; None before the first answer, and once it is deleted.
        cleared: when it was cleared for hulls, in seconds of `time.time`.
        forbidden: whether the token may not acknowledge or mute it, as was seen when somebody tried.
    """

    def __init__(self, client: AsyncHullClient, name: str) -> None:
        self.name = name
        self.alarm: Alarm | None = None
        self.cleared: dict[str, float] = {}
        self.forbidden = False
        self._client = client
        self._changed = asyncio.Event()
        self._tasks = [
            asyncio.create_task(repeat(name, self._read, lambda: READ_SECONDS, self._changed)),
            asyncio.create_task(self._follow()),
        ]

    async def close(self) -> None:
        """Stop following the alarm."""
        for task in self._tasks:
            task.cancel()
        await asyncio.wait(self._tasks)

    def read_now(self) -> None:
        """Somebody has acknowledged or muted it."""
        self._changed.set()

    async def _read(self) -> None:
        try:
            self.alarm = await self._client.get_alarm(self.name, timeout=TIMEOUT_SECONDS)
        except AlarmNotFoundError:
            self.alarm = None
            raise
        latest = time.time() - CLEARED_SECONDS
        raised = {status.hull for status in self.alarm.statuses if status.raised}
        self.cleared = {hull: at for hull, at in self.cleared.items() if at > latest and hull not in raised}

    async def _follow(self) -> None:
        """Read it at once where something has happened."""
        while True:
            try:
                async with self._client.watch_alarm(self.name) as watch:
                    async for event in watch:
                        if event.type == "cleared":
                            self.cleared[event.hull] = time.time()
                        self._changed.set()
            except DynhullError as error:
                log.info("%s: %s", self.name, error)
            await asyncio.sleep(RETRY_SECONDS)


class AlarmList:
    """The alarms of the server.

    Args:
        client: the connection.
        prefix: only alarms whose names begin with it are shown.
    """

    def __init__(self, client: AsyncHullClient, prefix: str) -> None:
        self._client = client
        self._prefix = prefix
        self._feeds: dict[str, AlarmFeed] = {}
        self._task = asyncio.create_task(repeat("alarms", self._list, lambda: LIST_SECONDS))

    def __iter__(self) -> Iterator[AlarmFeed]:
        return iter(self._feeds.values())

    async def close(self) -> None:
        """Stop following them."""
        self._task.cancel()
        await asyncio.wait([self._task])
        await asyncio.gather(*(feed.close() for feed in self))

    async def acknowledge(self, name: str, hull: str) -> str:
        """Say that somebody takes care of it; returns why not, empty where it was done."""
        try:
            await self._client.acknowledge_alarm(name, hull, timeout=TIMEOUT_SECONDS)
        except DynhullError as error:
            return self._refused(name, error)
        return self._done(name)

    async def mute(self, name: str, hull: str, seconds: float) -> str:
        """Mute it for so long, 0 for no longer; returns why not, empty where it was done."""
        until = datetime.now(UTC) + timedelta(seconds=seconds) if seconds else None
        try:
            await self._client.mute_alarm(name, hull, until, timeout=TIMEOUT_SECONDS)
        except DynhullError as error:
            return self._refused(name, error)
        return self._done(name)

    def _done(self, name: str) -> str:
        if name in self._feeds:
            self._feeds[name].read_now()
        return ""

    def _refused(self, name: str, error: DynhullError) -> str:
        if not isinstance(error, PermissionDeniedError):
            return f"{name}: {error}"
        if name in self._feeds:
            self._feeds[name].forbidden = True
        return f"{error}. Start the dashboard with a --token that may write {name}"

    async def _list(self) -> None:
        names: list[str] = []
        async for alarm in self._client.list_alarms(self._prefix, timeout=TIMEOUT_SECONDS):
            if len(names) == MOST_ALARMS:
                break
            names.append(alarm.name)
        for name in self._feeds.keys() - set(names):
            await self._feeds.pop(name).close()
        for name in names:
            if name not in self._feeds:
                self._feeds[name] = AlarmFeed(self._client, name)
