"""What a change of a hull means for a fence whose events are delayed: by accuracy, confirmations or time."""

from collections.abc import Collection, Mapping

import numpy as np
import numpy.typing as npt

from dynhull import Crossings
from dynhull.keys import key_list, take_keys

from ...records import NO_TIME
from ..events.sequences import Swap, caused
from ..index.keys_changed import KeysChanged
from ..index.subjects import Subjects, keyed
from ..model.records import Cause, Delay, EventType, Key, Origin, Subject
from .leg import NOBODY, FenceLeg

OWN = Cause.MOVED | Cause.APPEARED
GONE = Cause.REMOVED | Cause.EXPIRED
NO_ROWS = slice(0)
TRANSFERRED = 2  # a change, as the index reports it


def delay(
    leg: FenceLeg,
    subjects: Subjects,
    crossings: Crossings | None,
    rows: slice,
    swap: Swap | None,
    now: int,
    changed: KeysChanged | None,
    origins: Mapping[Key, Origin] = NOBODY,
    *,
    moved: bool | None = None,
) -> None:
    """Begin and end delays, and make the events for which nothing is missing any more.

    Args:
        leg: the fence, one with delays.
        subjects: the keys of a hull.
        crossings: who has changed sides, or None.
        rows: those that concern the fence.
        swap: a cause, and the one that it stands for.
        now: the time.
        changed: what has happened to the keys; None where only the area has changed.
        origins: where subjects of this fence come from, with their delays.
        moved: whether the area has; None where that of nobody has, also not the hull of the others.
    """
    delays, hull = leg.fence.delays, subjects.hull.name
    assert delays is not None  # the caller checks it
    first = len(leg.events)
    arrived = _reported_inside(delays.of(hull), crossings, rows, origins) if origins else set()
    begun: set[Key] = set()
    if crossings is not None:
        begun = _follow(leg, subjects, crossings, rows, swap, now)
    waiting = delays.of(hull)  # another one, if there were none before
    touched = set(begun)
    reports: Collection[Key] = ()
    if changed is not None and waiting:
        _leave(leg, subjects, changed, now)
        config = leg.row.config
        if config.confirmations or config.by_accuracy:
            reports = changed.reports(keyed(subjects.hull.state), waiting, origins.keys())
        for key in reports if config.confirmations else ():
            each = waiting[key]
            if key not in begun and not each.doubt and not delays.confirmed(each):
                leg.put_delay((hull, key), each._replace(reports=each.reports + 1))
                touched.add(key)
    if waiting and leg.row.config.by_accuracy:
        looked = delays.doubts(hull) if moved is not None else [key for key in reports if waiting[key].doubt]
        touched.update(_certain(leg, subjects, [key for key in looked if key not in begun], reports, now, moved=moved))
    ripe = [(hull, key) for key in touched if key in waiting and delays.ripe(waiting[key], leg.time(now))]
    end_some(leg, subjects, ripe, Cause(0), now)
    told = {event.key for event in leg.events[first:] if event.type is not EventType.CROSS}
    if arrived - told:
        leg.report(subjects, dict.fromkeys(arrived - told, (EventType.TRANSFER, int(Cause.MOVED), NO_TIME)), now)
    ordered = sorted(leg.events[first:], key=lambda event: event.key)  # type: ignore[arg-type, return-value]
    start = leg.events[first].sequence if ordered else 0
    leg.events[first:] = [
        event._replace(sequence=start + place, origin=origins.get(event.key))  # type: ignore[arg-type]
        for place, event in enumerate(ordered)
    ]


def _certain(
    leg: FenceLeg,
    subjects: Subjects,
    doubtful: Collection[Key],
    reports: Collection[Key],
    now: int,
    *,
    moved: bool | None,
) -> list[Key]:
    """End the doubt of those of some keys that are on their side by more than their accuracy. Returns these.

    Who has not moved is certain because the area `moved`, or the hull of the others, unless that is None.
    """
    delays, hull, config = leg.fence.delays, subjects.hull.name, leg.row.config
    if delays is None or not doubtful:
        return []
    waiting, keys = delays.of(hull), subjects.keys(doubtful)
    clear = subjects.clear(leg, keys, keyed(subjects.hull.state).positions(keys))
    reported, certain = set(reports), []
    for key, is_clear in zip(key_list(keys), clear.tolist(), strict=True):
        if not is_clear:
            continue
        own, each = key in reported, waiting[key]
        area = moved or (moved is not None and not own)
        causes = (Cause.MOVED if own else Cause(0)) | (Cause.AREA if area else Cause(0))
        since = leg.time(now) if config.confirms else each.since
        ends = each._replace(since=since, reports=int(own and config.confirmations > 0), causes=causes, doubt=False)
        leg.put_delay((hull, key), ends)
        certain.append(key)
    return certain


def doubt_new(leg: FenceLeg, now: int) -> None:
    """Let those be outside of a new fence whose position is not certainly inside of its area."""
    for subjects in leg.fence.subjects.values() if leg.row.config.by_accuracy else ():
        keys = subjects.index.inside(leg.row.number)
        points = keyed(subjects.hull.state).positions(keys)
        clear = subjects.clear(leg, keys, points)
        for key in key_list(take_keys(keys, np.flatnonzero(~clear))):
            leg.put_delay((subjects.hull.name, key), Delay(True, leg.time(now), 0, int(Cause.CREATED), doubt=True))


def take_over(leg: FenceLeg, subjects: Subjects, origins: Mapping[Key, Origin]) -> None:
    """Let subjects that come from other hulls of the fence bring their delays."""
    delays = leg.fence.delays
    assert delays is not None  # the caller checks it
    for key, origin in origins.items():
        each = delays.of(origin.hull).get(key)
        if each is not None:
            leg.put_delay((origin.hull, key), None)
            leg.put_delay((subjects.hull.name, key), each)


def _reported_inside(
    waiting: Mapping[Key, Delay], crossings: Crossings | None, rows: slice, origins: Mapping[Key, Origin]
) -> set[Key]:
    """Those of the subjects that come from other hulls that were inside, as the events say."""
    inside: set[Key] = set()
    if crossings is not None:
        found = zip(key_list(crossings.keys[rows]), crossings.changes[rows].tolist(), strict=True)
        inside = {key for key, change in found if change in (-1, 2)}
    return {key for key in origins if (key in inside) != (key in waiting)}


def end_some(leg: FenceLeg, subjects: Subjects, ripe: Collection[Subject], more: Cause, now: int) -> None:
    """End delays of keys of a hull with an event of each; `more` are causes beside those of the delay."""
    delays, hull = leg.fence.delays, subjects.hull.name
    if not ripe or delays is None:
        return
    found = {}
    for subject in ripe:
        each = delays.of(hull)[subject[1]]
        kind = EventType.ENTER if each.enters else EventType.EXIT
        found[subject[1]] = kind, each.causes | more, each.since
        leg.put_delay(subject, None)
    leg.report(subjects, found, now)


def end_all(leg: FenceLeg, now: int) -> None:
    """End the delays for which nothing is missing by the present settings of the fence, which has been replaced."""
    delays, time, config = leg.fence.delays, leg.time(now), leg.row.config
    if delays is None:
        return
    for hull, subjects in leg.fence.subjects.items():
        doubtful = delays.doubts(hull)
        if config.by_accuracy:
            _certain(leg, subjects, doubtful, (), now, moved=None)
        for key in () if config.by_accuracy else doubtful:
            leg.put_delay((hull, key), delays.of(hull)[key]._replace(doubt=False))
    ripe: dict[str, list[Subject]] = {}
    for subject, each in delays.all():
        if delays.ripe(each, time):
            ripe.setdefault(subject[0], []).append(subject)
    for hull, found in ripe.items():
        end_some(leg, leg.fence.subjects[hull], found, Cause.CHANGED, now)


def _follow(
    leg: FenceLeg, subjects: Subjects, crossings: Crossings, rows: slice, swap: Swap | None, now: int
) -> set[Key]:
    """Begin and end delays where subjects change sides. Returns the keys of those that begin with a report."""
    delays, hull = leg.fence.delays, subjects.hull.name
    assert delays is not None  # the caller checks it
    numbers = np.arange(len(crossings))[rows]
    at_once = []
    begun = set()
    doubtful = _doubtful(leg, subjects, crossings, numbers) if leg.row.config.by_accuracy else frozenset()
    columns = zip(
        numbers.tolist(),
        key_list(crossings.keys[rows]),
        crossings.changes[rows].tolist(),
        crossings.causes[rows].tolist(),
        strict=True,
    )
    for number, key, change, causes in columns:
        waits = key in delays.of(hull)
        if change == TRANSFERRED:
            if not waits:  # otherwise `delay` knows what the events say
                at_once.append(number)
        elif change == 0 or causes & GONE:
            if not waits:
                at_once.append(number)
            elif change:  # it had not entered
                leg.put_delay((hull, key), None)
        elif waits:  # it is back
            leg.put_delay((hull, key), None)
        elif number in doubtful:
            doubt = Delay(change > 0, leg.time(now), 0, caused(causes, swap), doubt=True)
            leg.put_delay((hull, key), doubt)
            begun.add(key)
        elif not leg.row.config.confirms:  # or the fence has been replaced by one without such rules
            at_once.append(number)
        else:
            own = causes & OWN != 0
            reports = int(own and leg.row.config.confirmations > 0)
            leg.put_delay((hull, key), Delay(change > 0, leg.time(now), reports, caused(causes, swap)))
            if own:
                begun.add(key)
    if at_once:
        leg.crossed(subjects, crossings, np.array(at_once, np.intp), swap, now)
    return begun


def _doubtful(
    leg: FenceLeg, subjects: Subjects, crossings: Crossings, numbers: npt.NDArray[np.intp]
) -> Collection[int]:
    """The rows of those among some that change sides by less than their accuracy."""
    changes, gone = crossings.changes[numbers], crossings.causes[numbers] & GONE != 0
    rows = numbers[(np.abs(changes) == 1) & ~gone]
    keys, points = take_keys(crossings.keys, rows), crossings.points[rows]
    clear = subjects.clear(leg, keys, points)
    return frozenset(rows[~clear].tolist())


def _leave(leg: FenceLeg, subjects: Subjects, changed: KeysChanged, now: int) -> None:
    """Make an exit of each key that is gone while its exit was delayed: it was outside, so it has not crossed."""
    delays, hull = leg.fence.delays, subjects.hull.name
    assert delays is not None  # the caller checks it
    waiting = delays.of(hull)
    keys = subjects.keys([key for key in changed.gone(waiting) if not waiting[key].enters])
    if not len(keys):
        return
    gone = np.isnan(keyed(subjects.hull.state).positions(keys)[:, 0])
    if gone.any():
        left = subjects.keys([key for key, each in zip(key_list(keys), gone.tolist(), strict=True) if each])
        for key in key_list(left):
            leg.put_delay((hull, key), None)
        leg.left(subjects, left, {key: int(changed.why_gone(key)) for key in key_list(left)}, now)
