"""The moments that reads are about."""

from typing import Any

from ..state.admission import shown
from .decode import InvalidFieldError
from .decode_batch import decode_timestamp


def decode_moment(request: Any) -> tuple[int | None, int] | None:
    """The revision of a read about the past, or the time in microseconds since 1970; None for the present."""
    by_revision, by_time = request.HasField("at_revision"), request.HasField("at_time")
    if not by_revision and not by_time:
        return None
    if by_revision and by_time:
        raise InvalidFieldError("at_time", "given", "give at_revision or at_time, not both")
    if request.min_revision:
        raise InvalidFieldError("min_revision", request.min_revision, "must be 0 in a read about the past")
    return (request.at_revision, 0) if by_revision else (None, decode_timestamp(request.at_time, "at_time"))


# A revision, or None and the time in microseconds since 1970.
When = tuple[int | None, int]


def decode_span(request: Any) -> tuple[When | None, When | None]:
    """Where a read of the past begins and ends; None where the request does not say so."""
    start, end = decode_end(request, "start"), decode_end(request, "end")
    if start is not None and end is not None:
        alike = (start[0] is None) == (end[0] is None)
        if alike and (end[0] or 0, end[1]) < (start[0] or 0, start[1]):
            by_time = end[0] is None
            field, value = ("end_time", shown(end[1])) if by_time else ("end_revision", end[0])
            raise InvalidFieldError(field, value, "is before the start")
    return start, end


def decode_end(request: Any, end: str) -> When | None:
    """The revision, or the time, at one end of a read of the past: `start` or `end`. None where it does not say."""
    match request.WhichOneof(end):
        case None:
            return None
        case chosen if chosen.endswith("_time"):
            return None, decode_timestamp(getattr(request, chosen), chosen)
        case chosen:
            return getattr(request, chosen), 0
