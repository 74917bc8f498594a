"""Positions that break the rules of a hull: held out until they are confirmed, contradicted, released or dropped.

A key has at most one position in quarantine. A put of it is judged by the position that was let in; if it breaks a
rule, also as if the held one had been let in. If it breaks none there, it confirms the held position.
"""

import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from heapq import nsmallest
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from dynhull.keys import PackedKeys, key_list, take_keys

from ..records import FOREVER, NO_TIME, HeldChange, HeldRows, KeyRows, Keys, QuarantineRules
from .deadlines import Key
from .judging import Judge
from .live import AnyKeyedHull

OFF = QuarantineRules()
Rows = npt.NDArray[np.bool_]


class Held(NamedTuple):
    """A position in quarantine; the fields are the columns of `HeldRows`."""

    x: float
    y: float
    time: int
    deadline: int
    speed: float
    growth: float
    revision: int
    confirmed: int
    accuracy: float


@dataclass(slots=True)
class Judged:
    """What the rules say of the rows of a batch.

    Attributes:
        let_in: (n,) the rows of its puts that are let in.
        held: the rows of its puts that are held.
        change: what that changes in the quarantine; None for nothing.
        released: the keys let in because their held position was confirmed.
        dropped: the keys whose held position is dropped: contradicted or removed.
        stale: puts that change nothing because the held position has a later event time.
        only_held: the keys removed that are in quarantine only.
    """

    let_in: Rows
    held: list[int]
    change: HeldChange | None
    released: int
    dropped: int
    stale: int
    only_held: int


class Quarantine:
    """The rules of a keyed hull, and the positions that it holds out.

    Args:
        kind: the kind of the keys.
        rules: the rules.
        stored: the positions.
    """

    def __init__(self, kind: str, rules: QuarantineRules, stored: HeldRows | None = None) -> None:
        self._kind = kind
        self.rules = rules
        self._held: dict[Key, Held] = {}
        self._seals = 0
        # No held position has an earlier time or deadline.
        self._first_time, self._first_deadline = FOREVER, FOREVER
        if stored is not None:
            self._put(stored)

    def __len__(self) -> int:
        return len(self._held)

    def __contains__(self, key: Key) -> bool:
        return key in self._held

    @property
    def has_rules(self) -> bool:
        """Whether there is any rule."""
        return self.rules.max_speed is not None or self.rules.max_growth is not None

    def stored(self) -> HeldRows:
        """The positions in the order of their keys. O(m log m)."""
        return self.page(None, len(self))[0]

    def page(self, after: Key | None, most: int) -> tuple[HeldRows, bool]:
        """At most `most` positions after a key, in the order of their keys, and whether more follow. O(m log m)."""
        held: Iterable[Any] = self._held
        first = nsmallest(most + 1, held if after is None else (key for key in held if key > after))
        return self.of(first[:most]), len(first) > most

    def of(self, keys: Iterable[Key]) -> HeldRows:
        """The positions of some held keys."""
        chosen = list(keys)
        return rows_of(self._pack(chosen), [self._held[key] for key in chosen])

    def whole(self) -> bool:
        """Whether nothing has changed since it was held. O(m)."""
        seals = 0
        for item in self._held.items():
            seals ^= _seal(*item)
        return seals == self._seals

    # Changes

    def follow(self, change: HeldChange) -> None:
        """Carry out a change."""
        for key in key_list(change.dropped):
            self._drop(key)
        self._put(change.rows)
        if change.rules is not None:
            self.rules = change.rules

    def expire(self, until: int | None, clock: int | None) -> None:
        """Drop the positions that are too old, or whose deadline has come. O(m) if there may be any, else O(1)."""
        old = until is not None and self._first_time <= until
        ended = clock is not None and self._first_deadline <= clock
        if not (old or ended):
            return
        staying = set(self.staying(until, clock))
        for key in self._held.keys() - staying:
            self._drop(key)
        self._first_time = min((each.time for each in self._held.values() if each.time != NO_TIME), default=FOREVER)
        self._first_deadline = min((each.deadline for each in self._held.values()), default=FOREVER)

    def staying(self, until: int | None, clock: int | None) -> list[Key]:
        """The keys whose positions are neither too old nor at their deadline. O(m)."""
        return [
            key
            for key, held in self._held.items()
            if not (until is not None and NO_TIME < held.time <= until)
            and not (clock is not None and held.deadline <= clock)
        ]

    def _put(self, rows: HeldRows) -> None:
        for key, *values in _items(rows):
            self._drop(key)
            held = self._held[key] = Held(*values)
            self._seals ^= _seal(key, held)
            if held.time != NO_TIME:
                self._first_time = min(held.time, self._first_time)
            self._first_deadline = min(held.deadline, self._first_deadline)

    def _drop(self, key: Key) -> None:
        held = self._held.pop(key, None)
        if held is not None:
            self._seals ^= _seal(key, held)

    # Judgements

    def judge(self, rows: KeyRows, written: Rows, hull: AnyKeyedHull, judge: Judge, revision: int) -> Judged:
        """Judge the puts of a batch, each alone: by the hull before the batch.

        Args:
            rows: the batch, with times if there is a rule of speed.
            written: (n,) the puts that would be written: neither skipped nor stale.
            hull: the hull before it.
            judge: judges in its frame.
            revision: the revision of the batch.
        """
        speeds, growths = self._measured(rows, written, hull, judge)
        unbroken = np.isnan(speeds) & np.isnan(growths)
        found = Judged(unbroken.copy(), [], None, 0, 0, 0, 0)
        keys = key_list(rows.keys) if self._held or not found.let_in.all() else []
        rejected, dropped = np.flatnonzero(~found.let_in).tolist(), []
        new: list[Held] = []
        for row in rejected:
            key, time = keys[row], NO_TIME if rows.times is None else int(rows.times[row])
            (x, y), confirmed = rows.points[row].tolist(), 0
            before = self._held.get(key)
            if before is not None:
                if hull.ordered and time < before.time:
                    found.stale += 1
                    continue
                if self._confirms(before, (x, y), time, hull, judge):
                    confirmed = before.confirmed + 1
                if 0 < self.rules.confirmations <= confirmed:
                    found.let_in[row] = True
                    found.released += 1
                    dropped.append(key)
                    continue
            deadline = FOREVER if rows.deadlines is None else int(rows.deadlines[row])
            found.held.append(row)
            accuracy = 0.0 if rows.accuracies is None else float(rows.accuracies[row])
            measures = float(speeds[row]), float(growths[row])
            new.append(Held(x, y, time, deadline, *measures, revision, confirmed, accuracy))
        if self._held:
            self._drop_others(rows, keys, written & unbroken, hull, found, dropped)
        if new or dropped:
            held = take_keys(rows.keys, np.array(found.held, np.intp))
            found.change = HeldChange(rows_of(held, new), self._pack(dropped))
        return found

    def _measured(
        self, rows: KeyRows, written: Rows, hull: AnyKeyedHull, judge: Judge
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """The speed and the growth of each put that breaks a rule, NaN for the others."""
        speeds, growths = np.full((2, len(rows.keys)), np.nan)
        rules = self.rules
        if rules.max_speed is not None and rows.times is not None:
            before, since = hull.positions(rows.keys), hull.times(rows.keys)
            known = np.flatnonzero(written & ~np.isnan(before[:, 0]) & ~np.isnan(since) & (rows.times != NO_TIME))
            elapsed = np.abs(rows.times[known] - since[known].astype(np.int64))
            fast, found = judge.too_fast(before[known], rows.points[known], elapsed, rules.max_speed)
            speeds[known[fast]] = found[fast]
        if rules.max_growth is not None and len(rows.keys):
            outside = np.flatnonzero(written & (hull.locate(rows.points) < 0))
            if len(outside):
                large, found = judge.too_large(hull, rows.points[outside], rules.max_growth)
                growths[outside[large]] = found[large]
        return speeds, growths

    def _confirms(self, held: Held, point: tuple[float, float], time: int, hull: AnyKeyedHull, judge: Judge) -> bool:
        """Whether a later position would break no rule if the held one had been let in."""
        if NO_TIME < time <= held.time:
            return False
        rules, here, there = self.rules, np.array([[held.x, held.y]]), np.array([point])
        if rules.max_speed is not None and NO_TIME not in (time, held.time):
            fast, _ = judge.too_fast(here, there, np.array([time - held.time]), rules.max_speed)
            if fast[0]:
                return False
        if rules.max_growth is not None:
            with_held = judge.with_point(hull, (held.x, held.y))
            return with_held is not None and not judge.too_large(with_held, there, rules.max_growth)[0][0]
        return True

    def _drop_others(
        self, rows: KeyRows, keys: list[Any], let_in: Rows, hull: AnyKeyedHull, found: Judged, dropped: list[Key]
    ) -> None:
        """Find the held positions that a batch contradicts or removes."""
        for row in np.flatnonzero(let_in).tolist():
            held = self._held.get(keys[row])
            if held is not None and (rows.times is None or rows.times[row] >= held.time):
                found.dropped += 1
                dropped.append(keys[row])
        for key in key_list(rows.removes):
            if key in self._held:
                found.dropped += 1
                found.only_held += key not in hull
                dropped.append(key)

    def _pack(self, keys: list[Key]) -> Keys:
        return PackedKeys.pack(keys) if self._kind == "str" else np.array(keys, np.uint64)  # type: ignore[arg-type]


def rows_of(keys: Keys, held: list[Held]) -> HeldRows:
    """Positions in quarantine as columns."""
    columns = zip(*held, strict=True) if held else ((),) * 9
    x, y, times, deadlines, speeds, growths, revisions, confirmed, accuracies = columns
    return HeldRows(
        keys,
        np.column_stack([np.array(x, np.float64), np.array(y, np.float64)]),
        np.array(times, np.int64),
        np.array(deadlines, np.int64),
        np.array(speeds, np.float64),
        np.array(growths, np.float64),
        np.array(revisions, np.int64),
        np.array(confirmed, np.int64),
        np.array(accuracies, np.float64),
    )


def _items(rows: HeldRows) -> Iterable[tuple[Any, ...]]:
    columns = (rows.times, rows.deadlines, rows.speeds, rows.growths, rows.revisions, rows.confirmed, rows.accuracies)
    return zip(key_list(rows.keys), *rows.points.T.tolist(), *(column.tolist() for column in columns), strict=True)


def _seal(key: Key, held: Held) -> int:
    return zlib.crc32(repr((key, held)).encode())
