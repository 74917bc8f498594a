"""The coordinates of a row: numbers of JSON, of a table, or texts that are numbers."""

import json
import math
from decimal import Decimal
from typing import Any

LONGEST_TEXT = 200
LARGEST_EXACT = 2.0**53  # of the numbers up to which doubles are all integers


NO_DOUBLE = "which is not a double: integers are exact up to 2**53"


class BadValueError(ValueError):
    """A value of a row cannot be used.

    Attributes:
        name: of its column or member.
        problem: what is wrong with it.
        value: the value.
    """

    def __init__(self, name: str, problem: str, value: Any = None) -> None:
        what = name if value is None else f"{name} is {value_text(value)},"
        super().__init__(f"{what} {problem}")
        self.name = name
        self.problem = problem
        self.value = value


def coordinate(value: Any, name: str, decimal: str = ".") -> float:
    """A finite number, or a text that is one, with this decimal mark; BadValueError says what is wrong with it.

    Decimals become the nearest double; integers that are none are bad.
    """
    if not isinstance(value, str) or value == "":
        return number(value, name)
    try:
        found = float(plain(value, decimal))
    except ValueError:
        mark = f" with the decimal mark {decimal!r}" if "," in value else ""
        raise BadValueError(name, f"not a number{mark}", value) from None
    if not math.isfinite(found):
        raise BadValueError(name, "not finite", value)
    if abs(found) >= LARGEST_EXACT and value.strip().lstrip("+-").isdecimal() and int(value) != found:
        raise BadValueError(name, NO_DOUBLE, int(value))
    return found + 0.0


def number(value: Any, name: str) -> float:
    """A finite number that is no text; BadValueError says what is wrong with it."""
    if value is None or value == "":
        raise BadValueError(name, "is missing")
    if isinstance(value, bool) or not isinstance(value, (int, float, Decimal)):
        raise BadValueError(name, "not a number", value)
    try:
        rounded = float(value)
    except OverflowError:  # of an integer
        rounded = math.inf
    if not math.isfinite(rounded):
        raise BadValueError(name, "not finite", value)
    if abs(rounded) >= LARGEST_EXACT and rounded != value and _is_integer(value):
        raise BadValueError(name, NO_DOUBLE, value)
    return rounded + 0.0


def _is_integer(value: int | float | Decimal) -> bool:
    """Whether it is written as an integer, perhaps with a fraction of zeros; 1e300 is not."""
    if isinstance(value, Decimal):
        return value == value.to_integral_value() and int(value.as_tuple().exponent) <= 0
    return isinstance(value, int)


def is_number(text: str) -> bool:
    """Whether a text is a number, with either decimal mark; NaN and the infinities count."""
    try:
        float(plain(text, "," if "," in text else "."))
    except ValueError:
        return False
    return True


def plain(text: str, decimal: str = ".") -> str:
    """The text with a point as decimal mark, for `float`; ValueError for notation of Python, such as 1_000."""
    if "_" in text or (decimal == "," and "." in text):
        raise ValueError
    return text.replace(decimal, ".")


def value_text(value: Any) -> str:
    """A value in messages, shortened: a text between quotes, anything else as JSON has it."""
    if isinstance(value, str):
        text = repr(value)
    elif isinstance(value, Decimal) or (isinstance(value, float) and not math.isfinite(value)):
        text = str(value)
    else:
        text = json_text(value)
    return text if len(text) <= LONGEST_TEXT else f"{text[:LONGEST_TEXT]}..."


def json_text(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    try:
        text = json.dumps(value, default=float)
    except ValueError:  # an integer too long for the interpreter to write
        text = f"an integer of {value.bit_length()} bits" if isinstance(value, int) else f"a {type(value).__name__}"
    return text if len(text) <= LONGEST_TEXT else f"{text[:LONGEST_TEXT]}..."
