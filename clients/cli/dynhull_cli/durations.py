"""Time spans, as people write them."""

from datetime import timedelta

from dynhull_surface.spans import FORMS, UNITS, span_of


def duration(text: str | None, option: str) -> timedelta | None:
    """A time span such as 30m; None for None. ValueError names the option."""
    if text is None:
        return None
    found = span_of(text)
    if found is None:
        raise ValueError(f"{option} {text!r} is not a time span: {FORMS}")
    return found


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
