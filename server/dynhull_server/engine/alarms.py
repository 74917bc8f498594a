"""Alarms as their callers use them: kept as fences are, with names of their own."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial

from ..state.alarms.rule import MARK, marked, unmarked
from ..state.alarms.status import AlarmStatus, statuses_of
from ..state.errors import (
    AlarmExistsError,
    AlarmNotFoundError,
    AlarmReplacedError,
    ConsumerNotFoundError,
    FenceExistsError,
    FenceNotFoundError,
    FenceReplacedError,
)
from ..state.fences.model.config import FenceConfig
from ..state.fences.model.fence import Fence
from ..state.fences.model.requests import AcknowledgeAlarm, MuteAlarm
from ..state.registry import page_of
from .driver import Driver
from .fences import Fences, LiveFence
from .waiter import Waiter


class Alarms:
    """The alarms of an engine.

    Args:
        driver: drives the core that has them.
        fences: the fences and alarms.
    """

    def __init__(self, driver: Driver, fences: Fences) -> None:
        self._driver = driver
        self._fences = fences

    def get(self, name: str) -> LiveFence:
        """The alarm of that name, or raise AlarmNotFoundError."""
        with calling_them_alarms():
            return self._fences.get(marked(name))

    def page(self, prefixes: Sequence[str], after: str, size: int) -> tuple[list[LiveFence], bool]:
        """At most `size` alarms whose names follow `after`, and whether there are more, as `Fences.page`."""
        found = [marked(prefix) for prefix in prefixes]
        names, more = page_of(self._driver.core.fences, found, marked(after) if after else "", size)
        return [self._fences.get(name) for name in names], more

    async def create(self, name: str, config: FenceConfig) -> LiveFence:
        """Create an alarm, or raise the error that refuses it."""
        with calling_them_alarms():
            return await self._fences.create(marked(name), config)

    async def delete(self, name: str) -> None:
        """Delete an alarm, or raise AlarmNotFoundError or NotStoredError."""
        with calling_them_alarms():
            await self._fences.delete(marked(name))

    async def statuses(self, alarm: LiveFence) -> list[AlarmStatus]:
        """The hulls for which an alarm is raised, waits, or is muted, by name."""
        with calling_them_alarms():
            return await alarm.read(partial(_statuses, self._driver.time()), rows=alarm.fence.inside)

    async def acknowledge(self, name: str, hull: str) -> AlarmStatus:
        """Take note that somebody takes care of an alarm that is raised for a hull."""
        with calling_them_alarms():
            request = AcknowledgeAlarm(Waiter(), marked(name), self._driver.time(), hull)
            found: AlarmStatus = await self._driver.ask(request)
            return found

    async def mute(self, name: str, hull: str, until: int) -> AlarmStatus:
        """Mute an alarm for a hull until a time, in microseconds since 1970."""
        with calling_them_alarms():
            request = MuteAlarm(Waiter(), marked(name), self._driver.time(), hull, until)
            found: AlarmStatus = await self._driver.ask(request)
            return found


@contextmanager
def calling_them_alarms() -> Iterator[None]:
    """Have refusals speak of alarms, as callers know them."""
    try:
        yield
    except FenceNotFoundError as error:
        raise AlarmNotFoundError(unmarked(error.name)) from None
    except FenceExistsError as error:
        raise AlarmExistsError(unmarked(error.name)) from None
    except FenceReplacedError as error:
        raise AlarmReplacedError(unmarked(error.name), error.uid) from None
    except ConsumerNotFoundError as error:
        raise ConsumerNotFoundError(unmarked(error.fence), error.name, "alarm") from None


def alarms_among(fences: Fences) -> list[LiveFence]:
    """All alarms, by name."""
    return [each for each in fences.all() if each.name.startswith(MARK)]


def _statuses(now: int, fence: Fence, _: object) -> list[AlarmStatus]:
    return [] if fence.watched is None else statuses_of(fence.watched, now)
