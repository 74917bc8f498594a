"""Metrics of fences."""

import heapq
from collections.abc import Iterator

from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily
from prometheus_client.metrics_core import Metric

from ..engine.alarms import alarms_among
from ..engine.fences import Fences, LiveFence
from ..engine.server_time import MICROSECONDS
from ..state.alarms.rule import is_alarm
from ..state.fences.model.records import EventType

# The number of fences with the largest backlogs that have metrics of their own.
NAMED_FENCES = 100


def fence_families(fences: Fences, now: int) -> Iterator[Metric]:
    """The number of fences, their events by type, and how far consumers are behind.

    Args:
        fences: the fences.
        now: the server's clock.
    """
    every = [each for each in fences.all() if not is_alarm(each.name)]
    yield GaugeMetricFamily("dynhull_fences", "Fences.", value=len(every))
    inside = sum(each.fence.inside for each in every)
    yield GaugeMetricFamily("dynhull_fence_inside", "Subjects inside of all fences.", value=inside)
    events = CounterMetricFamily(
        "dynhull_fence_events",
        "Events of fences and alarms since the start, by type; alarms begin and cease.",
        labels=["type"],
    )
    for kind in EventType:
        events.add_metric([kind.name.lower()], fences.events[kind])
    yield events
    backlog = GaugeMetricFamily(
        "dynhull_fence_backlog", "Events that the slowest consumer has not acknowledged.", labels=["fence"]
    )
    oldest = GaugeMetricFamily(
        "dynhull_fence_backlog_oldest_seconds",
        "Age of the oldest event in memory that the slowest consumer has not acknowledged.",
        labels=["fence"],
    )
    lost = GaugeMetricFamily(
        "dynhull_fence_lost_events", "Events dropped before a consumer acknowledged them.", labels=["fence"]
    )
    followed = [each for each in every if each.fence.consumers]
    for each in heapq.nlargest(NAMED_FENCES, followed, key=_backlog):
        backlog.add_metric([each.name], _backlog(each))
        oldest.add_metric([each.name], _age(each, now))
        lost.add_metric([each.name], sum(consumer.lost for consumer in each.fence.consumers.values()))
    yield from (backlog, oldest, lost)
    alarms = alarms_among(fences)
    yield GaugeMetricFamily("dynhull_alarms", "Alarms.", value=len(alarms))
    watched = sum(len(each.fence.watched) for each in alarms if each.fence.watched is not None)
    help_text = "Hulls that alarms watch, each counted once for each alarm, of at most --max-alarm-hulls."
    yield GaugeMetricFamily("dynhull_alarm_hulls", help_text, value=watched)
    raised = sum(each.fence.inside for each in alarms)
    yield GaugeMetricFamily("dynhull_alarm_raised", "Hulls for which an alarm is raised, of all alarms.", value=raised)


def _backlog(live: LiveFence) -> int:
    """The largest backlog of a consumer."""
    return max(live.fence.backlog(consumer) for consumer in live.fence.consumers.values())


def _age(live: LiveFence, now: int) -> float:
    """The age in seconds of the oldest event of the largest backlog, as far as it is in memory."""
    fence = live.fence
    after = max(fence.last - _backlog(live), fence.oldest_recent - 1)
    events = fence.events(after, 1)
    return max(now - events[0].time, 0) / MICROSECONDS if events else 0.0
