"""Which moves of keys may mean something for a fence over an area that never changes: those that change sides.

A key that stays on its side makes no event, as long as the fence waits for nothing of it. So of most moves nothing has
to be known but that; the fence itself judges the others.
"""

from collections.abc import Iterable, Iterator
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points
from dynhull.keys import Keys, key_list

from ..contents.key_rows import no_keys, of_kind
from ..contents.live import AnyKeyedHull
from ..records import CommitStamp, KeyRows, Record
from ..ways import NO_STAMPS, KeyWays, Stamps, joined
from .index.cells import NEAR, OUT, Cells
from .model.records import Key

Flags = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.intp]


@dataclass(slots=True)
class Relevant:
    """What one revision does to the keys that it may concern.

    Attributes:
        before: where some of them were before it, of which the fence has not been told.
        record: the revision, with these keys alone.
    """

    before: KeyRows
    record: Record


@dataclass(slots=True)
class Sifted:
    """The moves of a stretch of the past that may mean something: n rows.

    Attributes:
        keys: n keys.
        points: (n, 2) where they are from then on; NaN for those that are removed.
        before: (n, 2) where they were before.
        untold: (n,) whether the fence has not been told of the place before.
        stamps: the revisions.
        lasts: where all keys of the stretch are at its end.
        commits: all revisions, if the fence waits: it says which one was the last when it made an event.
    """

    keys: list[Key]
    points: Points
    before: Points
    untold: Flags
    stamps: Stamps
    lasts: KeyRows
    commits: Stamps

    def moved(self) -> Iterator[Relevant]:
        """The revisions that may mean something, in order."""
        order = np.argsort(self.stamps.revisions, kind="stable")
        revisions = self.stamps.revisions[order]
        told = joined([self.stamps, self.commits]).once()
        ends = np.searchsorted(revisions, told.revisions, side="right").tolist()
        first = 0
        for revision, number, time, end in zip(*told.columns(), ends, strict=True):
            rows, first = order[first:end], end
            there = self._rows(rows, self.points)
            yield Relevant(
                self._rows(rows[self.untold[rows]], self.before),
                Record(revision, there, cause="batch", committed=CommitStamp(number, time)),
            )

    def _rows(self, rows: Rows, points: Points) -> KeyRows:
        return _key_rows([self.keys[row] for row in rows.tolist()], points[rows], self.lasts.keys)


@dataclass(slots=True)
class _SiftedPart:
    """The moves of a part that may mean something, as in Sifted; and where its keys are at its end."""

    keys: list[Key]
    points: Points
    before: Points
    untold: Flags
    stamps: Stamps
    names: list[Key]
    lasts: Points


@dataclass(slots=True)
class Sieve:
    """Lets the moves through that may mean something.

    Attributes:
        cells: the area.
        crosses: whether subjects that pass through it make events.
        waits: whether the fence waits for reports of keys, or for time.
    """

    cells: Cells
    crosses: bool
    waits: bool

    def sift(self, hull: AnyKeyedHull, waiting: AbstractSet[Key], parts: Iterable[KeyWays]) -> Sifted:
        """The moves of a stretch that may mean something.

        Args:
            hull: the keys as they were before it.
            waiting: those of them of which the fence waits for something.
            parts: all moves.
        """
        run = _Sifting(self, hull, waiting)
        found = [run.sifted(part) for part in parts]
        kind = no_keys(hull.key_type)
        names = [name for part in found for name in part.names]
        lasts = np.concatenate([np.empty((0, 2)), *(part.lasts for part in found)])
        at = {name: row for row, name in enumerate(names)}  # of one in several parts the last place
        return Sifted(
            [key for part in found for key in part.keys],
            np.concatenate([np.empty((0, 2)), *(part.points for part in found)]),
            np.concatenate([np.empty((0, 2)), *(part.before for part in found)]),
            np.concatenate([np.empty(0, np.bool_), *(part.untold for part in found)]),
            joined([part.stamps for part in found]),
            _key_rows(list(at), lasts[list(at.values())], kind),
            joined(run.all).once(),
        )


@dataclass(slots=True)
class _Sifting:
    """Goes over the parts of a stretch.

    Attributes:
        all: all revisions of the parts, if the fence waits.
    """

    sieve: Sieve
    hull: AnyKeyedHull
    waiting: AbstractSet[Key]
    all: list[Stamps] = field(default_factory=list)
    _last: Key | None = field(default=None, init=False)  # of the part before, with its place,
    _place: Points = field(default_factory=lambda: np.empty(2), init=False)
    _told: bool = field(default=True, init=False)  # whether the fence is told of that place,
    _tells: bool = field(default=False, init=False)  # and whether it is told of all that follow

    def sifted(self, part: KeyWays) -> _SiftedPart:
        """The rows of a part that may mean something: each key has the place before it in front of its rows."""
        names = key_list(part.keys)
        lengths = np.diff(part.starts, append=len(part))
        standing = self.hull.positions(part.keys)
        goes_on = len(names) > 0 and names[0] == self._last
        if goes_on:
            standing[0] = self._place
        if self.sieve.waits:
            self.all.append(part.all_stamps())
        loud = np.flatnonzero(~self._quiet(part, standing, names, goes_on=goes_on))
        found = self._of_loud(part, standing, names, lengths, loud, goes_on=goes_on)
        if names:
            ends = part.starts + lengths - 1
            found.names, found.lasts = names, np.column_stack([part.x[ends], part.y[ends]])
            self._last, self._place = names[-1], found.lasts[-1]
        return found

    def _quiet(self, part: KeyWays, standing: Points, names: list[Key], *, goes_on: bool) -> Flags:
        """Keys of which no row can mean anything: they stay where all is on one side, and the fence does not wait."""
        if not names:
            return np.empty(0, np.bool_)
        boxes = [
            (
                np.minimum(np.minimum.reduceat(values, part.starts), at),
                np.maximum(np.maximum.reduceat(values, part.starts), at),
            )
            for values, at in zip((part.x, part.y), standing.T, strict=True)
        ]
        quiet = self.sieve.cells.stays(*boxes, crosses=self.sieve.crosses)
        if self.sieve.waits:
            quiet &= np.array([name not in self.waiting for name in names], np.bool_)
            quiet[0] &= not (goes_on and self._tells)
        return quiet

    def _of_loud(
        self, part: KeyWays, standing: Points, names: list[Key], lengths: Rows, loud: Rows, *, goes_on: bool
    ) -> _SiftedPart:
        """The rows of some keys that may mean something."""
        some, lengths = [names[each] for each in loud.tolist()], lengths[loud]
        count = len(some)
        own = np.repeat(np.arange(count), lengths + 1)  # whose row it is
        heads = np.cumsum(lengths + 1) - lengths - 1
        rows = np.ones(len(own), np.bool_)
        rows[heads] = False
        at = np.arange(len(own)) - np.repeat(heads + 1 - part.starts[loud], lengths + 1)  # its place in the part
        x, y = np.empty(len(own)), np.empty(len(own))
        for place, (column, values) in enumerate(((x, part.x), (y, part.y))):
            column[rows], column[heads] = values[at[rows]], standing[loud, place]
        goes_on = goes_on and count > 0 and loud[0] == 0
        tells = self._telling(x, y, rows, some, own, heads, goes_on=goes_on)
        untold = rows & ~tells
        if goes_on:
            untold[0] = not self._told
        chosen = np.flatnonzero(tells)
        if names:
            is_last = count > 0 and int(loud[-1]) == len(names) - 1
            self._told = is_last and bool(tells[-1])
            self._tells = is_last and self._tells
        return _SiftedPart(
            [some[each] for each in own[chosen].tolist()],
            np.column_stack([x[chosen], y[chosen]]),
            np.column_stack([x[chosen - 1], y[chosen - 1]]),
            untold[chosen - 1],
            part.stamps()[at[chosen]] if len(chosen) else NO_STAMPS,
            [],
            np.empty((0, 2)),
        )

    def _telling(
        self,
        x: npt.NDArray[np.float64],
        y: npt.NDArray[np.float64],
        rows: Flags,
        names: list[Key],
        own: Rows,
        heads: Rows,
        *,
        goes_on: bool,
    ) -> Flags:
        """Which rows may mean something."""
        cells = self.sieve.cells
        sides = cells.sides(x, y)
        tells = np.empty(len(x), np.bool_)
        tells[:1] = False
        tells[1:] = (sides[1:] != sides[:-1]) | (sides[1:] == NEAR)
        if self.sieve.crosses:
            outside = (sides[1:] == OUT) & (sides[:-1] == OUT)
            tells[1:] |= outside & cells.passes(x, y)
        tells &= rows
        if self.sieve.waits and len(names):
            before = np.cumsum(tells)
            waits = np.array([name in self.waiting for name in names], np.bool_)
            waits[0] |= goes_on and self._tells
            tells = rows & ((before > before[heads][own]) | waits[own])
            self._tells = bool(tells[-1])
        return tells


def _key_rows(keys: list[Key], points: Points, kind: Keys) -> KeyRows:
    """Keys that are put, and those whose place is NaN as removed."""
    gone = np.isnan(points[:, 0])
    if not gone.any():
        return KeyRows(of_kind(keys, kind), points, of_kind([], kind))
    removed = [keys[row] for row in np.flatnonzero(gone).tolist()]
    put = [keys[row] for row in np.flatnonzero(~gone).tolist()]
    return KeyRows(of_kind(put, kind), points[~gone], of_kind(removed, kind))
