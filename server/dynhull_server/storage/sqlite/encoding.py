"""Rows as bytes, and their checksums."""

import struct
import zlib
from collections.abc import Iterable, Iterator

import numpy as np

from dynhull.arrays import Points

from ...state.records import HullRow, Record

# Inserts, deletes, the batch's number among its producer's, length of the producer's name, whether lenient.
HEADER = struct.Struct("<IIQHB")
POINT_BYTES = 16


def encode(records: Iterable[Record]) -> bytes:
    """Records of consecutive revisions as one payload."""
    parts = []
    for record in records:
        producer = record.producer.encode()
        sizes = len(record.inserts), len(record.deletes)
        parts.append(HEADER.pack(*sizes, record.sequence, len(producer), record.lenient))
        parts += [producer, point_bytes(record.inserts), point_bytes(record.deletes)]
    return b"".join(parts)


def decode(payload: bytes, revision: int) -> Iterator[Record]:
    """The records of a payload, the first of which made `revision`. ValueError where the bytes are no records."""
    position = 0
    while position < len(payload):
        if position + HEADER.size > len(payload):
            raise ValueError(f"a header is cut at byte {position}")
        inserts, deletes, sequence, name, lenient = HEADER.unpack_from(payload, position)
        start = position + HEADER.size + name
        middle = start + inserts * POINT_BYTES
        end = middle + deletes * POINT_BYTES
        if end > len(payload):
            raise ValueError(f"a record is cut at byte {position}")
        producer = payload[position + HEADER.size : start].decode()
        inserted, deleted = points_from(payload[start:middle]), points_from(payload[middle:end])
        yield Record(revision, inserted, deleted, producer, sequence, bool(lenient))
        position, revision = end, revision + 1


def checksum(payload: bytes, *keys: int) -> int:
    """CRC-32 of a payload and of where it belongs, so that a row in another's place is noticed too."""
    return zlib.crc32(struct.pack(f"<{len(keys)}q", *keys), zlib.crc32(payload))


def weight(stored: int, *keys: int) -> int:
    """What a row of batches adds to the sum of all: of its checksum and of where it belongs, whatever its payload."""
    return checksum(b"", *keys, stored)


def hull_checksum(row: HullRow) -> int:
    """CRC-32 of a hull's row."""
    text = f"{row.name}\n{row.uid}".encode()
    return checksum(text + struct.pack("<d", row.created), row.number, row.max_points)


def point_bytes(points: Points) -> bytes:
    """(n, 2) points as 16 n bytes."""
    return np.ascontiguousarray(points, dtype="<f8").tobytes()


def points_from(data: bytes) -> Points:
    """The points of `point_bytes`."""
    return np.frombuffer(data, dtype="<f8").reshape(-1, 2).astype(np.float64, copy=False)
