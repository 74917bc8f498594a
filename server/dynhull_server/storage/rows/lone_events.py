"""An event that is alone in its row as bytes, since format 8: nothing is stored that follows from the rest.

Before that, a row with one event had the form of those with many: `event_blocks.py`.
"""

from collections.abc import Callable

from ...state.fences.events.format import NEAR, PLACES, LoneFlag, Mark
from ...state.fences.model.records import Cause, EventType, FenceEvent, Key, Origin, Position
from ...state.records import NO_TIME
from .columns import Cursor
from .event_positions import as_decimal
from .event_rows import (
    DISTANCE,
    INTEGER,
    OF_PAIRS,
    POSITION,
    put_differing,
    put_members,
    take_differing,
    take_members,
)
from .varints import put_signed, put_text, put_unsigned, take_signed, take_text, take_unsigned

# The first byte, which for many events is their number.
LONE = b"\0"
HAS_INSIDE, HAS_ORIGIN = 1, 2  # a further byte, of few events

Decimals = tuple[int, int]


def encode_lone(number: int, event: FenceEvent, *, own: bool) -> bytes:
    """An event as bytes.

    Args:
        number: the number of its fence.
        event: the event.
        own: whether its hull is the one whose keys the fence compares, and so is left out.
    """
    here, before = _decimal(event.position), _decimal(event.previous)
    decimals = (here is None) == (event.position is None) and (before is None) == (event.previous is None)
    flags = LoneFlag.HAS_HULL * (not own) | LoneFlag.HAS_AREA * (event.area_revision != 0)
    flags |= LoneFlag.DECIMALS * decimals | LoneFlag.HAS_FIRST_TIME * (event.first_time != NO_TIME)
    flags |= LoneFlag.HAS_CAUSES * (event.causes != Cause.MOVED)
    more = HAS_INSIDE * bool(event.inside) | HAS_ORIGIN * (event.origin is not None)
    flags |= LoneFlag.HAS_MORE * (more != 0)
    flags |= LoneFlag.STRING_KEY * isinstance(event.key, str) | LoneFlag.INTEGER_KEY * isinstance(event.key, int)
    mark = event.type | Mark.HAS_POSITION * (event.position is not None)
    mark |= Mark.HAS_PREVIOUS * (event.previous is not None)
    mark |= Mark.HAS_DISTANCE * bool(event.distance) | Mark.HAS_EVENT_TIME * (event.event_time != NO_TIME)
    out = bytearray(LONE)
    out.append(flags)
    for count in (number, event.sequence):
        put_unsigned(out, count)
    out.append(mark)
    if event.causes != Cause.MOVED:
        out.append(event.causes)
    put_unsigned(out, event.subject_revision)
    put_signed(out, event.time - NEAR)
    if event.area_revision:
        put_unsigned(out, event.area_revision)
    if not own:
        put_text(out, event.hull)
    if decimals:
        for place in (here, _minus(before, here)):
            for coordinate in place or ():
                put_signed(out, coordinate)
    else:
        if event.position is not None:
            out += POSITION.pack(*event.position)
        if event.previous is not None:
            put_differing(out, event.previous, event.position)
    if event.distance:
        out += DISTANCE.pack(event.distance)
    for time in (event.event_time, event.first_time):
        if time != NO_TIME:
            put_signed(out, time - event.time)
    if more:
        out.append(more)
    if event.inside:
        put_members(out, event.inside)
    if event.origin is not None:
        put_text(out, event.origin.hull)
        put_unsigned(out, event.origin.revision)
    if event.key is not None:  # last, so that its length follows
        out += event.key.encode() if isinstance(event.key, str) else INTEGER.pack(event.key)
    return bytes(out)


def lone_run(payload: bytes) -> tuple[int, int]:
    """The number of the fence of an event, and its sequence. ValueError if the bytes are no event."""
    cursor = Cursor(payload)
    cursor.take(2)
    return take_unsigned(cursor), take_unsigned(cursor)


def decode_lone(payload: bytes, own: Callable[[int], str]) -> tuple[int, FenceEvent]:
    """The inverse of `encode_lone`.

    Args:
        payload: the bytes.
        own: the name of the hull whose keys a fence compares, by its number.

    Raises:
        ValueError: the bytes are no event.
    """
    cursor = Cursor(payload)
    _, flags = cursor.take(2)
    number, sequence = take_unsigned(cursor), take_unsigned(cursor)
    (mark,) = cursor.take(1)
    (causes,) = cursor.take(1) if flags & LoneFlag.HAS_CAUSES else (Cause.MOVED.value,)
    revision, time = take_unsigned(cursor), take_signed(cursor) + NEAR
    area_revision = take_unsigned(cursor) if flags & LoneFlag.HAS_AREA else 0
    hull = take_text(cursor) if flags & LoneFlag.HAS_HULL else own(number)
    position = previous = None
    if flags & LoneFlag.DECIMALS:
        here = _take_decimal(cursor) if mark & Mark.HAS_POSITION else None
        position = _position(here)
        if mark & Mark.HAS_PREVIOUS:
            x, y = _take_decimal(cursor)
            previous = _position((x + here[0], y + here[1]) if here else (x, y))
    else:
        if mark & Mark.HAS_POSITION:
            position = POSITION.unpack(cursor.take(POSITION.size))
        if mark & Mark.HAS_PREVIOUS:
            previous = take_differing(cursor, position)
    kind = EventType(mark & Mark.TYPE)
    distance = 0.0 if mark & Mark.HAS_POSITION or kind in OF_PAIRS else None
    if mark & Mark.HAS_DISTANCE:
        (distance,) = DISTANCE.unpack(cursor.take(DISTANCE.size))
    event_time = time + take_signed(cursor) if mark & Mark.HAS_EVENT_TIME else NO_TIME
    first_time = time + take_signed(cursor) if flags & LoneFlag.HAS_FIRST_TIME else NO_TIME
    (more,) = cursor.take(1) if flags & LoneFlag.HAS_MORE else (0,)
    inside = take_members(cursor) if more & HAS_INSIDE else ()
    origin = Origin(take_text(cursor), take_unsigned(cursor)) if more & HAS_ORIGIN else None
    rest = cursor.take(len(payload) - cursor.position)
    key: Key | None = None
    if flags & LoneFlag.STRING_KEY:
        key = str(rest, "utf-8")
    elif flags & LoneFlag.INTEGER_KEY:
        if len(rest) != INTEGER.size:
            raise ValueError(f"an integer key of {len(rest)} bytes")
        (key,) = INTEGER.unpack(rest)
    elif rest:
        raise ValueError("bytes follow the event")
    return number, FenceEvent(
        sequence,
        kind,
        causes,
        hull,
        key,
        revision,
        area_revision,
        position,
        previous,
        distance,
        event_time,
        time,
        first_time,
        inside,
        origin,
    )


def _decimal(position: Position | None) -> Decimals | None:
    """A position as multiples of 1e-7; None if there is none, or it is no such numbers."""
    if position is None:
        return None
    x, y = map(as_decimal, position)
    return None if x is None or y is None else (x, y)


def _minus(place: Decimals | None, other: Decimals | None) -> Decimals | None:
    return (place[0] - other[0], place[1] - other[1]) if place and other else place


def _take_decimal(cursor: Cursor) -> Decimals:
    return take_signed(cursor), take_signed(cursor)


def _position(place: Decimals | None) -> Position | None:
    return None if place is None else (place[0] / PLACES, place[1] / PLACES)
