"""Limits on the state."""

from dataclasses import dataclass

from .records import HullSettings


@dataclass(frozen=True, slots=True)
class FenceLimits:
    """Limits on fences; error messages use the field names.

    Attributes:
        max_fences: the number of fences.
        max_alarms: the number of alarms.
        max_alarm_hulls: the number of hulls that all alarms watch, one counted for each alarm.
        max_fence_consumers: the number of consumers per fence, or alarm.
        max_fence_events: the number of events to keep per fence.
        max_fence_event_age: the seconds for which events are kept, 0 for no limit.
        fence_event_bytes: the memory for recent events of all fences, divided by their number; 64 MB at most in all.
    """

    max_fences: int = 100_000
    max_alarms: int = 100_000
    max_alarm_hulls: int = 1_000_000
    max_fence_consumers: int = 1_000
    max_fence_events: int = 1_000_000
    max_fence_event_age: float = 0.0
    fence_event_bytes: int = 2**18


@dataclass(frozen=True, slots=True)
class Limits:
    """Limits on the state; error messages use the field names.

    Attributes:
        max_hulls: the number of hulls.
        max_points: the number of points per hull, with multiplicity.
        max_producers: the number of producers (writers that number their batches) per hull.
        max_producers_per_caller: the number of producers per hull that belong to one caller.
        resume_bytes: the memory per hull for earlier vertices, from which watchers resume.
        fences: the limits on fences.
        max_past_rows: the number of points and rows of batches that a read of the past may rebuild.
        max_feed_consumers: the number of consumers of feeds.
    """

    max_hulls: int
    max_points: int
    max_producers: int
    max_producers_per_caller: int
    resume_bytes: int
    fences: FenceLimits = FenceLimits()
    max_past_rows: int = 20_000_000
    max_feed_consumers: int = 1_000

    def points_of(self, settings: HullSettings) -> int:
        """The number of points of a hull, with multiplicity."""
        return min(settings.max_points or self.max_points, self.max_points)
