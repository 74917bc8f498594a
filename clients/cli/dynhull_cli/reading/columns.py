"""Finds the columns of coordinates by name."""

import re
from collections.abc import Iterable, Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from dynhull.arrays import COLUMN_NAMES, Points

from .values import BadValueError, is_number

LONGITUDE_LATITUDE = "longitude", "latitude"
GEOMETRY_NAMES = (
    "geometry",
    "geom",
    "the_geom",
    "wkt",
    "ewkt",
    "wkt_geom",
    "wkb",
    "ewkb",
    "wkb_geometry",
    "geography",
    "geog",
)
DEGREES = [pair for pair in COLUMN_NAMES if pair[1] in ("lat", "latitude")]
PLANE = [pair for pair in COLUMN_NAMES if pair not in DEGREES]
ABBREVIATED = (("eastings", "northings"), ("east", "north"), ("e", "n"))  # names of coordinates, if there are no others
UNITS = re.compile(r"[(\[].*")
FILLINGS = re.compile(r"^(gps|geo|position|location|coordinates|decimal|wgs84)|(degrees|degree|deg|decimal|dd|wgs84)$")
GREATEST_LONGITUDE, GREATEST_LATITUDE = 360.0, 90.0
UNKNOWN_LATITUDE = 91.0  # of AIS, with the longitude 181 (ITU-R M.1371)
NOT_AVAILABLE = "which AIS writes where it is not available"


def has_pair(columns: Sequence[str]) -> bool:
    """Whether a pair of known names is among the columns."""
    return _pair(columns) is not None


def are_degrees(x: str, y: str) -> bool:
    """Whether the names of two columns say that these are longitudes and latitudes."""
    return (_plain(x), _plain(y)) in DEGREES


def say_plane(x: str, y: str) -> bool:
    """Whether the names of two columns say that these are coordinates of a plane."""
    return (_plain(x), _plain(y)) in PLANE


def look_like_degrees(points: Points) -> bool:
    """Whether points may well be longitudes and latitudes: within their bounds, not all whole or in the unit square."""
    size = np.abs(points)
    fractions = bool((points % 1).any()) and bool((size > 1).any())
    return fractions and bool((size <= (GREATEST_LONGITUDE / 2, GREATEST_LATITUDE)).all())


def why_no_place(lon: float, lat: float) -> str | None:
    """Why two numbers are no longitude and latitude; None if they are."""
    if lat == UNKNOWN_LATITUDE:
        return f"the latitude is {lat}, {NOT_AVAILABLE}"
    if abs(lat) > GREATEST_LATITUDE:
        hint = "; the longitude comes first" if abs(lon) <= GREATEST_LATITUDE else ""
        return f"the latitude is {lat}, not from -90 to 90 degrees{hint}"
    if abs(lon) > GREATEST_LONGITUDE:
        return f"the longitude is {lon}, not from -360 to 360 degrees"
    return None


def available(names: tuple[str, str], x: float, y: float) -> tuple[float, float]:
    """The coordinates of a row; BadValueError if they are those of AIS for a position that is not available."""
    if y == UNKNOWN_LATITUDE and are_degrees(*names):
        raise BadValueError(names[1], NOT_AVAILABLE, y)
    return x, y


def coordinate_columns(path: Path | str, columns: Sequence[str], x: str | None, y: str | None) -> tuple[int, int]:
    """The indices of the columns of x and y: those given, or the first known pair.

    ValueError where a column is not there; the message names the columns that are.
    """
    pair = _pair(columns)
    if x is None and y is None and pair is not None:
        return pair
    if x is None and y is None:
        raise ValueError(
            f"{path} has no columns with names such as x and y or lon and lat: name two with --x and --y; "
            f"it has {', '.join(columns)}"
        )
    found = []
    for option, column in (("--x", x), ("--y", y)):
        if column is None:
            raise ValueError(f"{path}: name its {option[2:]} column with {option}; it has {', '.join(columns)}")
        found.append(column_index(path, columns, option, column))
    return found[0], found[1]


def geometry_column(
    path: Path | str, columns: Sequence[str], x: str | None, y: str | None, geometry: str | None
) -> str | None:
    """The column of geometries: the given one, or that of a known name where no columns of x and y are given or known.

    None without one. ValueError where the given one is not there.
    """
    if geometry is not None:
        return columns[column_index(path, columns, "--geometry", geometry)]
    if x is not None or y is not None or has_pair(columns):
        return None
    return next((column for column in columns if column.strip().lower() in GEOMETRY_NAMES), None)


def column_index(path: Path | str, columns: Sequence[str], option: str, column: str) -> int:
    """The index of a column, given by its name or, where none has that name, by its number from 1."""
    if columns.count(column) > 1:
        raise ValueError(f"{path} has {columns.count(column)} columns {column!r}: give the number of one with {option}")
    if column in columns:
        return columns.index(column)
    if column.isdecimal() and 1 <= int(column) <= len(columns):
        return int(column) - 1
    raise ValueError(f"{path} has no column {column!r} ({option}); it has {', '.join(columns)}")


def decimal_mark(texts: Iterable[str], delimiter: str) -> str:
    """The decimal mark: a comma if some number has one, none has a point, and commas do not separate columns.

    Otherwise a point.
    """
    numbers = [text for text in texts if is_number(text)] if delimiter != "," else []
    return "," if any("," in each for each in numbers) and not any("." in each for each in numbers) else "."


def pair_of(columns: Iterable[str]) -> tuple[str, str] | None:
    """The names of the columns of x and y, if a pair of known names is among them."""
    names = list(columns)
    pair = _pair(names)
    return None if pair is None else (names[pair[0]], names[pair[1]])


def _pair(columns: Sequence[str]) -> tuple[int, int] | None:
    """The places of the first pair of known names, first of those that are written like this."""
    lowered = [column.strip().lower() for column in columns]
    for names, pairs in ((lowered, COLUMN_NAMES), (list(map(_plain, columns)), (*COLUMN_NAMES, *ABBREVIATED))):
        for x, y in pairs:
            if names.count(x) == names.count(y) == 1:
                return names.index(x), names.index(y)
    return None


@lru_cache(maxsize=1024)
def _plain(column: str) -> str:
    """A name without what is often written around it: GPS_LAT and Latitude (deg) are lat and latitude."""
    return FILLINGS.sub("", re.sub("[^a-z0-9]", "", UNITS.sub("", column.lower())))
