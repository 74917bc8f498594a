"""The rows of fences: which there are, and how changes of fences become statements."""

from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from typing import TYPE_CHECKING, assert_never

import numpy as np
import numpy.typing as npt

from ...compiled import numbers
from ...state.changes import FenceChange
from ...state.fences.events.block import AppendEvents, EventBlock, joined
from ...state.fences.model.records import (
    AddFence,
    ChangeFence,
    Consumer,
    DropConsumer,
    DropEvents,
    DropFence,
    FenceRow,
    Inside,
    Members,
    PutConsumer,
    PutDelays,
    Subject,
)
from ..port import NotCommittedError
from .encoding import checksum, weight
from .event_blocks import Runs, encode_block
from .event_rows import encode_delay, encode_inside
from .fence_rows import consumer_values, values
from .fence_runs import FenceRows, Staged, Start
from .ledger import Ledger
from .tables import MANY, Insert, Remove, Replace, Statement

if TYPE_CHECKING:
    from array import array

# Keys in a row of those who are inside: about half a megabyte, a commit that delays later ones only briefly.
KEYS_A_ROW = 16_384
# Events in a row: whoever reads those of one fence reads all of them.
EVENTS_A_ROW = 1024
# Rows of events that are deleted in the commit that drops them; of more, `sweep` deletes some at a time.
DROPPED_AT_ONCE = 64


@dataclass(frozen=True, slots=True)
class PutInside:
    """Step: a part of those who are inside of a fence."""

    number: int
    sequence: int
    parts: int
    part: int
    place: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class DropInside:
    """Step: deletes who was inside of a fence after an event."""

    number: int
    sequence: int


@dataclass(frozen=True, slots=True)
class ShrinkEvents:
    """Step: leaves of a row of events only those runs that fences need."""

    place: int
    runs: int
    payload: bytes


@dataclass(frozen=True, slots=True)
class StageEvents:
    """Step: some rows of a block, events of one fence, are written ahead of the commit that makes them valid.

    There is a gap before such rows, which tells a start that they are not valid. `begins` is whether they are the first
    ones; what has been staged before them was given up.
    """

    number: int
    block: EventBlock
    start: int
    end: int
    place: int
    begins: bool


@dataclass(frozen=True, slots=True)
class AppendFirst:
    """Step: the events before staged ones, in rows whose numbers are less than those of the staged ones."""

    block: EventBlock
    places: Sequence[int]


@dataclass(frozen=True, slots=True)
class CountStaged:
    """Step: the staged events of a fence are valid: they follow its last one, and lead to the sequence `last`."""

    number: int
    last: int


@dataclass(frozen=True, slots=True)
class DropStaged:
    """Step: deletes the staged events of a fence."""

    number: int


FenceStep = PutInside | DropInside | ShrinkEvents | StageEvents | AppendFirst | CountStaged | DropStaged
# Those that are of one fence that exists.
ChangeOfOne = (
    ChangeFence
    | DropFence
    | PutDelays
    | DropEvents
    | PutConsumer
    | DropConsumer
    | PutInside
    | DropInside
    | StageEvents
    | CountStaged
    | DropStaged
)


@dataclass(slots=True)
class _FenceNow:
    """A fence after a part of the changes; `rows` is its present state in the ledger.

    Attributes:
        rows: its present state in the ledger.
        count, sum: the number of all its rows, and the sum of their weights.
        start: where its events begin, None if none has been dropped.
        dropped: the number of its oldest runs of events that are dropped.
        consumers: the row number and weight of each changed consumer, None for a deleted one.
        delays: the row number and weight of each changed delay, None for one that has ended.
        deleted: whether it is deleted.
    """

    rows: FenceRows
    count: int
    sum: int
    start: Start | None = None
    dropped: int = 0
    consumers: dict[str, tuple[int, int] | None] = field(default_factory=dict)
    delays: dict[Subject, tuple[int, int] | None] = field(default_factory=dict)
    deleted: bool = False

    def consumer(self, name: str) -> tuple[int, int] | None:
        """The row number and weight of a consumer, None if there is none."""
        if name in self.consumers:
            return self.consumers[name]
        known = self.rows.consumers.get(name)
        return None if known is None else known[1:]


class FenceChanges:
    """The part of a group of changes that concerns fences.

    Args:
        ledger: the rows as of the last commit; it does not change before the effects.
        statements: receives the changes of rows.
        effects: receives the updates of the ledger.

    Attributes:
        rows, sum: what the changes add to the number of rows and to the sum of their weights.
        next_number: a number greater than those of new fences.
    """

    def __init__(self, ledger: Ledger, statements: list[Statement], effects: list[Callable[[], object]]) -> None:
        self._ledger = ledger
        self._statements = statements
        self._effects = effects
        self._now: dict[int, _FenceNow] = {}
        self._lasts = numbers()  # the last events of fences, where these are new
        self._blocks: list[EventBlock] = []
        self._firsts: list[AppendFirst] = []
        self._counted: list[int] = []  # fences whose staged events are valid from now on
        self._released: dict[int, int] = {}  # runs by row
        self._shrunk: dict[int, int] = {}  # weights by row
        self.rows = self.sum = self.next_number = 0

    def take(self, change: FenceChange | FenceStep) -> None:
        """Add a change."""
        if isinstance(change, AddFence):
            self._add(change)
            return
        if isinstance(change, AppendEvents):
            self._follow(change.block)
            self._blocks.append(change.block)
            return
        if isinstance(change, AppendFirst):
            self._follow(change.block)
            self._firsts.append(change)
            return
        if isinstance(change, ShrinkEvents):
            self._shrink(change)
            return
        number = change.row.number if isinstance(change, ChangeFence) else change.number
        now = self._fence(number)
        if now is not None:
            self._carry_out(change, now)
        elif not isinstance(change, PutInside | DropInside):  # those may come after the deletion
            raise NotCommittedError(f"there is no fence {number}")

    def _fence(self, number: int) -> _FenceNow | None:
        """A fence after the changes so far, None if it does not exist."""
        now = self._now.get(number)
        if now is None and (rows := self._ledger.fences.get(number)):
            now = self._now[number] = _FenceNow(rows, rows.count, rows.sum, rows.start)
        return None if now is None or now.deleted else now

    def _plus(self, now: _FenceNow, rows: int, weights: int) -> None:
        now.count += rows
        now.sum += weights
        self.rows += rows
        self.sum += weights

    def _add(self, change: AddFence) -> None:
        row = change.row
        if self._fence(row.number):
            raise NotCommittedError(f"fence {row.number} already exists")
        *columns, stored = values(row)
        each = weight(stored, row.number)
        rows = FenceRows(row, each, each, last=change.inside.sequence)
        now = self._now[row.number] = _FenceNow(rows, 0, 0)
        self._lasts[row.number] = rows.last
        self._plus(now, 1, each)
        self.next_number = max(self.next_number, row.number + 1)
        self._statements.append(Insert("fences", (*columns, stored)))

        def begin() -> None:
            self._ledger.fences[row.number] = rows
            self._ledger.runs.begin(row.number)

        self._effects.append(begin)
        for step in inside_steps(row.number, change.inside, lambda: next(self._ledger.inside_ids)):
            self._put_inside(step, now)

    def _carry_out(self, change: ChangeOfOne, now: _FenceNow) -> None:
        match change:
            case PutDelays():
                self._put_delays(change, now)
            case ChangeFence():
                self._change(change.row, now)
            case DropFence():
                self._drop_fence(change.number, now)
            case DropEvents():
                self._drop_events(change.first, now)
            case PutConsumer():
                self._put_consumer(change.consumer, change.number, now)
            case DropConsumer():
                self._drop_consumer(change.name, now)
                now.consumers[change.name] = None
                self._effects.append(lambda: now.rows.drop_consumer(change.name))
            case PutInside():
                self._put_inside(change, now)
            case DropInside():
                self._drop_inside(change.sequence, now)
            case StageEvents():
                self._stage(change)
            case CountStaged():
                self._count_staged(change)
            case DropStaged():
                self._drop_staged(change.number)
            case _:
                assert_never(change)

    def _follow(self, block: EventBlock) -> None:
        """Raise NotCommittedError if events do not follow the last ones of their fences."""
        gone = {number for number, now in self._now.items() if now.deleted}
        missing = gone.intersection(block.fences.tolist()) if gone else gone
        if missing:
            raise NotCommittedError(f"there is no fence {min(missing)}")
        try:
            self._ledger.runs.follow(block, self._lasts)
        except KeyError as error:
            raise NotCommittedError(f"there is no fence {error}") from None
        except ValueError as error:
            raise NotCommittedError(str(error)) from None

    def finish(self) -> None:
        """Write all events, after the last change: in one row, or in several if they are many."""
        if self._blocks:
            self._write(joined(self._blocks))
        for each in self._firsts:
            self._write(each.block, each.places)
        for number in self._counted:
            self._effects.append(partial(self._count, number))

    def _write(self, block: EventBlock, places: Iterable[int] = ()) -> None:
        for number in self._ledger.staged.keys() - self._counted:
            if number in block.fences:  # those were given up
                self._drop_staged(number)
        gone = [number for number, now in self._now.items() if now.deleted]
        if gone:
            block = block.only(~np.isin(block.fences, gone))
        of_rows = chain(places, self._ledger.event_ids)
        for start in range(0, len(block), EVENTS_A_ROW):
            end = min(start + EVENTS_A_ROW, len(block))
            self._write_events(block if end - start == len(block) else block.part(start, end), next(of_rows))

    def _write_events(self, block: EventBlock, place: int) -> None:
        each, runs = self._insert_events(block, place), len(block.fences)
        self.rows += 1
        self.sum += each

        def add() -> None:
            self._ledger.runs.add(block, place)
            self._ledger.events.add(place, each, runs, runs)

        self._effects.append(add)

    def _insert_events(self, block: EventBlock, place: int) -> int:
        """Write a row of events. Returns its weight."""
        payload = encode_block(block, self._own(block))
        stored = checksum(payload, *MANY)
        self._statements.append(Insert("events", (place, *MANY, stored, payload)))
        return weight(stored, *MANY)

    def _stage(self, step: StageEvents) -> None:
        staged = self._ledger.staged
        if step.begins:
            self._drop_staged(step.number)
        block = step.block.part(step.start, step.end)
        row = Staged(Runs(block.fences, block.firsts, block.counts), step.place, self._insert_events(block, step.place))
        self._effects.append(lambda: staged.setdefault(step.number, []).append(row))

    def _count_staged(self, step: CountStaged) -> None:
        rows = self._ledger.staged.get(step.number, [])
        last = self._lasts[step.number] if step.number in self._lasts else self._ledger.runs.last(step.number)
        if [last, *(row.last for row in rows)] != [*(row.first - 1 for row in rows), step.last]:
            raise NotCommittedError(f"the events of fence {step.number} up to {step.last} have not been written")
        self._lasts[step.number] = step.last
        self._counted.append(step.number)
        self.rows += len(rows)
        self.sum += sum(row.weight for row in rows)

    def _count(self, number: int) -> None:
        for row in self._ledger.staged.pop(number):
            runs = len(row.runs.fences)
            self._ledger.runs.add(row.runs, row.place)
            self._ledger.events.add(row.place, row.weight, runs, runs)

    def _drop_staged(self, number: int) -> None:
        self._delete_rows("events", [row.place for row in self._ledger.staged.get(number, ())])
        self._effects.append(lambda: self._ledger.staged.pop(number, None))

    def _own(self, block: EventBlock) -> npt.NDArray[np.bool_]:
        """Of which runs the hull is the one that the fence names."""
        try:
            return self._ledger.runs.own(block)
        except KeyError:  # a fence is new
            subjects = [self._rows(number).row.config.subjects for number in block.fences.tolist()]
            names = [block.names[hull] for hull in block.runs["hull"].tolist()]
            return np.array([name == own for name, own in zip(names, subjects, strict=True)])

    def _shrink(self, step: ShrinkEvents) -> None:
        place, events = step.place, self._ledger.events
        if not events.needs(place):
            return
        (left,), (before,) = (column.tolist() for column in events.left(np.array([place])))
        if left == self._released.get(place, 0):
            return
        stored = checksum(step.payload, *MANY)
        each = self._shrunk[place] = weight(stored, *MANY)
        self.sum += each - before
        self._statements.append(Replace(place, stored, step.payload))
        self._effects.append(lambda: events.shrink(place, each, step.runs))

    def _rows(self, number: int) -> FenceRows:
        now = self._now.get(number)
        return self._ledger.fences[number] if now is None else now.rows

    def _release(self, released: "array[int]") -> tuple[list[int], Callable[[], None]]:
        """Need some runs no longer, given the rows that they are in. Returns the rows in which nothing is left.

        And the update of the ledger.
        """
        places, counts = np.unique(np.frombuffer(released, np.int64), return_counts=True)
        left, weights = self._ledger.events.left(places)
        left = left - counts
        for at, place in enumerate(places.tolist() if self._released or self._shrunk else ()):
            left[at] -= self._released.get(place, 0)
            weights[at] = self._shrunk.get(place, weights[at])
        for place, count in zip(places.tolist(), counts.tolist(), strict=True):
            self._released[place] = self._released.get(place, 0) + count
        empty = left == 0
        self.rows -= int(empty.sum())
        self.sum -= sum(weights[empty].tolist())
        return places[empty].tolist(), partial(self._ledger.events.release, places, counts)

    def _change(self, row: FenceRow, now: _FenceNow) -> None:
        *columns, stored = values(row)
        each = weight(stored, row.number)
        self._statements.append(Remove("fences", (row.number,)))
        self._statements.append(Insert("fences", (*columns, stored)))
        self._plus(now, 0, each - now.rows.weight)
        self._effects.append(lambda: now.rows.change(row, each))

    def _drop_fence(self, number: int, now: _FenceNow) -> None:
        """Delete the row of the fence. `sweep` drops the rest."""
        now.deleted = True
        if number in self._lasts:
            self._lasts.pop(number)
        self._plus(now, -now.count, -now.sum)
        self._statements.append(Remove("fences", (number,)))

        rows = now.rows
        if number in self._ledger.fences:
            self._ledger.runs.update(rows)
        empty, release = self._release(rows.places[now.dropped :])

        def bury() -> None:
            gone, dead = self._ledger.fences.pop(number), self._ledger.dead
            self._ledger.runs.forget(gone)
            release()
            dead["events"].extend([*empty, *(row.place for row in self._ledger.staged.pop(number, ()))])
            dead["insides"].extend(place for each in gone.insides.values() for place in each.places.values())
            dead["consumers"].extend(place for _, place, _ in gone.consumers.values())
            dead["delays"].extend(place for place, _ in gone.delays.values())
            dead["starts"].extend([] if gone.start is None else [gone.start.place])

        self._effects.append(bury)

    def _drop_events(self, first: int, now: _FenceNow) -> None:
        rows, before = now.rows, now.start
        first = rows.boundary(first)
        if first <= (1 if before is None else before.first):
            return
        if rows.row.number in self._ledger.fences:
            self._ledger.runs.update(rows)
        if before is not None:
            self._plus(now, -1, -before.weight)
            self._delete_rows("starts", [before.place])
        start, stored = Start.at(next(self._ledger.start_ids), rows.row.number, first)
        now.start = start
        self._plus(now, 1, start.weight)
        self._statements.append(Insert("starts", (start.place, rows.row.number, first, stored)))
        count = len(rows.firsts) if first > rows.last else max(bisect_right(rows.firsts, first) - 1, 0)
        released = rows.places[now.dropped : count]
        dropped, now.dropped = len(released), max(now.dropped, count)
        empty, release = self._release(released)
        at_once = empty if len(empty) <= DROPPED_AT_ONCE else []
        self._delete_rows("events", at_once)

        def drop() -> None:
            release()
            rows.begin(start, dropped)
            self._ledger.dead["events"].extend(empty[len(at_once) :])

        self._effects.append(drop)

    def _put_consumer(self, consumer: Consumer, number: int, now: _FenceNow) -> None:
        self._drop_consumer(consumer.name, now)
        *columns, stored = consumer_values(number, consumer)
        place, each = next(self._ledger.consumer_ids), weight(stored, number)
        now.consumers[consumer.name] = place, each
        self._plus(now, 1, each)
        self._statements.append(Insert("consumers", (place, *columns, stored)))
        self._effects.append(lambda: now.rows.put_consumer(consumer, place, each))

    def _drop_consumer(self, name: str, now: _FenceNow) -> None:
        known = now.consumer(name)
        if known is not None:
            place, each = known
            self._plus(now, -1, -each)
            self._delete_rows("consumers", [place])

    def _put_delays(self, change: PutDelays, now: _FenceNow) -> None:
        number, rows = change.number, now.rows
        for subject, delay in change.delays.items():
            known = now.delays.get(subject, rows.delays.get(subject))
            if known is not None:
                self._plus(now, -1, -known[1])
                self._delete_rows("delays", [known[0]])
            if delay is None:
                now.delays[subject] = None
                self._effects.append(partial(rows.drop_delay, subject))
                continue
            payload = encode_delay(subject, delay)
            stored = checksum(payload, number)
            place, each = next(self._ledger.delay_ids), weight(stored, number)
            now.delays[subject] = place, each
            self._plus(now, 1, each)
            self._statements.append(Insert("delays", (place, number, stored, payload)))
            self._effects.append(partial(rows.put_delay, subject, place, each))

    def _put_inside(self, step: PutInside, now: _FenceNow) -> None:
        keys = step.number, step.sequence, step.part, step.parts
        stored = checksum(step.payload, *keys)
        each = weight(stored, *keys)
        self._plus(now, 1, each)
        self._statements.append(Insert("insides", (step.place, *keys, stored, step.payload)))
        self._effects.append(lambda: now.rows.put_inside(step.sequence, step.parts, step.part, step.place, each))

    def _drop_inside(self, sequence: int, now: _FenceNow) -> None:
        known = now.rows.insides.get(sequence)
        if known is not None:
            self._plus(now, -len(known.places), -known.sum)
            self._delete_rows("insides", known.places.values())
            self._effects.append(lambda: now.rows.drop_inside(sequence))

    def _delete_rows(self, table: str, places: Iterable[int]) -> None:
        if gone := list(places):
            self._statements.append(Remove(table, gone))


def inside_steps(number: int, inside: Inside, place: Callable[[], int]) -> list[PutInside]:
    """The rows of those who are inside; none where nobody is, before the first event."""
    if not inside.members and not inside.sequence:
        return []
    pieces = [
        Members(
            each.hull,
            each.keys[start : start + KEYS_A_ROW],
            each.revision,
            None if each.since is None else each.since[start : start + KEYS_A_ROW],
        )
        for each in inside.members
        for start in range(0, max(len(each.keys), 1), KEYS_A_ROW)
    ]
    rows = [[piece] for piece in pieces] or [[]]
    return [
        PutInside(number, inside.sequence, len(rows), part, place(), encode_inside(row, inside.time))
        for part, row in enumerate(rows)
    ]
