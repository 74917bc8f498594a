"""Points of GeoJSON geometries."""

from itertools import chain
from typing import Any

from ..reading.values import number
from .chunks import Position

NESTED = {"MultiPoint": 1, "LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}  # lists of lists ...
CLOSED = {"Polygon", "MultiPolygon"}


def positions(geometry: Any, every_vertex: bool) -> list[Position]:
    """The point of a geometry; with `every_vertex`, the vertices of any geometry, of a closed ring each once.

    ValueError where it has none.
    """
    if not isinstance(geometry, dict):
        raise ValueError("its geometry is missing")
    kind = geometry.get("type")
    if kind == "Point":
        return [position(geometry.get("coordinates"))]
    if not every_vertex:
        raise ValueError(f"its geometry is {kind}, not a Point (--vertices takes the vertices of every geometry)")
    if kind == "GeometryCollection":
        return list(chain.from_iterable(positions(each, True) for each in _list(geometry.get("geometries"))))
    if kind not in NESTED:
        raise ValueError(f"its geometry is {kind}, which GeoJSON does not have")
    lines: Any = [geometry.get("coordinates")]
    for _ in range(NESTED[kind] - 1):
        lines = chain.from_iterable(map(_list, lines))
    found = []
    for line in lines:
        vertices = [position(each) for each in _list(line)]
        found += vertices[:-1] if kind in CLOSED and vertices[:1] == vertices[1:][-1:] else vertices
    return found


def position(value: Any) -> Position:
    """An array of x, y and perhaps more; ValueError where it is none."""
    if not isinstance(value, list) or len(value) < 2:
        raise ValueError("not two coordinates")
    x, y = value[:2]
    return number(x, "x"), number(y, "y")


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError("its coordinates are not a list")
    return value
