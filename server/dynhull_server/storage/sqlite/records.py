"""Batches as bytes: what one row of the journal holds."""

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]

# Inserts, deletes, the batch's number among its producer's, length of the producer's name, whether lenient.
HEADER = struct.Struct("<IIQHB")
POINT_BYTES = 16


@dataclass(frozen=True, slots=True)
class Record:
    """One batch, as applied.

    Attributes:
        revision: the revision that it made.
        inserts: (n, 2) points inserted.
        deletes: (m, 2) points deleted.
        producer: who wrote it; empty for a writer without a name.
        sequence: the batch's number among the producer's.
        lenient: whether some of the deletes were passed over, because the point was not there.
    """

    revision: int
    inserts: Points
    deletes: Points
    producer: str = ""
    sequence: int = 0
    lenient: bool = False


def encode(records: Iterable[Record]) -> bytes:
    """Records of consecutive revisions as one payload."""
    parts = []
    for record in records:
        producer = record.producer.encode()
        sizes = len(record.inserts), len(record.deletes)
        parts.append(HEADER.pack(*sizes, record.sequence, len(producer), record.lenient))
        parts += [producer, _bytes(record.inserts), _bytes(record.deletes)]
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
        inserted, deleted = _points(payload[start:middle]), _points(payload[middle:end])
        yield Record(revision, inserted, deleted, producer, sequence, bool(lenient))
        position, revision = end, revision + 1


def checksum(payload: bytes, *keys: int) -> int:
    """CRC-32 of a payload and of where it belongs, so that a row in another's place is noticed too."""
    return zlib.crc32(struct.pack(f"<{len(keys)}q", *keys), zlib.crc32(payload))


def _bytes(points: Points) -> bytes:
    return np.ascontiguousarray(points, dtype="<f8").tobytes()


def _points(data: bytes) -> Points:
    return np.frombuffer(data, dtype="<f8").reshape(-1, 2).astype(np.float64, copy=False)
