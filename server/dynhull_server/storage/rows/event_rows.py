"""Events of fences as bytes, and who is inside.

A payload is a sequence of events. Numbers that grow from event to event (times, revisions) are stored as differences,
in as many bytes as they need; of a previous position only the bytes that differ from the position.
"""

import struct
from collections.abc import Iterable, Iterator

from dynhull.keys import PackedKeys

from ...state.fences.events.format import INTEGER_KEY, STRING_KEY, Mark
from ...state.fences.model.records import (
    AlarmStanding,
    Delay,
    EventType,
    FenceEvent,
    Inside,
    Key,
    Members,
    Position,
    Subject,
)
from ...state.records import NO_TIME, Keys
from .columns import Cursor, key_bytes, time_bytes
from .varints import put_signed, put_text, put_unsigned, take_signed, take_text, take_unsigned

POSITION = struct.Struct(">dd")
PAIR = struct.Struct(">QQ")
DISTANCE = struct.Struct("<d")
INTEGER = struct.Struct("<Q")

OF_PAIRS = (EventType.BEGIN, EventType.CEASE)  # they have a distance without a position
# The third byte, after the causes: beside the kind of the key.
KEY_BITS = 3
HAS_FIRST_TIME, HAS_HULL, HAS_INSIDE = 4, 8, 16
# Of some keys inside: beside their kind, whether their times follow.
HAS_SINCE = 4
ENTERS, HAS_STANDING, IN_DOUBT = 4, 8, 16  # of a delay: beside the kind of its key
STANDING = struct.Struct("<?dqq")  # a standing: whether there was a measure before, that, and two times


def decode_events(payload: bytes, sequence: int, own: str) -> Iterator[FenceEvent]:
    """The events of a payload; `sequence` is that of the first. ValueError if the bytes are no events."""
    cursor = Cursor(payload)
    time = subject = area = 0
    while not cursor.at_end:
        first, causes, third = cursor.take(3)
        time += take_signed(cursor)
        subject += take_signed(cursor)
        area += take_signed(cursor)
        hull = take_text(cursor) if third & HAS_HULL else own
        key: Key | None = None
        if third & KEY_BITS == STRING_KEY:
            key = take_text(cursor)
        elif third & KEY_BITS == INTEGER_KEY:
            (key,) = INTEGER.unpack(cursor.take(INTEGER.size))
        kind = EventType(first & Mark.TYPE)
        position = previous = None
        distance = 0.0 if first & Mark.HAS_POSITION or kind in OF_PAIRS else None
        if first & Mark.HAS_POSITION:
            position = POSITION.unpack(cursor.take(POSITION.size))
        if first & Mark.HAS_PREVIOUS:
            previous = take_differing(cursor, position)
        if first & Mark.HAS_DISTANCE:
            (distance,) = DISTANCE.unpack(cursor.take(DISTANCE.size))
        event_time = time + take_signed(cursor) if first & Mark.HAS_EVENT_TIME else NO_TIME
        first_time = time + take_signed(cursor) if third & HAS_FIRST_TIME else NO_TIME
        inside = take_members(cursor) if third & HAS_INSIDE else ()
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
    put_members(out, tuple(members))
    if time != NO_TIME:
        put_signed(out, time)
    return bytes(out)


def decode_inside(data: bytes, sequence: int) -> Inside:
    """The inverse of `encode_inside`."""
    cursor = Cursor(data)
    members = take_members(cursor)
    return Inside(sequence, members, NO_TIME if cursor.at_end else take_signed(cursor))


def encode_delay(subject: Subject, delay: Delay) -> bytes:
    """The delay of a subject, as bytes."""
    hull, key = subject
    kind = STRING_KEY if isinstance(key, str) else INTEGER_KEY
    standing = delay.standing
    flags = ENTERS * delay.enters | HAS_STANDING * (standing is not None) | IN_DOUBT * delay.doubt
    out = bytearray((kind | flags, delay.causes))
    put_text(out, hull)
    if isinstance(key, str):
        put_text(out, key)
    else:
        out += INTEGER.pack(key)
    put_signed(out, delay.since)
    put_unsigned(out, delay.reports)
    if standing is not None:
        previous = standing.previous
        out += STANDING.pack(previous is not None, previous or 0.0, standing.acknowledged, standing.muted)
    return bytes(out)


def decode_delay(data: bytes) -> tuple[Subject, Delay]:
    """The inverse of `encode_delay`. ValueError if the bytes are no delay."""
    cursor = Cursor(data)
    kind, causes = cursor.take(2)
    hull = take_text(cursor)
    key: Key
    if kind & KEY_BITS == STRING_KEY:
        key = take_text(cursor)
    else:
        (key,) = INTEGER.unpack(cursor.take(INTEGER.size))
    since, reports = take_signed(cursor), take_unsigned(cursor)
    standing = None
    if kind & HAS_STANDING:
        there, previous, *times = STANDING.unpack(cursor.take(STANDING.size))
        standing = AlarmStanding(previous if there else None, *times)
    if not cursor.at_end:
        raise ValueError("bytes follow the delay")
    return (hull, key), Delay(kind & ENTERS != 0, since, reports, causes, standing, kind & IN_DOUBT != 0)


def put_members(out: bytearray, members: tuple[Members, ...]) -> None:
    """Append subjects that were inside."""
    put_unsigned(out, len(members))
    for each in members:
        put_text(out, each.hull)
        put_unsigned(out, each.revision)
        kind = STRING_KEY if isinstance(each.keys, PackedKeys) else INTEGER_KEY
        out.append(kind if each.since is None else kind | HAS_SINCE)
        put_unsigned(out, len(each.keys))
        out += key_bytes(each.keys)
        if each.since is not None:
            out += time_bytes(each.since)


def take_members(cursor: Cursor) -> tuple[Members, ...]:
    """Read such subjects."""
    members = []
    for _ in range(take_unsigned(cursor)):
        hull, revision = take_text(cursor), take_unsigned(cursor)
        (kind,) = cursor.take(1)
        count = take_unsigned(cursor)
        keys: Keys = cursor.strings(count) if kind & KEY_BITS == STRING_KEY else cursor.integers(count)
        members.append(Members(hull, keys, revision, cursor.times(count) if kind & HAS_SINCE else None))
    return tuple(members)


def put_differing(out: bytearray, position: Position, other: Position | None) -> None:
    """Append the bytes in which a position differs from another one."""
    differing = [each ^ its for each, its in zip(_bits(position), _bits(other), strict=True)]
    x, y = ((word.bit_length() + 7) // 8 for word in differing)
    out.append(x << 4 | y)
    out += differing[0].to_bytes(x) + differing[1].to_bytes(y)


def take_differing(cursor: Cursor, other: Position | None) -> Position:
    """The inverse of `put_differing`."""
    (lengths,) = cursor.take(1)
    x = int.from_bytes(cursor.take(lengths >> 4))
    y = int.from_bytes(cursor.take(lengths & 15))
    here = _bits(other)
    found: Position = POSITION.unpack(PAIR.pack(here[0] ^ x, here[1] ^ y))
    return found


def _bits(position: Position | None) -> tuple[int, int]:
    bits: tuple[int, int] = PAIR.unpack(POSITION.pack(*(position or (0.0, 0.0))))
    return bits
