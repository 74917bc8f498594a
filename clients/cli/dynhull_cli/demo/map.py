"""Flat drawings of scenes: in the plane as they are, on the globe in a projection about the centre of the hull."""

import json
from importlib import resources
from typing import TYPE_CHECKING, Protocol

import numpy as np

from dynhull.globe import Gnomonic, boundary

from .scene import Points, Scene

if TYPE_CHECKING:
    from collections.abc import Callable

# The greatest distance in metres between neighbours on a line, so that great circles are drawn as they are.
SEGMENT = 20_000.0
CIRCLE_CORNERS = 180
# Coasts are drawn up to this far from the centre.
FARTHEST = 70.0


class Drawing(Protocol):
    """Where things of a scene are in the drawing."""

    coasts: list[Points]

    def place(self, points: Points) -> Points:
        """The places of points."""

    def line(self, vertices: Points) -> Points:
        """A closed line through vertices."""

    def circle(self, x: float, y: float, radius: float) -> Points:
        """A closed line around a circle."""


class Plane:
    """Points of a plane are drawn where they are."""

    def __init__(self) -> None:
        self.coasts: list[Points] = []

    def place(self, points: Points) -> Points:
        """The same points."""
        return points

    def line(self, vertices: Points) -> Points:
        """The straight edges."""
        return np.concatenate([vertices, vertices[:1]])

    def circle(self, x: float, y: float, radius: float) -> Points:
        """The circle."""
        angles = np.linspace(0, 2 * np.pi, CIRCLE_CORNERS)
        return np.column_stack([x + radius * np.cos(angles), y + radius * np.sin(angles)])


class Globe:
    """Lambert's azimuthal equal-area projection about a centre, in kilometres: areas in it are areas on the ground."""

    def __init__(self, center: tuple[float, float]) -> None:
        from pyproj import Geod, Transformer

        lon, lat = center
        self._geod = Geod(ellps="WGS84")
        projection = f"+proj=laea +lat_0={lat} +lon_0={lon} +ellps=WGS84 +units=km"
        self._project: Callable[..., tuple[Points, Points]] = Transformer.from_crs(
            "EPSG:4326", projection, always_xy=True
        ).transform
        self.coasts = [self.place(ring[near]) for ring in coastline() for near in _parts(center, ring)]

    def place(self, points: Points) -> Points:
        """Kilometres to the east and to the north of the centre."""
        return np.column_stack(self._project(*points.T)) if len(points) else points

    def line(self, vertices: Points) -> Points:
        """The great circles between the vertices."""
        along = boundary(vertices, SEGMENT)
        return self.place(np.concatenate([along, along[:1]]))

    def circle(self, x: float, y: float, radius: float) -> Points:
        """The places at that many metres."""
        ones = np.ones(CIRCLE_CORNERS)
        lon, lat, _ = self._geod.fwd(x * ones, y * ones, np.linspace(0, 360, CIRCLE_CORNERS), radius * ones)
        return self.place(np.column_stack([lon, lat]))


def drawing_of(scene: Scene) -> Drawing:
    """The drawing for a scene."""
    return Plane() if scene.center is None else Globe(scene.center)


def coastline() -> list[Points]:
    """The coasts of the world as closed rings of longitudes and latitudes: Natural Earth, 1:110m."""
    text = resources.files(__package__).joinpath("coastline.json").read_text(encoding="utf-8")
    return [np.array(ring) for ring in json.loads(text)]


def _parts(center: tuple[float, float], ring: Points) -> list[slice]:
    """The parts of a ring that are not far from the centre."""
    places, near = Gnomonic(center).project(ring)
    near &= np.hypot(*np.nan_to_num(places, nan=np.inf).T) < np.tan(np.radians(FARTHEST))
    edges = np.flatnonzero(np.diff(np.concatenate([[False], near, [False]]).astype(int)))
    return [slice(first, end) for first, end in edges.reshape(-1, 2).tolist()]
