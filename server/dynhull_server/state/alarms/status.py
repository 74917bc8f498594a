"""What an alarm says about a hull at present."""

from typing import NamedTuple

from ..records import NO_TIME
from .watched import Watched, WatchedHulls


class AlarmStatus(NamedTuple):
    """An alarm at one hull; times in microseconds since 1970, NO_TIME for none.

    Attributes:
        hull: the name of the hull.
        raised: whether the alarm is raised for it.
        revision: the revision of the hull.
        value: its measure there, or the seconds since its last change.
        since: since when the condition holds.
        acknowledged: when somebody has acknowledged the alarm.
        muted: until when it is muted.
    """

    hull: str
    raised: bool
    revision: int
    value: float
    since: int
    acknowledged: int
    muted: int


def status_of(watched: Watched, now: int) -> AlarmStatus:
    """What an alarm says about a hull."""
    known, revision = watched.standing, watched.hull.state.counts.revision
    value = watched.silent(now) if watched.of_silence else watched.value()
    since = NO_TIME if known is None else known.since
    acknowledged, muted = NO_TIME, NO_TIME
    if known is not None and known.standing is not None:
        acknowledged, muted = known.standing.acknowledged, known.standing.muted
    return AlarmStatus(
        watched.hull.name, watched.raised, revision, value, since, acknowledged, muted if muted > now else NO_TIME
    )


def statuses_of(hulls: WatchedHulls, now: int) -> list[AlarmStatus]:
    """What an alarm says about the hulls for which it is raised, waits, or is muted, by name."""
    found = (status_of(watched, now) for _, watched in sorted(hulls.of.items()) if watched.standing is not None)
    return [each for each in found if each.raised or each.since != NO_TIME or each.muted != NO_TIME]
