"""Changes that are committed together: what they do to the rows, and to the ledger."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from ...state.changes import Change
from ...state.feed_consumers import ConsumerId, DropFeedConsumer, FeedConsumer, PutFeedConsumer
from ...state.fences.events.block import AppendEvents
from ...state.records import Append, CommitStamp, Create, Delete, HullRow, HullSettings
from ..port import NotCommittedError
from .batch_rows import batch_checksum
from .encoding import checksum, encode, weight
from .feed_rows import StoredFeedConsumer, feed_consumer_values, stored_feed_consumer
from .fence_ledger import FenceChanges, FenceStep
from .hull_rows import values
from .ledger import HullRows, Ledger, StoredSnapshot
from .segment_rows import (
    StoredErasure,
    StoredSegment,
    Values,
    erasure_values,
    segment_values,
    segment_weight,
    unused_values,
)
from .tables import Insert, Remove, Statement

if TYPE_CHECKING:
    from array import array


@dataclass(frozen=True, slots=True)
class Chunk:
    """Step: a piece of a snapshot."""

    id: int
    snapshot: int
    number: int
    points: bytes


@dataclass(frozen=True, slots=True)
class Finish:
    """Step: makes a snapshot valid."""

    number: int
    snapshot: StoredSnapshot
    state: bytes


@dataclass(frozen=True, slots=True)
class DropSnapshot:
    """Step: deletes a snapshot; its chunks become dead."""

    number: int
    snapshot: StoredSnapshot


@dataclass(frozen=True, slots=True)
class DropBatches:
    """Step: deletes the oldest rows of batches of a hull; `weights` is the sum of their weights."""

    number: int
    ids: "array[int]"
    weights: int


@dataclass(frozen=True, slots=True)
class SetHistory:
    """Step: how much of the past of a hull is kept from now on."""

    number: int
    max_age: int
    max_bytes: int


@dataclass(frozen=True, slots=True)
class NameFile:
    """Step: names a file of a segment that is about to be written, so that a start after a kill removes it."""

    place: int
    file: str


@dataclass(frozen=True, slots=True)
class CloseSegment:
    """Step: from now on a segment, whose files are complete, has its batches, and the journal need not."""

    number: int
    segment: StoredSegment


@dataclass(frozen=True, slots=True)
class RetireSegment:
    """Step: nobody reads a segment from now on; its files are to be removed.

    With `settings`, only while the hull has these: when they are changed, it may be to keep the segment.
    """

    number: int
    segment: StoredSegment
    settings: HullSettings | None = None


@dataclass(frozen=True, slots=True)
class MendSegment:
    """Step: a row of segments that the ledger has already takes the place of a damaged one."""

    place: int
    values: Values
    more: int  # its weight, less that of the other


@dataclass(frozen=True, slots=True)
class EraseKeys:
    """Step: segments without some keys take the place of those that had them, each of one or of consecutive ones."""

    number: int
    replaced: tuple[tuple[tuple[StoredSegment, ...], StoredSegment], ...]
    stored: tuple[StoredErasure, ...]


@dataclass(frozen=True, slots=True)
class DropErasure:
    """Step: nothing is left of what an erasure was about."""

    number: int
    stored: StoredErasure


@dataclass(frozen=True, slots=True)
class Cut:
    """Step: deletes the newest row of batches of a hull, which is damaged; the hull ends at revision `last`."""

    number: int
    last: int
    weight: int


@dataclass(frozen=True, slots=True)
class DropNewest:
    """Step: deletes the newest rows of batches of a shard, which did not happen; it ends at revision `last`."""

    number: int
    last: int
    ids: "array[int]"
    weights: int


@dataclass(frozen=True, slots=True)
class DropDead:
    """Step: deletes the first dead rows of a table."""

    table: str
    ids: "array[int]"


@dataclass(frozen=True, slots=True)
class ChangeHull:
    """Step: another row of a hull, with the same number."""

    row: HullRow


@dataclass(frozen=True, slots=True)
class DropDeadSegment:
    """Step: deletes the row of files that are removed."""

    place: int


@dataclass(frozen=True, slots=True)
class Wipe:
    """Step: nothing but a commit, after which no file of the database has what was dropped before."""


SegmentStep = (
    SetHistory | NameFile | CloseSegment | RetireSegment | MendSegment | EraseKeys | DropErasure | DropDeadSegment
)
HullStep = Chunk | Finish | DropSnapshot | DropBatches | DropNewest | Cut | DropDead | ChangeHull
AnyStep = HullStep | SegmentStep | FenceStep | Wipe


class Group:
    """Changes that are committed together: the statements for the database, and the updates of the ledger.

    The ledger does not change before `adopt`, so no reader sees uncommitted rows.

    Args:
        ledger: the rows so far.
        changes: the changes, in order.
        now: the time in microseconds since 1970; one before the last commit counts as the time of that.

    Attributes:
        statements: the changes of rows.
        before, totals: the totals before and after them.
        wipes: whether there is a `Wipe` among them.
        commit: the commit that they are.
    """

    def __init__(self, ledger: Ledger, changes: Iterable[Change | AnyStep], now: int = 0) -> None:
        self._ledger = ledger
        self.before = self.totals = ledger.totals
        self.commit = CommitStamp(self.before.commits + 1, max(self.before.committed, now))
        # The hulls it concerns, after the changes so far.
        self._now: dict[int, _Now] = {}
        # The consumers of feeds that they change; None for those that are deleted.
        self._feed_consumers: dict[ConsumerId, StoredFeedConsumer | None] = {}
        self._effects: list[Callable[[], object]] = []
        self.statements: list[Statement] = []
        self.wipes = False
        self._fences = FenceChanges(ledger, self.statements, self._effects)
        for change in changes:
            self._take(change)
        fences = self._fences
        fences.finish()
        next_number = max(self.totals.next_number, fences.next_number)
        self.totals = self.totals.plus(0, 0, fences.sum, fences.rows)
        number, time = self.commit
        self.totals = self.totals._replace(commits=number, next_number=next_number, committed=time)

    def adopt(self) -> None:
        """Update the ledger, after the commit."""
        for effect in self._effects:
            effect()
        self._effects.clear()  # they refer to what refers to them: it would wait for the garbage collector
        self._ledger.totals = self.totals

    def _take(self, change: Change | AnyStep) -> None:
        match change:
            case Append():
                self._append(change)
            case AppendEvents():
                self._fences.take(change)
            case Create():
                self._create(change.row)
            case Delete():
                self._delete(change.number)
            case Chunk():
                stored = checksum(change.points, change.snapshot, change.number)
                values = change.id, change.snapshot, change.number, stored, change.points
                self.statements.append(Insert("chunks", values))
            case Finish():
                self._finish(change)
            case DropSnapshot():
                self._drop_snapshot(change)
            case DropBatches():
                self._drop_batches(change)
            case DropNewest():
                self._drop_newest(change)
            case Cut():
                self._cut(change)
            case DropDead():
                self._drop_dead(change)
            case ChangeHull():
                self._change(change.row)
            case SetHistory():
                self._set_history(change)
            case NameFile():
                self.statements.append(Insert("segments", unused_values(change.place, change.file)))
            case CloseSegment():
                self._close_segment(change)
            case RetireSegment():
                self._retire_segment(change)
            case MendSegment():
                self.totals = self.totals.plus(0, 0, change.more)
                self.statements += [Remove("segments", (change.place,)), Insert("segments", change.values)]
            case EraseKeys():
                self._erase(change)
            case DropErasure():
                self._drop_erasure(change)
            case Wipe():
                self.wipes = True
            case DropDeadSegment():
                self._drop_dead_segment(change.place)
            case PutFeedConsumer():
                self._put_feed_consumer(change.consumer)
            case DropFeedConsumer():
                self._drop_feed_consumer(change.id)
            case _:
                self._fences.take(change)  # any other kind is an error of types

    def _hull(self, number: int) -> "_Now | None":
        """A hull after the changes so far, None if it does not exist."""
        now = self._now.get(number)
        if now is None and (rows := self._ledger.hulls.get(number)):
            now = self._now[number] = _Now(rows, rows.row, len(rows.ids), rows.sum, rows.last)
        return None if now is None or now.deleted else now

    def _create(self, row: HullRow) -> None:
        if self._hull(row.number):
            raise NotCommittedError(f"hull {row.number} already exists")
        *columns, stored = values(row)
        rows = HullRows(row, stored)
        self._now[row.number] = _Now(rows, row, 0, stored, 0)
        next_number = max(self.totals.next_number, row.number + 1)
        self.totals = self.totals.plus(1, 0, stored)._replace(next_number=next_number)
        self.statements.append(Insert("hulls", (*columns, stored)))
        self._effects.append(lambda: self._ledger.hulls.__setitem__(row.number, rows))

    def _change(self, row: HullRow) -> None:
        now = self._hull(row.number)
        if now is None:
            raise NotCommittedError(f"there is no hull {row.number}")
        *columns, stored = values(row)
        more = stored - values(now.row)[-1]
        now.row = row
        now.sum += more
        self.totals = self.totals.plus(0, 0, more)
        self.statements += [Remove("hulls", (row.number,)), Insert("hulls", (*columns, stored))]
        self._effects.append(lambda: now.rows.change(row, more))

    def _append(self, change: Append) -> None:
        now = self._hull(change.number)
        if now is None:
            raise NotCommittedError(f"there is no hull {change.number}")
        first, last = change.records[0].revision, change.records[-1].revision
        if first != now.last + 1 or last - first + 1 != len(change.records):
            raise NotCommittedError(
                f"revisions {first} to {last} of hull {now.rows.row.name} do not follow revision {now.last}"
            )
        payload = encode(change.records)
        keys = change.number, first, last
        stored = batch_checksum(payload, *keys, *self.commit)
        each = weight(stored, *keys)
        place = next(self._ledger.batch_ids)
        now.batches, now.sum, now.last = now.batches + 1, now.sum + each, last
        self.totals = self.totals.plus(0, 1, each)
        self.statements.append(Insert("batches", (place, *keys, stored, payload, *self.commit)))
        self._effects.append(lambda: now.rows.append(first, last, place, each))

    def _delete(self, number: int) -> None:
        """Delete the row of the hull. `sweep` drops the rest, which for a large hull would delay other commits."""
        now = self._hull(number)
        if now is None:
            raise NotCommittedError(f"there is no hull {number}")
        now.deleted = True
        self.totals = self.totals.plus(-1, -now.batches, -now.sum)
        self.statements.append(Remove("hulls", (number,)))

        def bury() -> None:
            rows, dead = self._ledger.hulls.pop(number), self._ledger.dead
            dead["batches"] += rows.ids
            dead["snapshots"].extend(snapshot.id for snapshot in rows.snapshots)
            dead["segments"].extend(segment.id for segment in rows.segments)
            dead["segments"].extend(stored.id for stored in rows.erasures)
            for snapshot in rows.snapshots:
                dead["chunks"].extend(snapshot.chunks)

        self._effects.append(bury)

    def _finish(self, step: Finish) -> None:
        now = self._hull(step.number)
        snapshot = step.snapshot
        if now is None:  # deleted meanwhile
            self._effects.append(lambda: self._ledger.dead["chunks"].extend(snapshot.chunks))
            return
        keys = snapshot.id, step.number, snapshot.revision, len(snapshot.chunks)
        self.statements.append(Insert("snapshots", (*keys, step.state, checksum(step.state, *keys))))
        self._effects.append(lambda: now.rows.set_snapshots((*now.rows.snapshots, snapshot)))

    def _drop_snapshot(self, step: DropSnapshot) -> None:
        now = self._hull(step.number)
        if now is None or step.snapshot not in now.rows.snapshots or step.snapshot.id in now.gone:
            return
        now.gone.add(step.snapshot.id)

        def drop() -> None:
            now.rows.set_snapshots(each for each in now.rows.snapshots if each != step.snapshot)
            self._ledger.dead["chunks"].extend(step.snapshot.chunks)

        self.statements.append(Remove("snapshots", (step.snapshot.id,)))
        self._effects.append(drop)

    def _set_history(self, step: SetHistory) -> None:
        now = self._hull(step.number)
        if now is None:  # deleted meanwhile
            return
        row = now.row
        self._change(replace(row, settings=replace(row.settings, history=step.max_age, history_bytes=step.max_bytes)))

    def _close_segment(self, step: CloseSegment) -> None:
        now, segment = self._hull(step.number), step.segment
        if now is None or now.rows.filed + 1 != segment.first:  # deleted meanwhile
            self._effects.append(lambda: self._ledger.dead["segments"].append(segment.id))
            return
        self._add_segment(now, segment)

    def _add_segment(self, now: "_Now", segment: StoredSegment) -> None:
        values = segment_values(segment, now.rows.row.number)
        self._replace_segment(values)
        self._weigh(now, segment_weight(values))
        self._effects.append(lambda: now.rows.set_segments((*now.rows.segments, segment)))

    def _retire_segment(self, step: RetireSegment) -> None:
        now, segment = self._hull(step.number), step.segment
        if now is None or segment not in now.rows.segments or step.settings not in (None, now.row.settings):
            return
        self._replace_segment(unused_values(segment.id, segment.file))
        self._weigh(now, -segment_weight(segment_values(segment, step.number)))
        self._effects.append(lambda: now.rows.drop_segment(segment))
        self._effects.append(lambda: self._ledger.dead["segments"].append(segment.id))

    def _erase(self, step: EraseKeys) -> None:
        now = self._hull(step.number)
        if now is None:  # deleted meanwhile
            self._effects.append(lambda: self._ledger.dead["segments"].extend(new.id for _, new in step.replaced))
            return
        for olds, new in step.replaced:
            for old in olds:
                self._retire_segment(RetireSegment(step.number, old))
            self._add_segment(now, new)
        for stored in step.stored:
            values = erasure_values(stored, step.number)
            self.statements.append(Insert("segments", values))
            self._weigh(now, segment_weight(values))
        self._effects.append(lambda: now.rows.add_erasures(step.stored))

    def _drop_erasure(self, step: DropErasure) -> None:
        now = self._hull(step.number)
        if now is None or step.stored not in now.rows.erasures:
            return
        self.statements.append(Remove("segments", (step.stored.id,)))
        self._weigh(now, -segment_weight(erasure_values(step.stored, step.number)))
        self._effects.append(lambda: now.rows.drop_erasure(step.stored))

    def _drop_dead_segment(self, place: int) -> None:
        dead = self._ledger.dead["segments"]
        if place in dead:
            self.statements.append(Remove("segments", (place,)))
            self._effects.append(lambda: dead.remove(place))

    def _put_feed_consumer(self, consumer: FeedConsumer) -> None:
        self._drop_feed_consumer(consumer.id)
        stored = stored_feed_consumer(consumer, next(self._ledger.consumer_ids))
        self._feed_consumers[consumer.id] = stored
        self.totals = self.totals.plus(0, 0, stored.weight, 1)
        self.statements.append(Insert("consumers", (stored.place, *feed_consumer_values(consumer))))
        self._effects.append(lambda: self._ledger.feed_consumers.__setitem__(consumer.id, stored))

    def _drop_feed_consumer(self, ident: ConsumerId) -> None:
        known = self._feed_consumers.get(ident, self._ledger.feed_consumers.get(ident))
        if known is not None:
            self._feed_consumers[ident] = None
            self.totals = self.totals.plus(0, 0, -known.weight, -1)
            self.statements.append(Remove("consumers", (known.place,)))
            self._effects.append(lambda: self._ledger.feed_consumers.pop(ident, None))

    def _replace_segment(self, values: Values) -> None:
        self.statements += [Remove("segments", (values[0],)), Insert("segments", values)]

    def _weigh(self, now: "_Now", more: int) -> None:
        """Add to the sum of the rows of a hull."""
        now.sum += more
        self.totals = self.totals.plus(0, 0, more)
        self._effects.append(lambda: now.rows.weigh(more))

    def _drop_batches(self, step: DropBatches) -> None:
        now = self._hull(step.number)
        count = len(step.ids)
        if now is None or now.trimmed or now.rows.ids[:count] != step.ids:
            return
        now.trimmed = True
        now.batches, now.sum = now.batches - count, now.sum - step.weights
        self.totals = self.totals.plus(0, -count, -step.weights)
        self.statements.append(Remove("batches", step.ids))
        self._effects.append(lambda: now.rows.drop(count, step.weights))

    def _drop_newest(self, step: DropNewest) -> None:
        now = self._hull(step.number)
        count = len(step.ids)
        if now is None:  # deleted meanwhile
            return
        if now.rows.ids[-count:] != step.ids:
            raise NotCommittedError(f"hull {step.number} has other batches at its end")
        now.batches, now.sum, now.last = now.batches - count, now.sum - step.weights, step.last
        self.totals = self.totals.plus(0, -count, -step.weights)
        self.statements.append(Remove("batches", step.ids))
        self._effects.append(lambda: now.rows.drop_newest(count, step.weights, step.last))

    def _cut(self, step: Cut) -> None:
        rows = self._ledger.hulls[step.number]

        def cut() -> None:
            rows.last = step.last
            rows.firsts.pop()
            rows.ids.pop()
            rows.sum -= step.weight

        self.totals = self.totals.plus(0, -1, -step.weight)
        self.statements.append(Remove("batches", rows.ids[-1:]))
        self._effects.append(cut)

    def _drop_dead(self, step: DropDead) -> None:
        dead = self._ledger.dead[step.table]
        count = len(step.ids)
        if dead[:count] != step.ids:
            return
        self.statements.append(Remove(step.table, step.ids))

        def drop() -> None:
            if dead[:count] == step.ids:
                del dead[:count]

        self._effects.append(drop)


@dataclass(slots=True)
class _Now:
    """A hull after a part of the changes; `rows` is its present state in the ledger, and `row` its row.

    `gone` are the snapshots that were dropped, and `trimmed` is whether batches were: who trims a hull after a snapshot
    and who does so after a segment may come to the same rows in one group.
    """

    rows: HullRows
    row: HullRow
    batches: int
    sum: int
    last: int
    deleted: bool = False
    gone: set[int] = field(default_factory=set)
    trimmed: bool = False
