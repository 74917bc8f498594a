"""Answers as values: they compare, hash and print by their content, arrays and NaN included."""

from dataclasses import fields
from functools import cache
from typing import Any

import numpy as np

from .keys import PackedKeys

MOST_ROWS_PRINTED = 8


class Value:
    """Base of frozen dataclasses (with `eq=False, repr=False`) whose fields may be arrays, which become read-only.

    Two are equal if they are of one class and all fields are equal; NaN equals NaN. O(size of the arrays).
    """

    __slots__ = ()

    def __post_init__(self) -> None:
        for name, value in _items(self):
            if isinstance(value, np.ndarray) and value.flags.writeable:
                view = value.view()
                view.flags.writeable = False
                object.__setattr__(self, name, view)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(_equal(mine, getattr(other, name)) for name, mine in _items(self))

    def __hash__(self) -> int:
        return hash((type(self), *(_key(value) for _, value in _items(self))))

    def __repr__(self) -> str:
        shown = ", ".join(f"{name}={_text(value)}" for name, value in _items(self))
        return f"{type(self).__name__}({shown})"


def _items(value: Any) -> list[tuple[str, Any]]:
    return [(name, getattr(value, name)) for name in _names(value.__class__)]


@cache
def _names(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind))


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, np.ndarray) or isinstance(b, np.ndarray):
        x, y = np.asarray(a), np.asarray(b)
        return bool(np.array_equal(x, y, equal_nan="f" in (x.dtype.kind, y.dtype.kind)))
    if isinstance(a, (tuple, list)) and type(a) is type(b):
        return len(a) == len(b) and all(map(_equal, a, b))
    return bool(a == b or (a != a and b != b))


def _key(value: Any) -> Any:
    """Something hashable, the same for equal values."""
    if isinstance(value, np.ndarray):
        numbers = value.astype(np.float64) + 0.0  # no negative zeros
        numbers[np.isnan(numbers)] = np.nan  # one NaN of the many
        return value.shape, numbers.tobytes()
    if isinstance(value, (tuple, list)):
        return tuple(map(_key, value))
    if isinstance(value, PackedKeys):
        return value.lengths, value.data
    return "NaN" if value != value else value


def _text(value: Any) -> str:
    if isinstance(value, tuple) and any(isinstance(each, np.ndarray) for each in value):
        return f"({', '.join(map(_text, value))}{',' * (len(value) == 1)})"
    if not isinstance(value, np.ndarray):
        return repr(value)
    return str(value.tolist()) if len(value) <= MOST_ROWS_PRINTED else f"<array of shape {value.shape}>"
