"""When hulls and fences have something to do because time passes."""

from collections.abc import Iterator
from heapq import heappop, heappush

from .fences.model.fence import Fence
from .hull import Hull
from .registry import Registry

# Microseconds before those who have been inside of a fence for long are looked at again.
LOOK_AGAIN = 1_000_000


class Schedule:
    """The times at which points leave hulls, and at which subjects have been inside of fences for long enough.

    Args:
        registry: the hulls and fences.

    Attributes:
        fences: what is planned of fences; only whether there is anything is for others.
    """

    def __init__(self, registry: Registry) -> None:
        self._registry = registry
        # Heaps of times, each with the number and name of the hull or fence. An entry is outdated if its time is not
        # that of the plan.
        self._hulls: list[tuple[int, int, str]] = []
        self.fences: list[tuple[int, int, str]] = []

    def plan(self, hull: Hull) -> None:
        """Plan when points of a hull leave next. No trip of the hull is in progress."""
        due = hull.next_due
        if due is not None and (hull.due is None or due < hull.due):
            hull.due = due
            heappush(self._hulls, (due, hull.row.number, hull.name))

    def plan_fence(self, fence: Fence) -> None:
        """Plan when the next subject has been inside of a fence for long enough."""
        due = fence.next_due
        if due is not None and (fence.due is None or due < fence.due):
            self._push(fence, due)

    def look_again(self, fence: Fence, time: int) -> None:
        """Plan to look at a fence again a little after a time, or when more of it is due."""
        due = fence.due_after(time)
        self._push(fence, time + LOOK_AGAIN if due is None else min(due, time + LOOK_AGAIN))

    def _push(self, fence: Fence, due: int) -> None:
        fence.due = due
        heappush(self.fences, (due, fence.number, fence.name))

    def has(self, time: int) -> bool:
        """Whether anything is planned for a time or before it."""
        return _has(self.fences, time) or _has(self._hulls, time)

    def take(self, time: int) -> Iterator[Hull]:
        """The hulls with a plan for this time or before it, each without that plan."""
        while _has(self._hulls, time):
            due, number, name = heappop(self._hulls)
            hull = self._registry.hulls.get(name)
            if hull is not None and hull.row.number == number and hull.due == due:
                hull.due = None
                yield hull

    def take_fences(self, time: int) -> Iterator[Fence]:
        """The fences with a plan for this time or before it, each without that plan."""
        while _has(self.fences, time):
            due, number, name = heappop(self.fences)
            fence = self._registry.fences.get(name)
            if fence is not None and fence.number == number and fence.due == due:
                fence.due = None
                yield fence


def _has(planned: list[tuple[int, int, str]], time: int) -> bool:
    return bool(planned) and planned[0][0] <= time
