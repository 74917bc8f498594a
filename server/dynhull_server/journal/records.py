"""Batches as bytes: what one row of the journal holds."""

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]

# Inserts, deletes, the batch's number among its producer's, length of the producer's name.
HEADER = struct.Struct("<IIQH")
POINT_BYTES = 16


@dataclass(frozen=True, slots=True)
class Record:
    """One batch, as applied.

    Attributes:
        revision: the revision that it made.
        inserts: (n, 2) points inserted.
        deletes: (m, 2) points deleted; points that were not there are passed over, as they were the first time.
        producer: who wrote it; empty for a writer without a name.
        sequence: the batch's number among the producer's.
    """

    revision: int
    inserts: Points
    deletes: Points
    producer: str = ""
    sequence: int = 0


def encode(records: Iterable[Record]) -> bytes:
    """Records of consecutive revisions as one payload."""
    parts = []
    for record in records:
        producer = record.producer.encode()
        parts.append(HEADER.pack(len(record.inserts), len(record.deletes), record.sequence, len(producer)))
        parts += [producer, _bytes(record.inserts), _bytes(record.deletes)]
    return b"".join(parts)


def decode(payload: bytes, revision: int) -> Iterator[Record]:
    """The records of a payload, the first of which made `revision`. ValueError where the bytes are no records."""
    position = 0
    while position < len(payload):
        if position + HEADER.size > len(payload):
            raise ValueError(f"a header is cut at byte {position}")
        inserts, deletes, sequence, name = HEADER.unpack_from(payload, position)
        start = position + HEADER.size + name
        middle = start + inserts * POINT_BYTES
        end = middle + deletes * POINT_BYTES
        if end > len(payload):
            raise ValueError(f"a record is cut at byte {position}")
        producer = payload[position + HEADER.size : start].decode()
        yield Record(revision, _points(payload[start:middle]), _points(payload[middle:end]), producer, sequence)
        position, revision = end, revision + 1


def checksum(payload: bytes, *keys: int) -> int:
    """CRC-32 of a payload and of where it belongs, so that a row in another's place is noticed too."""
    return zlib.crc32(struct.pack(f"<{len(keys)}q", *keys), zlib.crc32(payload))


def _bytes(points: Points) -> bytes:
    return np.ascontiguousarray(points, dtype="<f8").tobytes()


def _points(data: bytes) -> Points:
    return np.frombuffer(data, dtype="<f8").reshape(-1, 2).astype(np.float64, copy=False)
