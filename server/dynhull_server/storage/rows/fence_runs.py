"""The rows of fences in memory: which there are, and which of them have the events of which fence, run by run."""

from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from threading import Lock
from typing import Any, NamedTuple, Self

import numpy as np
import numpy.typing as npt

from ...compiled import Numbers, native
from ...state.fences.events.block import EventBlock
from ...state.fences.model.records import Consumer, FenceRow, Subject
from ...state.fences.model.tallies import Integers, Table
from ..port import NEWEST
from .encoding import checksum, weight
from .event_blocks import Runs

# New runs of all fences together, at most.
MOST_NEW = 2**17
# The columns of `FenceRuns.table`.
LAST, SUBJECTS, SEEN = range(3)
NO_NAME = -1
ITEM = 8  # bytes


@dataclass(slots=True)
class InsideRows:
    """Who was inside after an event, in `parts` rows. It is complete once it has all of them.

    Attributes:
        sequence: the sequence of the event.
        parts: the number of rows.
        places: the row numbers by part.
        sum: the sum of their weights.
    """

    sequence: int
    parts: int
    places: dict[int, int] = field(default_factory=dict)
    sum: int = 0

    @property
    def complete(self) -> bool:
        """Whether all parts are there."""
        return len(self.places) == self.parts


class Start(NamedTuple):
    """Where the events of a fence begin of which some have been dropped.

    Attributes:
        first: the sequence of the oldest event.
        place: the row number.
        weight: the weight of the row.
    """

    first: int
    place: int
    weight: int

    @classmethod
    def at(cls, place: int, fence: int, first: int) -> tuple[Self, int]:
        """The row of a fence, and its checksum."""
        stored = checksum(b"", fence, first)
        return cls(first, place, weight(stored, fence, first)), stored


@dataclass(slots=True)
class FenceRows:
    """The rows of one fence.

    Attributes:
        row: the row of the fence itself.
        weight: its weight.
        sum: the sum of the weights of all rows of the fence, but those of events.
        count: the number of these rows.
        firsts: the first sequence in each run of events, ascending; see `FenceRuns.update`.
        places: the numbers of the rows that these are in.
        last: the newest sequence.
        at: the place of the fence in `FenceRuns`.
        start: where its events begin; None if none has been dropped.
        insides: who was inside, by sequence.
        consumers: each consumer with its row number and weight.
        delays: the row number and weight of each delay.
    """

    row: FenceRow
    weight: int
    sum: int
    count: int = 1
    firsts: "array[int]" = field(default_factory=lambda: array("q"))
    places: "array[int]" = field(default_factory=lambda: array("q"))
    last: int = 0
    at: int = -1
    start: Start | None = None
    insides: dict[int, InsideRows] = field(default_factory=dict)
    consumers: dict[str, tuple[Consumer, int, int]] = field(default_factory=dict)
    delays: dict[Subject, tuple[int, int]] = field(default_factory=dict)

    @property
    def first(self) -> int:
        """The sequence of the oldest event; that of the next one if there is none."""
        return 1 if self.start is None else self.start.first

    @property
    def base(self) -> int:
        """The newest sequence at which it is known who was inside; 0, when nobody was, if no row says so."""
        return max((each.sequence for each in self.insides.values() if each.complete), default=0)

    def boundary(self, first: int) -> int:
        """The sequence nearest before `first` such that the events before it may go."""
        return max(min(first, self.base + 1), self.first)

    def since(self, sequence: int, most: int = NEWEST) -> Self:
        """A copy that has, of the runs of events, only those with the next `most` events after a sequence."""
        sequence = max(sequence, self.first - 1)
        start = max(bisect_right(self.firsts, sequence + 1) - 1, 0)
        runs = slice(start, bisect_right(self.firsts, sequence + most))
        insides = {key: replace(each, places=dict(each.places)) for key, each in self.insides.items()}
        return replace(
            self,
            firsts=self.firsts[runs],
            places=self.places[runs],
            insides=insides,
            consumers=dict(self.consumers),
            delays=dict(self.delays),
        )

    def begin(self, start: Start, runs: int) -> None:
        """Let events begin later, and forget the oldest runs."""
        if self.start is not None:
            self._plus(-1, -self.start.weight)
        self.start = start
        self._plus(1, start.weight)
        del self.firsts[:runs], self.places[:runs]

    def put_inside(self, sequence: int, parts: int, part: int, place: int, each: int) -> None:
        """Add a row of those who are inside."""
        rows = self.insides.setdefault(sequence, InsideRows(sequence, parts))
        rows.places[part] = place
        rows.sum += each
        self._plus(1, each)

    def drop_inside(self, sequence: int) -> None:
        """Remove who was inside after an event."""
        rows = self.insides.pop(sequence)
        self._plus(-len(rows.places), -rows.sum)

    def put_consumer(self, consumer: Consumer, place: int, each: int) -> None:
        """Add or change a consumer."""
        self.drop_consumer(consumer.name)
        self.consumers[consumer.name] = consumer, place, each
        self._plus(1, each)

    def drop_consumer(self, name: str) -> None:
        """Remove a consumer, if there is one of that name."""
        known = self.consumers.pop(name, None)
        if known is not None:
            self._plus(-1, -known[2])

    def put_delay(self, subject: Subject, place: int, each: int) -> None:
        """Add or change the delay of a subject."""
        self.drop_delay(subject)
        self.delays[subject] = place, each
        self._plus(1, each)

    def drop_delay(self, subject: Subject) -> None:
        """Remove the delay of a subject, if it has one."""
        known = self.delays.pop(subject, None)
        if known is not None:
            self._plus(-1, -known[1])

    def change(self, row: FenceRow, each: int) -> None:
        """Change the row of the fence itself."""
        self._plus(0, each - self.weight)
        self.row, self.weight = row, each

    def _plus(self, rows: int, weights: int) -> None:
        self.count += rows
        self.sum += weights


@dataclass(slots=True)
class FenceRuns:
    """The runs of events of fences by number.

    A commit adds runs of many fences as columns: they are kept together, and each fence takes its own when somebody
    asks for them, or when they are many.

    Attributes:
        fences: the fences.
        table: of each fence the sequence of the last event, the hull or prefix of its subjects as a number, and how
            many of the new runs it has looked at.
    """

    fences: Mapping[int, FenceRows]
    table: Table = field(default_factory=lambda: Table(3))
    _names: dict[str, int] = field(default_factory=dict)
    _uses: Counter[str] = field(default_factory=Counter)
    _name_ids: "count[int]" = field(default_factory=count)
    _new: Integers = field(default_factory=lambda: np.empty((3, MOST_NEW), np.int64))  # number, sequence, row
    _end: int = 0
    _turn: Any = field(default_factory=Lock)  # fences take runs for commits, and for readers

    def begin(self, number: int) -> None:
        """Take note of a fence, which has its runs."""
        fence = self.fences[number]
        fence.at = self.table.add(number)
        name = fence.row.config.subjects
        self._uses[name] += 1
        if name not in self._names:
            self._names[name] = next(self._name_ids)
        self.table.columns[:, fence.at] = fence.last, self._names[name], self._end

    def forget(self, fence: FenceRows) -> None:
        """Forget a fence that is deleted."""
        self.table.remove(fence.row.number)
        name = fence.row.config.subjects
        self._uses[name] -= 1
        if not self._uses[name]:
            del self._uses[name], self._names[name]

    def follow(self, block: EventBlock, lasts: Numbers) -> None:
        """Take note in `lasts` of the last events of fences after a block; it has those before where they are new.

        Raises:
            ValueError: an event does not follow the last one of its fence. Nothing was noted.
            KeyError: a fence does not exist.
        """
        if native is not None and native.followed(block.runs, self.table.at, self.table.rows, LAST, lasts):
            return
        found: dict[int, int] = {}
        for number, first, made in zip(
            *(block.runs[name].tolist() for name in ("fence", "first", "count")), strict=True
        ):
            last = found.get(number)
            if last is None:
                last = lasts[number] if number in lasts else self.last(number)
            if last is None:
                raise KeyError(number)
            if first != last + 1:
                fence = self.fences.get(number)
                name = number if fence is None else fence.row.name
                raise ValueError(f"event {first} of fence {name} does not follow event {last}")
            found[number] = last + made
        for number, last in found.items():
            lasts[number] = last

    def last(self, number: int) -> int | None:
        """The sequence of the last event of a fence; None if it does not exist."""
        fence = self.fences.get(number)
        return None if fence is None else int(self.table.columns[LAST, fence.at])

    def own(self, block: EventBlock) -> npt.NDArray[np.bool_]:
        """Of which runs the hull is the one that the fence names; KeyError if a fence does not exist."""
        names = tuple([self._names.get(name, NO_NAME) for name in block.names])
        if native is not None:
            found = native.own(block.runs, self.table.at, self.table.rows, SUBJECTS, names)
            if found is not None:
                return np.frombuffer(found, np.bool_)
        subjects = self.table.columns[SUBJECTS][self.table.places(block.fences)]
        own: npt.NDArray[np.bool_] = np.array(names)[block.runs["hull"]] == subjects
        return own

    def add(self, block: EventBlock | Runs, row: int) -> None:
        """Add the runs of a row. O(runs), with O(all new runs) now and then."""
        if native is not None and isinstance(block, EventBlock) and self._end + len(block.runs) <= MOST_NEW:
            native.added(block.runs, self.table.at, self.table.rows, LAST, self._new, self._end, row)
            self._end += len(block.runs)
            return
        for first in range(0, len(block.fences), MOST_NEW):
            fences = block.fences[first : first + MOST_NEW]
            if self._end + len(fences) > MOST_NEW:
                self._hand_out()
            end = self._end + len(fences)
            self._new[0, self._end : end] = fences
            self._new[1, self._end : end] = block.firsts[first : first + MOST_NEW]
            self._new[2, self._end : end] = row
            self._end = end
        # A fence may have several runs: the last one counts.
        self.table.columns[LAST][self.table.places(block.fences)] = block.firsts + block.counts - 1

    def update(self, fence: FenceRows) -> None:
        """Let a fence have all of its runs. O(new runs of all)."""
        with self._turn:
            self._update(fence)

    def since(self, fence: FenceRows, sequence: int, most: int = NEWEST) -> FenceRows:
        """A copy of a fence that has the runs with the next `most` events after a sequence."""
        with self._turn:
            self._update(fence)
            return fence.since(sequence, most)

    def _update(self, fence: FenceRows) -> None:
        columns = self.table.columns
        seen = int(columns[SEEN, fence.at])
        if seen < self._end:
            own = np.flatnonzero(self._new[0, seen : self._end] == fence.row.number) + seen
            fence.firsts.frombytes(self._new[1, own].tobytes())
            fence.places.frombytes(self._new[2, own].tobytes())
            columns[SEEN, fence.at] = self._end
            fence.last = int(columns[LAST, fence.at])

    def _hand_out(self) -> None:
        """Let all fences have their runs, and begin anew."""
        with self._turn:
            numbers, *rest = self._new[:, : self._end]
            order = np.argsort(numbers, kind="stable")
            ascending = numbers[order]
            starts = np.flatnonzero(np.append(True, ascending[1:] != ascending[:-1]))
            ends = np.append(starts[1:], len(order)).tolist()
            firsts, places = (memoryview(column[order]).cast("B") for column in rest)
            lasts, seen = self.table.columns[LAST].tolist(), self.table.columns[SEEN].tolist()
            for number, start, end in zip(ascending[starts].tolist(), starts.tolist(), ends, strict=True):
                fence = self.fences.get(number)
                if fence is None:
                    continue
                begin = start
                if seen[fence.at]:
                    begin += int(order[start:end].searchsorted(seen[fence.at]))
                own = slice(begin * ITEM, end * ITEM)
                fence.firsts.frombytes(firsts[own])
                fence.places.frombytes(places[own])
                fence.last = lasts[fence.at]
            self.table.columns[SEEN] = 0
            self._end = 0


class Staged(NamedTuple):
    """A row of events of one fence that follow others which are not yet committed. It is not counted among the rows.

    Attributes:
        runs: its runs.
        place: the row number.
        weight: the weight of the row.
    """

    runs: Runs
    place: int
    weight: int

    @property
    def first(self) -> int:
        """The sequence of the first event."""
        return int(self.runs.firsts[0])

    @property
    def last(self) -> int:
        """The sequence of the last event."""
        return int(self.runs.firsts[-1] + self.runs.counts[-1]) - 1
