"""Input arrays: converted to float64 if that is exact, otherwise refused with an error that names the first bad row."""

import math
import operator
import sys
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from itertools import chain
from numbers import Number
from typing import Any

import numpy as np
import numpy.typing as npt

from ._implementation import kernel
from ._sources import COLUMN_NAMES, LARGEST_EXACT_INTEGER, coordinates_of

__all__ = ["COLUMN_NAMES", "Checked", "Points", "as_coordinate", "as_points", "packed_points", "plain_points"]

Points = npt.NDArray[np.float64]
"""Type of an (n, 2) array of finite doubles, a point in each row."""

MOST_AXES = 64  # of an array: no list is nested deeper
MOST_SHOWN = 80  # characters of a value in a message


class Checked:
    """Points that `as_points` returns unchanged, so that a request's points are checked only once.

    Args:
        points: an array that `as_points` or `packed_points` returned.
    """

    __slots__ = ("points",)

    def __init__(self, points: Points) -> None:
        self.points = points

    def __len__(self) -> int:
        return len(self.points)

    def __getitem__(self, rows: slice) -> "Checked":
        return Checked(self.points[rows])

    def __array__(self, dtype: npt.DTypeLike | None = None, copy: bool | None = None) -> npt.NDArray[Any]:
        return np.array(self.points, dtype=dtype, copy=copy)


# What `plain_points` may know; not their subclasses, some rows of which may be missing.
PLAIN_TYPES = frozenset((np.ndarray, list))


def as_points(xy: npt.ArrayLike, name: str = "points", *, on_globe: bool | None = False) -> Points:
    """Return `xy` as a C-contiguous float64 array of shape (n, 2) with finite entries and no negative zeros.

    Raises:
        ValueError: the shape is not (n, 2), an entry is not finite, or no double has its value (an integer beyond
            2**53, say).
        TypeError: an entry is not a real number.

    The message names the first bad row. A frame of geopandas in degrees gets a warning, as it is for a plane; with
    `on_globe`, one in other coordinates is refused; None if it is not known what the points are for. O(n); `Checked`
    points are not copied.
    """
    if type(xy) is Checked:
        return xy.points
    if type(xy) in PLAIN_TYPES and (points := plain_points(xy)) is not None:
        return points
    return _finite(_as_pairs(xy, name, on_globe), name)


def as_pairs(xy: npt.ArrayLike, name: str = "points") -> Points:
    """Return `xy` like `as_points`, but allow entries that are not finite and negative zeros.

    A contiguous float64 array is not copied.
    """
    pairs = _as_pairs(xy, name, False)
    return pairs if pairs.flags.c_contiguous and pairs.flags.aligned else pairs.copy(order="C")


def as_rows(points: npt.ArrayLike, name: str = "points") -> Points:
    """Return `points` as a float64 array of shape (n, d), d at least 2, checked like `as_points`."""
    array = _as_array(points, name)
    if array.ndim == 1 and array.size == 0:
        return np.empty((0, 2))
    if array.ndim != 2 or array.shape[1] < 2:
        raise ValueError(f"{name} must have shape (n, d), d at least 2, got {_shape(array)}")
    return _finite(_as_double(array, name), name)


def as_directions(directions: npt.ArrayLike, dimension: int) -> Points:
    """Return (k, dimension) directions, checked like `as_points`, none of them zero."""
    vectors = as_rows(directions, "directions")
    if len(vectors) and vectors.shape[1] != dimension:
        raise ValueError(f"directions must have shape (k, {dimension}), got {vectors.shape}")
    zero = np.flatnonzero(~vectors.any(axis=1))
    if zero.size:
        raise ValueError(f"directions row {zero[0]} is {_text(vectors[zero[0]])}: no direction")
    return np.ascontiguousarray(vectors.reshape(-1, dimension))


def as_array(values: npt.ArrayLike, name: str) -> npt.NDArray[Any]:
    """Return `np.asarray(values)`; refuse masked arrays."""
    refuse_masked(values, name)
    return np.asarray(values)


def refuse_masked(values: Any, name: str) -> None:
    """Raise ValueError for a masked array and for lists of masked arrays: numpy would use the hidden entries as values.

    Also if nothing is hidden, as scipy does: whether a call works must not depend on which data are missing today.
    """
    entries = [values]
    for _ in range(MOST_AXES):
        kinds = set(map(type, entries))
        if kinds <= {float, int} or "numpy.ma" not in sys.modules:
            return
        if any(issubclass(kind, np.ma.MaskedArray) for kind in kinds):
            raise ValueError(
                f"{name} must not be or contain a masked array: pass np.ma.compress_rows(...), which drops the rows "
                "with hidden entries, or the array's .filled(value)"
            )
        lists = tuple(kind for kind in kinds if issubclass(kind, (list, tuple)))
        if not lists:
            return
        entries = list(chain.from_iterable(entry for entry in entries if type(entry) in lists))


def as_tuples(points: Points) -> list[tuple[float, float]]:
    """The rows of an (n, 2) array as tuples, for code that reads one point at a time."""
    return [(x, y) for x, y in points.tolist()]


def as_vector(value: npt.ArrayLike, name: str) -> Points:
    """Return one point or vector of two or more finite coordinates."""
    array = as_array(value, name)
    if array.ndim != 1 or len(array) < 2:
        raise ValueError(f"{name} must have shape (d,), d at least 2, got {array.shape}")
    vector: Points = as_rows(array[None], name)[0]
    return vector


def finite_pairs(xy: npt.ArrayLike, name: str) -> Points:
    """Return `xy` as a float64 array of shape (..., 2), checked like `as_points`."""
    array = _as_array(xy, name)
    if array.ndim == 0 or array.shape[-1] != 2:
        raise ValueError(f"{name} must have shape (..., 2), got {_shape(array)}")
    flat = array.reshape(-1, 2)
    return _finite(_as_double(flat, name), name).reshape(array.shape)


def as_coordinate(value: Any, name: str) -> float:
    """Return one coordinate as a finite float, converted if that is exact.

    Raises:
        ValueError: the value is not finite, or no double has it.
        TypeError: the value is not a real number.
    """
    if type(value) is float:
        double = value
    else:
        refuse_masked(value, name)
        double = _as_double_scalar(value, name)
    if not math.isfinite(double):
        raise ValueError(f"{name} is {double!r}: coordinates must be finite")
    return double + 0.0


def as_count(value: Any, name: str, least: int = 0) -> int:
    """Return an integer as an int, the largest possible one for a larger one.

    Raises:
        ValueError: it is less than `least`.
        TypeError: it is not an integer.
    """
    try:
        count = operator.index(value)
    except TypeError:
        raise TypeError(f"{name} must be an integer, got {value!r}") from None
    if count < least:
        raise ValueError(f"{name} is {count}: must be at least {least}")
    return min(count, sys.maxsize)


def as_operations(ops: npt.ArrayLike, rows: int) -> npt.NDArray[np.int8]:
    """Return `ops` as int8 of shape (rows,), each +1 (insert) or -1 (delete)."""
    array = as_array(ops, "ops")
    if array.shape != (rows,):
        raise ValueError(f"ops must have shape ({rows},) like the points, got {array.shape}")
    if array.dtype.kind not in "iuf" and rows:
        raise TypeError(f"ops must be numbers, got {array.dtype}")
    bad = np.flatnonzero((array != 1) & (array != -1))
    if bad.size:
        raise ValueError(f"ops row {bad[0]} is {array[bad[0]]!s}: must be +1 (insert) or -1 (delete)")
    return np.ascontiguousarray(array, dtype=np.int8)


def as_times(times: Any, rows: int) -> npt.NDArray[np.float64]:
    """Return `times` as a float64 array of shape (rows,) with finite entries and no negative zeros; always a copy."""
    if isinstance(times, Iterable) and not hasattr(times, "__len__") and not hasattr(times, "__array__"):
        times = list(times)
    array = as_array(times, "times")
    if array.shape != (rows,):
        raise ValueError(f"times must have shape ({rows},) like the points, got {array.shape}")
    if array.dtype.kind in "USVMm":
        raise TypeError(f"times must be real numbers, got {array.dtype}")
    return finite_times(array, "times", partial(_as_double_scalar, kind="times"))


def as_time(value: Any, name: str) -> float:
    """Return one time, or a span of time, as a finite float, converted if that is exact."""
    double = value if type(value) is float else _as_double_scalar(value, name, "times")
    if not math.isfinite(double):
        raise ValueError(f"{name} is {double!r}: times must be finite")
    return double + 0.0


def finite_times(
    array: npt.NDArray[Any], name: str, one: Callable[[Any, str], float], *, or_none: bool = False
) -> npt.NDArray[np.float64]:
    """Return an array of times as new finite doubles without negative zeros.

    Where numpy might round, `one` converts each value; it also gets the name of its row. `or_none` allows NaN.
    """
    if not _converts_exactly(array):
        array = np.array([one(value, f"{name} row {row}") for row, value in enumerate(array.tolist())])
    doubles = array.astype(np.float64) + 0.0
    strange = np.flatnonzero(np.isinf(doubles) if or_none else ~np.isfinite(doubles))
    if strange.size:
        raise ValueError(f"{name} row {strange[0]} is {doubles[strange[0]]}: times must be finite")
    return doubles


def _converts_exactly(array: npt.NDArray[Any]) -> bool:
    if array.dtype.kind in "iu":
        return not array.size or (array.min() >= -LARGEST_EXACT_INTEGER and array.max() <= LARGEST_EXACT_INTEGER)
    return array.dtype in (np.float64, np.float32, np.float16)


def _as_pairs(xy: npt.ArrayLike, name: str, on_globe: bool | None) -> Points:
    array = _as_array(coordinates_of(xy, name, on_globe=on_globe), name)
    if array.ndim == 1 and array.size == 0:
        return np.empty((0, 2))
    if array.ndim != 2 or array.shape[1] != 2:
        hint = f"; one point is [[{array[0]}, {array[1]}]]" if array.shape == (2,) else ""
        raise ValueError(f"{name} must have shape (n, 2), got {_shape(array)}{hint}")
    return _as_double(array, name)


def _as_array(xy: Any, name: str) -> npt.NDArray[Any]:
    if type(xy) is np.ndarray and xy.dtype == np.float64:
        return xy
    if isinstance(xy, Iterable) and not hasattr(xy, "__len__") and not hasattr(xy, "__array__"):
        xy = list(xy)
    refuse_masked(xy, name)
    try:
        array = np.asarray(xy)
    except ValueError:
        for row, entry in enumerate(xy):
            if not hasattr(entry, "__len__") or len(entry) != 2:
                raise ValueError(f"{name} row {row} is {repr_of(entry)}: must be two numbers") from None
        raise
    if array.dtype.kind in "USVMm":
        raise TypeError(f"{name} row {_first_not_a_number(xy)}: coordinates must be real numbers, got {array.dtype}")
    return array


def _shape(array: npt.NDArray[Any]) -> str:
    """The shape of an array; for an object that is none, what it is."""
    if array.ndim:
        return str(array.shape)
    value = array.item()
    if not isinstance(value, Iterable):
        return repr_of(value)
    advice = "" if isinstance(value, Mapping) else ": use list(points)"
    return f"a {type(value).__name__}{advice}"


def _first_not_a_number(xy: Any) -> int:
    """The row because of which numpy chose a text, date or record type."""
    for row, entry in enumerate(xy):
        values = entry if hasattr(entry, "__len__") and not isinstance(entry, str | bytes) else [entry]
        if not all(isinstance(value, Number) for value in values):
            return row
    return 0


def _as_double(array: npt.NDArray[Any], name: str) -> Points:
    """Convert an (n, 2) array to float64; refuse the first row whose value would change."""
    if array.dtype == np.float64:
        return array
    kind = array.dtype.kind
    if kind == "b" or array.dtype in (np.float16, np.float32):
        return np.asarray(array, dtype=np.float64)
    if kind in "iu":
        large = (array > LARGEST_EXACT_INTEGER) | (array < -LARGEST_EXACT_INTEGER)
        doubtful = np.flatnonzero(large.any(axis=1))
    elif kind in "fc":  # wider than a double, or complex: exact if it survives a round trip
        with np.errstate(over="ignore"):
            same = (array.real.astype(np.float64) == array) | np.isnan(array)
        doubtful = np.flatnonzero(~same.all(axis=1))
        if doubtful.size:
            row = doubtful[0]
            raise ValueError(f"{name} row {row} is {_text(array[row])}: not exactly a pair of doubles")
        return array.real.astype(np.float64)
    else:
        doubtful = np.arange(len(array))
    for row in doubtful.tolist():
        for value in array[row].tolist():
            _as_double_scalar(value, f"{name} row {row}")
    return array.astype(np.float64)


def repr_of(value: Any) -> str:
    """The repr of a value for a message, shortened if it is long; Python refuses to write the longest integers."""
    try:
        text = repr(value)
    except ValueError:
        return f"a{'n' * isinstance(value, int)} {type(value).__name__} with too many digits to show"
    return text if len(text) <= MOST_SHOWN else f"{text[: MOST_SHOWN // 2 - 3]}...{text[-(MOST_SHOWN // 2 - 3) :]}"


def _as_double_scalar(value: Any, name: str, kind: str = "coordinates") -> float:
    if not isinstance(value, Number) and not hasattr(value, "__float__"):
        raise TypeError(f"{name}: {kind} must be real numbers, got {repr_of(value)}")
    try:
        double = float(value.real if isinstance(value, complex) and value.imag == 0 else value)
    except OverflowError:
        raise ValueError(f"{name} is {repr_of(value)}: too large for a double") from None
    except (TypeError, ValueError):
        raise TypeError(f"{name}: {kind} must be real numbers, got {repr_of(value)}") from None
    if double != value and not math.isnan(double):
        raise ValueError(f"{name} is {repr_of(value)}: no double has this value")
    return double


def plain_points(xy: Any) -> Points | None:
    """The copy that `as_points` returns for an (n, 2) array of finite doubles; None for any other array.

    With the kernel, also for a list of pairs of numbers; perhaps None for any list.
    """
    if kernel is not None:
        return kernel.plain_points(xy)
    if isinstance(xy, list) or xy.dtype != np.float64 or xy.ndim != 2 or xy.shape[1] != 2:
        return None
    copy = _copy(xy)
    return copy if np.isfinite(copy).all() else None


def _packed_points(packed: bytes) -> Points | None:
    """The points whose coordinates are these little-endian doubles; None if one is not finite."""
    return plain_points(np.frombuffer(packed, "<f8").astype(np.float64, copy=False).reshape(-1, 2))


packed_points = _packed_points if kernel is None or sys.byteorder == "big" else kernel.packed_points


def _finite(array: Points, name: str) -> Points:
    copy = _copy(array)
    finite = np.isfinite(copy)
    if not finite.all():
        row = int(np.flatnonzero(~finite.all(axis=-1))[0])
        raise ValueError(f"{name} row {row} is {_text(array[row])}: coordinates must be finite")
    return copy


def _copy(array: Points) -> Points:
    """A copy without negative zeros, because -0.0 and 0.0 are the same coordinate; no other thread writes to it."""
    return np.ascontiguousarray(array + 0.0)


def _text(row: npt.NDArray[Any]) -> str:
    return "(" + ", ".join(str(value) for value in row.tolist()) + ")"
