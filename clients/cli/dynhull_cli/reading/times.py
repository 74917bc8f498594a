"""Points in time, as files and people write them, in microseconds since 1970."""

from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from enum import StrEnum
from typing import Any

from .values import BadValueError


class TimeUnit(StrEnum):
    """The units of times that are numbers."""

    SECONDS = "s"
    MILLISECONDS = "ms"
    MICROSECONDS = "us"
    NANOSECONDS = "ns"


EPOCH = datetime(1970, 1, 1, tzinfo=UTC)
MICROSECOND = timedelta(microseconds=1)
LARGEST_TIME = 2**53  # microseconds: the years 1685 to 2255
NOT_OF_THESE_YEARS = "not from the years 1685 to 2255"
LARGEST_EXPONENT = 30  # of a number: far beyond these years in any unit
MICROSECONDS = {
    TimeUnit.SECONDS: Decimal(1_000_000),
    TimeUnit.MILLISECONDS: Decimal(1000),
    TimeUnit.MICROSECONDS: Decimal(1),
    TimeUnit.NANOSECONDS: Decimal("0.001"),
}
NAMES = {
    TimeUnit.SECONDS: "seconds",
    TimeUnit.MILLISECONDS: "milliseconds",
    TimeUnit.MICROSECONDS: "microseconds",
    TimeUnit.NANOSECONDS: "nanoseconds",
}
# A number below this is in the unit: seconds reach to the year 5138, and milliseconds begin in 1973.
LIMITS = {
    TimeUnit.SECONDS: Decimal(10) ** 11,
    TimeUnit.MILLISECONDS: Decimal(10) ** 14,
    TimeUnit.MICROSECONDS: Decimal(10) ** 17,
}


class TimeReader:
    """Reads times: ISO 8601 with a time zone, or numbers since 1970, all in one unit.

    Attributes:
        unit: the unit of numbers; None until the first number decides it.
        note: a line about the unit that the first number decided; None without one.
    """

    def __init__(self, name: str, unit: TimeUnit | None = None) -> None:
        self.unit = unit
        self.note: str | None = None
        self._name = name

    def read(self, value: Any) -> int:
        """The time in microseconds since 1970; ValueError says what is wrong with the value."""
        if isinstance(value, str) and value[4:5] == "-" and value[:4].isdecimal():  # a date, as most times are
            return self._of_text(value.strip())
        if isinstance(value, datetime):
            return self._of_datetime(value, value.isoformat())
        text = "" if value is None else str(value).strip()
        if not text:
            raise BadValueError(self._name, "is missing")
        try:
            number = Decimal(text)
        except InvalidOperation:
            return self._of_text(text)
        if not number.is_finite() or "_" in text:
            raise BadValueError(self._name, "not a time", text)
        return self._of_number(number, text)

    def _of_number(self, number: Decimal, text: str) -> int:
        unit = unit_of(number) if self.unit is None else self.unit
        if number.adjusted() > LARGEST_EXPONENT or abs(number) * MICROSECONDS[unit] > LARGEST_TIME:
            raise BadValueError(self._name, f"as {NAMES[unit]} {NOT_OF_THESE_YEARS}", text)
        micros = int((number * MICROSECONDS[unit]).to_integral_value("ROUND_FLOOR"))
        if self.unit is None:
            self.unit = unit
            self.note = (
                f"{self._name}: times are {NAMES[unit]} since 1970, the first is "
                f"{(EPOCH + timedelta(microseconds=micros)).isoformat()}; --time-unit reads them in another unit"
            )
        return micros

    def _of_text(self, text: str) -> int:
        try:
            time = datetime.fromisoformat(text)
        except ValueError:
            raise BadValueError(self._name, "neither ISO 8601 with a time zone nor a number", text) from None
        return self._of_datetime(time, text)

    def _of_datetime(self, value: datetime, text: str) -> int:
        if value.tzinfo is None:
            raise BadValueError(self._name, "without a time zone: add Z for UTC, or an offset", text)
        micros = (value - EPOCH) // MICROSECOND
        if abs(micros) > LARGEST_TIME:
            raise BadValueError(self._name, NOT_OF_THESE_YEARS, text)
        return micros


def shown_time(micros: int) -> str:
    """A time as ISO 8601."""
    return (EPOCH + timedelta(microseconds=micros)).isoformat().replace("+00:00", "Z")


def unit_of(number: Decimal) -> TimeUnit:
    """The unit in which a number since 1970 is a time of our age."""
    return next((unit for unit, limit in LIMITS.items() if abs(number) < limit), TimeUnit.NANOSECONDS)
