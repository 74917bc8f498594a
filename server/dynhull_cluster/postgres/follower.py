"""Follows a partition that another server owns: the ledger as of ever later moments, without a look at every row again.

Rows that are added have greater numbers, for as long as the partition has the same owner. Rows that are dropped are
looked for where they can be: batches and snapshots that a newer snapshot has superseded, or a segment has, the newest
batches of a shard, which its root may undo, and whatever a deleted hull had. Rows of hulls and of segments may be other
ones. In the end the rows must agree with the totals, as in an examination. If they do not, something else has happened,
and what was read before is void.
"""

from array import array
from collections import defaultdict
from itertools import count
from typing import Any

from psycopg.pq import TransactionStatus

from dynhull_server.storage.port import DamagedError, Progress, StorageError
from dynhull_server.storage.rows.encoding import weight
from dynhull_server.storage.rows.examine import Findings, examine
from dynhull_server.storage.rows.fence_examine import FenceExamination, FoundFences
from dynhull_server.storage.rows.hull_rows import FORMATS, values
from dynhull_server.storage.rows.ledger import HullRows, Ledger, StoredSnapshot
from dynhull_server.storage.rows.segment_rows import (
    erasure_from,
    erasure_values,
    segment_checksum,
    segment_from,
    segment_values,
    segment_weight,
)
from dynhull_server.storage.rows.tables import COLUMNS, FORMAT
from dynhull_server.storage.rows.totals import Totals, totals_from

from .database import Connection, as_storage_errors
from .reader import PostgresReader

OF_FENCES = (
    *("fences", "events", "staged", "runs", "feed_consumers"),
    *("event_ids", "inside_ids", "consumer_ids", "delay_ids", "start_ids"),
)
SEGMENT = "id, hull, checksum"
DEAD_OF_FENCES = "events", "insides", "consumers", "delays", "starts"


class Follower:
    """The rows of a partition, as of a moment.

    Args:
        connection: a connection that nobody else uses.
        partition: the partition.
        place: what messages call it.

    Attributes:
        connection: the connection. Between two calls, it has a transaction that reads the rows as of the moment.
        ledger: the rows.
        repairs: the steps that an owner would take first.
        epoch: the epoch of the owner.
    """

    def __init__(self, connection: Connection, partition: int, place: str) -> None:
        self.connection = connection
        self.ledger = Ledger()
        self.repairs: list[Any] = []
        self.epoch = 0
        self._partition = partition
        self._place = place
        self._reader = PostgresReader(connection, partition)
        self._weights: dict[int, array[int]] = {}  # of the rows of batches, by hull
        self._hulls = Totals()  # of the rows, without those of fences
        self._snapshots = (0, 0)
        self._segments: dict[int, tuple[int, int]] = {}  # of each row, its hull and its checksum

    @as_storage_errors()
    def begin(self, progress: Progress) -> None:
        """Examine every row.

        Raises:
            DamagedError: something is damaged.
        """
        self.epoch = self._next_moment()
        findings = Findings()
        examine(self._reader, FORMAT, findings, progress)
        if damage := [*findings.fatal, *findings.notes]:
            raise DamagedError(f"{self._place}: {'; '.join(damage)}")
        ledger = self.ledger = findings.ledger
        self.repairs = list(findings.repairs)
        ledger.dead["chunks"] = array("q")  # they may belong to a snapshot that is being written: a sweep looks again
        weights = defaultdict[int, "array[int]"](lambda: array("I"))
        for number, first, last, stored in self._reader.every("batches", "hull, first, last, checksum"):
            weights[number].append(weight(stored, number, first, last))
        self._weights = {number: weights[number] for number in ledger.hulls}
        self._hulls = Totals().plus(
            len(ledger.hulls),
            sum(len(hull.ids) for hull in ledger.hulls.values()),
            sum(hull.sum for hull in ledger.hulls.values()),
        )
        self._snapshots = self._count_snapshots()
        self._segments = self._look_at_segments()

    @as_storage_errors()
    def go_on(self, epoch: int | None = None) -> None:
        """Follow what has come since.

        Args:
            epoch: the epoch that the partition is to have, by default that of `begin`.

        Raises:
            StorageError: what has come since does not follow what there was.
        """
        if self._next_moment() != (self.epoch if epoch is None else epoch):
            raise self._void("another server owns it")
        totals, both = totals_from(self._reader.totals())
        if totals is None or not both:
            raise DamagedError(f"{self._place}: a copy of the totals is damaged")
        before = self.ledger.totals
        if totals == before:
            return
        if totals.commits <= before.commits:
            raise self._void("commits are missing")
        if (totals.hulls, totals.next_number) != (before.hulls, before.next_number):
            self._follow_hulls()
        self._follow_batches()
        self._forget_swept()
        if (snapshots := self._count_snapshots()) != self._snapshots:
            self._follow_snapshots()
            self._snapshots = snapshots
        self._follow_segments()
        self._follow_drops(totals)
        fences = self._examine_fences()  # also where there are none: those deleted meanwhile may have left rows
        if not self._agrees(totals, fences):
            self._follow_changes()
            self._follow_drops(totals)
        if not self._agrees(totals, fences):
            raise self._void("its rows and their totals do not follow from those before")
        self.ledger.totals = totals

    def _follow_drops(self, totals: Totals) -> None:
        if self._hulls.batches > totals.batches:
            self._drop_superfluous()
        if self._hulls.batches > totals.batches:
            self._drop_ends()

    def _agrees(self, totals: Totals, fences: FoundFences) -> bool:
        """Whether the rows are those that the totals record."""
        there = self._hulls.plus(0, 0, fences.sum, fences.rows)
        return all(getattr(there, name) == getattr(totals, name) for name in ("hulls", "batches", "sum", "fence_rows"))

    def close(self) -> None:
        """Close the connection."""
        self.connection.close()

    def _next_moment(self) -> int:
        """Read from now on what is committed now; returns the epoch of the owner."""
        if self.connection.info.transaction_status is not TransactionStatus.IDLE:
            self.connection.execute("ROLLBACK")
        self._reader.begin()
        found = self.connection.execute("SELECT epoch FROM owners WHERE partition = %s", [self._partition]).fetchone()
        return 0 if found is None else int(found[0])

    def _follow_hulls(self) -> None:
        ledger, dead = self.ledger, self.ledger.dead
        there = {number for (number,) in self._reader.every("hulls", "id")}
        for number in ledger.hulls.keys() - there:
            gone = ledger.hulls.pop(number)
            del self._weights[number]
            dead["batches"] += gone.ids
            dead["snapshots"].extend(each.id for each in gone.snapshots)
            self._hulls = self._hulls.plus(-1, -len(gone.ids), -gone.sum)
        columns, read = FORMATS[FORMAT]
        for row in self._reader.some("hulls", columns, array("q", sorted(there - ledger.hulls.keys()))):
            found = read(*row)
            if not found.whole:
                raise DamagedError(f"{self._place}: the row of hull {found.row.number} is damaged")
            ledger.hulls[found.row.number] = HullRows(found.row, found.checksum)
            self._weights[found.row.number] = array("I")
            self._hulls = self._hulls.plus(1, 0, found.checksum)

    def _follow_batches(self) -> None:
        ledger = self.ledger
        newest = next(ledger.batch_ids) - 1
        columns = "rowid, hull, first, last, checksum"
        for place, number, first, last, stored in self._reader.after("batches", columns, newest):
            newest = place
            hull = ledger.hulls.get(number)
            if hull is None:  # of a hull that was created and deleted meanwhile
                ledger.dead["batches"].append(place)
                continue
            if first != hull.last + 1:
                self._drop_undone(hull, first - 1)
            each = weight(stored, number, first, last)
            hull.append(first, last, place, each)
            self._weights[number].append(each)
            self._hulls = self._hulls.plus(0, 1, each)
        ledger.batch_ids = count(newest + 1)

    def _count_snapshots(self) -> tuple[int, int]:
        """The number of snapshots and the greatest number of one, which change with them. Notes the numbers in use."""
        rows, newest, chunk, unfinished = self.connection.execute(
            "SELECT (SELECT count(*) FROM snapshots WHERE partition = %(partition)s), "
            "(SELECT coalesce(max(id), 0) FROM snapshots WHERE partition = %(partition)s), "
            "coalesce(max(rowid), 0), coalesce(max(snapshot), 0) FROM chunks WHERE partition = %(partition)s",
            {"partition": self._partition},
        ).fetchall()[0]
        ledger = self.ledger
        ledger.chunk_ids = count(max(next(ledger.chunk_ids), chunk + 1))
        ledger.snapshot_ids = count(max(next(ledger.snapshot_ids), newest + 1, unfinished + 1))
        return rows, newest

    def _follow_snapshots(self) -> None:
        ledger = self.ledger
        known = {each.id for hull in ledger.hulls.values() for each in hull.snapshots}
        there: set[int] = set()
        new: dict[int, tuple[int, StoredSnapshot]] = {}
        orphans = array("q")
        for place, number, revision, chunks in self._reader.every("snapshots", "id, hull, revision, chunks"):
            there.add(place)
            if number not in ledger.hulls:
                orphans.append(place)
            elif place not in known:
                new[place] = number, StoredSnapshot(place, revision, array("q", [0]) * chunks)
        ledger.dead["snapshots"] = orphans
        for place, of, number in self._reader.every("chunks", "rowid, snapshot, number"):
            if of in new:
                new[of][1].chunks[number] = place
        for hull in ledger.hulls.values():
            hull.set_snapshots(each for each in hull.snapshots if each.id in there)
        for number, snapshot in new.values():
            if 0 in snapshot.chunks:
                raise DamagedError(f"{self._place}: a snapshot of hull {number} is damaged")
            hull = ledger.hulls[number]
            hull.set_snapshots((*hull.snapshots, snapshot))

    def _look_at_segments(self) -> dict[int, tuple[int, int]]:
        """The hull and the checksum of each row of segments. Notes the numbers in use, and which rows are to go."""
        ledger = self.ledger
        there = {place: (number, stored) for place, number, stored in self._reader.every("segments", SEGMENT)}
        ledger.segment_ids = count(max(next(ledger.segment_ids), max(there, default=0) + 1))
        ledger.dead["segments"] = array("q", (place for place, (of, _) in there.items() if of not in ledger.hulls))
        return there

    def _follow_segments(self) -> None:
        before, self._segments = self._segments, self._look_at_segments()
        if self._segments == before:
            return
        gone = {place for place, each in before.items() if self._segments.get(place) != each}
        new = array("q", (place for place, each in self._segments.items() if before.get(place) != each))
        for number, hull in self.ledger.hulls.items():
            for segment in [each for each in hull.segments if each.id in gone]:
                hull.drop_segment(segment)
                self._weigh(hull, -segment_weight(segment_values(segment, number)))
            for stored in [each for each in hull.erasures if each.id in gone]:
                hull.drop_erasure(stored)
                self._weigh(hull, -segment_weight(erasure_values(stored, number)))
        for row in self._reader.some("segments", ", ".join(COLUMNS["segments"]), new):
            place, number, first, last, file, facts, checksum = row
            if number not in self.ledger.hulls:
                continue
            hull = self.ledger.hulls[number]
            if segment_checksum(*row[:-1]) != checksum:
                raise DamagedError(f"{self._place}: the row of the past of revisions {first} to {last} is damaged")
            if file:
                hull.set_segments((*hull.segments, segment_from(place, first, last, file, facts)))
            else:
                hull.add_erasures([erasure_from(place, first, last, facts)])
            self._weigh(hull, segment_weight(row))

    def _weigh(self, hull: HullRows, more: int) -> None:
        hull.weigh(more)
        self._hulls = self._hulls.plus(0, 0, more)

    def _follow_changes(self) -> None:
        """Take up rows of hulls that were there before, and are other ones now."""
        columns, read = FORMATS[FORMAT]
        for row in self._reader.every("hulls", columns):
            found = read(*row)
            hull = self.ledger.hulls.get(found.row.number)
            if hull is not None and found.whole and found.row != hull.row:
                *_, before = values(hull.row)
                hull.change(found.row, found.checksum - before)
                self._hulls = self._hulls.plus(0, 0, found.checksum - before)

    def _drop_superfluous(self) -> None:
        """Find the rows of batches that were dropped behind snapshots: of each hull, the first ones."""
        for number, hull in self.ledger.hulls.items():
            candidates = hull.superfluous()
            if not candidates:
                continue
            left = sum(1 for _ in self._reader.some("batches", "batches.rowid", candidates))
            gone = len(candidates) - left
            weights = sum(self._weights[number][:gone])
            hull.drop(gone, weights)
            del self._weights[number][:gone]
            self._hulls = self._hulls.plus(0, -gone, -weights)

    def _drop_ends(self) -> None:
        """Find the newest rows of shards that were dropped, and not followed by others."""
        for hull in self.ledger.hulls.values():
            if hull.row.settings.shard is not None and hull.ids:
                there = sum(1 for _ in self._reader.some("batches", "batches.rowid", hull.ids))
                if there < len(hull.ids):
                    self._drop_undone(hull, hull.firsts[there] - 1)

    def _drop_undone(self, hull: HullRows, last: int) -> None:
        """Drop the rows of a shard after a revision."""
        gone = hull.after(last)
        if hull.row.settings.shard is None or not gone or hull.firsts[-len(gone)] != last + 1:
            raise self._void(f"revision {last + 1} of hull {hull.row.name!r} follows {hull.last}")
        each = self._weights[hull.row.number]
        weights = sum(each[-len(gone) :])
        hull.drop_newest(len(gone), weights, last)
        del each[-len(gone) :]
        self._hulls = self._hulls.plus(0, -len(gone), -weights)

    def _forget_swept(self) -> None:
        """Leave out what the owner has swept of deleted hulls: a sweep takes longest for what is not there."""
        dead = self.ledger.dead
        if dead["batches"]:
            there = self._reader.some("batches", "batches.rowid", dead["batches"])
            dead["batches"] = array("q", (place for (place,) in there))

    def _examine_fences(self) -> FoundFences:
        fresh = Ledger()
        found = FenceExamination(self._reader, fresh, FORMAT, contents=False).run()
        if found.fatal:
            raise DamagedError(f"{self._place}: {'; '.join(found.fatal)}")
        for name in OF_FENCES:
            setattr(self.ledger, name, getattr(fresh, name))
        for table in DEAD_OF_FENCES:
            self.ledger.dead[table] = fresh.dead[table]
        self.repairs = list(found.repairs)
        return found

    def _void(self, reason: str) -> StorageError:
        return StorageError(f"{self._place} is to be read anew: {reason}")
