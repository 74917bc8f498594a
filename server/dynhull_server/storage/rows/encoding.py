"""Records as bytes, and the checksums of rows.

A payload is a sequence of records: a header, the name of the producer, the hull's clock, its centre, the columns of
the rows, what the root of a hull over shards knows of these, and what made the revision. What is optional has a flag in
the header. Records of the formats 1 and 2 have no flags but LENIENT. Before format 5 the further flags were the upper
byte of the length of the name, which was always 0.
"""

import struct
import zlib
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ...state.records import Cause, Condition, Division, Expiry, KeyRows, PointRows, Record, Rows, Shares, Tally
from .columns import Cursor, accuracy_bytes, key_bytes, point_bytes, time_bytes
from .held_rows import change_bytes, take_change

# The number of points inserted, keys put or points expired; that of points deleted or keys removed; the sequence
# number; the length of the producer's name; the further flags; the flags.
HEADER = struct.Struct("<IIQBBB")
TIME = struct.Struct("<q")
CENTER = struct.Struct("<dd")
# Whether points have left because of their age, and the number of shards; of each shard its number and its tally.
SHARES = struct.Struct("<?H")
TALLY = struct.Struct("<HQQQ")
# The number of shards from then on, and the generation of this division.
DIVISION = struct.Struct("<HQ")
MOST_NUMBERS = 8  # in the key of a row
NUMBERS = [struct.Struct(f"<{count}q") for count in range(MOST_NUMBERS + 1)]

HAS_CENTER, MAY_SKIP = 1, 2  # further flags
HAS_HELD = 4  # since format 8
HAS_SHARES = 8  # since format 9
HAS_DIVISION = 16  # since format 10
HAS_CAUSE = 32  # since format 11
HAS_ACCURACIES = 64  # since format 13
FURTHER = HAS_CENTER | MAY_SKIP | HAS_HELD | HAS_SHARES | HAS_DIVISION | HAS_CAUSE | HAS_ACCURACIES
CAUSES: dict[Cause, bytes] = {
    "batch": b"\1",
    "expiry": b"\2",
    "recenter": b"\3",
    "quarantine": b"\4",
    "division": b"\5",
    "epoch": b"\6",
}
CAUSE_OF = {code: cause for cause, code in CAUSES.items()}
LENIENT, HAS_TIMES, HAS_DEADLINES, HAS_CLOCK = 1, 2, 4, 8
KINDS = 48  # the flags with the kind of the rows
POINTS, STRINGS, INTEGERS, EXPIRY = 0, 16, 32, 48
CONDITIONS: dict[Condition | None, int] = {None: 0, "absent": 64, "present": 128}
CONDITION_OF = {flags: condition for condition, flags in CONDITIONS.items()}
CONDITION_FLAGS = 192


def encode(records: Iterable[Record]) -> bytes:
    """Records of consecutive revisions as one payload. O(size of the payload)."""
    parts = []
    for record in records:
        producer = record.producer.encode()
        added, removed, flags, columns = _encoded(record.rows)
        further = MAY_SKIP if record.may_skip else 0
        if record.center is not None:
            further |= HAS_CENTER
            columns.insert(0, CENTER.pack(*record.center))
        if isinstance(record.rows, KeyRows) and record.rows.accuracies is not None:
            further |= HAS_ACCURACIES
            columns.append(accuracy_bytes(record.rows.accuracies))
        if isinstance(record.rows, KeyRows) and record.rows.held is not None:
            further |= HAS_HELD
            columns.append(change_bytes(record.rows.held))
        if record.shares is not None:
            further |= HAS_SHARES
            columns.append(_share_bytes(record.shares))
            if record.shares.division is not None:
                further |= HAS_DIVISION
                columns.append(DIVISION.pack(record.shares.division.shards, record.shares.division.generation))
        if record.cause is not None:
            further |= HAS_CAUSE
            columns.append(CAUSES[record.cause])
        if record.clock is not None:
            flags |= HAS_CLOCK
            columns.insert(0, TIME.pack(record.clock))
        parts += [HEADER.pack(added, removed, record.sequence, len(producer), further, flags), producer, *columns]
    return b"".join(parts)


def decode(payload: bytes, revision: int) -> Iterator[Record]:
    """The records of a payload; `revision` is that of the first. ValueError if the bytes are no records."""
    cursor = Cursor(payload)
    while not cursor.at_end:
        added, removed, sequence, name, further, flags = HEADER.unpack(cursor.take(HEADER.size))
        if further > FURTHER:
            raise ValueError(f"a record has the unknown further flags {further:#x}")
        producer = str(cursor.take(name), "utf-8")
        clock = _time(cursor) if flags & HAS_CLOCK else None
        center = CENTER.unpack(cursor.take(CENTER.size)) if further & HAS_CENTER else None
        rows = _decoded(cursor, added, removed, flags)
        if further & HAS_ACCURACIES:
            if not isinstance(rows, KeyRows):
                raise ValueError("points without keys have accuracies")
            rows = replace(rows, accuracies=cursor.accuracies(added))
        if further & HAS_HELD:
            if not isinstance(rows, KeyRows):
                raise ValueError("points without keys are in quarantine")
            rows.held = take_change(cursor, strings=flags & KINDS == STRINGS)
        shares = _shares(cursor, divides=bool(further & HAS_DIVISION)) if further & HAS_SHARES else None
        cause = _cause(cursor) if further & HAS_CAUSE else None
        yield Record(revision, rows, producer, sequence, clock, center, bool(further & MAY_SKIP), shares, cause)
        revision += 1


def checksum(payload: bytes, *keys: int) -> int:
    """CRC-32 of a payload and its keys, so that a row in the place of another is noticed too."""
    return zlib.crc32(NUMBERS[len(keys)].pack(*keys), zlib.crc32(payload))


def weight(stored: int, *keys: int) -> int:
    """The contribution of a row of batches to the sum of the totals: CRC-32 of its stored checksum and its keys."""
    return checksum(b"", *keys, stored)


def _encoded(rows: Rows) -> tuple[int, int, int, list[bytes]]:
    """The two numbers of rows, the flags and the columns."""
    if isinstance(rows, PointRows):
        inserts, deletes = rows.inserts, rows.deletes
        flags = LENIENT if rows.lenient else 0
        columns = [point_bytes(inserts), point_bytes(deletes)]
        if rows.times is not None:
            flags |= HAS_TIMES
            columns.append(time_bytes(rows.times))
        return len(inserts), len(deletes), flags, columns
    if isinstance(rows, KeyRows):
        return len(rows.keys), len(rows.removes), *_encoded_keys(rows)
    if rows.until is None:
        return rows.points, 0, EXPIRY, []
    return rows.points, 0, EXPIRY | HAS_TIMES, [TIME.pack(rows.until)]


def _encoded_keys(rows: KeyRows) -> tuple[int, list[bytes]]:
    strings = not isinstance(rows.keys, np.ndarray)
    if isinstance(rows.removes, np.ndarray) == strings:
        raise TypeError("the keys to put and to remove are of different kinds")
    flags = (STRINGS if strings else INTEGERS) | CONDITIONS[rows.condition]
    columns = [key_bytes(rows.keys), key_bytes(rows.removes), point_bytes(rows.points)]
    if rows.times is not None:
        flags |= HAS_TIMES
        columns.append(time_bytes(rows.times))
    if rows.deadlines is not None:
        flags |= HAS_DEADLINES
        columns.append(time_bytes(rows.deadlines))
    return flags, columns


def _decoded(cursor: Cursor, added: int, removed: int, flags: int) -> Rows:
    kind = flags & KINDS
    if kind == EXPIRY:
        return Expiry(_time(cursor) if flags & HAS_TIMES else None, added)
    if kind == POINTS:
        inserts, deletes = cursor.points(added), cursor.points(removed)
        times = cursor.times(added) if flags & HAS_TIMES else None
        return PointRows(inserts, deletes, bool(flags & LENIENT), times)
    read = cursor.strings if kind == STRINGS else cursor.integers
    keys, removes, points = read(added), read(removed), cursor.points(added)
    times = cursor.times(added) if flags & HAS_TIMES else None
    deadlines = cursor.times(added) if flags & HAS_DEADLINES else None
    if flags & CONDITION_FLAGS not in CONDITION_OF:
        raise ValueError(f"a record has the unknown flags {flags:#x}")
    return KeyRows(keys, points, removes, times, deadlines, CONDITION_OF[flags & CONDITION_FLAGS])


def _share_bytes(shares: Shares) -> bytes:
    tallies = [TALLY.pack(shard, each.step, each.points, each.distinct) for shard, each in shares.tallies.items()]
    return SHARES.pack(shares.expiry, len(tallies)) + b"".join(tallies)


def _shares(cursor: Cursor, *, divides: bool) -> Shares:
    expiry, count = SHARES.unpack(cursor.take(SHARES.size))
    found = [TALLY.unpack(cursor.take(TALLY.size)) for _ in range(count)]
    division = Division(*DIVISION.unpack(cursor.take(DIVISION.size))) if divides else None
    return Shares({shard: Tally(*numbers) for shard, *numbers in found}, expiry, division)


def _cause(cursor: Cursor) -> Cause:
    code = bytes(cursor.take(1))
    if code not in CAUSE_OF:
        raise ValueError(f"a record has the unknown cause {code.hex()}")
    return CAUSE_OF[code]


def _time(cursor: Cursor) -> int:
    (time,) = TIME.unpack(cursor.take(TIME.size))
    return int(time)
