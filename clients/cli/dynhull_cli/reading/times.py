"""Points in time, as files and people write them, in microseconds since 1970."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from decimal import Decimal, InvalidOperation
from typing import Any

import numpy as np
import numpy.typing as npt

from dynhull_surface.iso_times import from_iso

from .time_forms import Ambiguous, TimeForm, TimeUnit, from_format
from .values import BadValueError

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
    """Reads times: ISO 8601, or numbers since 1970, all in one unit; or those of another form.

    Attributes:
        unit: the unit of numbers; None until the first number decides it.
        note: a line about the unit that the first number decided; None without one.
    """

    def __init__(self, name: str, form: TimeForm | None = None) -> None:
        self._form = form or TimeForm()
        self.unit = self._form.unit
        self.note: str | None = None
        self._name = name

    def read(self, value: Any) -> int:
        """The time in microseconds since 1970; ValueError says what is wrong with the value."""
        form = self._form.format
        if form is None and isinstance(value, str) and value[4:5] == "-" and value[:4].isdecimal():
            return self._of_text(value.strip())  # a date, as most times are
        if isinstance(value, datetime):
            return self._of_datetime(value, value.isoformat())
        text = "" if value is None else str(value).strip()
        if not text:
            raise BadValueError(self._name, "is missing")
        if form is not None:
            return self._of_form(text, form)
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
            time = from_iso(text)
        except ValueError:
            zone = " with a time zone" if self._form.zone is None else ""
            other = self._form.advice("; {} reads other forms", "time_format")
            raise BadValueError(self._name, f"neither ISO 8601{zone} nor a number{other}", text) from None
        return self._of_datetime(time, text)

    def _of_form(self, text: str, form: str) -> int:
        try:
            time = from_format(text, form)
        except ValueError:
            raise BadValueError(self._name, f"not of the form {form}", text) from None
        return self._of_datetime(time, text)

    def _of_datetime(self, value: datetime, text: str) -> int:
        return self._of_zone(value, text) if value.tzinfo is None else self._checked(value, text)

    def _of_zone(self, value: datetime, text: str) -> int:
        """The time that the clocks of the zone say."""
        form, zone = self._form, self._form.zone
        if zone is None:
            named = form.advice(", or name it with {}", "time_zone")
            raise BadValueError(self._name, f"without a time zone: add Z for UTC, or an offset{named}", text)
        moments = sorted({self._checked(value.replace(tzinfo=zone, fold=fold), text) for fold in (0, 1)})
        if len(moments) == 1:
            return moments[0]
        if form.ambiguous is Ambiguous.REFUSE:
            read = (EPOCH + timedelta(microseconds=moments[0])).astimezone(zone)
            twice = read.replace(tzinfo=None, fold=0) == value
            what = (
                "exists twice in {}: clocks were put back" if twice else "does not exist in {}: clocks were put forward"
            )
            which = form.advice("; {} says which moment it is: earlier or later", "ambiguous")
            raise BadValueError(self._name, what.format(zone.key) + which, text)
        return moments[0 if form.ambiguous is Ambiguous.EARLIER else -1]

    def _checked(self, value: datetime, text: str) -> int:
        micros = (value - EPOCH) // MICROSECOND
        if abs(micros) > LARGEST_TIME:
            raise BadValueError(self._name, NOT_OF_THESE_YEARS, text)
        return micros


def as_times(micros: Sequence[int | None]) -> npt.NDArray[np.datetime64]:
    """Times as the SDK takes them, of microseconds since 1970."""
    return np.array(micros, "datetime64[us]")


def shown_time(micros: int) -> str:
    """A time as ISO 8601."""
    return (EPOCH + timedelta(microseconds=micros)).isoformat().replace("+00:00", "Z")


def unit_of(number: Decimal) -> TimeUnit:
    """The unit in which a number since 1970 is a time of our age."""
    return next((unit for unit, limit in LIMITS.items() if abs(number) < limit), TimeUnit.NANOSECONDS)
