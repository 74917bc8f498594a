"""Arguments that are no arrays: which values they may have."""

from __future__ import annotations

import operator
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Collection


def require_not_negative(**numbers: float | None) -> None:
    """Raise ValueError if one of the arguments is negative or not a number."""
    for argument, value in numbers.items():
        if isinstance(value, Real) and not value >= 0:
            raise ValueError(f"{argument} must be at least 0, got {value}")


def choice(argument: str, value: Any, choices: Collection[Any]) -> Any:
    """The value; ValueError names the argument and what it may be."""
    if value not in choices:
        raise ValueError(f"{argument} must be one of {', '.join(map(repr, choices))}, got {value!r}")
    return value


def text(argument: str, value: Any) -> str:
    """The value; TypeError if it is no str."""
    if not isinstance(value, str):
        raise TypeError(f"{argument} is {value!r}: must be a str")
    return value


def whole(argument: str, value: Any, bits: int = 64, least: int = 0) -> int:
    """The value as an integer without sign; TypeError if it is no integer, ValueError if it is out of range."""
    try:
        number = operator.index(value)
    except TypeError:
        raise TypeError(f"{argument} is {value!r}: must be an integer") from None
    if number < least:
        raise ValueError(f"{argument} must be at least {least}, got {number}")
    if number >= 2**bits:
        raise ValueError(f"{argument} must be less than 2**{bits}, got {number}")
    return number


def flag(name: str, value: Any) -> bool:
    """The value; TypeError if it is neither True nor False."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} is {value!r}: must be True or False")
    return bool(value)


def positive(argument: str, value: int | None) -> int:
    """The value in the form of a message, 0 for None; ValueError if it is less than 1."""
    if value is not None and value < 1:
        raise ValueError(f"{argument} must be at least 1, got {value}")
    return value or 0
