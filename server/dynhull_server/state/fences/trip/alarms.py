"""What a change of a hull, or time, means for an alarm: it waits, is raised, and is cleared."""

import math

from ...alarms.rule import AlarmRule
from ...alarms.values import Seen
from ...alarms.watched import Watched, WatchedHulls
from ...records import NO_TIME
from ..model.fence import Fence
from ..model.records import AlarmStanding, Cause, Delay, EventType
from .leg import FenceLeg


def look(leg: FenceLeg, watched: Watched, cause: Cause, now: int) -> None:
    """Compare a hull that has a new revision, for that cause, or has come to the alarm."""
    rule, before, fresh = _rule(leg), watched.changed(), watched.fresh
    watched.fresh = False
    if rule.silence:
        if cause is not Cause.CREATED:  # the hull may have been silent before
            watched.moved = leg.time(now)
        if watched.raised:
            _clear(leg, watched, cause, None, now)
    elif watched.raised:
        if before is not None and watched.holds(rule.clears):
            _clear(leg, watched, cause, before, now)
    elif before is not None or fresh:
        holds = watched.holds(rule.raises)
        if watched.waits and not holds:
            _put(leg, watched, _rest(watched))
        elif holds and not watched.waits:
            begun = _begun(leg, watched, cause, None if fresh else before, now)
            _put(leg, watched, begun)
            if not rule.hold:
                _raise(leg, watched, now)
    watched_hulls(leg.fence).plan(watched)


def pass_time(leg: FenceLeg, watched: Watched, due: int) -> None:
    """Raise an alarm for a hull for which the condition has held, or which has been silent, for long enough."""
    if _rule(leg).silence:
        revision, kept = watched.hull.state.counts.revision, _standing(watched)
        _put(leg, watched, Delay(True, watched.moved, revision, 0, kept._replace(acknowledged=NO_TIME)))
    _raise(leg, watched, due, Cause.TIME)


def deleted(leg: FenceLeg, watched: Watched, now: int) -> None:
    """Clear an alarm for a hull that is deleted, and forget what is known of it."""
    if watched.raised:
        _clear(leg, watched, Cause.REMOVED, None, now, gone=True)
    _put(leg, watched, None)


def put_standing(leg: FenceLeg, watched: Watched, *, acknowledged: int | None = None, muted: int | None = None) -> None:
    """Change who has acknowledged the alarm for a hull, or until when it is muted."""
    known, standing = watched.standing, _standing(watched)
    if acknowledged is not None:
        standing = standing._replace(acknowledged=acknowledged)
    if muted is not None:
        standing = standing._replace(muted=muted)
    put = Delay(False, NO_TIME, 0, 0, standing) if known is None else known._replace(standing=standing)
    _put(leg, watched, None if put == Delay(False, NO_TIME, 0, 0, AlarmStanding()) else put)


def _begun(leg: FenceLeg, watched: Watched, cause: Cause, before: Seen | None, now: int) -> Delay:
    """That the condition holds from this revision on."""
    previous = None if before is None else _finite(watched.value(before))
    standing = _standing(watched)._replace(previous=previous, acknowledged=NO_TIME)
    return Delay(True, leg.time(now), _revision(watched, cause), int(cause), standing)


def _raise(leg: FenceLeg, watched: Watched, now: int, more: int = 0) -> None:
    """Raise the alarm for the reason for which it waits."""
    rule, waiting = _rule(leg), watched.standing
    assert waiting is not None  # it waits
    watched_hulls(leg.fence).put_raised(watched, raised=True)
    _put(leg, watched, waiting._replace(enters=False))
    previous = None if waiting.standing is None else waiting.standing.previous
    value = watched.silent(now) if rule.silence else watched.value()
    leg.alarmed(
        EventType.BEGIN,
        waiting.causes | more,
        watched,
        (value, rule.raises.limit, previous),
        (waiting.reports, waiting.since),
        now,
        watched.keys(),
    )


def _clear(leg: FenceLeg, watched: Watched, cause: Cause, before: Seen | None, now: int, *, gone: bool = False) -> None:
    rule = _rule(leg)
    watched_hulls(leg.fence).put_raised(watched, raised=False)
    _put(leg, watched, _rest(watched))
    value = math.inf if gone else 0.0 if rule.silence else watched.value()
    previous = None if before is None else _finite(watched.value(before))
    began = _revision(watched, cause), leg.time(now)
    leg.alarmed(EventType.CEASE, cause, watched, (value, rule.clears.limit, previous), began, now)


def _revision(watched: Watched, cause: Cause) -> int:
    """The revision of the hull that has changed: of the other one if it was that alone."""
    other = watched.other
    changed = other if other is not None and cause is Cause.AREA else watched.hull
    return changed.state.counts.revision


def _finite(value: float) -> float | None:
    """A value before; None for the distance from an empty hull."""
    return value if math.isfinite(value) else None


def _rest(watched: Watched) -> Delay | None:
    """What is left of what is known of a hull for which the condition does not hold."""
    muted = _standing(watched).muted
    return None if muted == NO_TIME else Delay(False, NO_TIME, 0, 0, AlarmStanding(muted=muted))


def _standing(watched: Watched) -> AlarmStanding:
    known = watched.standing
    return AlarmStanding() if known is None or known.standing is None else known.standing


def _put(leg: FenceLeg, watched: Watched, standing: Delay | None) -> None:
    if standing != watched.standing:
        watched.standing = standing
        leg.put_standing(watched.hull.name, standing)


def _rule(leg: FenceLeg) -> AlarmRule:
    rule = leg.row.config.rule
    assert rule is not None  # only alarms are asked
    return rule


def watched_hulls(fence: Fence) -> WatchedHulls:
    """The hulls of an alarm."""
    assert fence.watched is not None  # only alarms are asked
    return fence.watched
