"""The ways of some keys through the revisions of a hull."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import key_list

from .contents import replayed
from .contents.deadlines import Key
from .contents.key_rows import of_kind
from .contents.keyed import Keyed
from .records import NO_TIME, Expiry, HullSettings, Kept, KeyRows, Keys, Record, Times


@dataclass(slots=True)
class Moves:
    """Where keys were, from which revision on: rows in the order of revisions.

    Attributes:
        rows: (n,) which of the keys.
        revisions: (n,) the revision that put it there.
        times: (n,) when it was committed, in microseconds since 1970; NO_TIME where that is not known.
        points: (n, 2) where it was; NaN from where on it was not in the hull.
        event_times: (n,) the time of the position; NO_TIME for none.
    """

    rows: npt.NDArray[np.int32]
    revisions: npt.NDArray[np.int64]
    times: Times
    points: Points
    event_times: Times

    def __len__(self) -> int:
        return len(self.rows)

    def __getitem__(self, which: slice | npt.NDArray[np.bool_]) -> "Moves":
        return Moves(
            self.rows[which], self.revisions[which], self.times[which], self.points[which], self.event_times[which]
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
    )


NO_ROWS, NO_TIMES = np.empty(0, np.int32), np.empty(0, np.int64)


class Tracker:
    """Follows some keys of a hull, of which it has no others: each batch does to them what it did to the hull.

    Args:
        settings: those of the hull. It has no window by number, in which other keys decide who leaves.
        keys: the keys.
        kept: where these are at first.
    """

    def __init__(self, settings: HullSettings, keys: Keys, kept: Kept) -> None:
        self._keys = keys
        self._rows: dict[Key, int] = {key: row for row, key in enumerate(key_list(keys))}
        self._by_event_time = settings.by_event_time
        # Positions are where they were put, on the globe, too; what is held out of the hull is not there.
        bare = replace(settings, frame="plane", center=None, quarantine=None)
        contents = replayed(Kept(kept.revision, replace(kept.contents, held=None), clock=kept.clock), bare)
        assert isinstance(contents, Keyed)
        self._contents = contents
        self._there: set[Key] = set(key_list(contents.hull.entities()[0]))

    def follow(self, records: Iterable[Record]) -> None:
        """Go over batches."""
        self.moves(records)

    def standing(self, revision: int, time: int) -> Moves:
        """Where the keys are that are there, as if they had been put there at a time."""
        found = self._contents.find(self._keys)
        rows = np.flatnonzero(found.present).astype(np.int32)
        times = np.full(len(rows), NO_TIME) if found.times is None else found.times[rows]
        return Moves(rows, np.full(len(rows), revision), np.full(len(rows), time), found.points[rows], times)

    def moves(self, records: Iterable[Record]) -> Moves:
        """Go over batches, and return what they have done."""
        return joined([part for record in records for part in self._moves(record)] or [NOTHING])

    def _moves(self, record: Record) -> list[Moves]:
        rows = record.rows
        if isinstance(rows, Expiry):
            self._contents.replay([record])
            found = self._contents.find(of_kind(list(self._there), self._keys))
            gone = [key for key, present in zip(list(self._there), found.present.tolist(), strict=True) if not present]
            return self._ends(record, gone)
        assert isinstance(rows, KeyRows)
        written = self._written(rows)
        self._contents.replay([record])
        put = [self._rows[key] for key in key_list(rows.keys)]
        parts = self._ends(record, [key for key in key_list(rows.removes) if key in self._there])
        self._there.update(key_list(rows.keys) if written is None else _which(key_list(rows.keys), written))
        if not put:
            return parts
        times = np.full(len(put), NO_TIME) if rows.times is None else rows.times
        moves = _of(record, put, rows.points, times)
        return [*parts, moves if written is None else moves[written]]

    def _ends(self, record: Record, gone: list[Key]) -> list[Moves]:
        """What it is for keys to leave."""
        if not gone:
            return []
        self._there.difference_update(gone)
        rows = [self._rows[key] for key in gone]
        return [_of(record, rows, np.full((len(rows), 2), np.nan), np.full(len(rows), NO_TIME))]

    def _written(self, rows: KeyRows) -> npt.NDArray[np.bool_] | None:
        """Which puts change the position of their key; None for all."""
        if rows.condition is None and not (self._by_event_time and rows.times is not None):
            return None
        found = self._contents.find(rows.keys)
        written = np.ones(len(rows.keys), np.bool_)
        if rows.condition is not None:
            written &= found.present == (rows.condition == "present")
        if self._by_event_time and rows.times is not None and found.times is not None:
            written &= ~(found.present & (rows.times < found.times))
        return written


def _of(record: Record, rows: list[int], points: Points, event_times: Times) -> Moves:
    time = NO_TIME if record.committed is None else record.committed.time
    count = len(rows)
    return Moves(np.array(rows, np.int32), np.full(count, record.revision), np.full(count, time), points, event_times)


def _which(keys: list[Key], which: npt.NDArray[np.bool_]) -> list[Key]:
    return [key for key, chosen in zip(keys, which.tolist(), strict=True) if chosen]


NOTHING = Moves(NO_ROWS, NO_TIMES, NO_TIMES, np.empty((0, 2)), NO_TIMES)


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
