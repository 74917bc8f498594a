"""Times as ISO 8601 and RFC 3339 have them, leap seconds among them."""

import re
from datetime import datetime, timedelta

LEAP_SECOND = re.compile(r"([T ]\d\d:?\d\d:?)60")
SECOND = timedelta(seconds=1)


def from_iso(text: str) -> datetime:
    """A time; ValueError if the text is none.

    A second 60 is the first one of the next minute, as POSIX and PostgreSQL have it: datetime has no room for leap
    seconds either.
    """
    try:
        return datetime.fromisoformat(text)
    except ValueError:  # which small letters make, too
        usual, leaps = LEAP_SECOND.subn(r"\g<1>59", text.upper(), count=1)
        time = datetime.fromisoformat(usual)
        return next_second(time) if leaps else time


def next_second(time: datetime) -> datetime:
    """The time a second later; ValueError after the last one that there is."""
    try:
        return time + SECOND
    except OverflowError as error:
        raise ValueError(str(error)) from None
