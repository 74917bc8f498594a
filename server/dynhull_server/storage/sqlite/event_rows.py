"""Events of fences as bytes, and who is inside.

A payload is a sequence of events. Numbers that grow from event to event (times, revisions) are stored as differences,
in as many bytes as they need; of a previous position only the bytes that differ from the position.
"""

import struct
from collections.abc import Iterable, Iterator

from dynhull.keys import PackedKeys

from ...state.fences.records import Delay, EventType, FenceEvent, Inside, Key, Members, Position, Subject
from ...state.records import NO_TIME, Keys
from .columns import Cursor, key_bytes, time_bytes

POSITION = struct.Struct(">dd")
PAIR = struct.Struct(">QQ")
DISTANCE = struct.Struct("<d")
INTEGER = struct.Struct("<Q")

# The first byte of an event: its type, and what it has. A distance without bytes of its own is 0.
TYPE_BITS = 15
OF_PAIRS = (EventType.BEGIN, EventType.CEASE)  # they have a distance without a position
HAS_POSITION, HAS_PREVIOUS, HAS_DISTANCE, HAS_EVENT_TIME = 16, 32, 64, 128
# The third byte, after the causes.
NO_KEY, STRING_KEY, INTEGER_KEY = 0, 1, 2
KEY_BITS = 3
HAS_FIRST_TIME, HAS_HULL, HAS_INSIDE = 4, 8, 16
# Of some keys inside: beside their kind, whether their times follow.
HAS_SINCE = 4
ENTERS = 4  # of a delay: beside the kind of its key
SEVEN_BITS, MORE = 127, 128


def encode_events(events: Iterable[FenceEvent], own: str) -> bytes:
    """Events as one payload. `own` is the name of the hull whose keys the fence compares; others are written out."""
    out = bytearray()
    time = subject = area = 0
    for event in events:
        first, third = int(event.type), NO_KEY
        if event.position is not None:
            first |= HAS_POSITION
        if event.previous is not None:
            first |= HAS_PREVIOUS
        if event.distance:
            first |= HAS_DISTANCE
        if event.event_time != NO_TIME:
            first |= HAS_EVENT_TIME
        if event.key is not None:
            third = STRING_KEY if isinstance(event.key, str) else INTEGER_KEY
        if event.first_time != NO_TIME:
            third |= HAS_FIRST_TIME
        if event.hull != own:
            third |= HAS_HULL
        if event.inside:
            third |= HAS_INSIDE
        out += bytes((first, event.causes, third))
        _signed(out, event.time - time)
        _signed(out, event.subject_revision - subject)
        _signed(out, event.area_revision - area)
        time, subject, area = event.time, event.subject_revision, event.area_revision
        if event.hull != own:
            _text(out, event.hull)
        if isinstance(event.key, str):
            _text(out, event.key)
        elif event.key is not None:
            out += INTEGER.pack(event.key)
        if event.position is not None:
            out += POSITION.pack(*event.position)
        if event.previous is not None:
            _differing(out, event.position, event.previous)
        if event.distance:
            out += DISTANCE.pack(event.distance)
        if event.event_time != NO_TIME:
            _signed(out, event.event_time - time)
        if event.first_time != NO_TIME:
            _signed(out, event.first_time - time)
        if event.inside:
            _members(out, event.inside)
    return bytes(out)


def decode_events(payload: bytes, sequence: int, own: str) -> Iterator[FenceEvent]:
    """The events of a payload; `sequence` is that of the first. ValueError if the bytes are no events."""
    cursor = Cursor(payload)
    time = subject = area = 0
    while not cursor.at_end:
        first, causes, third = cursor.take(3)
        time += _read_signed(cursor)
        subject += _read_signed(cursor)
        area += _read_signed(cursor)
        hull = _read_text(cursor) if third & HAS_HULL else own
        key: Key | None = None
        if third & KEY_BITS == STRING_KEY:
            key = _read_text(cursor)
        elif third & KEY_BITS == INTEGER_KEY:
            (key,) = INTEGER.unpack(cursor.take(INTEGER.size))
        kind = EventType(first & TYPE_BITS)
        position = previous = None
        distance = 0.0 if first & HAS_POSITION or kind in OF_PAIRS else None
        if first & HAS_POSITION:
            position = POSITION.unpack(cursor.take(POSITION.size))
        if first & HAS_PREVIOUS:
            previous = _read_differing(cursor, position)
        if first & HAS_DISTANCE:
            (distance,) = DISTANCE.unpack(cursor.take(DISTANCE.size))
        event_time = time + _read_signed(cursor) if first & HAS_EVENT_TIME else NO_TIME
        first_time = time + _read_signed(cursor) if third & HAS_FIRST_TIME else NO_TIME
        inside = _read_members(cursor) if third & HAS_INSIDE else ()
        yield FenceEvent(
            sequence,
            kind,
            causes,
            hull,
            key,
            subject,
            area,
            position,
            previous,
            distance,
            event_time,
            time,
            first_time,
            inside,
        )
        sequence += 1


def encode_inside(members: Iterable[Members], time: int) -> bytes:
    """Who is inside, as bytes, and the time of the last event."""
    out = bytearray()
    _members(out, tuple(members))
    if time != NO_TIME:
        _signed(out, time)
    return bytes(out)


def decode_inside(data: bytes, sequence: int) -> Inside:
    """The inverse of `encode_inside`."""
    cursor = Cursor(data)
    members = _read_members(cursor)
    return Inside(sequence, members, NO_TIME if cursor.at_end else _read_signed(cursor))


def encode_delay(subject: Subject, delay: Delay) -> bytes:
    """The delay of a subject, as bytes."""
    hull, key = subject
    kind = STRING_KEY if isinstance(key, str) else INTEGER_KEY
    out = bytearray((kind | ENTERS * delay.enters, delay.causes))
    _text(out, hull)
    if isinstance(key, str):
        _text(out, key)
    else:
        out += INTEGER.pack(key)
    _signed(out, delay.since)
    _unsigned(out, delay.reports)
    return bytes(out)


def decode_delay(data: bytes) -> tuple[Subject, Delay]:
    """The inverse of `encode_delay`. ValueError if the bytes are no delay."""
    cursor = Cursor(data)
    kind, causes = cursor.take(2)
    hull = _read_text(cursor)
    key: Key
    if kind & KEY_BITS == STRING_KEY:
        key = _read_text(cursor)
    else:
        (key,) = INTEGER.unpack(cursor.take(INTEGER.size))
    since, reports = _read_signed(cursor), _read_unsigned(cursor)
    if not cursor.at_end:
        raise ValueError("bytes follow the delay")
    return (hull, key), Delay(kind & ENTERS != 0, since, reports, causes)


def _members(out: bytearray, members: tuple[Members, ...]) -> None:
    _unsigned(out, len(members))
    for each in members:
        _text(out, each.hull)
        _unsigned(out, each.revision)
        kind = STRING_KEY if isinstance(each.keys, PackedKeys) else INTEGER_KEY
        out.append(kind if each.since is None else kind | HAS_SINCE)
        _unsigned(out, len(each.keys))
        out += key_bytes(each.keys)
        if each.since is not None:
            out += time_bytes(each.since)


def _read_members(cursor: Cursor) -> tuple[Members, ...]:
    members = []
    for _ in range(_read_unsigned(cursor)):
        hull, revision = _read_text(cursor), _read_unsigned(cursor)
        (kind,) = cursor.take(1)
        count = _read_unsigned(cursor)
        keys: Keys = cursor.strings(count) if kind & KEY_BITS == STRING_KEY else cursor.integers(count)
        members.append(Members(hull, keys, revision, cursor.times(count) if kind & HAS_SINCE else None))
    return tuple(members)


def _differing(out: bytearray, position: Position | None, previous: Position) -> None:
    """The bits of two doubles that differ from two others, without the bytes that are the same at their beginning."""
    x, y = _bits(previous, position)
    lengths = [(each.bit_length() + 7) // 8 for each in (x, y)]
    out.append(lengths[0] << 4 | lengths[1])
    for each, length in zip((x, y), lengths, strict=True):
        out += each.to_bytes(length)


def _read_differing(cursor: Cursor, position: Position | None) -> Position:
    (lengths,) = cursor.take(1)
    x = int.from_bytes(cursor.take(lengths >> 4))
    y = int.from_bytes(cursor.take(lengths & 15))
    here = PAIR.unpack(POSITION.pack(*(position or (0.0, 0.0))))
    found: Position = POSITION.unpack(PAIR.pack(here[0] ^ x, here[1] ^ y))
    return found


def _bits(one: Position, other: Position | None) -> tuple[int, int]:
    a, b = (PAIR.unpack(POSITION.pack(*each)) for each in (one, other or (0.0, 0.0)))
    return a[0] ^ b[0], a[1] ^ b[1]


def _text(out: bytearray, text: str) -> None:
    data = text.encode()
    _unsigned(out, len(data))
    out += data


def _read_text(cursor: Cursor) -> str:
    return str(cursor.take(_read_unsigned(cursor)), "utf-8")


def _signed(out: bytearray, number: int) -> None:
    _unsigned(out, number << 1 if number >= 0 else -number << 1 | 1)


def _read_signed(cursor: Cursor) -> int:
    number = _read_unsigned(cursor)
    return -(number >> 1) if number & 1 else number >> 1


def _unsigned(out: bytearray, number: int) -> None:
    while number > SEVEN_BITS:
        out.append(number & SEVEN_BITS | MORE)
        number >>= 7
    out.append(number)


def _read_unsigned(cursor: Cursor) -> int:
    number = shift = 0
    while True:
        (byte,) = cursor.take(1)
        number |= (byte & SEVEN_BITS) << shift
        if byte <= SEVEN_BITS:
            return number
        shift += 7
