"""Points of GeoJSON geometries."""

import json
import math
from decimal import Decimal
from itertools import chain
from typing import Any

from .chunks import Position

NESTED = {"MultiPoint": 1, "LineString": 1, "MultiLineString": 2, "Polygon": 2, "MultiPolygon": 3}  # lists of lists ...
CLOSED = {"Polygon", "MultiPolygon"}
LONGEST_TEXT = 200


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
    return number(value[0], "x"), number(value[1], "y")


def number(value: Any, name: str) -> float:
    """A finite number; ValueError where it is none."""
    if value is None:
        raise ValueError(f"{name} is missing")
    if isinstance(value, bool) or not isinstance(value, int | float | Decimal):
        raise ValueError(f"{name} is {json_text(value)}, not a number")
    try:
        rounded = float(value)
    except OverflowError:  # of an integer
        rounded = math.inf
    if not math.isfinite(rounded):
        raise ValueError(f"{name} is {_shortened(str(value))}, not finite")
    return rounded + 0.0


def json_text(value: Any) -> str:
    """A value as it stands in the file, shortened."""
    return _shortened(json.dumps(value, default=float))


def _shortened(text: str) -> str:
    return text if len(text) <= LONGEST_TEXT else f"{text[:LONGEST_TEXT]}..."


def _list(value: Any) -> list[Any]:
    if not isinstance(value, list):
        raise ValueError("its coordinates are not a list")
    return value
