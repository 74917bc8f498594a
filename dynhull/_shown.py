"""A hull for other programs: as GeoJSON, which geometry libraries read, and as a picture, which notebooks show."""

from html import escape
from typing import Any

import numpy as np

from .arrays import Points

WIDTH, HEIGHT = 320.0, 240.0
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
    return {"type": "Polygon", "coordinates": ((*corners, corners[0]),)}


def svg(vertices: Points, title: str, points: Points | None = None) -> str:
    """A drawing of (h, 2) vertices and, if given, the (n, 2) points inside, with the same unit on both axes."""
    place = _fitted(vertices)
    corners = " ".join(f"{x:.2f},{y:.2f}" for x, y in place(vertices))
    dots = "".join(
        f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius}" fill="{COLOUR}"/>'
        for some, radius in ((points, 1.5), (vertices, 3.0))
        if some is not None
        for x, y in place(some)
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {HEIGHT:g}" '
        f'width="{WIDTH:g}" height="{HEIGHT:g}" role="img"><title>{escape(title)}</title>'
        f'<polygon points="{corners}" fill="{COLOUR}" fill-opacity="0.15" stroke="{COLOUR}" stroke-width="1.5" '
        f'stroke-linejoin="round"/>{dots}</svg>'
    )


def _fitted(vertices: Points) -> Any:
    """From coordinates to places in the picture. Halved first: the extent of two doubles may be no double."""
    if not len(vertices):
        return lambda points: points
    halves = vertices / 2
    low, high = halves.min(axis=0), halves.max(axis=0)
    room = np.array([WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN])
    extent = high - low
    unit = float((extent / room).max())
    middle = low + extent / 2

    def place(points: Points) -> Points:
        away = (points / 2 - middle) / unit if unit > 0 else np.zeros_like(points)
        return np.array([WIDTH / 2, HEIGHT / 2]) + away * [1, -1]

    return place
