"""Reading hulls during commits."""

from array import array
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from typing import Any

from ...state.contents.joining import held_in_one, in_one
from ...state.records import CommitStamp, Contents, Kept, Parts, Record
from ..port import DamagedError
from .batch_rows import batch_records, commit_columns, is_whole
from .chunks import state_from
from .encoding import checksum
from .ledger import HullRows, StoredSnapshot
from .tables import Reader, UnreadableError


def read_hull(reader: Reader, hull: HullRows, until: int) -> Kept:
    """A hull at revision `until`, or at its last one if that is earlier.

    Args:
        reader: reads the rows as of when `hull` was copied.
        hull: the rows of the hull.
        until: the revision.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    if until < hull.oldest:
        raise DamagedError(f"revision {until} of hull {hull.row.name!r} is no longer kept")
    with as_damage(hull):
        kept = newest_snapshot(reader, hull, until)
        rows = batch_rows(reader, hull.between(kept.revision, until))
        _add_records(kept, hull, rows, until)
    return kept


def read_records(reader: Reader, hull: HullRows, after: int) -> list[Record]:
    """The batches of a hull after a revision.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    kept = Kept(revision=after)
    with as_damage(hull):
        rows = batch_rows(reader, hull.between(after, hull.last))
        _add_records(kept, hull, rows, hull.last)
    return kept.records


def read_each(reader: Reader, hulls: Sequence[HullRows]) -> Iterator[Kept]:
    """Hulls at their last revisions, in this order. Those without snapshots share queries: they may be many.

    Raises:
        DamagedError: a row is damaged or missing.
    """
    ids = array("q", (place for hull in hulls if not hull.snapshots for place in hull.ids))
    rows = batch_rows(reader, ids)
    for hull in hulls:
        if hull.snapshots:
            yield read_hull(reader, hull, hull.last)
            continue
        kept = Kept()
        try:
            _add_records(kept, hull, islice(rows, len(hull.ids)), hull.last)
        except UnreadableError as error:
            raise _unreadable(hull, error) from error
        yield kept


def commit_of(reader: Reader, hull: HullRows, revision: int) -> CommitStamp | None:
    """The commit of a revision; None where it is not known, because the row is damaged, or of an earlier format."""
    for first, last, stored, payload, *commit in batch_rows(reader, hull.between(revision - 1, revision)):
        if first <= revision <= last and None not in commit:
            whole = is_whole(stored, payload, hull.row.number, first, last, *commit)
            return CommitStamp(*commit) if whole else None
    for snapshot in hull.snapshots:
        if snapshot.revision == revision:
            kept = snapshot_state(reader, hull.row.number, snapshot)
            return None if kept is None else kept.committed
    return None


def batch_rows(reader: Reader, places: "array[int]") -> Iterator[tuple[Any, ...]]:
    """Of rows of batches, the revisions, the checksum, the payload and the commit."""
    return reader.some("batches", f"first, last, checksum, payload, {commit_columns(reader.version)}", places)


def whole_rows(hull: HullRows, rows: Iterable[tuple[Any, ...]]) -> Iterator[tuple[Any, ...]]:
    """The rows that `batch_rows` has read. Raises DamagedError if one is damaged."""
    return (_whole(hull, row) for row in rows)


def whole_records(hull: HullRows, rows: Iterable[tuple[Any, ...]]) -> Iterator[Record]:
    """The records in rows that `batch_rows` has read. Raises DamagedError for one that is damaged."""
    for first, _, _, payload, *commit in whole_rows(hull, rows):
        yield from batch_records(payload, first, *commit)


def _whole(hull: HullRows, row: tuple[Any, ...]) -> tuple[Any, ...]:
    first, last, stored, payload, *commit = row
    if not is_whole(stored, payload, hull.row.number, first, last, *commit):
        raise DamagedError(f"hull {hull.row.name!r}: revisions {first} to {last} are damaged: restore a backup")
    return row


@contextmanager
def as_damage(hull: HullRows) -> Iterator[None]:
    """Name the hull of a row that the database cannot read."""
    try:
        yield
    except UnreadableError as error:
        raise _unreadable(hull, error) from error


def _unreadable(hull: HullRows, error: UnreadableError) -> DamagedError:
    return DamagedError(f"hull {hull.row.name!r} cannot be read ({error}): restore a backup")


def newest_snapshot(reader: Reader, hull: HullRows, until: int) -> Kept:
    """The newest snapshot of a revision not after `until` that is not damaged; the empty hull where there is none."""
    kept, parts = newest_in_parts(reader, hull, until)
    kept.contents = in_one(parts.parts)
    return kept


def newest_in_parts(reader: Reader, hull: HullRows, until: int) -> tuple[Kept, Parts]:
    """The same without its contents, and these."""
    for snapshot in reversed(hull.snapshots):
        if snapshot.revision <= until:
            found = _snapshot(reader, hull.row.number, snapshot)
            if found is not None:
                return found
    return Kept(), Parts(0, [Contents()])


def snapshot_state(reader: Reader, number: int, snapshot: StoredSnapshot) -> Kept | None:
    """A snapshot without its contents, None if it is damaged."""
    state = _state(reader, number, snapshot)
    return None if state is None else state_from(state)[0]


def _state(reader: Reader, number: int, snapshot: StoredSnapshot) -> bytes | None:
    keys = snapshot.id, number, snapshot.revision, len(snapshot.chunks)
    row = next(
        reader.some("snapshots", "state, checksum, snapshots.id, hull, revision, chunks", array("q", [snapshot.id])),
        None,
    )
    if row is None or tuple(row[2:]) != keys or checksum(row[0], *keys) != row[1]:
        return None
    state: bytes = row[0]
    return state


def _snapshot(reader: Reader, number: int, snapshot: StoredSnapshot) -> tuple[Kept, Parts] | None:
    """A snapshot without its contents, and these; None if it is damaged."""
    state = _state(reader, number, snapshot)
    if state is None:
        return None
    kept, decode_chunk = state_from(state)
    parts = []
    found = reader.some("chunks", "number, checksum, points", array("q", snapshot.chunks))
    for expected, (number, stored, data) in enumerate(found):
        if number != expected or checksum(data, snapshot.id, number) != stored:
            return None
        parts.append(decode_chunk(data))
    if len(parts) != len(snapshot.chunks):
        return None
    kept.revision = snapshot.revision
    held = [part.held for part in parts if part.held is not None]
    if len(held) > 1:
        parts = [*(part for part in parts if part.held is None), Contents(held=held_in_one(held))]
    return kept, Parts(sum(map(len, parts)), parts)


def _add_records(kept: Kept, hull: HullRows, rows: Iterable[tuple[Any, ...]], until: int) -> None:
    """Add the revisions after the snapshot, up to `until` or the last one; `rows` are those that have them."""
    expected = kept.revision
    for record in whole_records(hull, rows):
        if not kept.revision < record.revision <= until:
            continue
        expected += 1
        if record.revision != expected:
            raise DamagedError(f"hull {hull.row.name!r}: revision {expected} is missing: restore a backup")
        kept.records.append(record)
    if expected < min(until, hull.last):
        raise DamagedError(f"hull {hull.row.name!r}: revision {expected + 1} is missing: restore a backup")
