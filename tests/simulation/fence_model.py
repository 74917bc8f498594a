"""What fences must say: their events follow from what the storage has kept of the hulls, in exact integers.

The storage reports the revisions of a commit hull by hull. In which order they came between hulls is not in it, and is
not promised: there must be one order from which all events of the commit follow.
"""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from support.sides import Disk, Point, Rings, Shape, apart, shape_of_hull

from dynhull.keys import as_keys, key_list
from dynhull_server.engine.watch_fence import Sent
from dynhull_server.state.alarms.rule import AlarmRule
from dynhull_server.state.alarms.status import AlarmStatus
from dynhull_server.state.fences.events.block import AppendEvents
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig, HullArea, PolygonArea
from dynhull_server.state.fences.model.expected import NOWHERE, OF_ALL, daily
from dynhull_server.state.fences.model.records import (
    AddFence,
    AlarmStanding,
    Cause,
    ChangeFence,
    Consumer,
    Delay,
    DropConsumer,
    DropEvents,
    DropFence,
    EventType,
    FenceEvent,
    FenceRow,
    Members,
    Origin,
    PutConsumer,
    PutDelays,
)
from dynhull_server.state.limits import FenceLimits
from dynhull_server.state.records import NO_TIME

from .alarm_model import AlarmJudge, Known, kept, same_event
from .alarm_model import Change as AlarmChange
from .alarm_model import alike as known_alike
from .entities import Entity, Key, accuracy_of

if TYPE_CHECKING:
    from .model import Model, Truth

FENCE_CHANGES = AddFence | ChangeFence | DropFence | AppendEvents | DropEvents | PutConsumer | DropConsumer | PutDelays
# Fences have names beside those of hulls.
PREFIX = "fence:"
# Coordinates and lengths are multiples of 1 / 64.
UNIT = 64
# Of an event that two hulls begin or cease to be near, there is no key.
WHOLE = None

Subject = tuple[str, Key]
Keyed = dict[Key, Entity]
# A key, its place before and after, and why it is gone, or 0.
Change = tuple[Key, Entity | None, Entity | None, int]


@dataclass(slots=True, eq=False)
class FenceTruth:
    """One fence as the storage has kept it.

    Attributes:
        row: its identity and settings.
        events: all its events, also those that were dropped.
        first: the oldest event that is kept.
        consumers: its consumers.
        acknowledged: the last sequence that each consumer has ever acknowledged.
        inside: who is inside, and since when it waits for its dwell event; None if it has made it.
        near: whether two hulls are near.
        ever: the names of the hulls that it has ever depended on, other than by a prefix.
        droppable: the first event that may be kept as the oldest one.
        deleted: the number of commits when it was deleted, None before.
        outside: since when expected keys are outside, None if they are inside; those not named have not moved.
        missing: the expected keys that are missing, and their deadlines.
        expecting: since when it expects keys, once that is known.
        passed: up to when the times of day at which it expects keys have passed; None if it does otherwise.
        restored: whether a backup has brought it back, after which nobody follows which keys are missing.
        known: of an alarm, what is known of each hull that it watches.
        latest: the latest time that its events or what is known have.
        begun: when it was made, or the server has begun, by the server's clock.
    """

    row: FenceRow
    events: list[FenceEvent] = field(default_factory=list)
    first: int = 1
    consumers: dict[str, Consumer] = field(default_factory=dict)
    acknowledged: dict[str, int] = field(default_factory=dict)
    inside: dict[Subject, int | None] = field(default_factory=dict)
    near: bool = False
    ever: set[str] = field(default_factory=set)
    droppable: int = 1
    deleted: int | None = None
    outside: dict[Key, int | None] = field(default_factory=dict)
    missing: dict[Key, int] = field(default_factory=dict)
    expecting: int | None = None
    passed: int | None = None
    restored: bool = False
    known: dict[str, Known] = field(default_factory=dict)
    latest: int = NO_TIME
    begun: float = 0

    @property
    def config(self) -> FenceConfig:
        return self.row.config

    @property
    def last(self) -> int:
        return len(self.events)

    def reads(self, row: FenceRow) -> None:
        """Take over settings."""
        self.row = row
        self.ever |= self.needs

    @property
    def needs(self) -> set[str]:
        """The names of the hulls that it depends on, other than by a prefix."""
        config = self.config
        return {config.area_hull or "", config.subjects if config.kind != "prefix" else ""} - {""}


class State(NamedTuple):
    """A fence in the middle of a commit: who is inside, and which of its new events have been explained.

    Of an alarm, what is known of each hull, and the latest time.
    """

    inside: dict[Subject, int | None]
    near: bool
    explained: int
    known: Mapping[str, Known] = MappingProxyType({})
    latest: int = NO_TIME


class Step(NamedTuple):
    """Revisions that came at once, by the name of the hull: the last one before, and the last one of them.

    Or a new hull `appears`, which is empty.
    """

    to: dict[str, tuple[int, int]]
    together: bool
    appears: str = ""


class FenceModel:
    """All fences over the lives of a plan.

    Args:
        model: the model of the hulls.

    Attributes:
        alive: the fences there are, by name.
        ever: all fences.
        unacked: the consumers that callers have asked to delete, by the name of the fence.
        asked: until when callers have asked to mute an alarm for a hull, by its name; None to acknowledge it.
    """

    def __init__(self, model: "Model") -> None:
        self._model = model
        self.alive: dict[str, FenceTruth] = {}
        self.ever: dict[int, FenceTruth] = {}
        self._told: dict[tuple[int, int], list[tuple[FenceTruth, int]]] = {}
        self.asked: defaultdict[str, set[tuple[str, int | None]]] = defaultdict(set)
        self.unacked: defaultdict[str, set[str]] = defaultdict(set)
        self._judge = AlarmJudge(model, self._corners)

    def belong_to(self, model: "Model") -> None:
        """Go on beside another model of the hulls."""
        self._model = model
        self._judge = AlarmJudge(model, self._corners)

    def new_life(self) -> None:
        """A server starts on what has been kept."""
        for fence in self.alive.values():
            fence.begun = self._model.clock()
            since = [known.since or NO_TIME for known in fence.known.values()]
            fence.latest = max([NO_TIME, *since, *(event.time for event in fence.events[-1:])])

    # What is kept

    def landed(
        self, changes: Sequence[Any], before: "dict[str, tuple[Truth, int]]", created: Sequence[str] = ()
    ) -> None:
        """The storage has kept these changes of fences, and new revisions of hulls.

        Args:
            changes: the changes of fences.
            before: the hulls that have changed, by name, with their revisions before.
            created: the names of the hulls that are new.
        """
        by_fence: dict[int, list[Any]] = {}
        made: dict[int, list[FenceEvent]] = {}
        for change in changes:
            if isinstance(change, AppendEvents):
                for number, events in change.block.by_fence().items():
                    by_fence.setdefault(number, [])
                    made.setdefault(number, []).extend(events)
                continue
            number = change.row.number if isinstance(change, AddFence | ChangeFence) else change.number
            by_fence.setdefault(number, []).append(change)
        for number, of_fence in by_fence.items():
            made[number] = self._numbered(number, of_fence, made.get(number, []))
        others = {number: _without_expected(events) for number, events in made.items()}
        self._revised(before, others, created, by_fence)
        for number, of_fence in by_fence.items():
            fence = self.ever[number]
            fence.events += made[number]
            self._drop(fence, of_fence)
            if of_fence and isinstance(of_fence[-1], DropFence):
                self._deleted(fence)
        for fence in self.alive.values():
            for name, (truth, revision) in before.items():
                if fence.config.concerns(name):
                    for each in range(revision + 1, truth.revision + 1):
                        self._told.setdefault((truth.row.number, each), []).append((fence, fence.last))

    @property
    def alarmed(self) -> bool:
        """Whether there are alarms."""
        return any(fence.config.rule is not None for fence in self.alive.values())

    @property
    def watched(self) -> int:
        """The number of hulls that alarms watch, each counted once for each alarm."""
        return sum(len(fence.known) for fence in self.alive.values())

    def told(self, number: int, revision: int) -> list[tuple[FenceTruth, int]]:
        """The fences that a revision concerned, and their events when it was committed."""
        return self._told.get((number, revision), [])

    def _numbered(self, number: int, changes: list[Any], events: list[FenceEvent]) -> list[FenceEvent]:
        """The new events of a fence, if their numbers and times are in order; those of new settings are explained."""
        first = changes[0] if changes else None
        if isinstance(first, AddFence):
            self._added(first.row)
        fence = self.ever.get(number)
        if fence is None or fence.deleted is not None:
            raise self._model.finds(f"{first or events} are kept of a fence that is not there")
        sequences = [event.sequence for event in events]
        if sequences != list(range(fence.last + 1, fence.last + 1 + len(events))):
            raise self._model.finds(f"events {sequences} of {fence.row.name} are kept after {fence.last}")
        times = [event.time for event in (*fence.events[-1:], *events)]
        if times != sorted(times):
            raise self._model.finds(f"the times of events of {fence.row.name} go back: {times}")
        if early := [event for event in events if event.first_time > event.time]:
            raise self._model.finds(f"events of {fence.row.name} are before what they are about: {early}")
        before, others, inside = fence.config, _without_expected(events), {key for _, key in fence.inside}
        if isinstance(first, AddFence):
            self._began(fence, changes, others)
        elif isinstance(first, ChangeFence):
            self._replaced(fence, first.row, others)
        renewed = isinstance(first, AddFence) or expected_of(before) != expected_of(fence.config)
        passed = None if renewed else _passed(changes)
        if before.expected_by and not fence.restored:
            self._expects_by(fence, before, events, inside, fence.passed if passed is None else passed)
        elif not fence.restored:
            self._expects_within(fence, before, events)
        if renewed:
            fence.outside, fence.missing, fence.expecting, fence.passed = {}, {}, None, _passed(changes)
        return events

    def _expects_by(
        self, fence: FenceTruth, config: FenceConfig, events: list[FenceEvent], inside: set[Key], until: int | None
    ) -> None:
        """Whether keys are missing and arrive as they should, by a time of day, in a fence around one hull.

        Up to `until` deadlines have passed then; `inside` are the keys that were.
        """
        expected, late = set(config.expected), dict[Key, tuple[int, int]]()
        whole, waiting = expected <= inside, list[Key]()
        for event in events:
            key = event.key
            if key is None or key not in expected:
                continue
            match event.type:
                case EventType.ENTER:
                    inside.add(key)
                    if key in fence.missing:
                        late[key] = fence.missing.pop(key), event.time
                case EventType.EXIT:
                    inside.discard(key)
                case EventType.ARRIVED:
                    if late.pop(key, None) != (event.first_time, event.time):
                        raise self._model.finds(f"{event} of {fence.row.name} arrives without being missing")
                case EventType.MISSING:
                    if not waiting:
                        self._pass_deadlines(fence, config, event.time, missing=True, whole=whole)
                        waiting, whole = sorted(expected - inside), False
                    if not waiting or waiting.pop(0) != key:
                        raise self._model.finds(f"{event} of {fence.row.name} is missing, and not {waiting}")
                    fence.missing[key] = fence.passed or 0
            whole |= expected <= inside
        if late or waiting:
            raise self._model.finds(f"{late} of {fence.row.name} have not arrived, {waiting} are not missing")
        if until is not None and fence.passed is not None:
            self._pass_deadlines(fence, config, until, missing=False, whole=whole)
        if until != fence.passed:
            raise self._model.finds(f"of {fence.row.name} deadlines up to {until} have passed, and not {fence.passed}")

    def _pass_deadlines(
        self, fence: FenceTruth, config: FenceConfig, until: int, *, missing: bool, whole: bool
    ) -> None:
        """Deadlines pass, at the last of which keys are `missing`; for the others the fence must have been `whole`."""
        times, found = daily(config.expected_by), 0
        while fence.passed is not None and (due := times.after(fence.passed)) <= until:
            fence.passed, found = due, found + 1
        if found < missing or (found > missing and not whole):
            raise self._model.finds(f"{found} deadlines of {fence.row.name} pass up to {until}, {missing=}, {whole=}")

    def _expects_within(self, fence: FenceTruth, config: FenceConfig, events: list[FenceEvent]) -> None:
        """Whether keys are missing and arrive as they should, by an age, in a fence around one hull."""
        late = dict[Key, tuple[int, int]]()
        for event in events:
            key = event.key
            if key is None or key not in config.expected:
                continue
            match event.type:
                case EventType.ENTER:
                    fence.outside[key] = None
                    if key in fence.missing:
                        late[key] = fence.missing.pop(key), event.time
                case EventType.EXIT:
                    fence.outside[key] = event.time
                case EventType.ARRIVED:
                    if late.pop(key, None) != (event.first_time, event.time):
                        raise self._model.finds(f"{event} of {fence.row.name} arrives without being missing")
                case EventType.MISSING:
                    if key not in fence.outside and fence.expecting is None:
                        fence.expecting = event.first_time
                    since = fence.outside.get(key, fence.expecting)
                    due = event.first_time + config.expected_within
                    if since != event.first_time or event.time < due or key in fence.missing:
                        raise self._model.finds(f"{event} of {fence.row.name} is missing, and outside since {since}")
                    fence.missing[key] = due
        if late:
            raise self._model.finds(f"{late} of {fence.row.name} have not arrived")

    def _added(self, row: FenceRow) -> None:
        if row.number in self.ever or row.number in self._model.numbers:
            raise self._model.finds(f"the number {row.number} is given to another fence")
        if row.name in self.alive:
            raise self._model.finds(f"a second fence {row.name} is made beside the first")
        self.alive[row.name] = self.ever[row.number] = fence = FenceTruth(row, begun=self._model.clock())
        self._model.numbers.add(row.number)
        fence.reads(row)

    def _deleted(self, fence: FenceTruth) -> None:
        """The fence has one more event, which only those see who watch it."""
        closed = self.summary(fence, EventType.CLOSED, 0)
        time = fence.events[-1].time if fence.events else NO_TIME
        fence.events.append(closed._replace(sequence=fence.last + 1, time=time))
        fence.deleted = self._model.commits
        del self.alive[fence.row.name]

    # Settings

    def _began(self, fence: FenceTruth, changes: list[Any], events: list[FenceEvent]) -> None:
        """A new fence begins with these events."""
        if fence.config.rule is not None:
            self._alarm_began(fence, fence.config.rule, events, changes)
            return
        added = changes[0]
        config, since = fence.config, fence.row.waits.time or None
        now = self._now()
        expected = []
        if config.kind == "other":
            fence.near = self._near(config, now)
            if fence.near:
                expected.append(self._paired(config, now, near=True, causes=Cause.CREATED))
        for name, truth in self._subjects(config):
            revision = now[name]
            for key, entity in sorted(truth.held[revision].items()):
                shape, p = self._shape(config, now, key), _exact(entity)
                if shape.holds(p, closed=config.closed) and _is_clear(config, shape, entity):
                    fence.inside[name, key] = since
                    there = Expected(config, now, name, key, None, entity)
                    expected.append(there.event(EventType.ENTER, Cause.CREATED))
        match config.initial:
            case "snapshot":
                expected = [self.summary(fence, EventType.SNAPSHOT, Cause.CREATED)]
            case "none":
                kept = _members(added.inside.members)
                if kept != _members(self._members(fence)):
                    raise self._model.finds(f"inside of {fence.row.name} are {fence.inside}, kept are {kept}")
                expected = []
        if not self._as_expected(expected, events):
            raise self._model.finds(f"{fence.row.name} begins with {events}, and should with {expected}")
        for event in events:
            fence.inside |= dict.fromkeys(_named(event) if config.dwell else (), event.time)

    def _replaced(self, fence: FenceTruth, row: FenceRow, events: list[FenceEvent]) -> None:
        """A fence gets other settings, and these events follow."""
        if row.config.dwell != fence.config.dwell:
            fence.inside = dict.fromkeys(fence.inside, row.waits.time if row.config.dwell else None)
        fence.droppable = self._droppable(fence)  # that may just be going on
        fence.reads(row)
        config, now = row.config, self._now()
        state = State(dict(fence.inside), fence.near, 0)
        expected = []
        if config.kind == "other" and self._near(config, now) != fence.near:
            fence.near = not fence.near
            expected = [self._paired(config, now, near=fence.near, causes=Cause.CHANGED)]
        for name, truth in self._subjects(config):
            places = truth.held[now[name]]
            changes = [(key, place, place, 0) for key, place in sorted(places.items())]
            looked = list(self._look(config, now, state, name, changes, Cause.CHANGED, now))
            expected += [event for event in looked if event.type is not EventType.CROSS]
        if not self._as_expected(expected, events):
            raise self._model.finds(f"{fence.row.name} is replaced with {events}, and should be with {expected}")
        for event in events:
            self.follow(config, fence.inside, event)

    # Alarms

    def _watches(self, config: FenceConfig, name: str) -> bool:
        """Whether an alarm watches a hull."""
        rule, alive = config.rule, self._model.alive
        if rule is None or not (config.compares(name) or (config.kind == "other" and name == config.subjects)):
            return False
        return rule.suits(alive[name].row.settings, None if rule.other is None else alive[rule.other].row.settings)

    def _watched(self, config: FenceConfig) -> list[str]:
        return [name for name in sorted(self._model.alive) if self._watches(config, name)]

    def _alarm_began(self, fence: FenceTruth, rule: AlarmRule, events: list[FenceEvent], stored: Sequence[Any]) -> None:
        """A new alarm begins with these events."""
        state = State({}, False, 0)
        now = self._now()
        changes = [self._judge.looked(rule, {}, name, Cause.CREATED, now) for name in self._watched(fence.config)]
        after = self.after_changes(state, changes, events)
        if isinstance(after, str) or after.explained != len(events):
            raise self._model.finds(f"{fence.row.name} begins with {events}, and should with {changes}: {after}")
        fence.known, fence.latest = dict(after.known), after.latest
        self._adopt(fence, {}, _stored({fence.row.number: stored}).get(fence.row.number, {}))

    def _adopt(self, fence: FenceTruth, was: Mapping[str, Known], stored: Mapping[str, Delay | None]) -> None:
        """Take over what only the storage says of an alarm, if the rest is as it should be."""
        known, problem = self.kept_of_alarm(fence, was, fence.known, stored)
        if problem:
            raise self._model.finds(problem)
        fence.known = known
        fence.latest = max(fence.latest, *(each.since for each in stored.values() if each is not None), NO_TIME)

    def after_changes(self, state: State, changes: Iterable[AlarmChange], events: list[FenceEvent]) -> State | str:
        """The state after some changes at hulls, if the next events are those that they make; or what is wrong."""
        known, latest = dict(state.known), state.latest
        expected = []
        for change in changes:
            if change.known is None:
                known.pop(change.hull, None)
            else:
                known[change.hull] = change.known
            if change.event is not None:
                expected.append(change.event)
        made = events[state.explained : state.explained + len(expected)]
        if len(made) < len(expected):
            return f"there are {made}, and should be {expected}"
        for real, one in zip(sorted(made, key=lambda event: event.hull), expected, strict=True):
            if not same_event(real, one):
                return f"there is {real}, and should be {one}"
            latest = max(latest, real.time)
            if real.type is EventType.BEGIN:
                known[real.hull] = known[real.hull]._replace(since=real.event_time)
        return State({}, False, state.explained + len(expected), known, latest)

    def alarm_after(
        self, fence: FenceTruth, state: State, step: Step, at: dict[str, int], events: list[FenceEvent]
    ) -> State | str:
        """The state of an alarm after a step, if its next events follow; or what is wrong."""
        rule = fence.config.rule
        assert rule is not None  # the caller asks for alarms
        now = at | {name: last for name, (_, last) in step.to.items()}
        if late := self._too_late(fence, rule, state, step, at):
            return late
        if step.appears:
            watched = self._watches(fence.config, step.appears)
            changes = [self._judge.looked(rule, state.known, step.appears, Cause.APPEARED, now)] if watched else []
            return self.after_changes(state, changes, events)
        hulls = {*state.known, *(name for name in step.to if self._watches(fence.config, name))}
        return self.after_changes(state, self._judge.after(rule, state.known, hulls, step.to, at, now), events)

    def _too_late(self, fence: FenceTruth, rule: AlarmRule, state: State, step: Step, at: dict[str, int]) -> str:
        """What time should have made before a batch of a step that came later; empty for nothing."""
        if self._model.faulty or self._model.stopping:
            return ""
        for name, (_, last) in step.to.items():
            if not fence.config.concerns(name):  # it may have come while the alarm had something under way
                continue
            sent = self._model.sent(self._model.alive[name].attempts[last])
            if sent is None or sent[1].get(PREFIX + fence.row.name, (0, 0))[0] != fence.row.number:
                continue
            for hull, known in state.known.items():
                due = self._judge.late(rule, known, hull, at, fence.begun)
                if due is not None and due <= sent[0] and self._was_seen((hull, rule.other), sent[1], at):
                    return f"{hull} should have been raised at {due}, before a batch at {sent[0]}"
        return ""

    def _was_seen(self, hulls: Iterable[str | None], seen: Mapping[str, tuple[int, int]], at: dict[str, int]) -> bool:
        """Whether these revisions of hulls had been seen."""
        alive = self._model.alive
        return all(seen.get(name, (0, 0)) >= (alive[name].row.number, at[name]) for name in hulls if name is not None)

    def by_time(self, fence: FenceTruth, state: State, events: list[FenceEvent], at: dict[str, int]) -> State | str:
        """The state of an alarm after the next event, if time has made it; or why not."""
        rule = fence.config.rule
        assert rule is not None  # the caller asks for alarms
        event = events[state.explained]
        known = state.known.get(event.hull)
        change = self._judge.by_time(rule, known, event, at, (fence.begun, state.latest))
        if change is None:
            return f"time does not make {event} of {known} at {state.latest}"
        return self.after_changes(state, [change], events)

    def kept_of_alarm(
        self,
        fence: FenceTruth,
        was: Mapping[str, Known],
        known: Mapping[str, Known],
        stored: Mapping[str, Delay | None],
    ) -> tuple[dict[str, Known], str]:
        """What is known of an alarm after a commit, with what only the storage says; and what is wrong there."""
        found = dict(known)
        for hull in sorted({*was, *known, *stored}):
            now, before = found.get(hull), was.get(hull, Known())
            if hull in stored:
                delay = stored[hull]
                if now is not None:
                    now = found[hull] = self._adopted(fence, hull, now, delay)
                if not known_alike(delay, kept(now or Known())):
                    return found, f"of {fence.row.name} at {hull} {delay} is kept, known is {now}"
            elif kept(before) != kept(now or Known()):
                return found, f"of {fence.row.name} at {hull} nothing is kept: {now} was {before}"
        return found, ""

    def _adopted(self, fence: FenceTruth, hull: str, now: Known, delay: Delay | None) -> Known:
        """What is known, with what only the storage says: since when, who has taken note, and what is muted."""
        standing = AlarmStanding() if delay is None or delay.standing is None else delay.standing
        if now.since is None and delay is not None and delay.since != NO_TIME:
            now = now._replace(since=delay.since)
        since = now.since or 0
        if now.raised and (hull, None) in self.asked[fence.row.name] and standing.acknowledged >= since:
            now = now._replace(acknowledged=standing.acknowledged)
        if (hull, standing.muted) in self.asked[fence.row.name]:
            now = now._replace(muted=standing.muted)
        return now

    def taken(self, name: str, status: AlarmStatus) -> None:
        """An alarm was acknowledged or muted for a hull: that is kept until it is cleared, or somebody else does."""
        fence = self.alive.get(name)
        known = None if fence is None else fence.known.get(status.hull)
        if fence is None or known is None:
            return
        raises = [each for each in fence.events if each.hull == status.hull and each.type is EventType.BEGIN]
        once = sum(each.event_time == status.since for each in raises) == 1  # else it may have been another raise
        same = known.raised and status.raised and known.since == status.since and once
        forgotten = same and status.acknowledged != NO_TIME == known.acknowledged
        muted = status.muted != NO_TIME == known.muted and (status.hull, NO_TIME) not in self.asked[name]
        if forgotten or (same and muted):
            raise self._model.finds(f"{status} of {name} was answered, kept is {known}")

    def overdue_alarms(self, time: int) -> list[tuple[str, str]]:
        """The alarms that time should have raised by a time, each with its hull."""
        now = self._now()
        return [
            (name, hull)
            for name, fence in self.alive.items()
            if fence.config.rule is not None
            for hull, known in fence.known.items()
            if (due := self._judge.late(fence.config.rule, known, hull, now, fence.begun)) is not None and due <= time
        ]

    # Revisions

    def _revised(
        self,
        before: "dict[str, tuple[Truth, int]]",
        made: dict[int, list[FenceEvent]],
        created: Sequence[str],
        by_fence: Mapping[int, Sequence[Any]],
    ) -> None:
        """Explain the events of a commit, and what it has stored of alarms, by the new revisions of hulls."""
        stored = _stored(by_fence)
        begun = {number for number, changes in by_fence.items() if changes and isinstance(changes[0], AddFence)}
        fences = [
            fence
            for fence in self.alive.values()
            if (
                any(fence.config.concerns(name) for name in (*before, *created))
                or made.get(fence.row.number)
                or fence.row.number in stored
            )
            and not _of_settings(made.get(fence.row.number))
            and fence.row.number not in begun
        ]
        if not fences:
            return
        names = {name for name in before if any(fence.config.concerns(name) for fence in fences)}
        lanes = {name: before[name] for name in names}
        search = _Search(self, fences, lanes, (made, stored), created)
        found = search.run()
        if found is None:
            raise self._model.finds(f"no order of {sorted(names)} explains the events: {search.problem}")
        for fence in fences:
            state = found[fence.row.number]
            fence.inside, fence.near = state.inside, state.near
            if fence.config.rule is not None:
                was, fence.known, fence.latest = fence.known, dict(state.known), state.latest
                self._adopt(fence, was, stored.get(fence.row.number, {}))

    def expected(self, fence: FenceTruth, state: State, step: Step, at: dict[str, int]) -> "Iterator[FenceEvent]":
        """The events of a fence that a step makes. `at` are the revisions before it."""
        config = fence.config
        now = at | {name: last for name, (_, last) in step.to.items()}
        area = config.area_hull
        area_moved = area in step.to and self._corners(area, at) != self._corners(area, now)
        if config.kind == "other":
            other = config.subjects
            other_moved = other in step.to and self._corners(other, at) != self._corners(other, now)
            if (area_moved or other_moved) and self._near(config, now) != state.near:
                causes = (Cause.AREA if area_moved else 0) | (Cause.MOVED if other_moved else 0)
                yield self._paired(config, now, near=not state.near, causes=causes)
            return
        moved = self._transfers(config, step, at) if step.together else {}
        for name, truth in self._subjects(config):
            was = truth.held[at[name]] if name in at else {}
            present = truth.held[now[name]]
            if not area_moved and name not in step.to:
                continue
            gone: dict[Key, int] = {}
            for revision in range(at.get(name, 0) + 1, now[name] + 1):
                gone |= truth.gone[revision]
            changes = [
                (key, was.get(key), present.get(key), gone.get(key, 0))
                for key in sorted({*was, *present})
                if area_moved
                or config.area == HullArea(name, without_self=True)
                or was.get(key) is not present.get(key)
            ]
            changes = [
                (key, self._place(moved[name, key], at) if (name, key) in moved else before, place, why)
                for key, before, place, why in changes
                if (name, key) not in moved.values()
            ]
            yield from self._look(config, now, state, name, changes, Cause.AREA if area_moved else 0, at, moved)

    def _transfers(self, config: FenceConfig, step: Step, at: dict[str, int]) -> dict[Subject, Subject]:
        """The subjects that batches which came together have moved to another hull, and who they were before."""
        found: dict[Subject, Subject] = {}
        truths = {name: truth for name, truth in self._subjects(config) if name in step.to}
        for source, truth in truths.items():
            left = truth.gone[step.to[source][1]]
            for key in (key for key, why in left.items() if why == Cause.REMOVED):
                for target, other in truths.items():
                    new = key not in other.held[at[target]] and key in other.held[step.to[target][1]]
                    if new and target != source and (target, key) not in found:
                        found[target, key] = source, key
                        break
        return found

    def _place(self, subject: Subject, at: dict[str, int]) -> Entity:
        hull, key = subject
        return self._model.alive[hull].held[at[hull]][key]

    def _look(
        self,
        config: FenceConfig,
        now: dict[str, int],
        state: State,
        name: str,
        changes: Iterable[Change],
        cause: int,
        at: dict[str, int],
        moved: dict[Subject, Subject] | None = None,
    ) -> "Iterator[FenceEvent]":
        """The events of one hull's keys; `cause` is why the area is another one than `at` revisions before, or 0."""
        for key, was, place, gone in changes:
            former = (moved or {}).get((name, key), (name, key))
            origin = Origin(former[0], now[former[0]]) if former[0] != name else None
            inside = former in state.inside
            shape = self._shape(config, now, key)
            there = Expected(config, now, name, key, was, place, origin)
            if place is None:
                if inside:  # where it was is not said of one that had perhaps left
                    before = self._shape(config, at, key)
                    left = was is not None and not _is_clear(config, before, was)
                    left = left and before.farther(_exact(was), _units(config.margin), closed=config.closed)
                    yield (there._replace(was=None) if left else there).event(EventType.EXIT, gone | cause)
                continue
            p = _exact(place)
            causes = cause | (Cause.APPEARED if was is None else Cause.MOVED if origin or _exact(was) != p else 0)
            causes = causes or Cause.AREA  # only the others have moved, of whom the subject itself is not one
            if not _is_clear(config, shape, place):
                if inside and origin is not None:
                    yield there.event(EventType.TRANSFER, causes)
            elif inside:
                if shape.farther(p, _units(config.margin), closed=config.closed):
                    yield there.event(EventType.EXIT, causes)
                elif origin is not None:
                    yield there.event(EventType.TRANSFER, causes)
            elif shape.holds(p, closed=config.closed):
                yield there.event(EventType.ENTER, causes)
            elif config.crosses and was is not None and _exact(was) != p and shape.passed(_exact(was), p):
                yield there.event(EventType.CROSS, causes)

    def follow(self, config: FenceConfig, inside: dict[Subject, int | None], event: FenceEvent) -> None:
        """Take in an event."""
        if event.key is None:
            return
        match event.type:
            case EventType.ENTER:
                inside[event.hull, event.key] = event.time if config.dwell else None
            case EventType.EXIT:
                del inside[event.former]
            case EventType.TRANSFER:
                inside[event.hull, event.key] = inside.pop(event.former)
            case EventType.DWELL:
                inside[event.hull, event.key] = None

    def dwells(self, fence: FenceTruth, state: State, event: FenceEvent, at: dict[str, int]) -> bool:
        """Whether a subject has been inside for long enough to make this event at these revisions."""
        config = fence.config
        assert event.key is not None  # nobody dwells as a whole
        since = state.inside.get((event.hull, event.key))
        if since is None or event.time - since < config.dwell:
            return False
        place = self._model.alive[event.hull].held[at[event.hull]].get(event.key)
        there = Expected(config, at, event.hull, event.key, None, place)
        return same(event, there.event(EventType.DWELL, Cause.TIME)._replace(first_time=since))

    # Consumers and retention

    def permit(self, number: int, first: int) -> None:
        """Events before `first` may be dropped from now on."""
        fence = self.ever[number]
        fence.droppable = max(fence.droppable, first)

    def _drop(self, fence: FenceTruth, changes: list[Any]) -> None:
        """Take over which events are kept, and what consumers have acknowledged and lost."""
        dropped = max((change.first for change in changes if isinstance(change, DropEvents)), default=fence.first)
        if dropped > fence.first and dropped > self._droppable(fence):
            raise self._model.finds(f"the events of {fence.row.name} before {dropped} are dropped too early")
        put = {change.consumer.name: change.consumer for change in changes if isinstance(change, PutConsumer)}
        for name in {*fence.consumers, *put}:
            known = fence.consumers.get(name, Consumer(name, fence.first - 1))
            now = put.get(name, known)
            if now.acknowledged < known.acknowledged and name in self.unacked[fence.row.name]:
                known = Consumer(name, fence.first - 1)  # deleted, and made again in the same trip
            if not known.acknowledged <= now.acknowledged <= max(fence.last, known.acknowledged):
                raise self._model.finds(f"the consumer {known} of {fence.row.name} becomes {now}")
            most, least = (
                known.lost + max(dropped - 1 - max(each.acknowledged, fence.first - 1), 0) for each in (known, now)
            )
            if not least <= now.lost <= most:
                raise self._model.finds(f"the consumer {known} loses the events before {dropped}, and becomes {now}")
            if name in put:
                fence.acknowledged[name] = max(fence.acknowledged.get(name, 0), now.acknowledged)
        fence.consumers |= put
        for change in changes:
            if isinstance(change, DropConsumer):
                del fence.consumers[change.name]
        fence.first = dropped

    def _droppable(self, fence: FenceTruth) -> int:
        config = fence.config
        if config.max_event_age:
            return fence.last + 1
        return max(fence.droppable, fence.last - config.max_events + 1 if config.max_events else 1)

    # What is answered

    def seen(self, number: int, uid: str, after: int, sent: Sent) -> None:
        """Events after a sequence were sent."""
        fence = self.ever.get(number)
        if fence is None or fence.row.uid != uid:
            raise self._model.finds(f"an answer names a fence that is not kept: {uid}")
        if sent.lost is not None:
            # With a fence its events go, but for those that the server still has in memory.
            first = fence.first if fence.deleted is None else fence.last
            if sent.lost[0] != after + 1 or not after < sent.lost[1] < first:
                raise self._model.finds(f"{sent.lost} are called lost after {after}, kept are those from {fence.first}")
            after = sent.lost[1]
        for event in sent.events:
            after += 1
            if event.sequence != after:
                raise self._model.finds(f"event {event.sequence} of {fence.row.name} was sent in place of {after}")
            if event.sequence > fence.last:
                raise self._model.finds(f"event {event} of {fence.row.name} was sent, and is not kept")
            if not alike(event, fence.events[event.sequence - 1]):
                raise self._model.finds(f"{event} was sent, kept is {fence.events[event.sequence - 1]}")
        if sent.sequence != after:
            raise self._model.finds(
                f"the events of {fence.row.name} up to {after} are called those up to {sent.sequence}"
            )

    def acked(self, number: int, consumer: Consumer, sequence: int | None) -> None:
        """An acknowledgement was answered."""
        fence = self.ever[number]
        kept = fence.acknowledged.get(consumer.name)
        if consumer.name in self.unacked[fence.row.name]:  # of one that is made and deleted at once nothing is kept
            kept = fence.last
        if kept is None or not (sequence or 0) <= consumer.acknowledged <= kept:
            raise self._model.finds(f"{consumer} of {fence.row.name} was answered to {sequence}, kept is {kept}")

    def held(self, number: int, sequence: int, members: Iterable[Members]) -> None:
        """Who is inside was read, after the event of a sequence."""
        fence = self.ever[number]
        if sequence == fence.last and fence.deleted is None:
            kept, found = _members(self._members(fence)), _members(members)
            if {hull: keys for hull, (keys, _) in found.items()} != {hull: keys for hull, (keys, _) in kept.items()}:
                raise self._model.finds(f"inside of {fence.row.name} are {kept}, answered was {found}")

    def overdue(self, time: int) -> list[tuple[str, Subject | str]]:
        """Who should have made its dwell event at a time by the server's clock, or which alarms should be raised.

        Or the fences of which a deadline should have passed.
        """
        deadlines = [
            (name, fence.config.expected_by)
            for name, fence in self.alive.items()
            if fence.config.expected_by and fence.passed is not None and not fence.restored
            if daily(fence.config.expected_by).after(fence.passed) <= time
        ]
        return [*self.overdue_alarms(time), *deadlines] + [
            (name, subject)
            for name, fence in self.alive.items()
            if fence.config.dwell
            for subject, since in fence.inside.items()
            if since is not None and since + fence.config.dwell <= time
        ]

    def full(self, name: str, limit: str, limits: FenceLimits) -> bool:
        """Whether a limit leaves no room for one more fence, or for one more consumer of this one."""
        alarms = [fence.config for fence in self.alive.values() if fence.config.rule is not None]
        if limit == "max_fences":
            return len(self.alive) - len(alarms) >= limits.max_fences
        if limit == "max_alarms":
            return len(alarms) >= limits.max_alarms
        if limit == "max_alarm_hulls":
            return sum(len(self._watched(config)) for config in alarms) + len(alarms) > limits.max_alarm_hulls
        return name in self.alive and len(self.alive[name].consumers) >= limits.max_fence_consumers

    def needed(self, name: str) -> bool:
        """Whether a fence depends on a hull."""
        return any(name in fence.needs for fence in self.alive.values())

    def fenced(self, name: str, commits: int) -> bool:
        """Whether a fence has depended on a hull since some commit."""
        return any(
            name in fence.ever and (fence.deleted is None or fence.deleted > commits) for fence in self.ever.values()
        )

    # Areas and subjects

    def _now(self) -> dict[str, int]:
        return {name: truth.revision for name, truth in self._model.alive.items()}

    def _subjects(self, config: FenceConfig) -> "list[tuple[str, Truth]]":
        alive = self._model.alive
        return [
            (name, alive[name])
            for name in sorted(alive)
            if config.compares(name) and alive[name].row.settings.identity != "multiset"
        ]

    def _corners(self, name: str | None, at: dict[str, int]) -> Rings:
        assert name is not None
        truth = self._model.alive[name]
        revision = at[name]
        corners = truth.corners.get(revision)
        if corners is None:
            corners = truth.corners[revision] = shape_of_hull(map(_exact, truth.entities_at(revision).values()))
        return corners

    def _shape(self, config: FenceConfig, at: dict[str, int], key: Key) -> Shape:
        area = config.area
        if not isinstance(area, HullArea):
            return fixed_shape(area)
        if not area.without_self:
            return self._corners(area.name, at)
        others = self._model.alive[area.name].held[at[area.name]]
        return shape_of_hull(_exact(entity) for other, entity in others.items() if other != key)

    def _near(self, config: FenceConfig, at: dict[str, int]) -> bool:
        one, other = (self._corners(name, at).polygons for name in (config.area_hull, config.subjects))
        return not apart(one[0][0] if one else (), other[0][0] if other else (), _units(config.near))

    def _paired(self, config: FenceConfig, at: dict[str, int], *, near: bool, causes: int) -> FenceEvent:
        there = Expected(config, at, config.subjects, WHOLE, None, None)
        return there.event(EventType.BEGIN if near else EventType.CEASE, causes)

    def _members(self, fence: FenceTruth) -> Iterator[Members]:
        now = self._now()
        for name in sorted(hull for hull, known in fence.known.items() if known.raised):
            yield Members(name, np.empty(0, np.uint64), now[name])
        if fence.near:
            yield Members(fence.config.subjects, np.empty(0, np.uint64), now[fence.config.subjects])
        for name in sorted({hull for hull, _ in fence.inside}):
            keys = sorted(key for hull, key in fence.inside if hull == name)
            yield Members(name, as_keys(keys, self._model.alive[name].row.settings.identity), now[name])

    def summary(self, fence: FenceTruth, kind: EventType, causes: int) -> FenceEvent:
        """An event with all who are inside of a fence."""
        now = self._now()
        there = Expected(fence.config, now, "", WHOLE, None, None)
        return there.event(kind, causes)._replace(inside=tuple(self._members(fence)))

    def _as_expected(self, expected: list[FenceEvent], events: list[FenceEvent]) -> bool:
        """Whether events are the expected ones. In one revision they are ordered by key; hulls come in any order."""
        by_hull = sorted(events, key=lambda event: event.hull)
        return len(events) == len(expected) and all(map(same, by_hull, expected))


class Expected(NamedTuple):
    """What an expected event is about: `was` and `place` are the entity before and after, `origin` where it was."""

    config: FenceConfig
    at: dict[str, int]
    hull: str
    key: Key | None
    was: Entity | None
    place: Entity | None
    origin: Origin | None = None

    def event(self, kind: EventType, causes: int) -> FenceEvent:
        """The event, without what is only known of the real one."""
        area = self.config.area_hull
        place = self.place
        return FenceEvent(
            0,
            kind,
            int(causes),
            self.hull,
            self.key,  # type: ignore[arg-type]
            self.at[self.hull] if self.hull else 0,
            self.at[area] if area is not None else 0,
            None if place is None else (place.x, place.y),
            None if self.was is None else (self.was.x, self.was.y),
            None,
            NO_TIME if place is None else place.time,
            0,
            origin=self.origin,
        )


class _Search:
    """Looks for an order of the revisions of a commit from which its events follow.

    Attributes:
        problem: what was wrong with the order that explained the most events.
    """

    def __init__(
        self,
        model: FenceModel,
        fences: list[FenceTruth],
        lanes: "dict[str, tuple[Truth, int]]",
        changes: tuple[dict[int, list[FenceEvent]], Mapping[int, Mapping[str, Delay | None]]],
        created: Sequence[str],
    ) -> None:
        self._model = model
        self._fences = fences
        self._created = [
            name
            for name in created
            if any(model._watches(fence.config, name) for fence in fences if fence.config.rule is not None)
        ]
        self._lanes = {name: lane for name, lane in lanes.items() if not lane[0].deleted}
        self._deleted = {name: lane for name, lane in lanes.items() if lane[0].deleted}
        self._made, self._stored = changes
        self._explained = -1
        self.problem = ""

    def run(self) -> dict[int, State] | None:
        at = self._model._now() | {name: revision for name, (_, revision) in self._lanes.items()}
        states = {
            fence.row.number: State(dict(fence.inside), fence.near, 0, fence.known, fence.latest)
            for fence in self._fences
        }
        gone = self._hulls_gone(states, at)
        return None if gone is None else self._from(self._wait(gone, at), at)

    def _hulls_gone(self, states: dict[int, State], at: dict[str, int]) -> dict[int, State] | None:
        """The keys of deleted hulls leave."""
        for name, (truth, revision) in self._deleted.items():
            for fence in self._fences:
                state = states[fence.row.number]
                if fence.config.rule is not None:
                    change = self._model._judge.gone(state.known.get(name), name, revision)
                    left = self._model.after_changes(state, [change], self._events(fence))
                    if isinstance(left, str):
                        self._note(states, f"{fence.row.name}: {left}")
                        return None
                    states = states | {fence.row.number: left}
                    continue
                keys = sorted(key for hull, key in state.inside if hull == name)
                expected = [
                    Expected(fence.config, at | {name: revision}, name, key, truth.held[revision][key], None).event(
                        EventType.EXIT, Cause.REMOVED
                    )
                    for key in keys
                ]
                after = self._explain(fence, state, expected)
                if after is None:
                    return None
                states = states | {fence.row.number: after}
        return states

    def _from(self, states: dict[int, State], at: dict[str, int]) -> dict[int, State] | None:
        done = all(at[name] == truth.revision for name, (truth, _) in self._lanes.items())
        if done and not self._unseen(states):
            for fence in self._fences:
                left = self._events(fence)[states[fence.row.number].explained :]
                if left:
                    self._note(states, f"nothing explains {left[0]} of {fence.row.name}")
                    return None
                number = fence.row.number
                if fence.config.rule is not None and (
                    wrong := self._model.kept_of_alarm(
                        fence, fence.known, states[number].known, self._stored.get(number, {})
                    )[1]
                ):
                    self._note(states, wrong)
                    return None
            return states
        for step in self._steps(at, states):
            after = self._take(states, step, at)
            if after is not None:
                found = self._from(after, at | {name: last for name, (_, last) in step.to.items()})
                if found is not None:
                    return found
        return None

    def _unseen(self, states: dict[int, State]) -> list[str]:
        """The new hulls that alarms have not seen."""
        alarms = [fence for fence in self._fences if fence.config.rule is not None]
        return [
            name
            for name in self._created
            if any(
                name not in states[fence.row.number].known and self._model._watches(fence.config, name)
                for fence in alarms
            )
        ]

    def _steps(self, at: dict[str, int], states: dict[int, State]) -> list[Step]:
        """What may have come next, the most probable first."""
        steps: list[tuple[int, Step]] = [
            (0, Step({}, together=False, appears=name)) for name in self._unseen(states) if at[name] == 0
        ]
        for name, (truth, _) in self._lanes.items():
            revision = at[name] + 1
            if revision > truth.revision:
                continue
            attempt = truth.attempts[revision]
            bound = self._bound(truth, at[name])
            if bound is not None:
                step = self._all_of(bound[1], at)
                if step is not None:
                    steps.append((bound[0], Step(step, together=True)))
            if attempt is None or not self._model._model.together(attempt):
                steps.append((attempt or 0, Step({name: (at[name], revision)}, together=False)))
        return [step for _, step in sorted(steps, key=lambda each: each[0])]

    def _bound(self, truth: "Truth", at: int) -> tuple[int, list[int]] | None:
        """The next batch of a hull, and the ones that come together with it; before it some keys may have expired."""
        for revision in (at + 1, at + 2):
            attempt = truth.attempts[revision] if revision <= truth.revision else None
            if attempt is not None:
                together = self._model._model.together(attempt)
                return (attempt, together) if together else None
        return None

    def _all_of(self, together: list[int], at: dict[str, int]) -> dict[str, tuple[int, int]] | None:
        """The revisions of batches that come at once; None if something else comes before one of them."""
        step = {}
        for name, (truth, _) in self._lanes.items():
            for revision in range(at[name] + 1, truth.revision + 1):
                if truth.attempts[revision] in together:
                    if revision - at[name] > 2 or any(
                        each is not None for each in truth.attempts[at[name] + 1 : revision]
                    ):
                        return None
                    step[name] = at[name], revision
        return step

    def _take(self, states: dict[int, State], step: Step, at: dict[str, int]) -> dict[int, State] | None:
        """The states after a step, if the next events follow from it."""
        now = at | {name: last for name, (_, last) in step.to.items()}
        after = dict(states)
        for fence in self._fences:
            number = fence.row.number
            if fence.config.rule is not None:
                alarmed = self._model.alarm_after(fence, states[number], step, at, self._events(fence))
                if isinstance(alarmed, str):
                    self._note(states, f"{fence.row.name}: {alarmed}")
                    return None
                after[number] = alarmed
            elif any(fence.config.concerns(name) for name in step.to):
                expected = list(self._model.expected(fence, states[number], step, at))
                state = self._explain(fence, states[number], expected, together=step.together)
                if state is None:
                    return None
                after[number] = state
        return self._wait(after, now)

    def _explain(
        self, fence: FenceTruth, state: State, expected: list[FenceEvent], *, together: bool = False
    ) -> State | None:
        """The state after these events, if they are the next ones."""
        if not expected:
            return state
        events = self._events(fence)[state.explained : state.explained + len(expected)]
        for number, one in enumerate(expected):
            if number >= len(events) or not same(events[number], one, together=together):
                real = events[number] if number < len(events) else "nothing"
                self._note({0: state}, f"{fence.row.name} has {real}, and should have {one}")
                return None
        inside = dict(state.inside)
        near = state.near
        for event in events:
            self._model.follow(fence.config, inside, event)
            if event.type in (EventType.BEGIN, EventType.CEASE):
                near = event.type is EventType.BEGIN
        return State(inside, near, state.explained + len(events))

    def _wait(self, states: dict[int, State], at: dict[str, int]) -> dict[int, State]:
        """The states after the dwell events that come at these revisions."""
        for fence in self._fences:
            state, events = states[fence.row.number], self._events(fence)
            while fence.config.rule is not None and state.explained < len(events):
                raised = self._model.by_time(fence, state, events, at)
                if isinstance(raised, str):
                    self._note({0: state}, f"{fence.row.name}: {raised}")
                    break
                state = raised
            states = states | {fence.row.number: state}
            if not fence.config.dwell:
                continue
            while state.explained < len(events):
                event = events[state.explained]
                if event.type is not EventType.DWELL or not self._model.dwells(fence, state, event, at):
                    break
                inside = dict(state.inside)
                self._model.follow(fence.config, inside, event)
                state = State(inside, state.near, state.explained + 1)
            states = states | {fence.row.number: state}
        return states

    def _events(self, fence: FenceTruth) -> list[FenceEvent]:
        return self._made.get(fence.row.number, [])

    def _note(self, states: dict[int, State], problem: str) -> None:
        explained = sum(state.explained for state in states.values())
        if explained > self._explained:
            self._explained, self.problem = explained, problem


def _stored(by_fence: Mapping[int, Sequence[Any]]) -> dict[int, dict[str, Delay | None]]:
    """What changes store of alarms at hulls."""
    return {
        number: {
            hull: delay
            for change in changes
            if isinstance(change, PutDelays)
            for (hull, _), delay in change.delays.items()
        }
        for number, changes in by_fence.items()
        if any(isinstance(change, PutDelays) for change in changes)
    }


def _passed(changes: Iterable[Any]) -> int | None:
    """Up to when times of day have passed at which a fence expects keys, as changes store it."""
    stored = (change.delays.get((NOWHERE, OF_ALL)) for change in changes if isinstance(change, PutDelays))
    return max((each.since for each in stored if each is not None), default=None)


def _of_settings(events: list[FenceEvent] | None) -> bool:
    """Whether events follow from the settings of a fence, not from revisions."""
    settings = Cause.CREATED | Cause.CHANGED
    return bool(events) and events[0].causes & settings != 0 and not events[0].causes & Cause.TIME


def same(real: FenceEvent, expected: FenceEvent, *, together: bool = False) -> bool:
    """Whether an event is as expected; its sequence and time are compared elsewhere."""
    gone = real.position is None and real.key is not None
    if (real.distance is None) != (gone or not real.hull):
        return False
    if real.type is EventType.ENTER and real.distance != 0.0:
        return False
    known = expected._replace(
        sequence=real.sequence, time=real.time, distance=real.distance, inside=real.inside, causes=real.causes
    )
    causes = expected.causes
    if real.first_time != NO_TIME and real.type in (EventType.ENTER, EventType.EXIT):  # it was in doubt before
        known = known._replace(first_time=real.first_time, previous=None)
        causes = real.causes
    if together and causes & Cause.EXPIRED and real.causes & Cause.REMOVED:
        causes = causes & ~Cause.EXPIRED | Cause.REMOVED
    return real == known and real.causes == causes and _members(real.inside) == _members(expected.inside)


def alike(one: FenceEvent, other: FenceEvent) -> bool:
    """Whether two events are the same one."""
    time = other.time if one.type is EventType.CLOSED else one.time  # that one is not stored
    return one._replace(inside=(), time=time) == other._replace(inside=()) and _members(one.inside) == _members(
        other.inside
    )


def _members(inside: Iterable[Members]) -> dict[str, tuple[list[Key], int]]:
    return {each.hull: (list(key_list(each.keys)), each.revision) for each in inside}


def _named(event: FenceEvent) -> list[Subject]:
    """The subjects that an event at the beginning of a fence names."""
    if event.type is EventType.SNAPSHOT:
        return [(each.hull, key) for each in event.inside for key in key_list(each.keys)]
    return [] if event.key is None else [(event.hull, event.key)]


def _is_clear(config: FenceConfig, shape: Shape, entity: Entity) -> bool:
    """Whether a position decides its side, by its accuracy."""
    error = _units(accuracy_of(entity.x)) if config.by_accuracy else 0
    return not error or shape.clear(_exact(entity), error, closed=config.closed)


def expected_of(config: FenceConfig) -> tuple[object, ...]:
    """What a fence expects."""
    return config.expected, config.expected_by, config.expected_within


def _without_expected(events: list[FenceEvent]) -> list[FenceEvent]:
    """The events but those of keys that are missing or arrive, of which `_expects` takes care."""
    return [event for event in events if event.type not in (EventType.MISSING, EventType.ARRIVED)]


@cache
def fixed_shape(area: CircleArea | PolygonArea) -> Shape:
    """An area that no hull moves."""
    if isinstance(area, CircleArea):
        return Disk((_units(area.x), _units(area.y)), _units(area.radius))
    polygons = ([np.frombuffer(ring).reshape(-1, 2).tolist() for ring in polygon] for polygon in area.polygons)
    return Rings(
        tuple(tuple(tuple((_units(x), _units(y)) for x, y in ring) for ring in polygon) for polygon in polygons)
    )


def _units(length: float) -> int:
    units = int(length * UNIT)
    assert units == length * UNIT
    return units


def _exact(entity: Entity) -> Point:
    return _units(entity.x), _units(entity.y)
