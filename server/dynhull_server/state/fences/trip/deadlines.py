"""Events that time makes: of subjects that have waited for long enough. Each is made when it was due."""

from itertools import takewhile
from operator import itemgetter

from ..model.dwell import Dwelling
from ..model.fence import Fence
from ..model.records import NO_WAITS, Cause, EventType, FenceEvent, Key, Subject
from ..model.requests import PassTime
from .alarms import pass_time as raise_by_time
from .comparison import Comparison
from .delayed import end_some
from .expected import follow, report_missing

# The most subjects that make an event together because time has passed.
MOST_DUE = 4096


def pass_time(request: PassTime, fence: Fence, comparison: Comparison) -> None:
    """Make the events for which time has passed, in the order of times, hulls and keys."""
    if fence is not request.fence:
        return
    for watched, due in () if fence.watched is None else fence.watched.take(request.time, MOST_DUE):
        comparison.applied = True
        raise_by_time(comparison.leg(fence), watched, due)
    config, stays, expected = fence.row.config, _Stays(fence, comparison, request.time), fence.expectations
    made = 0
    while made < MOST_DUE:  # the others at the next look
        times = []
        if fence.delays is not None and fence.delays.first is not None:
            times.append(fence.delays.first + config.min_dwell)
        if (since := stays.first()) is not None:
            times.append(since + config.dwell)
        if expected is not None and (deadline := expected.first_due) is not None:
            times.append(deadline)
        due = min(times, default=request.time + 1)
        if due > request.time:
            return
        ripe: dict[str, list[Subject]] = {}
        for subject in () if fence.delays is None else fence.delays.due(due, MOST_DUE):
            ripe.setdefault(subject[0], []).append(subject)
        for hull, found in sorted(ripe.items()):
            comparison.applied = True
            end_some(comparison.leg(fence), fence.subjects[hull], found, Cause.TIME, due)
        waited: dict[str, dict[Key, tuple[EventType, int, int]]] = {}
        for (hull, key), since in stays.take(due - config.dwell):
            waited.setdefault(hull, {})[key] = EventType.DWELL, int(Cause.TIME), since
        for hull, keys in sorted(waited.items()):
            comparison.leg(fence).report(fence.subjects[hull], keys, due)
        made += sum(map(len, (*ripe.values(), *waited.values())))
        if expected is not None:
            comparison.applied = True
            follow(comparison.leg(fence), due)
            if expected.first_due == due:
                made += report_missing(comparison.leg(fence), due)


class _Stays:
    """Who waits for a dwell event: those whose time comes in a trip, and those who enter in it.

    Args:
        fence: the fence.
        comparison: makes the events of the trip.
        until: the time up to which it comes.
    """

    def __init__(self, fence: Fence, comparison: Comparison, until: int) -> None:
        self._fence = fence
        self._comparison = comparison
        dwelling, dwell = fence.dwelling, fence.row.config.dwell
        # Ascending by times.
        self._known = {} if dwelling is None else dict(dwelling.due(until - dwell, MOST_DUE))
        self._new = Dwelling(NO_WAITS)
        self._seen = 0

    def first(self) -> int | None:
        """Since when the one counts that has waited longest; None if nobody waits."""
        self._look()
        times = next(iter(self._known.values()), None), self._new.first
        return min((time for time in times if time is not None), default=None)

    def take(self, since: int) -> list[tuple[Subject, int]]:
        """Those who have counted since then or longer."""
        self._look()
        known = takewhile(lambda each: each[1] <= since, self._known.items())
        return [*known, *self._new.due(since, MOST_DUE)]

    def _look(self) -> None:
        """Take in the events that the trip has made since."""
        leg = self._comparison.legs.get(self._fence.number)
        made: list[FenceEvent] = [] if leg is None else leg.events[self._seen :]
        self._seen += len(made)
        if self._fence.dwelling is None:
            return
        self._new.follow(made)
        for event in made:
            since = None if event.key is None else self._known.pop(event.former, None)
            if since is not None and event.type is EventType.TRANSFER and event.key is not None:
                self._known[event.hull, event.key] = since
                self._known = dict(sorted(self._known.items(), key=itemgetter(1)))
