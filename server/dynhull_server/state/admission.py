"""The times of the rows of a batch: which are too far ahead, which are too old, and the clock that they lead to."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

import numpy as np
import numpy.typing as npt

from .errors import InvalidBatchError
from .records import HullSettings, Times

# Microseconds: a batch reads the server's clock as of the last tenth of a second, so that points leave before at most
# ten batches a second.
TICK = 100_000
# Times up to here are exact as doubles: the years 1685 to 2255.
GREATEST_TIME = 2**53

EPOCH = datetime(1970, 1, 1, tzinfo=UTC)


@dataclass(slots=True)
class Admission:
    """The times of a batch.

    Attributes:
        times: (n,) the time of each row, or None.
        clock: the clock of the hull after the batch, None for a hull without a clock.
        young: (n,) which rows are not too old; None if all are not.
        clamped: the number of rows whose time was reduced.
    """

    times: Times | None
    clock: int | None
    young: npt.NDArray[np.bool_] | None = None
    clamped: int = 0


def server_clock(clock: int | None, time: int) -> int:
    """The clock of a hull that the server's clock drives, which was `clock`, at `time`."""
    reading = time - time % TICK
    return reading if clock is None else max(clock, reading)


def too_old(settings: HullSettings, clock: int | None) -> int | None:
    """The greatest time that is too old for the window at `clock`; None if age does not matter."""
    window = settings.window
    return clock - window.max_age if clock is not None and window is not None and window.max_age else None


def admit(
    settings: HullSettings,
    times: Times | None,
    rows: int,
    field: str,
    arrived: int,
    clock: int | None,
    *,
    held: bool = False,
) -> Admission:
    """Admit the rows of a batch.

    Args:
        settings: the settings of the hull.
        times: (rows,) their event times, or None.
        rows: the number of rows.
        field: the field of the batch that has the times.
        arrived: the time of their arrival.
        clock: the clock of the hull.
        held: whether the rows are released from quarantine. How far their times were ahead was judged when they came,
            by a clock that may have been set back since.

    Raises:
        InvalidBatchError: times are required, or a time is further ahead than the hull allows.
    """
    window = settings.window
    if times is None and rows:
        if settings.by_event_time:
            raise InvalidBatchError(field, "empty", "this hull is ordered by event time: each row needs one")
        if window is not None and window.clock == "data":
            raise InvalidBatchError(field, "empty", "event times drive the clock of this hull: each row needs one")
    if window is None:
        return Admission(times, clock)
    admission = Admission(np.full(rows, arrived, np.int64) if times is None else times, clock)
    if times is not None and window.max_skew is not None and not held:
        _limit_skew(admission, arrived + window.max_skew, field, clamps=window.clamps)
    assert admission.times is not None  # a hull with a window has times
    if window.clock == "server":
        admission.clock = server_clock(clock, arrived)
    elif rows:
        greatest = int(admission.times.max())
        admission.clock = greatest if clock is None else max(clock, greatest)
    limit = too_old(settings, admission.clock)
    if limit is not None:
        young = admission.times > limit
        if not young.all():
            admission.young = young
    return admission


def _limit_skew(admission: Admission, latest: int, field: str, *, clamps: bool) -> None:
    times = admission.times
    assert times is not None  # only event times can be ahead
    ahead = times > latest
    if not ahead.any():
        return
    if not clamps:
        row = int(np.argmax(ahead))
        problem = f"further ahead of the server's clock than this hull allows: the latest time is {shown(latest)}"
        raise InvalidBatchError(field, shown(int(times[row])), problem, row)
    admission.times = np.minimum(times, latest)
    admission.clamped = int(np.count_nonzero(ahead))


def shown(time: int) -> str:
    """A time for error messages, as ISO 8601."""
    return (EPOCH + timedelta(microseconds=time)).isoformat().replace("+00:00", "Z")
