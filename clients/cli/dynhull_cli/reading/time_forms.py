"""How times are written that do not say it themselves."""

import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta, timezone
from enum import StrEnum
from typing import TYPE_CHECKING

from dynhull_surface.iso_times import next_second

from .values import BadValueError

if TYPE_CHECKING:
    from zoneinfo import ZoneInfo

ZONE = (
    "Time zone of times that have none, such as Europe/Berlin or UTC, with the summer time of each date. Default: they "
    "are refused."
)
AMBIGUOUS = (
    "Which moment a time is that exists twice or not at all in its time zone, because clocks were put back or forward: "
    "earlier or later; or refuse it."
)
FORMAT = (
    "Form of times, as strptime of C and Python reads it: %d/%m/%Y %H:%M:%S, say; %z is an offset. Default: ISO 8601, "
    "or numbers since 1970."
)
SAMPLE = datetime(2004, 11, 23, 17, 48, 59, tzinfo=UTC)
NAMED_ZONE = re.compile(r"(?<!%)(?:%%)*%Z")
LEAP = 60


class TimeUnit(StrEnum):
    """The units of times that are numbers."""

    SECONDS = "s"
    MILLISECONDS = "ms"
    MICROSECONDS = "us"
    NANOSECONDS = "ns"


class Ambiguous(StrEnum):
    """What becomes of times that exist twice or not at all."""

    EARLIER = "earlier"
    LATER = "later"
    REFUSE = "refuse"


@dataclass(frozen=True, slots=True)
class TimeForm:
    """How times are written.

    Attributes:
        unit: the unit of numbers; None for that which the first one seems to have.
        zone: the time zone of times that have none; None to refuse them.
        ambiguous: what becomes of times that exist twice or not at all in it.
        format: their form, for strptime; None for ISO 8601 and numbers.
        option: what these settings are called, for messages; None where there are none.
    """

    unit: TimeUnit | None = None
    zone: "ZoneInfo | None" = None
    ambiguous: Ambiguous = Ambiguous.REFUSE
    format: str | None = None
    option: Callable[[str], str] | None = None

    def advice(self, text: str, setting: str) -> str:
        """An advice that names a setting, with it in the place of {}; empty where there are no settings."""
        return "" if self.option is None else text.format(self.option(setting))


def time_form(
    option: Callable[[str], str],
    unit: TimeUnit | None,
    zone: str | None,
    ambiguous: Ambiguous,
    form: str | None,
) -> TimeForm:
    """How times are written, of the settings `time_unit`, `time_zone`, `ambiguous` and `time_format`.

    BadValueError, named by what `option` calls a setting, says what is wrong with it.
    """
    if ambiguous is not Ambiguous.REFUSE and zone is None:
        raise BadValueError(option("ambiguous"), f"is given with {option('time_zone')}")
    if form is not None:
        if unit is not None:
            raise BadValueError(option("time_format"), f"is given without {option('time_unit')}, which is for numbers")
        _check_format(form, option("time_format"))
    return TimeForm(unit, None if zone is None else _zone(zone, option("time_zone")), ambiguous, form, option)


def from_format(text: str, form: str) -> datetime:
    """A time of a form; ValueError if the text is none. A second 60 is the first one of the next minute."""
    try:
        return datetime.strptime(text, form)
    except ValueError:
        found = time.strptime(text, form)  # which has second 60, unlike datetime
        if found.tm_sec != LEAP:
            raise
        offset = None if found.tm_gmtoff is None else timezone(timedelta(seconds=found.tm_gmtoff))
        return next_second(datetime(*found[:5], LEAP - 1, tzinfo=offset))


def _zone(name: str, option: str) -> "ZoneInfo":
    from zoneinfo import ZoneInfo

    try:
        return ZoneInfo(name)
    except (KeyError, ValueError, OSError):  # an OSError where it is a folder of zones
        problem = "no time zone of the IANA database, such as Europe/Berlin or UTC (pip install tzdata has them all)"
        raise BadValueError(option, problem, name) from None


def _check_format(form: str, option: str) -> None:
    if NAMED_ZONE.search(form):
        raise BadValueError(option, "names of time zones (%Z) cannot be read: %z reads offsets", form)
    try:
        found = datetime.strptime(SAMPLE.strftime(form), form)
    except (ValueError, re.error) as error:  # the latter where a directive comes twice
        raise BadValueError(option, f"not a form of times: {error}", form) from None
    if found.date() != SAMPLE.date():
        raise BadValueError(option, "does not say year, month and day of a time, as %d/%m/%Y does", form)
