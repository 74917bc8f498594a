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


def duration(text: str | None, option: str) -> timedelta | None:
    """A time span such as 30m; None for None. ValueError names the option."""
    if text is None:
        return None
    found = SPAN.fullmatch(text.strip())
    try:
        if found is not None:
            return float(found[1]) * UNITS[found[2]]
    except OverflowError:
        pass
    raise ValueError(
        f"{option} {text!r} is not a time span: write for example 500ms, 90s, 30m, 2h or 7d; a number alone is seconds"
    )


def more_than_0(text: str, option: str) -> float:
    """The seconds of a time span that must not be 0. ValueError names the option."""
    span = duration(text, option)
    if span is None or span.total_seconds() <= 0:
        raise ValueError(f"{option} {text!r} must be more than 0")
    return span.total_seconds()


def shown(span: timedelta) -> str:
    """A time span in the largest unit that needs no fraction."""
    for unit in ("d", "h", "m", "s"):
        if not span % UNITS[unit]:
            return f"{span // UNITS[unit]}{unit}"
    return f"{span / UNITS['ms']:g}ms"
