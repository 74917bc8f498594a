"""The hulls and fences that are committed, and the numbers and places of new ones."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from sortedcontainers import SortedDict

from .errors import FenceNotFoundError, HullNotFoundError, LimitExceededError
from .fences.events.recent import RecentEvents
from .fences.model.fence import Fence
from .fences.model.tallies import Tallies
from .hull import Hull
from .limits import Limits
from .records import NO_TIME
from .trip import Reservation

if TYPE_CHECKING:
    from .fences.model.config import FenceConfig


class Registry:
    """What there is by name.

    Args:
        limits: the limits on the state.
        next_number: a number greater than that of any hull or fence ever created.

    Attributes:
        limits: the limits on the state.
        hulls: the hulls by name.
        fences: the fences by name; alarms are among them.
        alarms: the alarms by number.
        tallies: what is counted of these.
        recent: their recent events.
    """

    def __init__(self, limits: Limits, next_number: int) -> None:
        self.limits = limits
        self.hulls: SortedDict[str, Hull] = SortedDict()
        self.fences: SortedDict[str, Fence] = SortedDict()
        self.tallies = Tallies()
        self.recent = RecentEvents(limits.fences.fence_event_bytes)
        self._next_number = next_number
        self._creating = self._fencing = self._to_watch = 0
        self.alarms: dict[int, Fence] = {}

    def get(self, name: str) -> Hull:
        """The hull of that name, or raise HullNotFoundError."""
        hull: Hull | None = self.hulls.get(name)
        if hull is None:
            raise HullNotFoundError(name)
        return hull

    def fence(self, name: str) -> Fence:
        """The fence of that name, or raise FenceNotFoundError."""
        fence: Fence | None = self.fences.get(name)
        if fence is None:
            raise FenceNotFoundError(name)
        return fence

    @property
    def latest_time(self) -> int | None:
        """The latest time of the server's clock that a hull or fence has recorded, None for none. O(both)."""
        dated = [hull for hull in self.hulls.values() if hull.counts.clock is not None]
        clocks = [hull.counts.clock for hull in dated if hull.state.follows_server]
        clocks += [fence.time for fence in self.fences.values() if fence.time != NO_TIME]
        return max((clock for clock in clocks if clock is not None), default=None)

    def add_fence(self, fence: Fence) -> None:
        """Add a fence that is committed."""
        fence.join(self.tallies, self.recent)
        self.fences[fence.name] = fence
        if fence.watched is not None:
            self.alarms[fence.number] = fence

    def remove_fences(self, fences: Sequence[Fence]) -> None:
        """Remove fences that are deleted, once their last events are among the recent ones."""
        if fences:
            left = self.recent.of(np.array([fence.number for fence in fences]))
            for fence in fences:
                fence.part(left)
                del self.fences[fence.name]
                self.alarms.pop(fence.number, None)

    def compared(self, config: "FenceConfig") -> list[str]:
        """The names of the hulls whose keys a fence compares, or which an alarm watches."""
        if config.kind != "prefix":
            return [config.subjects] if config.kind == "hull" or config.rule is not None else []
        names = [name for name in self.hulls.irange(config.subjects) if name.startswith(config.subjects)]
        if config.rule is not None:
            other = None if config.rule.other is None else self.hulls[config.rule.other].row.settings
            suits = config.rule.suits
            return [each for each in names if config.compares(each) and suits(self.hulls[each].row.settings, other)]
        return [name for name in names if self.hulls[name].row.settings.identity != "multiset"]

    def reserve_hull(self) -> Reservation:
        """A place for a hull that may be created. Give it back once that is decided."""
        most = self.limits.max_hulls
        full = len(self.hulls) + self._creating >= most
        self._creating += 1
        return Reservation(self._new_number(), LimitExceededError("max_hulls", most) if full else None, self.limits)

    def reserve_fence(self, *, alarm: bool) -> int | None:
        """A number for a fence or alarm that may be created, None if it is too many. Give it back later."""
        self._fencing += 1
        there = len(self.alarms) if alarm else len(self.fences) - len(self.alarms)
        most = self.limits.fences.max_alarms if alarm else self.limits.fences.max_fences
        return self._new_number() if there + self._fencing <= most else None

    @property
    def watched(self) -> int:
        """The number of hulls that alarms watch, each counted once for each alarm. O(alarms)."""
        return sum(len(fence.watched) for fence in self.alarms.values() if fence.watched is not None)

    def reserve_watched(self, most: int) -> int:
        """Room for hulls that alarms are to watch: `most`, or what there is. Give it back later."""
        room = min(most, max(self.limits.fences.max_alarm_hulls - self.watched - self._to_watch, 0)) if most else 0
        self._to_watch += room
        return room

    def number_of_shard(self) -> int:
        """A number for a shard that is created."""
        return self._new_number()

    def give_back(self, hulls: int, fences: int = 0, watched: int = 0) -> None:
        """Give back places that were reserved."""
        self._creating -= hulls
        self._fencing -= fences
        self._to_watch -= watched

    def _new_number(self) -> int:
        number = self._next_number
        self._next_number += 1
        return number


def page_of(
    names: "SortedDict[str, Any]", prefixes: Sequence[str], after: str, size: int, *, but: str | None = None
) -> tuple[list[str], bool]:
    """At most `size` names that follow `after` and begin with a prefix, and whether there are more.

    The prefixes are sorted, and none of them begins with another. Names that begin with `but` are left out.
    """
    found: list[str] = []
    for prefix in prefixes:
        for name in names.irange(minimum=max(prefix, after)):
            if not name.startswith(prefix):
                break
            if name == after or (but is not None and name.startswith(but)):
                continue
            if len(found) == size:
                return found, True
            found.append(name)
    return found, False
