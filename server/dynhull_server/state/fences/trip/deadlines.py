"""Events that time makes: of subjects that have waited for long enough."""

from ..model.fence import Fence
from ..model.records import Cause, EventType, Key, Subject
from ..model.requests import PassTime
from .alarms import pass_time as raise_by_time
from .comparison import Comparison
from .delayed import end_some

# The most subjects that make an event together because time has passed.
MOST_DUE = 4096


def pass_time(request: PassTime, fence: Fence, comparison: Comparison) -> None:
    """Make the events for which time has passed, in the order of hulls and keys."""
    if fence is not request.fence:
        return
    ripe: dict[str, list[Subject]] = {}
    for subject in () if fence.delays is None else fence.delays.due(request.time, MOST_DUE):
        ripe.setdefault(subject[0], []).append(subject)
    for hull, found in sorted(ripe.items()):
        comparison.applied = True
        end_some(comparison.leg(fence), fence.subjects[hull], found, Cause.TIME, request.time)
    for watched in () if fence.watched is None else fence.watched.take(request.time, MOST_DUE):
        comparison.applied = True
        raise_by_time(comparison.leg(fence), watched, request.time)
    made = comparison.legs.get(fence.number)
    # The events of this trip come after those that `dwelling` knows.
    changed = set() if made is None else {event.former for event in made.events if event.key is not None}
    waited: dict[str, dict[Key, tuple[EventType, int, int]]] = {}
    due = () if fence.dwelling is None else fence.dwelling.due(request.time - fence.row.config.dwell, MOST_DUE)
    for (hull, key), since in due:
        if (hull, key) not in changed:
            waited.setdefault(hull, {})[key] = EventType.DWELL, int(Cause.TIME), since
    for hull, keys in sorted(waited.items()):
        comparison.leg(fence).report(fence.subjects[hull], keys, request.time)
