"""A column of geometries: well-known binary, also in hexadecimal digits, or text, perhaps with SRID; or GeoJSON."""

import re
from collections.abc import Sequence
from itertools import islice
from typing import Any

import numpy as np

from . import wkb
from .chunks import Points, Position
from .geometry import positions
from .reference_system import note_reference_system
from .source import Source

Value = bytes | str | dict[str, Any] | None
"""WKB, a text, or GeoJSON."""
DEGREES = 4326  # the SRID of GeoJSON

WKB_POINTS = np.dtype([("order", "u1"), ("type", "<u4"), ("xy", "<f8", (2,))])
LITTLE_ENDIAN, POINT = 1, 1
SRID = re.compile(r"\s*SRID\s*=\s*(\d+)\s*;", re.IGNORECASE)
HEXADECIMAL = re.compile(r"\s*0[01](?:[0-9a-f]{2}){4,}\s*", re.IGNORECASE)


class GeometryColumn:
    """Reads the points of geometries.

    Args:
        source: the input, which learns whether these are degrees.
        name: of the column.
        system_known: whether the input has said in which coordinate reference system its geometries are. Otherwise the
            first SRID does; it is that of all.
    """

    def __init__(self, source: Source, name: str, *, system_known: bool) -> None:
        self._source, self._name = source, name
        self._every_vertex = source.options.vertices
        self._system_known = system_known
        self._srid: int | None = None

    def points(self, rows: Sequence[Value]) -> Points | None:
        """The points where all rows are plain ones, which is the usual case; otherwise None."""
        if not self._system_known:  # the first rows say it
            return None
        if all(isinstance(row, bytes) for row in rows):
            return _wkb_points(rows)
        return _wkt_points(rows) if all(isinstance(row, str) for row in rows) else None

    def positions(self, row: Value) -> list[Position]:
        """The points of a geometry; ValueError where it has none."""
        srid, geometry = _decoded(row)
        if srid is not None and srid != self._srid and (self._srid is not None or not self._system_known):
            if self._srid is not None:
                raise ValueError(f"its SRID is {srid}, and that of the first geometry {self._srid}")
            self._srid = srid
            self._note(f"EPSG:{srid}")
        found = positions(geometry, self._every_vertex)
        if not self._system_known:
            self._note(None)
        return found

    def _note(self, system: str | None) -> None:
        self._system_known = True
        note_reference_system(self._source, system, f"the column {self._name}")


def _decoded(row: Value) -> tuple[int | None, Any]:
    """The SRID of a geometry, None without one, and its GeoJSON."""
    if isinstance(row, dict):
        return DEGREES, row
    if isinstance(row, str):
        if HEXADECIMAL.fullmatch(row):
            row = bytes.fromhex(row)
        else:
            srid = SRID.match(row)
            text = row if srid is None else row[srid.end() :]
            return None if srid is None else int(srid[1]), _of_text(text) if text.strip() else None
    return (None, None) if row is None else (wkb.srid_of(row), wkb.decode(row))


def _of_text(text: str) -> Any:
    import shapely

    try:
        return wkb.decode(shapely.to_wkb(shapely.from_wkt(text)))
    except (shapely.errors.ShapelyError, NotImplementedError) as error:
        problem = str(error).removeprefix("ParseException: ")
        raise ValueError(f"its geometry is not well-known text: {problem}") from None


def _wkb_points(rows: Sequence[Any]) -> Points | None:
    if any(len(row) != WKB_POINTS.itemsize for row in rows):
        return None
    found = np.frombuffer(b"".join(rows), WKB_POINTS)
    usual = (found["order"] == LITTLE_ENDIAN).all() and (found["type"] == POINT).all()
    return found["xy"] + 0.0 if usual and np.isfinite(found["xy"]).all() else None


def _wkt_points(rows: Sequence[Any]) -> Points | None:
    if any(row[:1] not in "Pp" for row in islice(rows, 1)):
        return None
    import shapely

    found = shapely.from_wkt(np.array(rows, object), on_invalid="ignore")
    if not (shapely.get_type_id(found) == 0).all():
        return None
    points = shapely.get_coordinates(found)
    return points + 0.0 if len(points) == len(rows) and np.isfinite(points).all() else None
