"""What storages on databases have in common: a ledger in memory, and rows that are read as of the same moment."""

import logging
from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from math import inf
from threading import Lock
from time import monotonic
from typing import Protocol, TypeVar

import numpy as np
import numpy.typing as npt

from ...state.changes import Change
from ...state.contents.joining import in_one
from ...state.errors import words
from ...state.feed_consumers import FeedConsumer
from ...state.fences.model.records import FenceEvent, Inside, KeptFence
from ...state.records import CommitStamp, Contents, HullRow, Kept, Keys, Parts, Record
from ...state.tracks import KeyChanges
from ...state.ways import KeyWays
from ..of_keys import changes_of_keys, contents_of_keys, ways_of
from ..past import EraseRequest, Erasure, Hole, Moment, StoredHistory, created
from ..port import NEWEST, DamagedError, NotCommittedError, StorageError, StorageStep, StoredContents
from ..segments.archive import NEEDS, Archive, is_installed
from ..segments.parquet import load
from . import chunks
from .divided import newest_rows
from .encoding import weight
from .erasing import Erasing
from .examine import Findings
from .fence_ledger import DropInside, ShrinkEvents, inside_steps
from .fence_reading import read_events, read_fences, shrunk
from .fence_runs import FenceRows
from .filed import Filed, holes
from .filing import excess, oldest_of_all, outdated, past_erasures, read_due
from .group import (
    Chunk,
    CloseSegment,
    DropBatches,
    DropDead,
    DropDeadSegment,
    DropErasure,
    DropSnapshot,
    EraseKeys,
    Finish,
    Group,
    NameFile,
    RetireSegment,
    SetHistory,
)
from .ledger import DROPPED, HullRows, Ledger, StoredSnapshot
from .past_rows import (
    GATHERED_ROWS,
    batches_after,
    columns_between,
    gathered_after,
    moment_at,
    oldest_moment,
    require_batches,
    state_revision,
    state_until,
)
from .reading import commit_of, read_each, read_hull, read_records
from .segment_rows import StoredErasure, StoredSegment, is_whole
from .staging import staging
from .tables import COLUMNS, Reader

log = logging.getLogger(__name__)

DROPPED_BYTES, DROPPED_ROWS = 2**19, 1000  # per step
SEGMENT = ", ".join(f"segments.{column}" for column in COLUMNS["segments"])
# Seconds between looks for files that belong to nobody, and those after which a store carries out nothing of what a
# server has given up: by a clock that is never set, as the one on the wall may be while a call is late.
LOOK, LATE = 3600.0, 86_400.0

Picked = TypeVar("Picked")
Found = TypeVar("Found")


class Lent(Reader, Protocol):
    """A reader that one thread has borrowed."""

    def begin(self) -> None:
        """From now on read the rows as of this moment."""


class RowStorage(ABC):
    """The part of the port that works on the ledger, whatever database the rows are in.

    An implementation sets `_ledger` when it opens, and holds `_visible` while it commits a group and adopts it.
    """

    immediate = False
    keeps = True
    epoch = 0

    def __init__(self, archive: Archive | None = None) -> None:
        self._archive = archive
        self._filed = None if archive is None else Filed(archive)
        self._ledger = Ledger()
        self._visible = Lock()  # held while the ledger may differ from the committed rows
        self._unsettled = False
        self._under_way: dict[int, set[int]] = {}  # chunks of unfinished snapshots
        self._filing: set[int] = set()  # rows of segments that are being written
        self._late: dict[int, float] = {}  # of rows whose files may come yet: when they are removed once more, or 0
        self._erased = False  # what was dropped may be in free parts of the database still, and is not to be
        self._wiping = False  # the same, in these or in its log
        self._looked = -inf  # when it was looked for files that belong to nobody

    @property
    @abstractmethod
    def _place(self) -> str:
        """Where the rows are, for messages."""

    @abstractmethod
    def _lend(self) -> AbstractContextManager[Lent]:
        """A reader, for one thread. Errors of the database become StorageError."""

    @abstractmethod
    def _write(self, group: Group) -> None:
        """Commit a group."""

    @abstractmethod
    def _confirm(self) -> None:
        """Make all commits durable, or raise TakenOverError if another server decides by now.

        What cannot be undone waits for it: a crash must not take back the commit that it follows from, and what was
        read before it is nobody else's.
        """

    def _wipe(self) -> Iterator[StorageStep]:
        """The steps after which no file of the database has what was dropped before; none where that is not ours."""
        return iter(())

    # Committing

    def ahead(
        self, changes: Sequence[Change | StorageStep]
    ) -> tuple[Sequence[StorageStep], Sequence[Change | StorageStep]]:
        """What of many events can be written before the changes."""
        return staging(changes, lambda: next(self._ledger.event_ids))

    def _contents(self, notes: list[str]) -> StoredContents:
        """What was found, with messages about what was lost or repaired."""
        self._late = dict.fromkeys(self._ledger.dead["segments"], 0)
        rows = sorted((hull.row for hull in self._ledger.hulls.values()), key=lambda row: row.name)
        fences = sorted((fence.row for fence in self._ledger.fences.values()), key=lambda row: row.name)
        totals = self._ledger.totals
        return StoredContents(rows, totals.next_number, notes, fences, totals.committed, totals.commits)

    def _group(self, changes: Sequence[Change | StorageStep], now: int) -> Group:
        """The statements of a commit, and what it does to the ledger."""
        if self._unsettled:
            raise StorageError("the outcome of the previous commit is not known yet")
        try:
            return Group(self._ledger, changes, now)  # type: ignore[arg-type]  # all steps come from this class
        except NotCommittedError:
            raise
        except Exception as error:  # a value that does not fit a column, or no memory
            raise NotCommittedError(f"nothing was written: {words(error)}") from error

    @property
    def _latest(self) -> CommitStamp:
        """The last commit."""
        totals = self._ledger.totals
        return CommitStamp(totals.commits, totals.committed)

    def _renew(self, findings: Findings) -> None:
        """Go on with the rows as they are in the database, after a commit with an unknown outcome.

        Rows of segments that are damaged are put right, as at a start: the ledger has them so already.
        """
        with self._visible:
            findings.ledger.go_on_from(self._ledger, set().union(*self._under_way.values()))
            self._ledger = findings.ledger
            self._unsettled = False
        if findings.mends:
            try:
                self._write(Group(self._ledger, findings.mends))
            except BaseException:
                with self._visible:
                    self._unsettled = True
                raise
            for note in findings.notes:
                log.warning(note)

    # Reading

    def row(self, number: int) -> HullRow | None:
        """The hull with that number, or None."""
        with self._visible:
            hull = self._settled().hulls.get(number)
            return None if hull is None else hull.row

    def read(self, number: int, until: int = NEWEST) -> Kept:
        """A hull at a revision."""
        with self._reading(lambda ledger: ledger.hulls[number].copy()) as (reader, hull):
            return read_hull(reader, hull, until)

    def read_each(self, numbers: Sequence[int]) -> Iterator[Kept]:
        """Hulls at their last revisions."""
        with self._reading(lambda ledger: [ledger.hulls[number].copy() for number in numbers]) as (reader, hulls):
            yield from read_each(reader, hulls)

    def read_since(self, after: Mapping[int, int]) -> Iterator[tuple[int, list[Record]]]:
        """The batches of hulls after these revisions."""

        def pick(ledger: Ledger) -> list[HullRows]:
            return [ledger.hulls[each].copy() for each in after if ledger.hulls[each].last > after[each]]

        with self._reading(pick) as (reader, hulls):
            for hull in hulls:
                yield hull.row.number, read_records(reader, hull, after[hull.row.number])

    def oldest(self, number: int) -> int:
        """The oldest revision that `read` can return."""
        with self._visible:
            return self._settled().hulls[number].oldest

    def oldest_moment(self, number: int, *, timed: bool = False) -> Moment:
        """The oldest revision that can be read."""
        return self._of_past(
            number,
            lambda filed, hull: filed.oldest_moment(hull, timed=timed),
            lambda reader, hull: oldest_moment(reader, hull, timed=timed),
        )

    def moment(self, number: int, time: int) -> Moment | None:
        """The last revision committed at or before a time."""
        with self._of_hull(number) as (reader, hull):
            found = moment_at(reader, hull, time)
        if found is not None:
            return found
        return self._of_past(number, lambda filed, hull: filed.moment(hull, time), lambda *_: None)

    def state_revision(self, number: int, until: int) -> int:
        """The revision of the newest snapshot that is not after `until`."""
        return self._of_past(
            number,
            lambda filed, hull: filed.state_revision(hull, until) if until < hull.oldest else None,
            lambda _, hull: state_revision(hull, until),
        )

    def state(self, number: int, until: int) -> tuple[Kept, Parts]:
        """The newest snapshot of a revision not after `until`, and its contents."""
        return self._of_past(
            number,
            lambda filed, hull: filed.state(hull, until) if until < hull.oldest else None,
            lambda reader, hull: state_until(reader, hull, until),
        )

    def batches(self, number: int, after: int, until: int) -> list[Record]:
        """The batches that follow a revision."""
        return self._of_past(
            number,
            lambda filed, hull: filed.batches(hull, after, until) if after < hull.start else None,
            lambda reader, hull: batches_after(reader, hull, after, until),
        )

    def gathered(self, number: int, after: int, until: int) -> list[Record]:
        """What the batches that follow a revision come to."""
        return self._of_past(
            number,
            lambda filed, hull: filed.gathered(hull, after, until) if after < hull.start else None,
            lambda reader, hull: gathered_after(reader, hull, after, until),
        )

    def key_state(self, number: int, keys: Keys, until: int) -> tuple[int, npt.NDArray[np.int32], Contents]:
        """What the newest snapshot has of some keys."""
        kept, parts = self._of_past(
            number,
            lambda filed, hull: filed.key_state(hull, keys, until) if until < hull.oldest else None,
            lambda reader, hull: state_until(reader, hull, until),
        )
        return kept.revision, *contents_of_keys(in_one(parts.parts), keys)

    def key_changes(self, number: int, keys: Keys, after: int, until: int) -> tuple[int, KeyChanges]:
        """What some of the batches after a revision do to some keys."""

        def in_journal(reader: Reader, hull: HullRows) -> tuple[int, KeyChanges]:
            require_batches(hull, after)
            columns = columns_between(reader, hull, after, min(until, hull.last), GATHERED_ROWS, keys)
            return int(columns.revision[-1]), changes_of_keys(columns, keys)

        return self._of_past(
            number,
            lambda filed, hull: filed.key_changes(hull, keys, after, until) if after < hull.start else None,
            in_journal,
        )

    def ways(
        self, number: int, after: int, until: int, read: Callable[[Iterator[KeyWays]], Found]
    ) -> tuple[int, Found | None]:
        """What a function makes of the moves of keys of some batches."""

        def in_journal(reader: Reader, hull: HullRows) -> tuple[int, Found | None]:
            require_batches(hull, after)
            columns = columns_between(reader, hull, after, min(until, hull.last), GATHERED_ROWS)
            ways = ways_of(columns)
            return int(columns.revision[-1]), None if ways is None else read(iter([ways]))

        return self._of_past(
            number,
            lambda filed, hull: filed.ways(hull, after, until, read) if after < hull.start else None,
            in_journal,
        )

    def erasures(self, number: int) -> tuple[Erasure, ...]:
        """The erasures that concern what is there of a hull."""
        with self._visible:
            return tuple(each.erasure for each in self._settled().hulls[number].erasures)

    def _of_past(
        self,
        number: int,
        in_files: Callable[[Filed, HullRows], Found | None],
        in_journal: Callable[[Reader, HullRows], Found],
    ) -> Found:
        """What is found in the segments of a hull; in the journal where that is None.

        No rows are held as of a moment while files are read, which may take long. If these are replaced or removed
        meanwhile, or the journal drops what it had, it is looked for again.
        """
        while True:
            with self._visible:
                hull = self._settled().hulls[number].copy()
            try:
                found = None if self._filed is None else in_files(self._filed, hull)
                if found is not None:
                    return found
                with self._of_hull(number) as (reader, rows):
                    return in_journal(reader, rows)
            except DamagedError:
                with self._visible:
                    now = self._settled().hulls[number]
                if (now.segments, now.oldest, now.start) == (hull.segments, hull.oldest, hull.start):
                    raise

    def _of_hull(self, number: int) -> AbstractContextManager[tuple[Reader, HullRows]]:
        """A reader, and the rows of a hull as of the same moment; KeyError if no hull has that number."""
        return self._reading(lambda ledger: ledger.hulls[number].copy())

    def feed_consumers(self) -> list[FeedConsumer]:
        """The consumers of feeds as last committed."""
        with self._visible:
            return [each.consumer for each in self._settled().feed_consumers.values()]

    def read_fences(self, numbers: Sequence[int]) -> list[KeptFence | None]:
        """Fences as last committed."""

        def pick(ledger: Ledger) -> list[FenceRows | None]:
            found = [ledger.fences.get(number) for number in numbers]
            return [None if fence is None else ledger.runs.since(fence, fence.base) for fence in found]

        with self._reading(pick) as (reader, fences):
            return read_fences(reader, fences)

    def read_events(self, number: int, after: int, most: int) -> list[FenceEvent]:
        """Events of a fence."""
        with self._reading(lambda ledger: ledger.runs.since(ledger.fences[number], after, most)) as (reader, fence):
            return read_events(reader, fence, after, most)

    def boundary(self, number: int, first: int) -> int:
        """The sequence nearest before `first` such that all events before it can be dropped."""
        with self._visible:
            return self._settled().fences[number].boundary(first)

    def inside(self, number: int, inside: Inside) -> Iterator[StorageStep]:
        """Write who is inside, then drop what that supersedes."""
        yield from inside_steps(number, inside, lambda: next(self._ledger.inside_ids))
        while (fence := self._ledger.fences.get(number)) and (
            older := [key for key in fence.insides if key < fence.base]
        ):
            yield DropInside(number, older[0])

    @contextmanager
    def _reading(self, pick: Callable[[Ledger], Picked]) -> Iterator[tuple[Reader, Picked]]:
        """A reader, and a part of the ledger as of the same moment."""
        with self._lend() as reader:
            with self._visible:
                picked = pick(self._settled())
                reader.begin()
            yield reader, picked

    def _settled(self) -> Ledger:
        if self._unsettled:
            raise StorageError("the outcome of the last commit is not known yet")
        return self._ledger

    # Snapshots, and the removal of superseded rows

    def snapshot(self, number: int, kept: Kept) -> Iterator[StorageStep]:
        """Write a snapshot, then drop the rows it supersedes."""
        contents = kept.contents
        cuts = chunks.cuts(contents)
        ids = [next(self._ledger.chunk_ids) for _ in cuts]
        snapshot = StoredSnapshot(next(self._ledger.snapshot_ids), kept.revision, array("q", ids))
        self._under_way[snapshot.id] = set(ids)
        try:
            for i, (place, cut) in enumerate(zip(ids, cuts, strict=True)):
                yield Chunk(place, snapshot.id, i, chunks.chunk(contents, cut))
            commit = self._commit_of(number, kept.revision)
            yield Finish(number, snapshot, chunks.state(replace(kept, committed=commit)))
        finally:
            del self._under_way[snapshot.id]
        yield from self._trim(number)

    def _commit_of(self, number: int, revision: int) -> CommitStamp | None:
        """The commit of a revision, None where it is not known."""
        with self._reading(lambda ledger: [hull.copy() for hull in [ledger.hulls.get(number)] if hull]) as (
            reader,
            found,
        ):
            return next((commit_of(reader, hull, revision) for hull in found), None)

    def _trim(self, number: int) -> Iterator[StorageStep]:
        while (hull := self._ledger.hulls.get(number)) and (snapshot := hull.outlived()):
            yield DropSnapshot(number, snapshot)
        yield from self._drop_dead("chunks")
        while (hull := self._ledger.hulls.get(number)) and (ids := hull.superfluous()):
            rows = self._few("batches", ids, "batches.rowid, first, last, checksum, ")
            if any(place != row[0] for place, row in zip(ids, rows, strict=False)) or not rows:
                with self._visible:
                    dropped = hull.superfluous() != ids
                if dropped:  # by who trims it after a segment, or after a snapshot
                    continue
                raise DamagedError(f"{self._place}: a row of batches of hull {number} is missing")
            weights = sum(weight(stored, number, first, last) for _, first, last, stored in rows)
            yield DropBatches(number, ids[: len(rows)], weights)

    # The past

    def history(self, number: int) -> StoredHistory:
        """What is there of a hull."""
        with self._of_hull(number) as (reader, hull):
            filed = None if self._filed is None else self._filed.oldest_moment(hull, timed=False)
            first = filed or oldest_moment(reader, hull, timed=False)
            last = Moment(hull.last, commit_of(reader, hull, hull.last) if hull.last else created(hull.row))
            facts = [segment.facts for segment in hull.segments]
            size = sum(segment.size for segment in hull.segments)
            batches, moves = sum(each.batches for each in facts), sum(each.moves for each in facts)
            return StoredHistory(first, last, size, batches, moves, tuple(each.erasure for each in hull.erasures))

    def holes(self) -> list[Hole]:
        """What could not be read of hulls that are there, when it was last needed."""
        files = set() if self._filed is None else self._filed.unreadable.copy()
        if not files:
            return []
        with self._visible:
            return list(holes(self._settled().hulls, files))

    def why_no_history(self) -> str:
        """Why it cannot keep what the journal drops."""
        if self._archive is None:
            return "has a server without --history-dir, which keeps no history"
        return "" if is_installed() else f"has a server that keeps no history: that {NEEDS}"

    def set_history(self, number: int, max_age: int, max_bytes: int) -> StorageStep:
        """The step that changes how much of the past is kept."""
        return SetHistory(number, max_age, max_bytes)

    def file_history(self, now: int) -> Iterator[StorageStep]:
        """Write segments of what is due, and remove those that are not to be kept any longer."""
        if self._wiping:
            yield from self._wipe()
        archive = self._archive
        if archive is None:
            return
        numbers = self._with_past()
        if numbers:
            load()  # before there are batches to wait for it
        yield from self._remove_files(archive)
        damage: DamagedError | None = None
        for number in numbers:
            try:
                yield from self._file_hull(number, now, archive)
            except DamagedError as error:  # the others go on
                damage = damage or error
        if archive.most_bytes:
            with self._visible:
                gone = list(oldest_of_all(self._settled().hulls, archive.most_bytes))
            for number, segment in gone:
                with self._visible:
                    hulls = self._settled().hulls
                    enough = excess(hulls, archive.most_bytes) <= 0
                    name = hulls[number].row.name if number in hulls else None
                if name is None:
                    continue
                if enough and segment.begins:  # hulls were deleted meanwhile
                    break
                log.warning(
                    "the past of all hulls is more than --max-history-bytes: the oldest goes",
                    extra={"hull": name, "first": segment.first, "last": segment.last, "bytes": segment.size},
                )
                yield RetireSegment(number, segment)
        yield from self._remove_files(archive)
        if monotonic() - self._looked >= LOOK:
            self._looked = monotonic()
            self._remove_orphans(archive)
        if damage is not None:
            raise damage

    def _file_hull(self, number: int, now: int, archive: Archive) -> Iterator[StorageStep]:
        while (hull := self._ledger.hulls.get(number)) and hull.due > hull.filed:
            yield from self._close_segment(number, archive)
        yield from self._trim(number)
        settings = hull.row.settings if hull else None
        for segment in outdated(hull, now, archive) if hull else ():
            yield RetireSegment(number, segment, settings)
        for stored in past_erasures(hull) if hull else ():
            yield DropErasure(number, stored)

    def _remove_orphans(self, archive: Archive) -> None:
        """Remove the files that owners before this one have written long after it became the owner."""
        for number in self._with_past():
            with self._visible:
                hull = self._settled().hulls.get(number)
                files = set() if hull is None else {each.file for each in hull.segments}
            if hull is not None:
                for file in archive.orphans(hull.row.uid, self.epoch):
                    if file not in files:
                        archive.remove(file)

    def _with_past(self) -> list[int]:
        """The hulls that have a past, or are to have one."""
        with self._visible:
            hulls = self._settled().hulls.values()
            return [hull.row.number for hull in hulls if hull.segments or hull.erasures or hull.row.settings.history]

    def erase(self, number: int, requests: Sequence[EraseRequest], until: int, now: int) -> Iterator[StorageStep]:
        """File what the journal has of the keys, then replace the segments that have them."""
        if self._archive is not None:
            yield from self._erase_filed(number, requests, until, now, self._archive)
        self._look_for_dead_chunks()
        yield from self._drop_dead("chunks")
        self._erased = True
        yield from self._wipe()

    def _erase_filed(
        self, number: int, requests: Sequence[EraseRequest], until: int, now: int, archive: Archive
    ) -> Iterator[StorageStep]:
        while (hull := self._ledger.hulls.get(number)) and hull.due > hull.filed:
            yield from self._close_segment(number, archive)
        yield from self._trim(number)
        with self._visible:
            found = self._settled().hulls.get(number)
        if found is not None:
            yield from self._erase(Erasing(found.copy(), requests, until, archive), now)
        yield from self._remove_files(archive)

    def _erase(self, erasing: Erasing, now: int) -> Iterator[StorageStep]:
        """Write what takes the place of segments with the keys, then replace them all at once."""
        number, uid = erasing.hull.row.number, erasing.hull.row.uid
        replaced: list[tuple[tuple[StoredSegment, ...], StoredSegment]] = []
        places: set[int] = set()
        try:
            for segments, due in erasing.segments():
                place, file = next(self._ledger.segment_ids), erasing.archive.name(uid, due.first, due.last, self.epoch)
                places.add(place)
                self._filing.add(place)
                yield NameFile(place, file)
                replaced.append((segments, due.write(erasing.archive, place, file)))
            if replaced:
                done = erasing.done(now)
                stored = tuple(StoredErasure(next(self._ledger.segment_ids), each) for _, each in done)
                yield EraseKeys(number, tuple(replaced), stored)
                for request, erased in done:
                    request.erased = erased
        except BaseException:
            self._abandon(places)
            raise
        finally:
            self._filing -= places

    def _close_segment(self, number: int, archive: Archive) -> Iterator[StorageStep]:
        with self._reading(lambda ledger: ledger.hulls[number].copy()) as (reader, hull):
            due = read_due(reader, hull)
        place, file = next(self._ledger.segment_ids), archive.name(hull.row.uid, due.first, due.last, self.epoch)
        self._filing.add(place)
        try:
            yield NameFile(place, file)
            yield CloseSegment(number, due.write(archive, place, file))
        except BaseException:
            self._abandon([place])
            raise
        finally:
            self._filing.remove(place)

    def _abandon(self, places: Collection[int]) -> None:
        """Rows of segments are nobody's, unless their commit was taken for a failure, and their files may come yet."""
        self._ledger.dead["segments"].extend(places)
        self._late.update(dict.fromkeys(places, 0))

    def _remove_files(self, archive: Archive) -> Iterator[StorageStep]:
        """Remove the files that no segment has, and then the rows that name them.

        Of what a server gave up, or was writing when it ended, the row stays, so that what a store takes late, or an
        owner that stood still writes when it goes on, is removed, too, whatever has become of the hull.
        """
        now = monotonic()
        while ids := [
            each
            for each in self._ledger.dead["segments"]
            if each not in self._filing and self._late.get(each, 0) <= now
        ]:
            with self._reading(lambda ledger: ledger.hulls.copy()) as (reader, hulls):
                rows = list(reader.some("segments", SEGMENT, array("q", ids[:1])))
            damaged = not all(map(is_whole, rows))  # its file may be that of another one: the next start examines it
            # Or its commit was taken for a failure, and was none.
            if damaged or any(number in hulls for _, number, *_ in rows):
                self._ledger.dead["segments"].remove(ids[0])
                self._late.pop(ids[0], None)
                continue
            self._confirm()
            for *_, file, _, _ in rows:
                if file:
                    archive.remove(file)
                    if self._filed is not None:
                        self._filed.forget(file)
            if rows and (archive.takes_late or self.epoch) and self._late.get(ids[0]) == 0:
                self._late[ids[0]] = monotonic() + LATE
                continue
            yield DropDeadSegment(ids[0])
            self._late.pop(ids[0], None)

    def cut(self, number: int, last: int) -> StorageStep | None:
        """The step that drops the revisions after `last`."""
        with self._reading(lambda ledger: ledger.hulls[number].copy()) as (reader, hull):
            return newest_rows(reader, hull, last)

    def sweep(self) -> Iterator[StorageStep]:
        """Drop the rows of deleted hulls and unfinished snapshots."""
        self._look_for_dead_chunks()
        for table in DROPPED:
            if table != "segments":  # they go with their files
                yield from self._drop_dead(table)
        for place in self._sparse():
            step = self._shrunk(place)
            if step is not None:
                yield step

    def _sparse(self) -> list[int]:
        with self._visible:
            return self._settled().events.sparse()

    def _shrunk(self, place: int) -> ShrinkEvents | None:
        """The step that leaves of a row of events what is needed; None if that is nothing."""
        with self._reading(lambda ledger: {key: fence.first for key, fence in ledger.fences.items()}) as (
            reader,
            firsts,
        ):
            return shrunk(reader, place, firsts)

    def _drop_dead(self, table: str) -> Iterator[StorageStep]:
        while ids := self._ledger.dead[table][:DROPPED_ROWS]:
            yield DropDead(table, ids[: max(1, len(self._few(table, ids)))])

    def _look_for_dead_chunks(self) -> None:
        """Find the chunks that belong to no snapshot, also those of abandoned ones."""
        with self._lend() as reader:
            rows = list(reader.every("chunks", "rowid, snapshot"))
        with self._visible:
            live = {snapshot.id for hull in self._ledger.hulls.values() for snapshot in hull.snapshots}
            live |= self._under_way.keys()
            self._ledger.dead["chunks"] = array("q", (place for place, snapshot in rows if snapshot not in live))

    def _few(self, table: str, ids: "array[int]", columns: str = "") -> list[Sequence[int]]:
        """Some columns of the first rows: as many as fit into a step, but at least one."""
        taken: list[Sequence[int]] = []
        size = 0
        with self._lend() as reader:
            for *row, length in reader.some(table, f"{columns}{DROPPED[table]}", ids[:DROPPED_ROWS]):
                size += length
                if taken and size > DROPPED_BYTES:
                    break
                taken.append(row)
        return taken
