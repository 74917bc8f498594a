"""Numbers in bodies: read as the nearest double, and never from a text; time spans may be texts, and moments are."""

from typing import Annotated, Any

from pydantic import BeforeValidator, Field

from dynhull_surface.as_of import read_moment
from dynhull_surface.spans import FORMS, span_of

LARGEST = 2**64 - 1


def seconds_of(value: Any) -> Any:
    """The seconds of a time span such as 30m; what is no text, as it is."""
    if not isinstance(value, str):
        return value
    span = span_of(value)
    try:
        return float(value) if span is None else span.total_seconds()
    except ValueError:
        raise ValueError(f"must be a time span: {FORMS}") from None


def _moment(text: Any) -> int | str:
    if not isinstance(text, str):
        raise ValueError("must be a valid string")
    return read_moment(text)


def or_text(span: Any) -> BeforeValidator:
    """What lets a number of seconds be a text, too."""
    return BeforeValidator(seconds_of, json_schema_input_type=span | str)


SPAN = "Seconds, or a time span such as 30m"
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_UpToYears = Annotated[float, Field(strict=True, ge=0, le=1e9, allow_inf_nan=False)]
_Lifetime = Annotated[float, Field(strict=True, gt=0, le=1e9)]
_AnyTime = Annotated[float, Field(strict=True, gt=0, allow_inf_nan=False)]
_UpToOneYear = Annotated[float, Field(strict=True, gt=0, le=86_400 * 366)]
_UpToOneDay = Annotated[float, Field(strict=True, gt=0, le=86_400)]
Seconds = Annotated[_UpToYears, or_text(_UpToYears)]
Lifetime = Annotated[_Lifetime, or_text(_Lifetime)]
KeptSpan = Annotated[_AnyTime, or_text(_AnyTime)]
PastSpan = Annotated[_UpToOneYear, or_text(_UpToOneYear)]
DaySpan = Annotated[_UpToOneDay, or_text(_UpToOneDay)]
# Pairs are lists of two: their JSON schema, unlike that of tuples, is the same in every draft.
Point = Annotated[list[Number], Field(min_length=2, max_length=2)]
# A revision, or the text of a time.
Moment = Annotated[int | str, BeforeValidator(_moment, json_schema_input_type=Annotated[str, Field(max_length=100)])]
