"""Integers and texts in as many bytes as they need, written one by one."""

from .columns import Cursor

SEVEN_BITS, MORE = 127, 128


def put_unsigned(out: bytearray, number: int) -> None:
    """Append an integer that is not negative, seven bits a byte."""
    while number > SEVEN_BITS:
        out.append(number & SEVEN_BITS | MORE)
        number >>= 7
    out.append(number)


def take_unsigned(cursor: Cursor) -> int:
    """Read such an integer."""
    number = shift = 0
    while True:
        (byte,) = cursor.take(1)
        number |= (byte & SEVEN_BITS) << shift
        if byte <= SEVEN_BITS:
            return number
        shift += 7


def put_signed(out: bytearray, number: int) -> None:
    """Append an integer, its sign in the lowest bit."""
    put_unsigned(out, number << 1 if number >= 0 else -number << 1 | 1)


def take_signed(cursor: Cursor) -> int:
    """Read such an integer."""
    number = take_unsigned(cursor)
    return -(number >> 1) if number & 1 else number >> 1


def put_text(out: bytearray, text: str) -> None:
    """Append the length of a text in UTF-8, and the text."""
    data = text.encode()
    put_unsigned(out, len(data))
    out += data


def take_text(cursor: Cursor) -> str:
    """Read such a text."""
    return str(cursor.take(take_unsigned(cursor)), "utf-8")
