"""Times of entities: finite doubles in a unit of the caller's choice, checked with the row named."""

from __future__ import annotations

import math
from decimal import Decimal
from functools import partial
from numbers import Real
from typing import TYPE_CHECKING, Any

from .arrays import as_array, finite_times

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

NO_TIME = math.nan
"""The time of an entity that was put without one."""


def as_times(times: npt.ArrayLike, name: str = "times", *, or_none: bool = False) -> npt.NDArray[np.float64]:
    """Return times as a new float64 array of shape (k,), finite and without negative zeros. O(k).

    Args:
        times: (k,) array-like of real numbers.
        name: what error messages call the times.
        or_none: whether NaN, for no time, is allowed.

    Raises:
        ValueError: the shape is not (k,), or a time is not finite or not exactly a double.
        TypeError: a time is not a real number.
    """
    array = as_array(times, name)
    if array.ndim != 1:
        raise ValueError(f"{name} must have shape (k,), got {array.shape}")
    return finite_times(array, name, partial(as_time, or_none=or_none), or_none=or_none)


def as_time(time: Any, name: str = "time", *, or_none: bool = False) -> float:
    """Return one time as a finite float, checked like `as_times`."""
    if isinstance(time, bool) or not isinstance(time, Real | Decimal):
        raise TypeError(f"{name} is {time!r}: a time is a real number")
    try:
        double = float(time)
    except OverflowError:
        raise ValueError(f"{name} is {time!r}: too large for a double") from None
    if math.isnan(double) and or_none:
        return NO_TIME
    if not math.isfinite(double):
        raise ValueError(f"{name} is {double!r}: times must be finite")
    if double != time:
        raise ValueError(f"{name} is {time!r}: no double has this value")
    return double + 0.0
