"""The ways of some keys through the revisions of a hull."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

from .records import FOREVER, NO_TIME, Accuracies, Condition, Contents, HullSettings, Times

PUT, REMOVE, EXPIRE = range(3)
NO_KEY = -1


@dataclass(slots=True)
class Moves:
    """Where keys were, from which revision on: rows in the order of revisions.

    Attributes:
        rows: (n,) which of the keys.
        revisions: (n,) the revision that put it there.
        times: (n,) when it was committed, in microseconds since 1970; NO_TIME where that is not known.
        points: (n, 2) where it was; NaN from where on it was not in the hull.
        event_times: (n,) the time of the position; NO_TIME for none.
        accuracies: (n,) how far the position may be from where the key was; 0 for not at all.
    """

    rows: npt.NDArray[np.int32]
    revisions: npt.NDArray[np.int64]
    times: Times
    points: Points
    event_times: Times
    accuracies: Accuracies

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, which: slice | npt.NDArray[np.bool_]) -> "Moves":
        return Moves(
            self.rows[which],
            self.revisions[which],
            self.times[which],
            self.points[which],
            self.event_times[which],
            self.accuracies[which],
        )


def joined(parts: Sequence[Moves]) -> Moves:
    """Moves one after the other."""
    if len(parts) == 1:
        return parts[0]
    return Moves(
        np.concatenate([NO_ROWS, *(part.rows for part in parts)]),
        np.concatenate([NO_TIMES, *(part.revisions for part in parts)]),
        np.concatenate([NO_TIMES, *(part.times for part in parts)]),
        np.concatenate([np.empty((0, 2)), *(part.points for part in parts)]),
        np.concatenate([NO_TIMES, *(part.event_times for part in parts)]),
        np.concatenate([EXACT, *(part.accuracies for part in parts)]),
    )


NO_ROWS, NO_TIMES, EXACT = np.empty(0, np.int32), np.empty(0, np.int64), np.empty(0)


@dataclass(slots=True)
class KeyChanges:
    """What batches say of some keys: rows in the order in which they count.

    Attributes:
        rows: (n,) which of the keys; NO_KEY for what is about all of them.
        ops: (n,) PUT, REMOVE, or EXPIRE: all that are too old leave.
        revisions: (n,) the revision.
        times: (n,) when it was committed; NO_TIME where that is not known.
        points: (n, 2) the position put.
        event_times: (n,) its time, NO_TIME for none; of EXPIRE the time up to which keys leave.
        deadlines: (n,) when the key leaves, FOREVER for never.
        accuracies: (n,) how far the position put may be from where the key was.
        clocks: (n,) the clock of the hull after the revision; NO_TIME for none.
        conditions: by revision, which keys are put, where that is not all.
    """

    rows: npt.NDArray[np.int32]
    ops: npt.NDArray[np.int8]
    revisions: npt.NDArray[np.int64]
    times: Times
    points: Points
    event_times: Times
    deadlines: Times
    accuracies: Accuracies
    clocks: Times
    conditions: dict[int, Condition]

    def __len__(self) -> int:
        return len(self.rows)


class Tracker:
    """Follows some keys of a hull: what each batch did to them there, it does here.

    Args:
        settings: those of the hull. It has no window by number, in which other keys decide who leaves.
        keys: the number of the keys.
        rows: which of these are there at first.
        contents: where they are, row by row.
    """

    def __init__(self, settings: HullSettings, keys: int, rows: npt.NDArray[np.int32], contents: Contents) -> None:
        self._by_event_time = settings.by_event_time
        self._there = np.zeros(keys, np.bool_)
        self._points = np.full((keys, 2), np.nan)
        self._times = np.full(keys, NO_TIME)
        self._deadlines = np.full(keys, FOREVER)
        self._accuracies = np.zeros(keys)
        self._there[rows] = True
        self._points[rows] = contents.points
        if contents.times is not None:
            self._times[rows] = contents.times
        if contents.deadlines is not None:
            self._deadlines[rows] = contents.deadlines
        if contents.accuracies is not None:
            self._accuracies[rows] = contents.accuracies

    def standing(self, revision: int, time: int) -> Moves:
        """Where the keys are that are there, as if they had been put there at a time."""
        rows = np.flatnonzero(self._there).astype(np.int32)
        count = len(rows)
        at = np.full(count, revision), np.full(count, time)
        return Moves(rows, *at, self._points[rows], self._times[rows], self._accuracies[rows])

    def moves(self, changes: KeyChanges) -> Moves:
        """Go over batches, and return what they have done."""
        if not len(changes):
            return NOTHING
        plain = not (
            self._by_event_time
            or changes.conditions
            or (changes.ops == EXPIRE).any()
            or (changes.deadlines != FOREVER).any()
            or (self._deadlines != FOREVER).any()
        )
        return self._at_once(changes) if plain else self._one_by_one(changes)

    def _at_once(self, changes: KeyChanges) -> Moves:
        """The same where each put counts, and nothing leaves by time."""
        put, rows = changes.ops == PUT, changes.rows
        order = np.lexsort((np.arange(len(rows)), rows))
        begins = np.append(True, rows[order][1:] != rows[order][:-1])
        before = np.empty(len(rows), np.bool_)  # whether the key of each row is there before it
        before[order] = np.where(begins, self._there[rows[order]], np.roll(put[order], 1))
        last = order[np.append(begins[1:], True)]
        of_last = rows[last]
        self._there[of_last] = put[last]
        self._points[of_last], self._times[of_last] = changes.points[last], changes.event_times[last]
        self._accuracies[of_last] = changes.accuracies[last]
        return _moves(changes, np.flatnonzero(put | before))

    def _one_by_one(self, changes: KeyChanges) -> Moves:
        parts: list[Moves] = []
        written: list[int] = []  # rows since the last part
        there, times, deadlines = self._there, self._times, self._deadlines
        for place, (row, op) in enumerate(zip(changes.rows.tolist(), changes.ops.tolist(), strict=True)):
            if op == EXPIRE:
                leaving = np.flatnonzero(self._leaving(changes, place)).astype(np.int32)
                if len(leaving):
                    there[leaving] = False
                    parts += [_moves(changes, written), _left(changes, place, leaving)]
                    written = []
            elif op == REMOVE:
                if there[row]:
                    there[row] = False
                    written.append(place)
            elif self._counts(changes, place, row):
                there[row] = True
                self._points[row], times[row] = changes.points[place], changes.event_times[place]
                self._accuracies[row] = changes.accuracies[place]
                deadlines[row] = changes.deadlines[place]
                written.append(place)
        return joined([*parts, _moves(changes, written)])

    def _counts(self, changes: KeyChanges, place: int, row: int) -> bool:
        """Whether a put changes the position of its key."""
        condition = changes.conditions.get(int(changes.revisions[place]))
        if condition is not None and bool(self._there[row]) != (condition == "present"):
            return False
        stale = self._by_event_time and self._there[row] and changes.event_times[place] < self._times[row]
        return not stale

    def _leaving(self, changes: KeyChanges, place: int) -> npt.NDArray[np.bool_]:
        """Which keys leave by time."""
        until, clock = changes.event_times[place], changes.clocks[place]
        old = self._times <= until if until != NO_TIME else np.zeros(len(self._times), np.bool_)
        leaving: npt.NDArray[np.bool_] = self._there & ((old & (self._times != NO_TIME)) | (self._deadlines <= clock))
        return leaving


def _moves(changes: KeyChanges, which: "list[int] | npt.NDArray[np.intp]") -> Moves:
    """Some of the rows."""
    if not len(which):
        return NOTHING
    gone = changes.ops[which] != PUT
    points, event_times, accuracies = changes.points[which], changes.event_times[which], changes.accuracies[which]
    points[gone], event_times[gone], accuracies[gone] = np.nan, NO_TIME, 0
    return Moves(changes.rows[which], changes.revisions[which], changes.times[which], points, event_times, accuracies)


def _left(changes: KeyChanges, place: int, rows: npt.NDArray[np.int32]) -> Moves:
    """Keys that have left by time."""
    count = len(rows)
    at = np.full(count, changes.revisions[place]), np.full(count, changes.times[place])
    return Moves(rows, *at, np.full((count, 2), np.nan), np.full(count, NO_TIME), np.zeros(count))


NOTHING = Moves(NO_ROWS, NO_TIMES, NO_TIMES, np.empty((0, 2)), NO_TIMES, EXACT)


class Thinning:
    """Keeps of each key the last row in each span of time.

    Args:
        origin: the time at which the spans begin.
        every: their length, in microseconds; 0 to keep all rows.
    """

    def __init__(self, origin: int, every: int) -> None:
        self._origin = origin
        self._every = every
        self._pending = NOTHING

    def take(self, moves: Moves) -> Moves:
        """What is certain of the rows so far."""
        if not self._every or not len(moves):
            return moves
        moves = joined([self._pending, moves])
        spans = self._spans(moves)
        moves = moves[_last_of_each(moves.rows, spans)]
        spans = self._spans(moves)
        over = spans < spans[-1] if len(spans) else spans == 0
        self._pending = moves[~over]
        return moves[over]

    def rest(self) -> Moves:
        """The rows that were not certain so far: there are no more."""
        rest, self._pending = self._pending, NOTHING
        return rest

    def _spans(self, moves: Moves) -> npt.NDArray[np.int64]:
        """The span of each row: ends of spans belong to them, as the commit at a moment to its state."""
        times = np.where(moves.times == NO_TIME, self._origin, moves.times)
        return -((self._origin - times) // self._every)


def _last_of_each(rows: npt.NDArray[np.int32], spans: npt.NDArray[np.int64]) -> npt.NDArray[np.bool_]:
    """Which rows are the last with their key and span."""
    order = np.lexsort((np.arange(len(rows)), spans, rows))
    row, span = rows[order], spans[order]
    last = np.ones(len(rows), np.bool_)
    last[:-1] = (row[1:] != row[:-1]) | (span[1:] != span[:-1])
    kept = np.zeros(len(rows), np.bool_)
    kept[order[last]] = True
    return kept
