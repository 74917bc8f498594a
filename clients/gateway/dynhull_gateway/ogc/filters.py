"""Which features are wanted: a box, a time, a page."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Self

import numpy as np
import numpy.typing as npt
import shapely
from pydantic import AfterValidator, BaseModel, ConfigDict, Field

from dynhull_surface.iso_times import from_iso

from ..schemas import PLACE

MOST = 10_000
FEW = 100
NUMBER = r"-?[0-9]{1,20}(\.[0-9]{1,20})?([eE]-?[0-9]{1,2})?"
BBOX = rf"^{NUMBER}(,{NUMBER}){{3}}((,{NUMBER}){{2}})?$"
OPEN = ("", "..")
RFC3339 = re.compile(r"\d{4}-\d\d-\d\d[Tt]\d\d:\d\d:\d\d(\.\d+)?([Zz]|[+-]\d\d:\d\d)")


@dataclass(frozen=True, slots=True)
class Matching:
    """A page of features.

    Attributes:
        features: the features.
        following: the name or key after which the next page begins; None on the last.
        matched: the number of features on all pages; None if it is not known.
    """

    features: list[dict[str, Any]]
    following: str | None
    matched: int | None


def in_range(lon: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Longitudes of -360 to 360 degrees as ones of -180 to 180, as CRS84 has them."""
    return np.where(np.abs(lon) <= 180, lon, lon - np.copysign(360, lon))


@dataclass(frozen=True, slots=True)
class Box:
    """A box in degrees; west is greater than east where it crosses the antimeridian."""

    west: float
    south: float
    east: float
    north: float

    @classmethod
    def read(cls, text: str) -> Self:
        """Of four numbers, or of six, two of which are heights."""
        if not re.fullmatch(BBOX, text):
            raise ValueError("must be four numbers of degrees with commas between: WEST,SOUTH,EAST,NORTH")
        numbers = [float(each) for each in text.split(",")]
        west, south, east, north = numbers if len(numbers) == 4 else (*numbers[:2], *numbers[3:5])
        for name, value, most in (("west", west, 360), ("south", south, 90), ("east", east, 360), ("north", north, 90)):
            if abs(value) > most:
                raise ValueError(f"must be WEST,SOUTH,EAST,NORTH: {name} is {value:g}, beyond {most} degrees")
        if south > north:
            raise ValueError(
                f"must be WEST,SOUTH,EAST,NORTH: the southern edge {south:g} is north of the northern edge {north:g}"
            )
        if east - west >= 360:
            west, east = -180.0, 180.0
        else:
            west, east = in_range(np.array([west, east])).tolist()
        return cls(west, south, east, north)

    def holds(self, lonlat: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
        """Which of (n, 2) places are in the box; 180 and -180 degrees are one meridian."""
        lon, lat = in_range(lonlat[:, 0]), lonlat[:, 1]
        in_lon = (
            (self.west <= lon) & (lon <= self.east)
            if self.west <= self.east
            else (self.west <= lon) | (lon <= self.east)
        )
        if self._has_antimeridian:
            in_lon |= np.abs(lon) == 180
        return in_lon & (self.south <= lat) & (lat <= self.north)

    def meets(self, geometry: Mapping[str, Any] | None) -> bool:
        """Whether a GeoJSON geometry within 180 degrees has a point in the box.

        What is nowhere is in every box: the standard has it in all pages (requirement 24, C).
        """
        if geometry is None:
            return True
        shape = shapely.geometry.shape(geometry)
        parts = [(self.west, self.east)] if self.west <= self.east else [(self.west, 180.0), (-180.0, self.east)]
        if self._has_antimeridian:
            parts += [(180.0, 180.0), (-180.0, -180.0)]
        return any(shape.intersects(shapely.box(west, self.south, east, self.north)) for west, east in parts)

    @property
    def _has_antimeridian(self) -> bool:
        return self.west > self.east or self.west == -180 or self.east == 180


@dataclass(frozen=True, slots=True)
class Interval:
    """From a time to a time, both included; None for an open end."""

    begin: datetime | None
    end: datetime | None

    @classmethod
    def read(cls, text: str) -> Self:
        """Of an instant, or of two with a slash between, one of which may be open: .. or nothing."""
        ends = text.split("/")
        if len(ends) > 2 or all(each in OPEN for each in ends):
            raise ValueError("must be a time, or an interval BEGIN/END, of which one may be open: ..")
        begin, end = (_instant(each) for each in (ends if len(ends) == 2 else ends * 2))
        if begin is not None and end is not None and begin > end:
            raise ValueError("begins after its end")
        return cls(begin, end)

    def holds(self, times: npt.NDArray[np.datetime64]) -> npt.NDArray[np.bool_]:
        """Which of (n,) times are in the interval."""
        found = np.ones(len(times), np.bool_)
        if self.begin is not None:
            found &= times >= _as_numpy(self.begin)
        if self.end is not None:
            found &= times <= _as_numpy(self.end)
        return found


def _readable(kind: type[Box] | type[Interval]) -> Any:
    def check(text: str) -> str:
        kind.read(text)
        return text

    return AfterValidator(check)


class Page(BaseModel):
    """The parameters of a page. Unknown ones are refused, as the standard demands."""

    model_config = ConfigDict(extra="forbid")

    bbox: Annotated[str, Field(json_schema_extra={"pattern": BBOX}), _readable(Box)] | None = Field(
        default=None,
        description="West, south, east, north in degrees; with heights, six numbers.",
        examples=["8,53,11,54"],
    )
    datetime: Annotated[str, Field(max_length=100), _readable(Interval)] | None = Field(
        default=None,
        description="An instant, or an interval such as 2026-01-01T00:00:00Z/.. with one open end: features with an "
        "event time in it, or without one. Keys of a hull that keeps its past are where they were at a past end.",
        examples=["2026-01-01T00:00:00Z/.."],
    )
    limit: int = Field(default=FEW, ge=1, description=f"The most features of a page; more than {MOST} means {MOST}.")
    after: str | None = Field(default=None, max_length=300, description="The feature before the first one of the page.")
    revision: Annotated[str, Field(pattern=PLACE)] | None = Field(
        default=None, description='Of the page before: the link "next" has it, so that all pages are of one revision.'
    )

    @property
    def most(self) -> int:
        """The most features."""
        return min(self.limit, MOST)

    @property
    def box(self) -> Box | None:
        """The box."""
        return None if self.bbox is None else Box.read(self.bbox)

    @property
    def interval(self) -> Interval | None:
        """The time."""
        return None if self.datetime is None else Interval.read(self.datetime)


def _instant(text: str) -> datetime | None:
    if text in OPEN:
        return None
    try:
        if RFC3339.fullmatch(text):
            return from_iso(text)
    except ValueError:
        pass
    raise ValueError(f"{text!r} is not a time such as 2026-01-31T12:00:00Z")


def _as_numpy(time: datetime) -> np.datetime64:
    return np.datetime64(round(time.timestamp() * 1_000_000), "us")
