"""The keys and times of rows, the times at which they leave, and their accuracies."""

from collections.abc import Callable
from decimal import Decimal
from typing import Any

from dynhull.keys import KeyType, as_key

from .time_forms import TimeForm
from .times import TimeReader
from .values import BadValueError, coordinate

Key = str | int
LONGEST_KEY = 255  # bytes
KEY_DIGITS = 20  # those of 2**64 - 1; Python refuses thousands in its own words
Labels = tuple[Key | None, int | None, int | None, float | None]
"""The key of a row, its time and the time at which it leaves, in microseconds since 1970, and its accuracy; or None."""


class LabelReader:
    """Checks the labels of rows.

    Args:
        key, time, expires, accuracy: the names of their columns or members; None for rows that have none.
        kind: that of the keys; None for the kind that they have.
        form: how times are written; None for ISO 8601 with a time zone, and numbers.
        noted: called with a line about the unit of times that are numbers.
        optional: whether rows may have no key, which is not an empty one, and no time. They may always have no time at
            which they leave, and no accuracy.
    """

    def __init__(
        self,
        key: str | None,
        time: str | None,
        expires: str | None = None,
        accuracy: str | None = None,
        *,
        kind: KeyType | None = None,
        form: TimeForm | None = None,
        noted: Callable[[str], object] | None = None,
        optional: bool = False,
    ) -> None:
        self._key, self._kind, self._optional, self._noted = key, kind, optional, noted
        self._accuracy = accuracy
        self._time = None if time is None else TimeReader(time, form)
        self._expires = None if expires is None else TimeReader(expires, form)

    def __call__(self, key: Any, time: Any, expires: Any = None, accuracy: Any = None) -> Labels:
        """The labels of a row; BadValueError says what is wrong with them."""
        without = self._key is None or (self._optional and key is None)
        return (None if without else key_of(key, self._key or "", self._kind), *self.others(time, expires, accuracy))

    def others(self, time: Any, expires: Any, accuracy: Any) -> tuple[int | None, int | None, float | None]:
        """The labels of a row but its key; BadValueError says what is wrong with them."""
        return (
            None if self._time is None or (self._optional and _absent(time)) else self._read(self._time, time),
            None if self._expires is None or _absent(expires) else self._read(self._expires, expires),
            None if self._accuracy is None or _absent(accuracy) else accuracy_of(accuracy, self._accuracy),
        )

    def _read(self, times: TimeReader, value: Any) -> int:
        time = times.read(value)
        if times.note is not None and self._noted is not None:
            self._noted(times.note)
            times.note = None
        return time


def accuracy_of(value: Any, name: str) -> float:
    """An accuracy; BadValueError says what is wrong with it."""
    found = coordinate(value, name)
    if found < 0:
        raise BadValueError(name, "must not be negative", value)
    return found


def key_of(value: Any, name: str, kind: KeyType | None = None) -> Key:
    """A key; BadValueError if it is missing, or cannot be one of this kind."""
    if isinstance(value, str) and 0 < len(value) <= LONGEST_KEY and value.isascii() and kind != "int":
        return value  # most are
    if _absent(value):
        raise BadValueError(name, "is missing")
    value = float(value) if isinstance(value, Decimal) else value
    if kind == "int":
        return as_key(integer_key(value, name), "int", name)
    if isinstance(value, bool | float | list | dict):
        raise BadValueError(name, "not a string" if kind == "str" else "not a string or an integer", value)
    return as_key(value if kind is None else str(value), kind or ("int" if isinstance(value, int) else "str"), name)


def integer_key(key: Any, place: str) -> int:
    """A key that is an integer; BadValueError names the place."""
    if isinstance(key, int) and not isinstance(key, bool):
        return key
    if not isinstance(key, str) or not key.strip().isdecimal() or len(key.strip().lstrip("0")) > KEY_DIGITS:
        problem = "not an integer from 0 to 2**64 - 1, and the keys of the hull are integers"
        raise BadValueError(place, problem, key)
    return int(key)


def _absent(value: Any) -> bool:
    return value is None or value == ""
