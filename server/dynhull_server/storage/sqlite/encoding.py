"""Rows as bytes, and their checksums."""

import struct
import zlib
from collections.abc import Iterable, Iterator

import numpy as np

from dynhull.arrays import Points

from ...state.records import HullRow, PointRows, Record

# The numbers of inserts and of deletes, the sequence number, the length of the producer's name, whether lenient.
HEADER = struct.Struct("<IIQHB")
POINT_BYTES = 16


def encode(records: Iterable[Record]) -> bytes:
    """Records of consecutive revisions as one payload."""
    parts = []
    for record in records:
        producer = record.producer.encode()
        rows = record.rows
        assert isinstance(rows, PointRows)
        sizes = len(rows.inserts), len(rows.deletes)
        parts.append(HEADER.pack(*sizes, record.sequence, len(producer), rows.lenient))
        parts += [producer, point_bytes(rows.inserts), point_bytes(rows.deletes)]
    return b"".join(parts)


def decode(payload: bytes, revision: int) -> Iterator[Record]:
    """The records of a payload; `revision` is that of the first. ValueError if the bytes are no records."""
    position = 0
    while position < len(payload):
        if position + HEADER.size > len(payload):
            raise ValueError(f"a header is cut short at byte {position}")
        inserts, deletes, sequence, name, lenient = HEADER.unpack_from(payload, position)
        start = position + HEADER.size + name
        middle = start + inserts * POINT_BYTES
        end = middle + deletes * POINT_BYTES
        if end > len(payload):
            raise ValueError(f"a record is cut short at byte {position}")
        producer = payload[position + HEADER.size : start].decode()
        inserted, deleted = points_from(payload[start:middle]), points_from(payload[middle:end])
        yield Record(revision, PointRows(inserted, deleted, bool(lenient)), producer, sequence)
        position, revision = end, revision + 1


def checksum(payload: bytes, *keys: int) -> int:
    """CRC-32 of a payload and its keys, so that a row in the place of another is noticed too."""
    return zlib.crc32(struct.pack(f"<{len(keys)}q", *keys), zlib.crc32(payload))


def weight(stored: int, *keys: int) -> int:
    """The contribution of a row of batches to the sum of the totals: CRC-32 of its stored checksum and its keys."""
    return checksum(b"", *keys, stored)


def hull_checksum(row: HullRow) -> int:
    """CRC-32 of the row of a hull."""
    text = f"{row.name}\n{row.uid}".encode()
    return checksum(text + struct.pack("<d", row.created), row.number, row.settings.max_points)


def point_bytes(points: Points) -> bytes:
    """(n, 2) points as 16 n bytes."""
    return np.ascontiguousarray(points, dtype="<f8").tobytes()


def points_from(data: bytes) -> Points:
    """The inverse of `point_bytes`."""
    return np.frombuffer(data, dtype="<f8").reshape(-1, 2).astype(np.float64, copy=False)
