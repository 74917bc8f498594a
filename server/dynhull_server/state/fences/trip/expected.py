"""What a trip makes of the keys that a fence expects inside: those missing at a deadline, and those that arrive."""

from ...records import NO_TIME
from ..model.expected import NOWHERE, OF_ALL, expectations_of
from ..model.records import Cause, EventType, FenceEvent, Key
from .leg import FenceLeg


def begin(leg: FenceLeg, now: int) -> None:
    """Begin to expect keys by the settings of a fence after the trip: nobody is missing so far."""
    fence, before = leg.fence, leg.fence.expectations
    for key in () if before is None else (*before.keys, OF_ALL):
        leg.delays[NOWHERE, key] = None
    fence.expectations = expected = expectations_of(leg.row.config, leg.time(now))
    if expected is not None:
        fence.count_expected()
        leg.put_expected(OF_ALL, expected.stored)
    leg.followed = len(leg.events)


def follow(leg: FenceLeg, now: int) -> None:
    """Take in the events that the trip has made since, and make an event of each key that has arrived."""
    expected = leg.fence.expectations
    if expected is None:
        return
    made = leg.events[leg.followed :]
    for event in made:
        if event.key is None or event.key not in expected.keys:
            continue
        if event.type is EventType.EXIT:
            leg.put_expected(event.key, expected.left(event.key, event.time))
        elif event.type is EventType.ENTER:
            since, stored = expected.entered(event.key)
            leg.put_expected(event.key, stored)
            if since is not None:
                arrived = event._replace(type=EventType.ARRIVED, time=leg.time(now), first_time=since)
                leg.events.append(arrived._replace(sequence=leg.last + 1, origin=None))
    leg.followed = len(leg.events)


def report_missing(leg: FenceLeg, due: int) -> int:
    """Make an event of each key that is missing at a deadline. Returns their number."""
    expected = leg.fence.expectations
    assert expected is not None  # the caller has asked when it is due
    found = expected.missing_at(due)
    time = leg.time(due)
    for key, since in found.items():
        leg.events.append(_missing(leg, key, since, time))
        leg.put_expected(key, expected.missed(key, due))
    leg.put_expected(OF_ALL, expected.pass_deadline(due))
    leg.followed = len(leg.events)
    return len(found)


def _missing(leg: FenceLeg, key: Key, since: int, time: int) -> FenceEvent:
    """The event: where the key is, if it is somewhere, in the first hull by name."""
    for name, subjects in sorted(leg.fence.subjects.items()):
        if isinstance(key, str) != (subjects.hull.row.settings.identity == "str"):
            continue
        found = leg.place(subjects, key)
        if found is not None:
            position, distance, event_time = found
            subject = EventType.MISSING, int(Cause.TIME), name, key, subjects.hull.state.counts.revision
            return FenceEvent(
                leg.last + 1, *subject, leg.area_revision, position, None, distance, event_time, time, since
            )
    config = leg.row.config
    name = config.subjects if config.kind == "hull" else NOWHERE
    revision = leg.fence.subjects[name].hull.state.counts.revision if name in leg.fence.subjects else 0
    subject = EventType.MISSING, int(Cause.TIME), name, key, revision
    return FenceEvent(leg.last + 1, *subject, leg.area_revision, None, None, None, NO_TIME, time, since)
