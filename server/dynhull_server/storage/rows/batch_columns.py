"""Rows of batches as columns, without an object for each batch: in C++ where they only put and remove."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from dynhull.keys import PackedKeys

from ...compiled import native
from ...state.records import NO_TIME, Identity, Keys
from ..segments.columns import NONE, ROWS, SegmentColumns, columns_of, joined
from .batch_rows import batch_records
from .encoding import INTEGERS, POINTS, STRINGS

KINDS = {"multiset": POINTS, "str": STRINGS, "int": INTEGERS}

# First and last revision, checksum, payload, number and time of the commit.
BatchRow = tuple[Any, ...]


def columns_of_rows(rows: Sequence[BatchRow], identity: Identity, wanted: Keys | None = None) -> SegmentColumns:
    """The batches in rows that have their checksums, one after the other. ValueError if the payloads have none.

    Where keys are wanted, rows of others may be missing: most of them, as a rule.
    """
    parts: list[SegmentColumns] = []
    payloads = [row[3] for row in rows]
    words = None if wanted is None else _words(wanted)
    at = 0
    while at < len(rows):
        count = 0
        if native is not None:
            count, part = _plain(rows, native.plain_batches(payloads, at, KINDS[identity], words), at, identity)
        if not count:
            count, part = 1, columns_of(_records(rows[at]), identity)
        parts.append(part)
        at += count
    return joined(parts, identity)


def _records(row: BatchRow) -> Iterable[Any]:
    first, _, _, payload, *commit = row
    return batch_records(payload, first, *commit)


def _plain(
    rows: Sequence[BatchRow], found: tuple[bytes, ...], at: int, identity: Identity
) -> tuple[int, SegmentColumns]:
    """The rows from a place on whose batches only put and remove, as columns; and their number."""
    records, counts, ops = _column(found[0], np.int32), _column(found[3], np.int32), _column(found[4], np.int8)
    some = rows[at : at + len(records)]
    commits = np.array([[NO_TIME, NO_TIME] if None in row[4:] else row[4:] for row in some], np.int64).reshape(-1, 2)
    first = np.array([row[0] for row in some], np.int64)
    starts = np.cumsum(records) - records
    revision = np.repeat(first - starts, records) + np.arange(len(counts))
    of_row = np.repeat(np.arange(len(some)), np.add.reduceat(counts, starts) if len(some) else records)
    ends = np.cumsum(counts)
    return len(some), SegmentColumns(
        identity,
        np.repeat(revision, counts),
        commits[of_row, 0],
        commits[of_row, 1],
        np.repeat(_column(found[2], np.int8), counts),
        np.repeat(_column(found[1], np.int64), counts),
        np.arange(len(ops)) - np.repeat(ends - counts, counts),
        np.full(len(ops), ROWS, np.int8),
        ops,
        (ops != NONE) & (identity != "multiset"),
        keys_of(found[5], found[6], identity),
        _column(found[7], np.float64).reshape(-1, 2),
        _column(found[8], np.int64),
        _column(found[9], np.int64),
        np.zeros(len(ops)),  # batches with accuracies are none of these
        [None] * len(ops),
    )


def _words(keys: Keys) -> list[bytes]:
    """Each key as the bytes that the journal has."""
    if isinstance(keys, PackedKeys):
        return [key.encode() for key in keys]
    return [int(key).to_bytes(8, "little") for key in keys]


def keys_of(lengths: bytes, data: bytes, identity: Identity) -> Keys:
    """Keys from C++, where those that are integers have no lengths."""
    return _column(data, np.uint64) if identity == "int" else PackedKeys(lengths, data)


def _column(data: bytes, kind: Any) -> Any:
    return np.frombuffer(data, kind)
