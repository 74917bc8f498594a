"""Time spans, as people write them."""

import re
from datetime import timedelta

UNITS = {
    "": timedelta(seconds=1),
    "ms": timedelta(milliseconds=1),
    "s": timedelta(seconds=1),
    "m": timedelta(minutes=1),
    "h": timedelta(hours=1),
    "d": timedelta(days=1),
}
SPAN = re.compile(r"(\d+(?:\.\d+)?)\s*(ms|s|m|h|d|)")
FORMS = "write for example 500ms, 90s, 30m, 2h or 7d; a number alone is seconds"


def span_of(text: str) -> timedelta | None:
    """A time span such as 30m; None if it is none, or longer than timedeltas can be."""
    found = SPAN.fullmatch(text.strip())
    if found is None:
        return None
    try:
        return float(found[1]) * UNITS[found[2]]
    except OverflowError:
        return None
