"""A storage in memory: for servers without a data folder, and as the simplest implementation of the port."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock

import numpy as np
import numpy.typing as npt

from ..state.changes import Change
from ..state.feed_consumers import ConsumerId, DropFeedConsumer, FeedConsumer, PutFeedConsumer
from ..state.fences.events.block import AppendEvents
from ..state.fences.model.records import (
    AddFence,
    ChangeFence,
    DropConsumer,
    DropEvents,
    DropFence,
    FenceEvent,
    Inside,
    KeptFence,
    PutConsumer,
    PutDelays,
)
from ..state.records import Append, CommitStamp, Contents, Create, Delete, HullRow, Kept, Keys, Parts, Record
from ..state.tracks import KeyChanges
from ..state.ways import KeyWays
from .of_keys import changes_of_keys, contents_of_keys, ways_of
from .past import EraseRequest, Erasure, Found, Hole, Moment, StoredHistory, created
from .port import NEWEST, DamagedError, NotCommittedError, Progress, StorageStep, StoredContents
from .segments.columns import columns_of

KEPT_SNAPSHOTS = 2
STEP_RECORDS = 1024  # of a read of the past
FENCE_CHANGES = AddFence | ChangeFence | DropFence | AppendEvents | PutDelays | DropEvents | PutConsumer | DropConsumer


@dataclass(slots=True)
class _Snapshot:
    """A step: a whole snapshot."""

    number: int
    kept: Kept


@dataclass(slots=True)
class _Cut:
    """A step: a shard ends at revision `last`."""

    number: int
    last: int


@dataclass(slots=True)
class _WhoIsInside:
    """A step: all who are inside of a fence."""

    number: int
    inside: Inside


@dataclass(slots=True)
class _Hull:
    row: HullRow
    last: int = 0
    records: list[Record] = field(default_factory=list)
    snapshots: list[_Snapshot] = field(default_factory=list)


class MemoryStorage:
    """Hulls in memory.

    Args:
        keeps: whether to keep batches and snapshots; without them hulls cannot be read back.
    """

    immediate = True
    epoch = 0

    def __init__(self, *, keeps: bool = True) -> None:
        self.keeps = keeps
        self._hulls: dict[int, _Hull] = {}
        self._feed_consumers: dict[ConsumerId, FeedConsumer] = {}
        self._fences: dict[int, KeptFence] = {}
        self._next_number = 1
        self._commit = CommitStamp(0, 0)
        self._turn = Lock()  # commits and reads run in different threads

    def open(self, progress: Progress) -> StoredContents:
        """The hulls."""
        progress(0, len(self._hulls))
        rows = sorted((hull.row for hull in self._hulls.values()), key=lambda row: row.name)
        fences = sorted((fence.row for fence in self._fences.values()), key=lambda row: row.name)
        return StoredContents(rows, self._next_number, [], fences, self._commit.time, self._commit.number)

    def commit(self, changes: Sequence[Change | StorageStep], now: int = 0) -> CommitStamp:
        """Keep the changes."""
        with self._turn:
            self._examine(changes)
            self._commit = CommitStamp(self._commit.number + 1, max(self._commit.time, now))
            for change in changes:
                self._carry_out(change)
            return self._commit

    def entitled(self) -> bool:
        """True: nobody else has this memory."""
        return True

    def ahead(
        self, changes: Sequence[Change | StorageStep]
    ) -> tuple[Sequence[StorageStep], Sequence[Change | StorageStep]]:
        """Nothing: commits take no time."""
        return (), changes

    def settle(self) -> CommitStamp:
        """The last commit: its outcome is never unknown."""
        return self._commit

    def row(self, number: int) -> HullRow | None:
        """The hull with that number, or None."""
        hull = self._hulls.get(number)
        return None if hull is None else hull.row

    def read(self, number: int, until: int = NEWEST) -> Kept:
        """A hull at a revision; DamagedError if its batches were not kept."""
        hull = self._hulls[number]
        if not self.keeps:
            raise DamagedError(f"the batches of {hull.row.name} were not kept")
        if until < self.oldest(number):
            raise DamagedError(f"revision {until} of hull {hull.row.name!r} is no longer kept")
        with self._turn:
            base = next((each for each in reversed(hull.snapshots) if each.kept.revision <= until), None)
            if base is None:
                base = _Snapshot(number, Kept())
            revision = base.kept.revision
            records = [record for record in hull.records if revision < record.revision <= until]
        return replace(base.kept, producers=dict(base.kept.producers), records=records)

    def read_each(self, numbers: Sequence[int]) -> Iterator[Kept]:
        """Hulls at their last revisions."""
        return map(self.read, numbers)

    def oldest(self, number: int) -> int:
        """The oldest revision that `read` can return."""
        hull = self._hulls[number]
        if not self.keeps:
            return NEWEST
        return hull.snapshots[0].kept.revision if len(hull.snapshots) == KEPT_SNAPSHOTS else 0

    def oldest_moment(self, number: int, *, timed: bool = False) -> Moment:
        """The oldest revision that can be read. All commits are known."""
        del timed
        with self._turn:
            hull = self._hulls[number]
            if not self.keeps:
                return Moment(hull.last, None)
            base = hull.snapshots[0].kept if len(hull.snapshots) == KEPT_SNAPSHOTS else Kept()
            return Moment(base.revision, base.committed if base.revision else created(hull.row))

    def moment(self, number: int, time: int) -> Moment | None:
        """The last revision committed at or before a time."""
        oldest = self.oldest_moment(number)
        with self._turn:
            found = [oldest, *(Moment(each.revision, each.committed) for each in self._hulls[number].records)]
        before = [each for each in found if each.committed is not None and each.committed.time <= time]
        return before[-1] if before else None

    def state_revision(self, number: int, until: int) -> int:
        """The revision of the newest snapshot that is not after `until`."""
        return self.read(number, until).revision

    def state(self, number: int, until: int) -> tuple[Kept, Parts]:
        """The newest snapshot of a revision not after `until`, and its contents."""
        kept = self.read(number, until)
        return replace(kept, records=[], contents=Contents()), Parts(len(kept.contents), [kept.contents])

    def batches(self, number: int, after: int, until: int) -> list[Record]:
        """The batches that follow a revision."""
        if not self.keeps or after < self.oldest(number):
            raise DamagedError(f"revision {after + 1} of hull {self._hulls[number].row.name!r} is no longer kept")
        with self._turn:
            return [each for each in self._hulls[number].records if after < each.revision <= until][:STEP_RECORDS]

    def gathered(self, number: int, after: int, until: int) -> list[Record]:
        """The batches themselves."""
        return self.batches(number, after, until)

    def key_state(self, number: int, keys: Keys, until: int) -> tuple[int, npt.NDArray[np.int32], Contents]:
        """What the newest snapshot has of some keys."""
        kept = self.read(number, until)
        return kept.revision, *contents_of_keys(kept.contents, keys)

    def key_changes(self, number: int, keys: Keys, after: int, until: int) -> tuple[int, KeyChanges]:
        """What some of the batches after a revision do to some keys."""
        records = self.batches(number, after, until)
        columns = columns_of(records, self._hulls[number].row.settings.identity)
        return records[-1].revision, changes_of_keys(columns, keys)

    def ways(
        self, number: int, after: int, until: int, read: Callable[[Iterator[KeyWays]], Found]
    ) -> tuple[int, Found | None]:
        """What a function makes of the moves of keys of some batches."""
        records = self.batches(number, after, until)
        columns = columns_of(records, self._hulls[number].row.settings.identity)
        ways = ways_of(columns)
        return records[-1].revision, None if ways is None else read(iter([ways]))

    def history(self, number: int) -> StoredHistory:
        """What is there of a hull."""
        first = self.oldest_moment(number)
        with self._turn:
            hull = self._hulls[number]
            committed = hull.records[-1].committed if hull.records else first.committed
            return StoredHistory(first, Moment(hull.last, committed))

    def holes(self) -> list[Hole]:
        """None: memory does not fail."""
        return []

    def why_no_history(self) -> str:
        """It keeps nothing on a disk."""
        return "has its server in memory, which keeps no history"

    def set_history(self, number: int, max_age: int, max_bytes: int) -> StorageStep:
        """Never called, since it says why not."""
        raise NotImplementedError

    def file_history(self, now: int) -> Iterator[StorageStep]:
        """There are no segments."""
        del now
        yield from ()

    def erasures(self, number: int) -> tuple[Erasure, ...]:
        """None: what is before two snapshots is forgotten."""
        del number
        return ()

    def erase(self, number: int, requests: Sequence[EraseRequest], until: int, now: int) -> Iterator[StorageStep]:
        """Nothing is left before the snapshots."""
        del number, requests, until, now
        yield from ()

    def snapshot(self, number: int, kept: Kept) -> Iterator[StorageStep]:
        """One step."""
        if self.keeps:
            yield _Snapshot(number, kept)

    def cut(self, number: int, last: int) -> StorageStep | None:
        """One step."""
        return _Cut(number, last) if self._hulls[number].last > last else None

    def sweep(self) -> Iterator[StorageStep]:
        """No steps: deletes leave nothing behind."""
        return iter(())

    def feed_consumers(self) -> list[FeedConsumer]:
        """The consumers of feeds."""
        with self._turn:
            return list(self._feed_consumers.values())

    def read_fences(self, numbers: Sequence[int]) -> list[KeptFence | None]:
        """Fences as last committed; DamagedError if their hulls were not kept."""
        with self._turn:
            return [self._kept(self._fences.get(number)) for number in numbers]

    def _kept(self, fence: KeptFence | None) -> KeptFence | None:
        if fence is None:
            return None
        if not self.keeps:
            raise DamagedError(f"who is inside of {fence.row.name} was not kept")
        events = [event for event in fence.events if event.sequence > fence.inside.sequence]
        return replace(fence, events=events, consumers=dict(fence.consumers), delays=dict(fence.delays))

    def read_events(self, number: int, after: int, most: int) -> list[FenceEvent]:
        """Events of a fence."""
        with self._turn:
            fence = self._fences[number]
            start = max(after + 1 - fence.first, 0)
            return fence.events[start : start + most]

    def boundary(self, number: int, first: int) -> int:
        """The sequence nearest before `first` such that all events before it can be dropped."""
        return self._boundary(self._fences[number], first)

    def _boundary(self, fence: KeptFence, first: int) -> int:
        return min(first, fence.inside.sequence + 1) if self.keeps else first

    def inside(self, number: int, inside: Inside) -> Iterator[StorageStep]:
        """One step."""
        if self.keeps:
            yield _WhoIsInside(number, inside)

    def sync(self) -> None:
        """Do nothing: memory is never durable."""

    def checkpoint(self) -> None:
        """Do nothing: memory needs no checkpoints."""

    def bytes_used(self) -> int:
        """0: nothing is on the disk."""
        return 0

    def close(self) -> None:
        """Do nothing."""

    def _examine(self, changes: Sequence[Change | StorageStep]) -> None:
        """Raise NotCommittedError if one of them cannot be applied after those before it."""
        last: dict[int, int | None] = {}  # revisions after the changes so far; None for a hull they delete
        for change in changes:
            if isinstance(change, Create):
                if self._last(change.row.number, last) is not None:
                    raise NotCommittedError(f"hull {change.row.number} already exists")
                last[change.row.number] = 0
            elif isinstance(change, _Cut):
                if self._last(change.number, last) is not None:
                    last[change.number] = change.last
            elif isinstance(change, Append | Delete):
                before = self._last(change.number, last)
                if before is None:
                    raise NotCommittedError(f"there is no hull {change.number}")
                if isinstance(change, Delete):
                    last[change.number] = None
                    continue
                revisions = [record.revision for record in change.records]
                if revisions != list(range(before + 1, before + 1 + len(revisions))):
                    raise NotCommittedError(f"revisions {revisions} of hull {change.number} do not follow {before}")
                last[change.number] = before + len(revisions)
        self._examine_fences(changes)

    def _examine_fences(self, changes: Sequence[Change | StorageStep]) -> None:
        last: dict[int, int | None] = {}  # sequences after the changes so far; None for a fence they delete
        for change in changes:
            if not isinstance(change, FENCE_CHANGES):
                continue
            if isinstance(change, AppendEvents):
                self._examine_events(change, last)
                continue
            number = change.row.number if isinstance(change, AddFence | ChangeFence) else change.number
            before = self._last_event(number, last)
            if isinstance(change, AddFence):
                if before is not None:
                    raise NotCommittedError(f"fence {number} already exists")
                last[number] = change.inside.sequence
                continue
            if before is None:
                raise NotCommittedError(f"there is no fence {number}")
            if isinstance(change, DropFence):
                last[number] = None

    def _examine_events(self, change: AppendEvents, last: dict[int, int | None]) -> None:
        block = change.block
        for number, first, count in zip(
            block.fences.tolist(), block.firsts.tolist(), block.counts.tolist(), strict=True
        ):
            before = self._last_event(number, last)
            if before is None:
                raise NotCommittedError(f"there is no fence {number}")
            if first != before + 1:
                raise NotCommittedError(f"event {first} of fence {number} does not follow {before}")
            last[number] = before + count

    def _last_event(self, number: int, changed: Mapping[int, int | None]) -> int | None:
        """The last event of a fence, None if it does not exist."""
        if number in changed:
            return changed[number]
        fence = self._fences.get(number)
        return None if fence is None else fence.last

    def _last(self, number: int, changed: Mapping[int, int | None]) -> int | None:
        """The last revision of a hull, None if it does not exist."""
        if number in changed:
            return changed[number]
        hull = self._hulls.get(number)
        return None if hull is None else hull.last

    def _carry_out(self, change: Change | StorageStep) -> None:
        match change:
            case Append():
                self._append(change)
            case Create():
                self._hulls[change.row.number] = _Hull(change.row)
                self._next_number = max(self._next_number, change.row.number + 1)
            case Delete():
                del self._hulls[change.number]
            case _Snapshot():
                self._take(change)
            case _Cut():
                if (hull := self._hulls.get(change.number)) is not None:  # otherwise deleted meanwhile
                    hull.records = [record for record in hull.records if record.revision <= change.last]
                    hull.last = change.last
            case _WhoIsInside():
                if change.number in self._fences:  # otherwise deleted meanwhile
                    self._fences[change.number].inside = change.inside
            case AddFence():
                self._fences[change.row.number] = KeptFence(change.row, change.inside)
                self._next_number = max(self._next_number, change.row.number + 1)
            case DropFence():
                del self._fences[change.number]
            case ChangeFence():
                self._fences[change.row.number].row = change.row
            case AppendEvents():
                for number, events in change.block.by_fence().items():
                    self._fences[number].events += events
            case PutFeedConsumer(consumer):
                self._feed_consumers[consumer.id] = consumer
            case DropFeedConsumer(ident):
                self._feed_consumers.pop(ident, None)
            case PutDelays() | DropEvents() | PutConsumer() | DropConsumer():
                self._change(self._fences[change.number], change)
            case _:
                raise TypeError(f"not a change or a step of this storage: {change}")

    def _append(self, change: Append) -> None:
        hull = self._hulls[change.number]
        hull.last = change.records[-1].revision
        hull.records += [replace(record, committed=self._commit) for record in change.records]

    def _change(self, fence: KeptFence, change: PutDelays | DropEvents | PutConsumer | DropConsumer) -> None:
        match change:
            case PutDelays():
                for subject, delay in change.delays.items():
                    if delay is None:
                        fence.delays.pop(subject, None)
                    else:
                        fence.delays[subject] = delay
            case DropEvents():
                dropped = max(self._boundary(fence, change.first) - fence.first, 0)
                del fence.events[:dropped]
                fence.first += dropped
                if not self.keeps:  # nobody asks who is inside, but later events follow this one
                    fence.inside = Inside(fence.first - 1)
            case PutConsumer():
                fence.consumers[change.consumer.name] = change.consumer
            case DropConsumer():
                fence.consumers.pop(change.name, None)

    def _take(self, snapshot: _Snapshot) -> None:
        hull = self._hulls.get(snapshot.number)
        if hull is None:  # deleted meanwhile
            return
        revision = snapshot.kept.revision
        commits = {each.kept.revision: each.kept.committed for each in hull.snapshots}
        commits |= {each.revision: each.committed for each in hull.records}
        snapshot = _Snapshot(snapshot.number, replace(snapshot.kept, committed=commits.get(revision)))
        snapshots = sorted([*hull.snapshots, snapshot], key=lambda each: each.kept.revision)
        hull.snapshots = snapshots[-KEPT_SNAPSHOTS:]
        if len(hull.snapshots) == KEPT_SNAPSHOTS:
            oldest = hull.snapshots[0].kept.revision
            hull.records = [record for record in hull.records if record.revision > oldest]
