"""A hull for other programs: as GeoJSON, which geometry libraries read, and as a picture, which notebooks show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from shapely.geometry.base import BaseGeometry

    from .arrays import Points

WIDTH, MOST_HEIGHT = 320.0, 240.0
MARGIN = 12.0
COLOUR = "#3b6fb6"


def geometry(vertices: Points) -> dict[str, Any]:
    """The hull of (h, 2) vertices as a GeoJSON geometry: Polygon, LineString for two vertices, Point for one.

    A hull without points is an empty Polygon.
    """
    corners = [(x, y) for x, y in vertices.tolist()]
    match len(corners):
        case 0:
            return {"type": "Polygon", "coordinates": ()}
        case 1:
            return {"type": "Point", "coordinates": corners[0]}
        case 2:
            return {"type": "LineString", "coordinates": tuple(corners)}
        case _:
            return {"type": "Polygon", "coordinates": ((*corners, corners[0]),)}


class Shown:
    """What any object with `__geo_interface__` has for libraries of geometry."""

    __slots__ = ()

    @property
    def wkt(self) -> str:
        """The geometry as Well-known Text, each coordinate in the digits that give the same double."""
        return well_known_text(_geometry_of(self))

    def to_shapely(self) -> BaseGeometry:
        """The geometry as one of shapely, which has to be installed."""
        from shapely.geometry import shape

        return shape(_geometry_of(self))


def _geometry_of(shown: Any) -> Mapping[str, Any]:
    geojson: Mapping[str, Any] = shown.__geo_interface__
    return geojson["geometry"] if geojson["type"] == "Feature" else geojson


def well_known_text(geojson: Mapping[str, Any]) -> str:
    """A GeoJSON geometry as Well-known Text."""
    kind, coordinates = geojson["type"], geojson["coordinates"]
    return f"{kind.upper()} {_nested([coordinates] if kind == 'Point' else coordinates)}"


def _nested(coordinates: Sequence[Any]) -> str:
    if not coordinates:
        return "EMPTY"
    if isinstance(coordinates[0], float):
        return " ".join(repr(number).removesuffix(".0") for number in coordinates)
    return f"({', '.join(map(_nested, coordinates))})"


def svg(vertices: Points, title: str, points: Points | None = None) -> str:
    """A drawing of (h, 2) vertices and, if given, the (n, 2) points inside, with the same unit on both axes."""
    from html import escape  # only notebooks need it

    place, height = _fitted(vertices)
    corners = " ".join(f"{x:.2f},{y:.2f}" for x, y in place(vertices))
    dots = "".join(
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius}" fill="{COLOUR}"/>'
        for some, radius in ((points, 1.5), (vertices, 3.0))
        if some is not None
        for x, y in place(some)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {height:g}" '
        f'width="{WIDTH:g}" height="{height:g}" role="img"><title>{escape(title)}</title>'
        f'<polygon points="{corners}" fill="{COLOUR}" fill-opacity="0.15" stroke="{COLOUR}" stroke-width="1.5" '
        f'stroke-linejoin="round"/>{dots}</svg>'
    )


def _fitted(vertices: Points) -> tuple[Callable[[Points], Points], float]:
    """From coordinates, doubles of any size, to places in the picture, and its height."""
    if not len(vertices):
        return (lambda points: points), 2 * MARGIN
    # Scaled to about 1, the extent neither overflows nor vanishes.
    exponent = int(np.frexp(np.abs(vertices).max())[1]) + 1
    scaled = np.ldexp(vertices, -exponent)
    low, high = scaled.min(axis=0), scaled.max(axis=0)
    unit = float(((high - low) / [WIDTH - 2 * MARGIN, MOST_HEIGHT - 2 * MARGIN]).max()) or 1.0
    height = round(float(high[1] - low[1]) / unit + 2 * MARGIN)

    def place(points: Points) -> Points:
        away: Points = (np.ldexp(points, -exponent) - (low + high) / 2) / unit
        return away * [1, -1] + [WIDTH / 2, height / 2]

    return place, height
