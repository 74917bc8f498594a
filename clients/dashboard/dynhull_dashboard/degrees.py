"""Places on the globe in the picture: longitude to the right, latitude upwards, in degrees."""

from math import cos, radians, sin

import numpy as np

from dynhull.globe import Gnomonic, geojson
from dynhull_client import Circle

from .drawing import Points

Center = tuple[float, float]  # longitude and latitude

FULL_TURN = 360.0
MEAN_RADIUS = 6_371_008.8  # of the earth, in metres
SQUARE_KILOMETRE = 1e6
CORNERS_OF_CIRCLE = 180
# Neighbours in an outline are at most this far apart, in metres, so that great circles are drawn as they are.
SEGMENT = 100_000.0
POLE = 90.0
RIM = 1.55  # radians from the middle of a plane of metres


def axes(center: Center | None) -> tuple[str, str]:
    """The names of both coordinates. `center`: of a hull on the globe."""
    return ("x", "y") if center is None else ("longitude", "latitude")


def position_text(x: float, y: float, center: Center | None) -> str:
    """A place in words: in degrees to the decimetre, in a plane with eight digits."""
    if center is None:
        return f"x {x:.8g}, y {y:.8g}"
    return f"longitude {round(x, 6):.9g}, latitude {round(y, 6):.8g}"


def shown(places: Points, center: Center | None) -> Points:
    """The places with longitudes within half a turn of the centre, so that no hull is torn at 180 degrees.

    Without a centre they are points of a plane, and stay.
    """
    if center is None or not len(places):
        return places
    lon = places[:, 0]
    return np.column_stack([lon - FULL_TURN * np.round((lon - center[0]) / FULL_TURN), places[:, 1]])


def shown_place(x: float, y: float, center: Center | None) -> tuple[float, float]:
    """The same for one place."""
    ((x, y),) = shown(np.array([[x, y]]), center).tolist()
    return x, y


def outline(vertices: Points, center: Center | None) -> list[Points]:
    """The rings that a hull fills in the picture; of a segment, its line.

    On the globe the edges are great circles. A hull that reaches half a turn from the centre is cut there, and with a
    pole inside it reaches the border of the map.
    """
    if center is None or len(vertices) < 2:
        return [shown(vertices, center)]
    east = np.array([center[0], 0.0])
    shape = geojson(shown(vertices, center) - east, SEGMENT)
    parts = shape["coordinates"] if shape["type"].startswith("Multi") else (shape["coordinates"],)
    return [np.array(part[0][:-1] if shape["type"].endswith("Polygon") else part) + east for part in parts]


def poles(rings: list[Points]) -> list[str]:
    """The poles in an outline."""
    lat = np.concatenate([ring[:, 1] for ring in rings])
    return [name for name, pole in (("north", POLE), ("south", -POLE)) if (lat == pole).any()]


class Flat:
    """A plane of metres around some places: true from their middle, and for the eye elsewhere.

    Args:
        places: (k, 2) longitudes and latitudes.
    """

    def __init__(self, places: Points) -> None:
        self._frame = Gnomonic.about(places)

    def flat(self, places: Points) -> Points | None:
        """The places in the plane; None if one is too far from the middle."""
        xy, near = self._frame.project(places)
        away = np.hypot(*xy.T)[:, None]
        return (
            MEAN_RADIUS * xy * np.divide(np.arctan(away), away, out=np.ones_like(away), where=away > 0)
            if near.all()
            else None
        )

    def places(self, xy: Points) -> Points:
        """The places of points of the plane, which is cut off a little before its border."""
        away = np.hypot(*xy.T)[:, None] / MEAN_RADIUS
        angles = np.minimum(away, RIM)
        return self._frame.unproject(
            xy / MEAN_RADIUS * np.divide(np.tan(angles), away, out=np.ones_like(away), where=away > 0)
        )


def disk(x: float, y: float, radius: float, center: Center | None) -> Points:
    """The border of the disk around a place as it is shown, clockwise; no places without a radius."""
    if not radius:
        return np.empty((0, 2))
    return shown(circle(Circle(x, y, radius), on_globe=center is not None)[::-1], center)


def circle(area: Circle, *, on_globe: bool) -> Points:
    """A circle; on the globe its radius is in metres. For the eye: the server decides who is inside."""
    angles = np.linspace(0, 2 * np.pi, CORNERS_OF_CIRCLE, endpoint=False)
    if not on_globe:
        return np.column_stack([area.x + area.r * np.cos(angles), area.y + area.r * np.sin(angles)])
    away, lat = area.r / MEAN_RADIUS, radians(area.y)
    north = np.arcsin(sin(lat) * cos(away) + cos(lat) * sin(away) * np.sin(angles))
    east = np.arctan2(np.cos(angles) * sin(away) * cos(lat), cos(away) - sin(lat) * np.sin(north))
    return np.column_stack([area.x + np.degrees(east), np.degrees(north)])
