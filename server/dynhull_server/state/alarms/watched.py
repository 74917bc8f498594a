"""An alarm at its hulls: for which it is raised, and when time decides something there."""

from collections.abc import Callable, Collection, Iterator, Mapping
from heapq import heappop, heappush
from typing import TYPE_CHECKING

import numpy as np

from dynhull.keys import PackedKeys
from dynhull.measure import LastVertices, compare

from ..records import NO_TIME
from .conditions import Condition
from .rule import MICROSECONDS, AlarmRule
from .values import EXACT, NOTHING, Seen, holds, rows_in, seen, value_of

if TYPE_CHECKING:
    from ..fences.model.records import Delay, Subject
    from ..hull import Hull
    from ..records import Keys

# An event has at most so many keys.
MOST_KEYS = 100
# No hull has so many changes.
NEVER = -1, -1


class Watched:
    """An alarm at one hull.

    Args:
        rule: the rule of the alarm.
        hull: the hull.
        moved: the time of its last change, in microseconds since 1970.
        other: the other hull that the rule names, None if it names none.

    Attributes:
        hull: the hull.
        other: the other hull.
        raised: whether the alarm is raised for it.
        standing: since when and why the condition holds, who has acknowledged it, and until when it is muted; None for
            nothing of that.
        moved: the time of the last change of the hull.
        planned: when it is planned to look at it, None if it is not.
        fresh: whether it has not been compared so far.
    """

    __slots__ = (
        "_as_of",
        "_last",
        "_rule",
        "_seen",
        "_still",
        "_still_for",
        "fresh",
        "hull",
        "moved",
        "other",
        "planned",
        "raised",
        "standing",
    )

    def __init__(self, rule: AlarmRule, hull: "Hull", moved: int, other: "Hull | None") -> None:
        self.hull = hull
        self.other = other
        self.raised = False
        self.standing: Delay | None = None
        self.moved = moved
        self.planned: int | None = None
        self.fresh = True
        self._rule = rule
        exact = rule.raises.measure in EXACT and not self._geographic
        # Of a measure that is compared exactly, which has only vertices; what is seen for others is in `_seen`.
        self._last = LastVertices() if exact else None
        self._still: Callable[[], bool] | None = None
        self._still_for: tuple[object, object] = (None, None)
        self._seen, self._as_of = NOTHING, NEVER
        self._look()

    def _look(self) -> None:
        if self._last is not None:
            self._last.take(self.hull.state.hull)
            return
        self._as_of = self._changes()
        if not self._rule.silence:
            self._seen = self._now()

    def _now(self) -> Seen:
        other = None if self.other is None else self.other.state
        return seen(self._rule, self.hull.state, other, geographic=self._geographic)

    def _noted(self) -> Seen:
        return self._seen if self._last is None else Seen(self._last.points())

    def _changes(self) -> tuple[int, int]:
        """What differs after each change of what the rule compares, of the hull and of the other one."""
        state = self.hull.state
        own = state.hull.changes if self._rule.of_outline else state.counts.revision
        return own, 0 if self.other is None else self.other.state.hull.changes

    @property
    def _geographic(self) -> bool:
        return self.hull.row.settings.geographic

    @property
    def vertex_count(self) -> int:
        """The number of vertices that were compared when it was last looked at; 0 for a rule that needs none."""
        return len(self._seen.vertices) + len(self._seen.others) if self._last is None else len(self._last)

    @property
    def waits(self) -> bool:
        """Whether the condition holds, but not yet for long enough."""
        return self.standing is not None and self.standing.enters

    @property
    def due(self) -> int | None:
        """When time raises the alarm, None if that does not happen by itself."""
        if self.raised:
            return None
        if self._rule.silence:
            return self.moved + self._rule.silence
        if self.standing is not None and self.standing.enters:
            return self.standing.since + self._rule.hold
        return None

    def changed(self) -> Seen | None:
        """What was seen of the hull before, if it has changed since this was last asked; else None."""
        if self._last is not None:
            unchanged = self._last.changes == self.hull.state.hull.changes
        else:
            unchanged = self._as_of == self._changes()
        if unchanged:
            return None
        before = self._noted()
        self._look()
        return before

    @property
    def still(self) -> Callable[[], bool] | None:
        """What is asked after a change of the outline, of a measure that is compared exactly; None for others.

        It takes note of the change and says yes where that certainly changes nothing for the alarm; no: perhaps. It is
        the same until the alarm is raised or cleared for the hull, or waits, or the hull is read anew.
        """
        last = self._last
        if last is None or self.fresh:
            return None
        hull, steady = self.hull.state.hull, self._rule.steady[2 if self.raised else self.waits]
        as_of, of = self._still_for
        if as_of is not hull or of is not steady:
            self._still, self._still_for = last.taker(hull, *steady), (hull, steady)
        return self._still

    def touched(self, now: int) -> bool:
        """Whether a new revision of the hull changes anything for the alarm; takes note of it if it does not."""
        still = self.still
        if still is not None:
            return self._crossed(still)
        if self.fresh or self._as_of == self._changes():
            return self.fresh
        rule, before = self._rule, self._seen
        if rule.silence and self.raised:
            return True
        self._look()
        if rule.silence:
            self.moved = max(self.moved, now)
            return False
        changes = self.holds(rule.clears) if self.raised else self.holds(rule.raises) != self.waits
        if changes:  # `changed` says what was before
            self._as_of, self._seen = NEVER, before
        return changes

    def _crossed(self, still: Callable[[], bool]) -> bool:
        """As `touched`, for a measure that is compared exactly."""
        hull, last = self.hull.state.hull, self._last
        assert last is not None  # of such a measure
        if last.changes == hull.changes or still():
            return False
        measure, bound, least, most = self._rule.steady[2 if self.raised else self.waits]
        if not least <= compare(hull.vertices(), measure, bound) <= most:
            return True  # `changed` says what was before
        last.take(hull)
        return False

    def doubt(self) -> None:
        """Compare the hull anew when it is touched next, even if its vertices have not changed."""
        self._as_of = NEVER

    def look_again(self) -> None:
        """Take note of the hull as the storage has it: what it was noted for has not been committed."""
        self._look()
        if self.hull.committed is not None:
            self.moved = min(self.moved, self.hull.committed.time)

    def holds(self, condition: Condition) -> bool:
        """Whether a condition of the rule holds for the hull as it was last looked at."""
        return holds(condition, self._noted(), self._rule, geographic=self._geographic)

    def value(self, before: Seen | None = None) -> float:
        """The measure as it was last looked at, or of what was seen before."""
        return value_of(self._noted() if before is None else before, self._rule, geographic=self._geographic)

    def keys(self) -> "Keys | None":
        """The keys of the vertices that the alarm is about, at most MOST_KEYS; None for other alarms and hulls."""
        state, raises = self.hull.state, self._rule.raises
        if not raises.of_vertices or self.hull.row.settings.identity == "multiset":
            return None
        if raises.measure == "vertex":
            found = [str(raises.subject)] if self._seen.number else []
        else:
            other = None if self.other is None else self.other.state
            rows = rows_in(raises.subject, state, other, geographic=self._geographic)[:MOST_KEYS]
            found = state.vertex_keys()[rows].tolist()
        if self.hull.row.settings.identity == "str":
            return PackedKeys.pack(found)
        return np.array(list(map(int, found)), np.uint64)

    @property
    def of_silence(self) -> bool:
        """Whether the alarm is about silence, and not about a measure."""
        return self._rule.silence > 0

    def silent(self, now: int) -> float:
        """The seconds since the last change of the hull."""
        return max(now - self.moved, 0) / MICROSECONDS


class WatchedHulls:
    """An alarm at all of its hulls.

    Args:
        rule: the rule of the alarm.
        created: the time of its creation, in microseconds since 1970: for hulls of which no commit is known.

    Attributes:
        other: the other hull that the rule names, with which all are compared; None if it names none.
        of: the hulls by name.
        raised: those for which the alarm is raised, by name.
    """

    def __init__(self, rule: AlarmRule, created: int) -> None:
        self.other: Hull | None = None
        self.of: dict[str, Watched] = {}
        self.raised: dict[str, Watched] = {}
        self._rule = rule
        self._created = created
        # A heap of times and names. An entry is outdated if the hull has another plan, and may be too early.
        self._due: list[tuple[int, str]] = []

    def __len__(self) -> int:
        return len(self.of)

    def add(self, hull: "Hull", now: int | None = None) -> Watched:
        """Watch a hull that has changed by its last commit, or `now` if that is earlier: commits have another clock."""
        moved = self._created if hull.committed is None else hull.committed.time
        moved = moved if now is None else min(moved, now)
        watched = self.of[hull.name] = Watched(self._rule, hull, moved, self.other)
        return watched

    def remove(self, name: str) -> None:
        """Watch a hull no longer, which is deleted."""
        self.of.pop(name, None)
        self.raised.pop(name, None)

    def put_raised(self, watched: Watched, *, raised: bool) -> None:
        """Say whether the alarm is raised for a hull."""
        watched.raised = raised
        if raised:
            self.raised[watched.hull.name] = watched
        else:
            self.raised.pop(watched.hull.name, None)

    def at(self, name: str) -> list[Watched]:
        """What is compared after a change of a hull: the hull, or all if it is the other one. By name."""
        if self.other is not None and name == self.other.name:
            return [each for _, each in sorted(self.of.items())]
        return [self.of[name]]

    def weight(self, name: str) -> int:
        """The number of vertices of all that is compared after a change of a hull."""
        total = 0
        for each in self.at(name):
            total += each.vertex_count
        return total

    def renewed(self, other: "Hull | None") -> "WatchedHulls":
        """The same hulls as they are now, of which nothing is known otherwise."""
        found = WatchedHulls(self._rule, self._created)
        found.other = other
        for each in self.of.values():
            found.add(each.hull, each.moved)
        return found

    def begin(self, now: int) -> None:
        """Take up the hulls at a start: what was committed by a clock that was ahead counts from now on."""
        for watched in self.of.values():
            watched.moved = min(watched.moved, now)
            self.plan(watched)

    def restore(self, raised: Collection[str], standings: "Mapping[Subject, Delay]") -> None:
        """Take over for which hulls the alarm is raised, and what is known there."""
        for name, watched in self.of.items():
            self.put_raised(watched, raised=name in raised)
            watched.standing = standings.get((name, ""))
            watched.fresh = False
            self.plan(watched)

    def plan(self, watched: Watched) -> None:
        """Plan when time raises the alarm for a hull."""
        due = watched.due
        if due is not None and (watched.planned is None or due < watched.planned):
            watched.planned = due
            heappush(self._due, (due, watched.hull.name))

    @property
    def first_due(self) -> int | None:
        """When time raises the alarm for a hull next, or earlier; None if it does not."""
        while self._due:
            time, name = self._due[0]
            watched = self.of.get(name)
            if watched is not None and watched.planned == time:
                if watched.due == time:
                    return time
                watched.planned = None
            heappop(self._due)
            if watched is not None:
                self.plan(watched)
        return None

    def first_due_after(self, time: int) -> int | None:
        """As `first_due`, of hulls for which that is after a time. O(the others): it looks at the top of the heap."""
        plans, stack, found = self._due[:], [0], []
        while stack:
            place = stack.pop()
            if place >= len(plans):
                continue
            due: int | None
            due, name = plans[place]
            if due <= time:
                stack += 2 * place + 1, 2 * place + 2
                watched = self.of.get(name)
                due = None if watched is None else watched.due
            if due is not None and due > time:
                found.append(due)
        return min(found, default=None)

    def take(self, now: int, most: int) -> Iterator[tuple[Watched, int]]:
        """At most that many hulls for which time raises the alarm now, each with the time at which it was due."""
        for _ in range(most):
            due = self.first_due
            if due is None or due > now:
                return
            _, name = heappop(self._due)
            watched = self.of[name]
            watched.planned = None
            yield watched, due

    @property
    def newest(self) -> int:
        """Since when the condition holds that holds shortest; NO_TIME if none does. O(n)."""
        return max((each.standing.since for each in self.of.values() if each.standing is not None), default=NO_TIME)
