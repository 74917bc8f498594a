"""Examination of a database: is all data present and intact, and which rows belong to which hull?"""

import struct
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import count
from typing import Any

import numpy as np

from ...state.alarms.rule import called
from ..port import Progress
from .batch_rows import commit_columns, is_whole
from .encoding import checksum, weight
from .fence_examine import FenceExamination, FoundFences
from .group import AnyStep, Cut, DropSnapshot, MendSegment
from .hull_rows import found_hulls, row_checksum, settings_text
from .ledger import HullRows, Ledger, StoredSnapshot
from .segment_examine import SegmentExamination
from .tables import COLUMNS, FENCES_SINCE, SEGMENTS_SINCE, Reader
from .totals import Totals, totals_from

PROGRESS_ROWS = 1000

MISSING = 0  # the number of no row


@dataclass(slots=True)
class Findings:
    """The result of an examination.

    Attributes:
        ledger: the rows of each hull.
        fatal: damage that prevents serving the database, because it is uncertain which batches are lost.
        notes: losses and repairs that are known exactly.
        damaged: the numbers of the damaged hulls.
        repairs: the steps that repair the database.
        both_totals: whether both copies of the totals are intact.
        starts: for a migration, where the events of fences begin that have dropped some, by number.
    """

    ledger: Ledger = field(default_factory=Ledger)
    fatal: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    damaged: set[int] = field(default_factory=set)
    repairs: list[AnyStep] = field(default_factory=list)
    both_totals: bool = True
    starts: dict[int, int] = field(default_factory=dict)

    @property
    def mends(self) -> list[MendSegment]:
        """The repairs of segments, which the ledger has already, and the totals not yet."""
        return [each for each in self.repairs if isinstance(each, MendSegment)]

    def blame(self, hull: HullRows, text: str, *, fatal: bool) -> None:
        """Record damage to a hull."""
        self.damaged.add(hull.row.number)
        (self.fatal if fatal else self.notes).append(f"hull {hull.row.name!r}: {text}")


@dataclass(slots=True)
class _Scanned:
    """The rows of one hull, in the order read."""

    rows: HullRows
    lasts: "array[int]" = field(default_factory=lambda: array("q"))
    gaps: bool = False
    damaged: dict[int, int] = field(default_factory=dict)  # weights by first revision
    snapshots: dict[int, StoredSnapshot] = field(default_factory=dict)


def examine(reader: Reader, version: int, findings: Findings, progress: Progress, *, contents: bool = True) -> None:
    """Compare all rows with their checksums and the totals.

    Args:
        reader: reads the rows.
        version: the format.
        findings: receives the rows of each hull, and what is damaged.
        progress: called with the rows examined so far and the total.
        contents: whether to read and check payloads and points too.

    Raises:
        UnreadableError: the database itself is damaged.
    """
    _Examination(reader, version, findings, progress, contents=contents).run()


class _Examination:
    """Reads every row. Without `contents`, payloads and points are neither read nor checked."""

    def __init__(
        self,
        reader: Reader,
        version: int,
        findings: Findings,
        progress: Progress,
        *,
        contents: bool,
    ) -> None:
        self._contents = contents
        self._reader = reader
        self._version = version
        self._findings = findings
        self._ledger = findings.ledger
        self._hulls: dict[int, _Scanned] = {}
        self._progress = progress
        self._done = self._all = 0
        self._newest_snapshot = MISSING
        self._next_number = 1
        self._fences = FoundFences()
        self._past: SegmentExamination | None = None
        self._mended = 0  # what the weights of segments that are put right are more than before
        self._renewed = 0  # checksums of the rows of hulls in the present format, less the stored ones

    def run(self) -> None:
        """Read everything once."""
        totals = self._totals()
        self._hull_rows()
        self._snapshots()
        self._chunks()
        self._batches()
        if self._version >= SEGMENTS_SINCE:
            self._segments()
        if self._version >= FENCES_SINCE:
            examination = FenceExamination(self._reader, self._ledger, self._version, contents=self._contents)
            self._fences = examination.run()
            self._findings.fatal += self._fences.fatal
            self._findings.repairs += self._fences.repairs
            self._findings.starts = self._fences.starts
        self._compare(totals)
        for scanned in self._hulls.values():
            self._judge(scanned)
        self._judge_fenced()

    def _totals(self) -> Totals | None:
        self._all = self._reader.count("batches") + self._reader.count("chunks")
        self._progress(0, self._all)
        if self._version == 1:
            return None
        totals, self._findings.both_totals = totals_from(self._reader.totals())
        if totals is None:
            self._findings.fatal.append(
                "both copies of the totals are damaged, so missing batches could not be noticed"
            )
        elif not self._findings.both_totals:
            self._findings.notes.append(
                "one of the two copies of the totals was damaged, and was restored from the other"
            )
        return totals

    def _hull_rows(self) -> None:
        texts: dict[int, str] = {}  # by the identity of settings: rows share them, and the ledger keeps the rows
        for hull in found_hulls(self._reader, self._version):
            row = hull.row
            if not hull.whole:
                self._findings.damaged.add(row.number)
                self._findings.fatal.append(f"the row of hull {row.number}, {row.name!r}, is damaged")
            text = texts.get(id(row.settings))
            if text is None:
                text = texts[id(row.settings)] = settings_text(row.settings)
            # Of a whole row in the present format it is the one that is stored.
            renewed = hull.checksum if hull.whole and hull.settings == text else row_checksum(row, text)
            if hull.whole:
                self._renewed += renewed - hull.checksum
            rows = self._ledger.hulls[row.number] = HullRows(row, renewed)
            self._hulls[row.number] = _Scanned(rows)

    def _snapshots(self) -> None:
        columns = ", ".join(COLUMNS["snapshots"])
        for place, number, revision, chunks, state, stored in self._reader.every("snapshots", columns):
            self._newest_snapshot = place
            scanned = self._hulls.get(number)
            if scanned is None:
                self._ledger.dead["snapshots"].append(place)
            elif _matches(stored, state, place, number, revision, chunks):
                scanned.snapshots[place] = StoredSnapshot(place, revision, array("q", [MISSING]) * chunks)
            else:
                lost = StoredSnapshot(place, revision if isinstance(revision, int) else 0)
                scanned.rows.set_snapshots((*scanned.rows.snapshots, lost))

    def _chunks(self) -> None:
        """Assign the chunks to their snapshots."""
        chunks = {key: snapshot.chunks for each in self._hulls.values() for key, snapshot in each.snapshots.items()}
        column = "points" if self._contents else "NULL"
        newest = MISSING
        for place, snapshot, number, stored, data in self._counted(
            "chunks", f"rowid, snapshot, number, checksum, {column}"
        ):
            newest = place
            places = chunks.get(snapshot)
            if places is None:
                self._ledger.dead["chunks"].append(place)
            elif (not self._contents or _matches(stored, data, snapshot, number)) and number in range(len(places)):
                places[number] = place
            if isinstance(snapshot, int):
                self._newest_snapshot = max(self._newest_snapshot, snapshot)
        self._ledger.chunk_ids = count(newest + 1)
        self._ledger.snapshot_ids = count(self._newest_snapshot + 1)

    def _batches(self) -> None:
        column = "payload" if self._contents else "NULL"
        columns = f"rowid, hull, first, last, checksum, {column}, {commit_columns(self._version)}"
        newest = MISSING
        hulls, dead = self._hulls, self._ledger.dead["batches"]
        for place, number, first, last, stored, payload, *commit in self._counted("batches", columns):
            newest = place
            scanned = hulls.get(number)
            if scanned is None:
                dead.append(place)
                if isinstance(number, int):
                    self._next_number = max(self._next_number, number + 1)
                continue
            try:
                whole = not self._contents or is_whole(stored, payload, number, first, last, *commit)
                each = weight(stored, number, first, last)
            except (TypeError, struct.error):
                self._findings.blame(scanned.rows, "a row of batches is damaged", fatal=True)
                continue
            scanned.gaps |= first != scanned.rows.last + 1 and len(scanned.lasts) > 0
            scanned.rows.append(first, last, place, each)
            scanned.lasts.append(last)
            if not whole:
                scanned.damaged[first] = each
        self._ledger.batch_ids = count(newest + 1)

    def _segments(self) -> None:
        self._past = SegmentExamination(self._reader, self._ledger.hulls)
        self._past.run()

    def _mend_segments(self, lacking: int | None, committed: int) -> None:
        """Take up what damaged rows of segments were: `lacking` is their weight, None where that is not known."""
        past = self._past
        if past is None:
            return
        found = None if lacking is None else past.explain(lacking, committed)
        if found is None:
            for hull, text in past.blamed():
                if hull is None:
                    self._findings.fatal.append(text)
                else:
                    self._findings.blame(hull, text, fatal=True)
        for each in found or ():
            self._mended += each.step.more
            self._findings.repairs.append(each.step)
            if each.lost and each.hull is not None:
                self._findings.blame(each.hull, each.text, fatal=False)
            else:
                self._findings.notes.append(
                    each.text if each.hull is None else f"hull {each.hull.row.name!r}: {each.text}"
                )
        self._ledger.dead["segments"].extend(past.dead)
        self._ledger.segment_ids = count(past.newest + 1)

    def _counted(self, table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        for row in self._reader.every(table, columns):
            yield row
            self._done += 1
            if self._done % PROGRESS_ROWS == 0:
                self._progress(self._done, self._all)

    def _compare(self, totals: Totals | None) -> None:
        """Compare the rows found with the totals."""
        hulls = self._ledger.hulls.values()
        fences = self._fences
        numbers = [self._next_number, fences.next_number, *(number + 1 for number in self._ledger.hulls)]
        there = Totals(next_number=max(numbers)).plus(0, 0, fences.sum, fences.rows)
        lacking = None if totals is None else totals.sum - there.sum - sum(hull.sum for hull in hulls) + self._renewed
        self._mend_segments(lacking, 0 if totals is None else totals.committed)
        there = there.plus(len(hulls), sum(len(hull.ids) for hull in hulls), sum(hull.sum for hull in hulls))
        there = there.plus(0, 0, -self._mended)
        self._ledger.totals = (totals or there)._replace(sum=there.sum)
        stored = there.plus(0, 0, -self._renewed)
        if totals is not None and (totals.hulls, totals.batches, totals.sum) != (
            there.hulls,
            there.batches,
            stored.sum,
        ):
            self._findings.fatal.append(
                f"the totals record {totals.hulls} hulls with {totals.batches} rows of batches, the tables have "
                f"{there.hulls} with {there.batches}, or different ones: rows are missing, or log and database do not "
                "belong together"
            )
            self._findings.fatal += fences.gaps
        if totals is not None and totals.fence_rows != there.fence_rows:
            self._findings.fatal.append(
                f"the totals record {totals.fence_rows} rows of fences, the tables have {there.fence_rows}"
            )
        names = Counter(hull.row.name for hull in hulls)
        self._findings.fatal += [f"{times} hulls have the name {name!r}" for name, times in names.items() if times > 1]

    def _judge(self, scanned: _Scanned) -> None:
        """Determine whether the newest revision of the hull can be read."""
        hull = scanned.rows
        base = self._judge_snapshots(scanned)
        if not (scanned.gaps or scanned.damaged) and (not hull.firsts or hull.firsts[0] <= base + 1):
            hull.last = max(base, hull.last)
            return
        order = np.argsort(hull.firsts, kind="stable")
        firsts, lasts, ids = (np.array(column, np.int64)[order] for column in (hull.firsts, scanned.lasts, hull.ids))
        hull.firsts, hull.ids = array("q", firsts.tobytes()), array("q", ids.tobytes())
        hull.last = max(base, int(lasts[-1]) if len(lasts) else 0)
        needed = int(np.searchsorted(lasts, base, side="right"))
        expected = np.append(base, lasts)[:-1] + 1
        if needed < len(firsts) and firsts[needed] > base + 1:
            self._findings.blame(hull, f"revisions {base + 1} to {firsts[needed] - 1} are missing", fatal=True)
        for row in (np.flatnonzero(firsts[1:] != expected[1:]) + 1).tolist():
            text = f"revisions {expected[row]} to {firsts[row] - 1} are missing"
            if firsts[row] < expected[row]:
                text = f"revisions {firsts[row]} to {lasts[row - 1]} are stored twice"
            if row > needed:
                self._findings.blame(hull, text, fatal=True)
            else:
                self._findings.blame(hull, f"{text}, which only affects resuming from old revisions", fatal=False)
        for row, first in enumerate(firsts.tolist()):
            if first in scanned.damaged:
                self._judge_damaged(scanned, row, needed, base, f"revisions {first} to {lasts[row]} are damaged")

    def _judge_damaged(self, scanned: _Scanned, row: int, needed: int, base: int, text: str) -> None:
        hull = scanned.rows
        if row < needed:
            self._findings.blame(hull, f"{text}, which only affects resuming from old revisions", fatal=False)
        elif row + 1 == len(hull.firsts):
            last = max(base, hull.firsts[row] - 1)
            self._findings.blame(
                hull, f"{text}: the hull was cut back to revision {last}, the last intact one", fatal=False
            )
            self._findings.repairs.append(Cut(hull.row.number, last, scanned.damaged[hull.firsts[row]]))
        else:
            self._findings.blame(hull, f"{text}, and later ones exist", fatal=True)

    def _judge_fenced(self) -> None:
        """A fence cannot follow a hull that is cut back, or that is missing."""
        cut = {step.number for step in self._findings.repairs if isinstance(step, Cut)}
        kept = {hull.row.name for number, hull in self._ledger.hulls.items() if number not in cut}
        for fence in self._ledger.fences.values():
            config = fence.row.config
            needed = {config.area_hull, config.subjects if config.kind != "prefix" else None} - {None}
            lost = needed - kept
            lost |= {
                self._ledger.hulls[number].row.name
                for number in cut
                if config.concerns(self._ledger.hulls[number].row.name)
            }
            if lost:
                self._findings.fatal.append(
                    f"{called(fence.row.name)} depends on hull {min(map(str, lost))!r}, whose newest revision is lost"
                )

    def _judge_snapshots(self, scanned: _Scanned) -> int:
        """The revision of the newest intact snapshot, 0 if there is none."""
        hull = scanned.rows
        if not (hull.snapshots or scanned.snapshots):
            return 0
        lost = [*hull.snapshots]
        lost += [snapshot for snapshot in scanned.snapshots.values() if MISSING in snapshot.chunks]
        hull.set_snapshots((*hull.snapshots, *scanned.snapshots.values()))
        for snapshot in lost:
            text = f"the snapshot at revision {snapshot.revision} is damaged, and was dropped"
            self._findings.blame(hull, text, fatal=False)
            self._findings.repairs.append(DropSnapshot(hull.row.number, snapshot))
        return max((snapshot.revision for snapshot in hull.snapshots if snapshot not in lost), default=0)


def _matches(stored: object, payload: Any, *keys: Any) -> bool:
    try:
        return checksum(payload, *keys) == stored
    except (TypeError, struct.error):
        return False
