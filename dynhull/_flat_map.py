"""A hull on the globe as GeoJSON (RFC 7946): counter-clockwise, cut at 180 degrees, and with a pole inside.

A position carries the number of times that the boundary has crossed the antimeridian to the east. Each sheet of the
map, between two crossings, then holds one part of the hull, because a meridian meets a convex hull in one piece.
"""

from __future__ import annotations

from itertools import pairwise
from math import atan, copysign, degrees
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ._ellipsoid import GREATEST_RADIUS, along, edge_angles, unit_vectors
from .arrays import Points, as_tuples

if TYPE_CHECKING:
    from ._predicates import Point

MOST_POSITIONS = 10_000_000


class Position(NamedTuple):
    """Longitude from -180 to below 180, latitude, and the sheet of the map."""

    lon: float
    lat: float
    sheet: int


def boundary(vertices: Points, max_segment: float | None = None) -> Points:
    """(k, 2) places along the boundary, counter-clockwise from the first vertex; of two vertices, there and not back.

    Args:
        vertices: (h, 2) vertices.
        max_segment: the greatest distance of neighbours in metres; None for the vertices alone.

    Raises:
        ValueError: `max_segment` is not positive, or leads to more than MOST_POSITIONS places.
    """
    if max_segment is None or len(vertices) < 2:
        return vertices
    if not max_segment > 0:
        raise ValueError(f"max_segment is {max_segment!r}: must be greater than 0 metres")
    ends = np.roll(vertices, -1, axis=0)
    closed = len(vertices) > 2
    if not closed:
        vertices, ends = vertices[:-1], ends[:-1]
    pieces = np.ceil(edge_angles(vertices, ends) * GREATEST_RADIUS / max_segment).clip(1)
    if pieces.sum() > MOST_POSITIONS:
        raise ValueError(f"max_segment is {max_segment!r}: more than {MOST_POSITIONS} positions")
    counts = pieces.astype(np.int64)
    edge = np.repeat(np.arange(len(vertices)), counts)
    step = np.arange(len(edge)) - np.repeat(np.cumsum(counts) - counts, counts)
    places = np.where(step[:, None] > 0, along(vertices[edge], ends[edge], step / counts[edge]), vertices[edge])
    return places if closed else np.concatenate([places, ends[-1:]])


def geojson(vertices: Points, max_segment: float | None = None) -> dict[str, Any]:
    """The hull as a GeoJSON geometry by RFC 7946, with longitudes from -180 to 180.

    Polygon, or MultiPolygon across the antimeridian; LineString or MultiLineString for two vertices, Point for one. A
    hull without points is an empty Polygon.

    Args:
        vertices: (h, 2) vertices.
        max_segment: as for `boundary`, with the same errors.
    """
    closed = len(vertices) > 2
    corners = as_tuples(boundary(vertices, max_segment))
    if not corners:
        return {"type": "Polygon", "coordinates": ()}
    if len(corners) == 1:
        ((lon, lat),) = corners
        return {"type": "Point", "coordinates": (lon if abs(lon) <= 180 else _wrapped(lon), lat)}
    positions = _crossing(on_sheets(corners, closed=closed))
    if not closed:
        return _geometry("LineString", _lines(positions))
    turns = positions.pop().sheet - positions[0].sheet
    rings = [_around_pole(positions, turns)] if turns else _rings(positions)
    return _geometry("Polygon", [((*ring, ring[0]),) for ring in rings])


def _geometry(kind: str, parts: list[Any]) -> dict[str, Any]:
    if len(parts) == 1:
        return {"type": kind, "coordinates": parts[0]}
    return {"type": f"Multi{kind}", "coordinates": tuple(parts)}


def on_sheets(corners: list[Point], *, closed: bool) -> list[Position]:
    """The positions of the corners; if closed, the first again at the end, on the sheet where the way round arrives.

    A pole is a line on the map, its upper or lower border, and so the way over a pole follows the border.
    """
    if abs(corners[0][1]) == 90:
        corners = [*corners[1:], corners[0]]
    path = iter([*corners, corners[0]] if closed else corners)
    lon, lat = next(path)
    positions = [Position(_wrapped(lon), lat, 0)]
    for lon, lat in path:
        last = positions[-1]
        if abs(lat) == 90:
            positions.append(last._replace(lat=lat))
            continue
        lon = _wrapped(lon)
        east = lon - last.lon
        if abs(last.lat) == 90:
            positions.append(_along_border(last, lon))
        elif abs(east) == 180:
            over = last._replace(lat=copysign(90, last.lat + lat))
            positions += [over, _along_border(over, lon)]
        else:
            positions.append(Position(lon, lat, last.sheet - (east > 180) + (east < -180)))
            continue
        positions.append(positions[-1]._replace(lat=lat))
    return positions


def _along_border(last: Position, lon: float) -> Position:
    """The end of a way along the border of the map, the hull on its left: to the west at the north pole."""
    if last.lat > 0:
        return Position(lon, last.lat, last.sheet - (lon > last.lon))
    return Position(lon, last.lat, last.sheet + (lon < last.lon))


def _crossing(positions: list[Position]) -> list[Position]:
    """The positions, with those between them where the way crosses the antimeridian."""
    result = positions[:1]
    for last, after in pairwise(positions):
        if after.sheet > last.sheet and after.lon != -180:
            result.append(Position(-180.0, _latitude_at_antimeridian(last, after), after.sheet))
        elif after.sheet < last.sheet and last.lon != -180:
            result.append(Position(-180.0, _latitude_at_antimeridian(last, after), last.sheet))
        result.append(after)
    return result


def _latitude_at_antimeridian(a: Position, b: Position) -> float:
    """Where the great circle through a and b crosses it."""
    if abs(a.lat) == 90:  # along the border
        return a.lat
    x, _, z = np.cross(*unit_vectors(np.array([a[:2], b[:2]]))).tolist()
    return degrees(atan(x / z))


def _rings(positions: list[Position]) -> list[list[Point]]:
    """The part of a ring on each sheet; not of a sheet that the ring touches at its border only."""
    sheets = {position.sheet for position in positions}
    parts = [_on_sheet(positions, sheet) for sheet in range(min(sheets) - 1, max(sheets) + 1)]
    return [part for part in parts if len({lon for lon, _ in part}) > 1]


def _on_sheet(positions: list[Position], sheet: int) -> list[Point]:
    """The positions on a sheet, with those of the next that are on the common border."""
    return [
        (lon if at == sheet else 180.0, lat)
        for lon, lat, at in positions
        if at == sheet or (at == sheet + 1 and lon == -180)
    ]


def _around_pole(positions: list[Position], turns: int) -> list[Point]:
    """A ring with a pole inside: once around, then along the border of the map."""
    start = next(i for i, position in enumerate(positions) if position.lon == -180)
    lat = positions[start].lat
    between = [(position.lon, position.lat) for position in positions[start + 1 :] + positions[:start]]
    west, east = -180.0 * turns, 180.0 * turns
    pole = 90.0 * turns
    return [(west, lat), *between, (east, lat), (east, pole), (west, pole)]


def _lines(positions: list[Position]) -> list[tuple[Point, ...]]:
    """The parts of a way between two points, cut at the antimeridian."""
    lines: list[tuple[int, list[Point]]] = []
    for a, b in pairwise(positions):
        sheet = a.sheet if a.lon != -180 else b.sheet if b.lon != -180 else min(a.sheet, b.sheet)
        start, end = _on_sheet([a, b], sheet)
        if lines and lines[-1][0] == sheet:
            lines[-1][1].append(end)
        else:
            lines.append((sheet, [start, end]))
    return [tuple(line) for _, line in lines]


def _wrapped(lon: float) -> float:
    """From -180 to below 180; exact."""
    if lon >= 180:
        return lon - 360
    return lon + 360 if lon < -180 else lon
