"""Points in time as microseconds since 1970, and their messages."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import TYPE_CHECKING, Any
from warnings import warn

import numpy as np
import numpy.typing as npt
from google.protobuf.duration_pb2 import Duration

from dynhull_proto.v1 import points_pb2
from dynhull_surface.iso_times import from_iso
from dynhull_surface.spans import span_of

if TYPE_CHECKING:
    from google.protobuf.timestamp_pb2 import Timestamp

Times = npt.NDArray[np.datetime64]
"""Type of an (n,) array of datetime64[us], in UTC."""

Span = float | timedelta | str
EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MICROSECOND = timedelta(microseconds=1)
LARGEST_TIME = 2**53  # microseconds: the years 1685 to 2255
YEAR_1970 = 365 * 86_400 * 1_000_000  # microseconds
# Integers that are times of our age in another unit: more than 1990, less than 2100.
OTHER_UNITS = {"seconds": 1, "milliseconds": 1000}
EARLIEST, LATEST = 631_152_000, 4_102_444_800
A_TIME = "a datetime or ISO 8601 with a time zone, a numpy.datetime64, or an integer of microseconds since 1970"
A_SPAN = "a timedelta, or text such as 500ms, 90s, 30m, 2h or 7d"
NO_ZONE = "has no time zone: write datetime.now(UTC), or value.replace(tzinfo=UTC) if it is in UTC"


def as_microseconds(times: Any, rows: int, name: str) -> npt.NDArray[np.int64]:
    """One time for each row, (rows,). Nanoseconds are cut off.

    Args:
        times: datetimes or ISO 8601 with a time zone; a numpy array of datetime64, which numpy defines to be in UTC; a
            column of pandas, polars or pyarrow with a time zone; or integers of microseconds since 1970. Those of that
            year are warned about: they are seconds or milliseconds, as a rule.
        rows: their number.
        name: what error messages call them.

    Raises:
        ValueError: a time has no time zone, is missing or not from the years 1685 to 2255, or their number differs.
        TypeError: a value is no time.
    """
    micros = _microseconds(times, name)
    if len(micros) != rows:
        raise ValueError(f"{name} has {len(micros)} rows for {rows} points")
    bad = np.flatnonzero((micros > LARGEST_TIME) | (micros < -LARGEST_TIME))
    if bad.size:
        raise ValueError(f"{name} row {bad[0]} is {micros[bad[0]]} microseconds: not from the years 1685 to 2255")
    return micros


def as_times(micros: npt.NDArray[np.int64] | None) -> Times | None:
    """The microseconds as times."""
    return None if micros is None else micros.view("datetime64[us]")


def encode_times(times: Any, rows: int, name: str) -> points_pb2.Times:
    """Times that `as_microseconds` takes, in the form of a message."""
    return points_pb2.Times(packed=np.asarray(as_microseconds(times, rows, name), "<i8").tobytes())


def decode_times(message: points_pb2.Times) -> Times:
    """Times as received, packed."""
    return np.frombuffer(message.packed, "<i8").astype("datetime64[us]")


def decode_time(message: Timestamp) -> datetime:
    """A time as received."""
    return message.ToDatetime(UTC)


def encode_duration(span: Span, name: str) -> Duration:
    """A time span in the form of a message, rounded to microseconds."""
    message = Duration()
    message.FromTimedelta(as_timedelta(span, name))
    return message


def as_timedelta(span: Span, name: str) -> timedelta:
    """A time span: a number is seconds, a text has a unit, as 30m.

    Raises:
        ValueError: it is none, or longer than timedeltas can be.
    """
    try:
        found = span_of(span) if isinstance(span, str) else span
        if found is None:
            raise ValueError("is no time span")
        return found if isinstance(found, timedelta) else timedelta(seconds=found)
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{name} is {span!r}: must be a finite number of seconds, {A_SPAN}") from None


def _microseconds(times: Any, name: str) -> npt.NDArray[np.int64]:
    if isinstance(times, str) or not hasattr(times, "__iter__"):
        raise TypeError(f"{name} is {times!r}: must be one time for each point, each {A_TIME}")
    values = _values(times, name)
    if isinstance(values, np.ndarray) and values.ndim != 1:
        raise ValueError(f"{name} must have shape (n,), got {values.shape}")
    if isinstance(values, np.ndarray) and values.dtype.kind in "Mi":
        missing = np.flatnonzero(np.isnat(values)) if values.dtype.kind == "M" else np.empty(0, np.intp)
        if missing.size:
            raise ValueError(f"{name} row {missing[0]} is missing: must be {A_TIME}")
        if values.dtype.kind == "M":
            return values.astype("datetime64[us]").astype(np.int64)
        return _of_integers(values.astype(np.int64), name)
    rows = list(values)
    micros = np.array([as_microsecond(value, f"{name} row {row}") for row, value in enumerate(rows)], np.int64)
    if any(isinstance(value, int | np.integer) for value in rows):
        return _of_integers(micros, name)
    return micros


def _of_integers(micros: npt.NDArray[np.int64], name: str) -> npt.NDArray[np.int64]:
    """The same, with a warning if there are times of 1970: the same one for all batches, which Python shows once."""
    early = micros[(micros >= 0) & (micros < YEAR_1970)]
    if early.size:
        first = int(early[0])
        units = (unit for unit, factor in OTHER_UNITS.items() if EARLIEST <= first / factor < LATEST)
        meant = next((f", which as {unit} would be of our age" for unit in units), "")
        message = f"{name}: integers are microseconds since 1970, and some are times of 1970{meant}"
        warn(f"{message}. Give datetimes, or datetime64 if these are meant", UserWarning, stacklevel=2)
    return micros


def _values(times: Any, name: str) -> Any:
    """An array of datetime64 or of integers for an array or a column of them; anything else as it is."""
    kind = getattr(times, "dtype", None) or getattr(times, "type", None)  # of numpy, pandas and polars; of pyarrow
    if kind is None or isinstance(times, np.ndarray):
        return times
    kind = getattr(kind, "pyarrow_dtype", kind)  # of pandas with columns of pyarrow
    if "date" in str(kind).lower() or "timestamp" in str(kind).lower():
        if getattr(kind, "tz", None) is None and getattr(kind, "time_zone", None) is None:
            raise ValueError(f"{name} has no time zone: give it one, in pandas with .dt.tz_localize('UTC')")
        return np.asarray(times, "datetime64[us]")
    return np.asarray(times)


def as_microsecond(value: Any, name: str) -> int:
    """A time in microseconds since 1970; ValueError or TypeError as of `as_microseconds`."""
    if isinstance(value, np.datetime64) and not np.isnat(value):
        value = int(value.astype("datetime64[us]").astype(np.int64))
    if isinstance(value, datetime) and value == value:  # pandas.NaT differs from itself
        if value.tzinfo is None:
            raise ValueError(f"{name} is {value.isoformat()}, which {NO_ZONE}")
        return (value - EPOCH) // MICROSECOND
    if isinstance(value, str):
        return _of_text(value, name)
    if isinstance(value, bool | np.bool_) or not isinstance(value, int | np.integer):
        raise TypeError(f"{name} is {value!r}: must be {A_TIME}")
    if abs(int(value)) > LARGEST_TIME:
        raise ValueError(f"{name} is {value} microseconds: not from the years 1685 to 2255")
    return int(value)


def _of_text(text: str, name: str) -> int:
    try:
        time = from_iso(text)
    except ValueError:
        raise ValueError(f"{name} is {text!r}: must be {A_TIME}") from None
    if time.tzinfo is None:
        raise ValueError(f"{name} is {text!r}, which has no time zone: add Z for UTC, or an offset")
    return (time - EPOCH) // MICROSECOND
