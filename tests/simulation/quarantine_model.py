"""What the quarantine of a hull in the plane holds out, worked out from the committed revisions in whole numbers.

A revision has the puts that were let in and those that are held: each must be judged so by the rules, and whoever
waited must have left for a reason.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import NamedTuple, Protocol

from support.sides import Point, hull

from dynhull_server.state.records import FOREVER, NO_TIME, HeldRows, KeyRows, QuarantineRules

Key = str | float
MICROSECONDS = 10**6
UNIT = 64  # coordinates are whole numbers of its inverse


class Position(Protocol):
    """A point with its time."""

    @property
    def x(self) -> float: ...

    @property
    def y(self) -> float: ...

    @property
    def time(self) -> int: ...


class Waiting(NamedTuple):
    """A position that is held out, the revision that held it, and how often it was confirmed."""

    x: float
    y: float
    time: int
    deadline: int
    revision: int
    confirmed: int


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a revision did to the quarantine: rows held, keys that were confirmed, and keys contradicted or removed."""

    held: int
    confirmed: int
    dropped: int


@dataclass(frozen=True, slots=True)
class Carried:
    """A request that was carried out: who waited, who was let in and who was dropped."""

    waited: frozenset[Key]
    released: frozenset[Key]
    dropped: frozenset[Key]


class BrokenRuleError(Exception):
    """The quarantine decided otherwise than its rules."""


class Quarantined:
    """The positions that a hull holds out.

    Args:
        rules: the rules, None for none.
        ordered: whether the hull is ordered by event time.
    """

    def __init__(self, rules: QuarantineRules | None, *, ordered: bool) -> None:
        self.rules = rules or QuarantineRules()
        self.waiting: dict[Key, Waiting] = {}
        self._ordered = ordered

    def leave(self, until: int | None, clock: int) -> None:
        """Drop what is too old, or whose time has come."""
        self.waiting = {
            key: each
            for key, each in self.waiting.items()
            if not (until is not None and NO_TIME < each.time <= until) and each.deadline > clock
        }

    def judge(self, there: Mapping[Key, Position], rows: KeyRows, revision: int) -> Verdict:
        """Follow a batch of positions."""
        places = [(each.x, each.y) for each in there.values()]
        gone, confirmed = set(), 0
        for key, put in _puts(rows).items():
            before, waiting = there.get(key), self.waiting.get(key)
            if not self._is_judged(rows, put, before):
                continue
            if not self._breaks(put, before, places):
                if waiting is not None and (put.time == NO_TIME or put.time >= waiting.time):
                    gone.add(key)
            elif 0 < self.rules.confirmations <= self._confirmed(put, waiting, places):
                gone.add(key)
                confirmed += 1
            else:
                raise BrokenRuleError(f"{key!r} is let in at {put}")
        gone.update(key for key in _listed(rows.removes) if key in self.waiting)
        held = {} if rows.held is None else waiting_of(rows.held.rows)
        for key, put in held.items():
            before = there.get(key)
            if not (self._is_judged(rows, put, before) and self._breaks(put, before, places)):
                raise BrokenRuleError(f"{key!r} is held at {put}")
            times = self._confirmed(put, self.waiting.get(key), places)
            if (put.revision, put.confirmed) != (revision, times) or 0 < self.rules.confirmations <= times:
                raise BrokenRuleError(f"{key!r} is held at {put}, and was confirmed {times} times")
        dropped = set() if rows.held is None else set(_listed(rows.held.dropped))
        if dropped != gone:
            raise BrokenRuleError(f"{dropped} left the quarantine rather than {gone}")
        self._follow(dropped, held)
        return Verdict(len(held), confirmed, len(gone) - confirmed)

    def carry_out(self, rows: KeyRows) -> Carried:
        """Follow a release, or another request about the quarantine."""
        assert rows.held is not None  # the request has it
        released, left = _puts(rows), frozenset(_listed(rows.held.dropped))
        waited = frozenset(self.waiting)
        for key, put in released.items():
            waiting = self.waiting.get(key, put)
            if waiting.time == NO_TIME and self.rules.max_speed is not None:  # a rule since then needs a time
                waiting = waiting._replace(time=put.time)
            if key not in left or waiting[:4] != put[:4]:
                raise BrokenRuleError(f"{key!r} is released at {put}, and waits at {self.waiting.get(key)}")
        if not left <= waited or len(rows.held.rows):
            raise BrokenRuleError(f"{left} left the quarantine, and {waited} were there")
        self._follow(left, {})
        if rows.held.rules is not None:
            self.rules = rows.held.rules
        return Carried(waited, frozenset(released), left - released.keys())

    def _follow(self, dropped: Iterable[Key], held: Mapping[Key, Waiting]) -> None:
        for key in dropped:
            self.waiting.pop(key, None)
        self.waiting |= held

    def _is_judged(self, rows: KeyRows, put: Waiting, before: Position | None) -> bool:
        """Whether a put would be written: neither skipped nor stale."""
        if rows.condition == ("present" if before is None else "absent"):
            return False
        return not (self._ordered and before is not None and put.time < before.time)

    def _confirmed(self, put: Waiting, waiting: Waiting | None, places: Sequence[tuple[float, float]]) -> int:
        """How often the key is confirmed with this put."""
        if waiting is None or NO_TIME < put.time <= waiting.time:
            return 0
        return 0 if self._breaks(put, waiting, [*places, waiting[:2]]) else waiting.confirmed + 1

    def _breaks(self, put: Waiting, before: Position | None, places: Sequence[tuple[float, float]]) -> bool:
        speed, growth = self.rules.max_speed, self.rules.max_growth
        if speed is not None and before is not None and NO_TIME not in (put.time, before.time):
            squared = Fraction(put.x - before.x) ** 2 + Fraction(put.y - before.y) ** 2
            if squared > (Fraction(speed) * abs(put.time - before.time) / MICROSECONDS) ** 2:
                return True
        if growth is None:
            return False
        area = _doubled_area(places)
        return area > 0 and _doubled_area([*places, put[:2]]) > Fraction(growth) * area


def waiting_of(rows: HeldRows) -> dict[Key, Waiting]:
    """Positions in quarantine, by key."""
    columns = (rows.times, rows.deadlines, rows.revisions, rows.confirmed)
    held = map(Waiting, *rows.points.T.tolist(), *(column.tolist() for column in columns))
    return dict(zip(_listed(rows.keys), held, strict=True))


def _puts(rows: KeyRows) -> dict[Key, Waiting]:
    keys = _listed(rows.keys)
    times = [NO_TIME] * len(keys) if rows.times is None else rows.times.tolist()
    deadlines = [FOREVER] * len(keys) if rows.deadlines is None else rows.deadlines.tolist()
    none = [0] * len(keys)
    return dict(zip(keys, map(Waiting, *rows.points.T.tolist(), times, deadlines, none, none), strict=True))


def _doubled_area(places: Iterable[tuple[float, float]]) -> int:
    corners: list[Point] = hull((int(UNIT * x), int(UNIT * y)) for x, y in places)
    pairs = zip(corners, corners[1:] + corners[:1], strict=True)
    return sum(ax * by - ay * bx for (ax, ay), (bx, by) in pairs)


def _listed(keys: object) -> list[Key]:
    return [key if isinstance(key, str) else int(key) for key in keys]  # type: ignore[attr-defined]
