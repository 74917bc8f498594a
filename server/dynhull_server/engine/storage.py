"""The state on the disk: what a hull asks of the journal."""

import json
from collections.abc import Iterable, Mapping
from concurrent.futures import Future
from dataclasses import dataclass

import numpy as np

from dynhull import DynamicHull
from dynhull.arrays import Points

from ..state.errors import StorageError, StorageFullError
from ..storage.sqlite.errors import JournalError, JournalFullError
from ..storage.sqlite.journal import NEWEST, HullRow, Journal
from ..storage.sqlite.records import Record
from ..storage.sqlite.recovery import Recovered

# Batches are replayed together up to so many points: as a set, which is many times faster.
REPLAYED_TOGETHER = 65_536


@dataclass(frozen=True, slots=True)
class Restored:
    """A hull as the journal has it."""

    hull: DynamicHull
    revision: int
    producers: dict[str, int]


class HullStore:
    """One hull's part of the journal."""

    def __init__(self, journal: Journal, row: HullRow, *, known: bool) -> None:
        self._journal = journal
        self._row = row
        self._known = known

    def create(self) -> Future[None]:
        """Commit the hull itself. A hull that is not created is committed with its first batch."""
        return self._now_known(self._journal.create(self._row))

    def append(self, records: list[Record]) -> Future[None]:
        """Commit batches."""
        return self._now_known(self._journal.append(self._row.number, records, None if self._known else self._row))

    def delete(self) -> Future[None]:
        """Commit that the hull is gone."""
        return self._journal.delete(self._row.number)

    def restore(self, until: int = NEWEST) -> Restored:
        """The hull as it was at a revision, as of the last commit. O(n log n)."""
        return replayed(self._journal.recover(self._row.number, until))

    def snapshot(self, revision: int, points: Points, producers: Mapping[str, int]) -> None:
        """Write a snapshot beside the traffic. Returns when it is done."""
        try:
            self._journal.snapshot(self._row.number, revision, points, json.dumps(dict(producers)).encode())
        except JournalError as error:
            raise storage_error(error) from error

    def oldest(self) -> int:
        """The oldest revision that `restore` can go back to."""
        return self._journal.oldest(self._row.number)

    def _now_known(self, commit: Future[None]) -> Future[None]:
        def committed(commit: Future[None]) -> None:
            self._known = self._known or commit.exception() is None

        commit.add_done_callback(committed)
        return commit


def storage_error(error: BaseException) -> StorageError:
    """What to tell callers of a commit that failed."""
    return StorageFullError(str(error)) if isinstance(error, JournalFullError) else StorageError(str(error))


def replayed(recovered: Recovered) -> Restored:
    """The hull that a snapshot and the batches after it make. O(n log n)."""
    hull = DynamicHull(recovered.points)
    producers: dict[str, int] = json.loads(recovered.state or "{}")
    revision = recovered.revision
    for record in recovered.records:
        revision = record.revision
        if record.producer:
            producers[record.producer] = record.sequence
    for records in _together(recovered.records):
        _replay(hull, records)
    return Restored(hull, revision, producers)


def _together(records: Iterable[Record]) -> Iterable[list[Record]]:
    """Records that may be applied as one set: none whose deletes depend on what was there at the time."""
    group: list[Record] = []
    rows = 0
    for record in records:
        if group and (record.lenient or group[-1].lenient or rows >= REPLAYED_TOGETHER):
            yield group
            group, rows = [], 0
        group.append(record)
        rows += len(record.inserts) + len(record.deletes)
    if group:
        yield group


def _replay(hull: DynamicHull, records: list[Record]) -> None:
    inserts = np.concatenate([record.inserts for record in records])
    deletes = np.concatenate([record.deletes for record in records])
    ops = np.repeat(np.array([1, -1], np.int8), [len(inserts), len(deletes)])
    hull.apply(ops, np.concatenate([inserts, deletes]), missing="ignore" if records[0].lenient else "raise")
