"""Reading hulls as they were, from the rows that there are."""

from array import array
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...compiled import Native, native
from ...state.records import NO_TIME, CommitStamp, Kept, KeyRows, Keys, Parts, Record
from ..past import Moment, created
from ..port import DamagedError
from ..segments.columns import CAUSES, NONE, Batches, SegmentColumns, joined
from ..segments.gathered import gathered, last_places_count
from .batch_columns import KINDS, BatchRow, columns_of_rows, keys_of
from .batch_rows import is_whole
from .ledger import HullRows
from .reading import as_damage, batch_rows, commit_of, newest_in_parts, whole_records, whole_rows
from .tables import Reader

# About the rows of points that one read has, and the rows of batches that it looks at.
STEP_POINTS, STEP_ROWS = 8192, 1024
# Rows of batches are decoded together up to these many bytes of payloads.
STEP_BYTES = 2**21
# Of which few keys are wanted.
WANTED_BYTES = 2**24
# Those of one that gathers them.
GATHERED_ROWS = 2**17
# The bytes of payloads that C++ gathers in one, at most and at least.
MOST_BYTES, LEAST_BYTES = 2**26, 2**16


def oldest_moment(reader: Reader, hull: HullRows, *, timed: bool) -> Moment:
    """The oldest revision that can be read; or, `timed`, the oldest whose commit is known."""
    oldest = hull.oldest
    if not oldest:
        return Moment(0, created(hull.row))
    with as_damage(hull):
        committed = commit_of(reader, hull, oldest)
        if committed is not None or not timed:
            return Moment(oldest, committed)
        low, high = 0, len(hull.ids)
        while low < high:  # those of earlier formats, which have no commit, come first
            middle = (low + high) // 2
            if _row(reader, hull, middle)[2] is None:
                low = middle + 1
            else:
                high = middle
        if low == len(hull.ids):
            return Moment(hull.last, None)
        first, _, committed = _row(reader, hull, low)
        return Moment(max(first, oldest), committed)


def moment_at(reader: Reader, hull: HullRows, time: int) -> Moment | None:
    """The last revision committed at or before a time; None if that is before what is kept, or not known."""
    with as_damage(hull):
        low, high = 0, len(hull.ids)
        while low < high:
            middle = (low + high) // 2
            committed = _row(reader, hull, middle)[2]
            if committed is None or committed.time <= time:
                low = middle + 1
            else:
                high = middle
        if low:
            _, last, committed = _row(reader, hull, low - 1)
            return None if committed is None or last < hull.start else Moment(last, committed)
        oldest = oldest_moment(reader, hull, timed=False)
    return oldest if oldest.committed is not None and oldest.committed.time <= time else None


def state_revision(hull: HullRows, until: int) -> int:
    """The revision of the newest snapshot that is not after `until`; 0 where there is none."""
    _require_kept(hull, until, hull.oldest)
    return max((each.revision for each in hull.snapshots if each.revision <= until), default=0)


def state_until(reader: Reader, hull: HullRows, until: int) -> tuple[Kept, Parts]:
    """The newest snapshot of a revision not after `until`, and its contents; the empty hull where there is none."""
    _require_kept(hull, until, hull.oldest)
    with as_damage(hull):
        return newest_in_parts(reader, hull, until)


def batches_after(reader: Reader, hull: HullRows, after: int, until: int) -> list[Record]:
    """The batches after a revision, as many as are read and applied in some milliseconds."""
    require_batches(hull, after)
    found: list[Record] = []
    points = 0
    with as_damage(hull):
        for record in whole_records(hull, batch_rows(reader, hull.between(after, until)[:STEP_ROWS])):
            if record.revision <= after:
                continue
            if record.revision > until or points >= STEP_POINTS:
                break
            if record.revision != after + len(found) + 1:
                raise DamagedError(
                    f"hull {hull.row.name!r}: revision {after + len(found) + 1} is missing: restore a backup"
                )
            found.append(record)
            points += len(record.rows)
    if not found and after < min(until, hull.last):
        raise DamagedError(f"hull {hull.row.name!r}: revision {after + 1} is missing: restore a backup")
    return found


def gathered_after(reader: Reader, hull: HullRows, after: int, until: int) -> list[Record]:
    """What the batches after a revision come to, as many as are read and applied in some tenths of a second."""
    require_batches(hull, after)
    last = min(until, hull.last)
    if after >= last:
        return []
    if native is not None and last_places_count(hull.row.settings):
        found = _last_places(native, reader, hull, after, last)
        if found is not None:
            return [found]
    columns = columns_between(reader, hull, after, last, GATHERED_ROWS)
    return list(gathered(Batches(columns), hull.row.settings, after, last))


def _last_places(native: Native, reader: Reader, hull: HullRows, after: int, until: int) -> Record | None:
    """What batches after a revision come to as one, without a column for each; None for `gathered` to do it.

    Only whole rows of batches, none of which does more than put and remove.
    """
    places, end, size = native.LastPlaces(KINDS[hull.row.settings.identity], until - after), after, 0
    last: BatchRow = ()
    with as_damage(hull):
        for rows in _few_bytes(whole_rows(hull, batch_rows(reader, hull.between(after, until)))):
            whole = _whole_between(rows, end, until)
            added = places.add([row[3] for row in whole], [row[1] - row[0] + 1 for row in whole])
            if added:
                last = whole[added - 1]
                end = last[1]
            size += sum(len(row[3]) for row in whole[:added])
            if added < len(rows) or size >= MOST_BYTES:
                break
    if end < until and size < LEAST_BYTES:
        return None
    clock, cause, *keys, points, times, deadlines = places.taken()
    if not points:  # whether those that have left again had times is not known
        return None
    identity = hull.row.settings.identity
    return Record(
        end,
        KeyRows(
            keys_of(keys[0], keys[1], identity),
            np.frombuffer(points).reshape(-1, 2),
            keys_of(keys[2], keys[3], identity),
            np.frombuffer(times, np.int64) if times else None,
            np.frombuffer(deadlines, np.int64) if deadlines else None,
        ),
        clock=None if clock == NO_TIME else clock,
        cause=None if cause == NONE else CAUSES[cause],
        committed=None if None in last[4:] else CommitStamp(*last[4:]),
    )


def _whole_between(rows: list[BatchRow], after: int, until: int) -> list[BatchRow]:
    """The rows that follow a revision without a gap, up to the first that has one after another revision."""
    found: list[BatchRow] = []
    for row in rows:
        if row[0] != after + 1 or row[1] > until:
            break
        found.append(row)
        after = row[1]
    return found


def columns_between(
    reader: Reader, hull: HullRows, after: int, until: int, most: int, wanted: Keys | None = None
) -> SegmentColumns:
    """The batches after a revision up to another one that is there, in columns.

    At least those of one row of batches; no further row is read after `most` points and keys. Where keys are wanted,
    rows of others may be missing, and do not count; then no further row is read after WANTED_BYTES either.
    """
    parts, count, size = list[SegmentColumns](), 0, 0
    identity = hull.row.settings.identity
    with as_damage(hull):
        for rows in _few_bytes(whole_rows(hull, batch_rows(reader, hull.between(after, until)))):
            parts.append(columns_of_rows(rows, identity, wanted))
            count += len(parts[-1])
            size += sum(len(row[3]) for row in rows)
            if count >= most or (wanted is not None and size >= WANTED_BYTES):
                break
    columns = joined(parts, identity)
    columns = columns.between(after, until)
    gaps = np.flatnonzero(np.diff(columns.revision, prepend=after) > 1)
    if len(gaps) or not len(columns):
        missing = int(columns.revision[gaps[0] - 1]) + 1 if len(gaps) and gaps[0] else after + 1
        raise DamagedError(f"hull {hull.row.name!r}: revision {missing} is missing: restore a backup")
    return columns


def _few_bytes(rows: Iterator[tuple[Any, ...]]) -> Iterator[list[tuple[Any, ...]]]:
    """Rows of batches, some at a time, with no more bytes than one of them or STEP_BYTES."""
    some, size = list[tuple[Any, ...]](), 0
    for row in rows:
        size += len(row[3])
        if some and (size > STEP_BYTES or len(some) == STEP_ROWS):
            yield some
            some, size = [], len(row[3])
        some.append(row)
    if some:
        yield some


def require_batches(hull: HullRows, after: int) -> None:
    """Raise DamagedError if batches after a revision are no longer kept."""
    _require_kept(hull, after, hull.start)


def _require_kept(hull: HullRows, revision: int, oldest: int) -> None:
    if revision < oldest:
        raise DamagedError(f"revision {revision} of hull {hull.row.name!r} is no longer kept")


def _row(reader: Reader, hull: HullRows, index: int) -> tuple[int, int, CommitStamp | None]:
    """The first and the last revision of a row of batches, and their commit."""
    row = next(batch_rows(reader, array("q", [hull.ids[index]])), None)
    if row is None or not is_whole(row[2], row[3], hull.row.number, row[0], row[1], *row[4:]):
        raise DamagedError(f"hull {hull.row.name!r}: a row of batches is damaged or missing: restore a backup")
    first, last, _, _, *commit = row
    return first, last, None if None in commit else CommitStamp(*commit)
