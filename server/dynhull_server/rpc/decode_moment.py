"""The moment that a read is about."""

from typing import Any

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
