"""The fences of a demo, and their events recomputed from all positions, frame by frame."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

import numpy as np

from dynhull import DynamicHull, GeoHull, convex_hull, orient2d
from dynhull.globe import Gnomonic
from dynhull_client import Circle

from .scene import Frame, Points

# Within this share of the radius, floating point might err about the side of a circle; it decides the rest.
UNSURE = 1e-6
# On the globe a circle is a polygon, whose edges are within this share of the radius.
SAGITTA = 1e-5
CORNERS = 720

Position = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Happening:
    """What an event of a fence says, whether it came from the server or was recomputed."""

    type: Literal["enter", "exit", "begin", "cease"] | str
    key: str | None
    cause: frozenset[str]
    position: Position | None
    previous: Position | None


class Circled:
    """The expected events of a fence around a circle; on the globe if there is a centre of projection."""

    def __init__(self, circle: Circle, center: Position | None) -> None:
        self._holds = self._in_plane if center is None else _OnGlobe(circle, center).holds
        self._circle = circle
        self._before: dict[str, Position] = {}
        self._inside: set[str] = set()

    def expected(self, frame: Frame) -> list[Happening]:
        """The events of a frame, in the order of the keys."""
        now = {name: (x, y) for name, (x, y) in zip(frame.names, frame.positions.tolist(), strict=True)}
        inside = {name for name in now if self._holds(now[name])}
        events = []
        for key in sorted(inside ^ self._inside, key=str.encode):
            position, previous = now.get(key), self._before.get(key)
            cause = (
                "subject_removed" if position is None else "subject_appeared" if previous is None else "subject_moved"
            )
            kind = "enter" if key in inside else "exit"
            events.append(Happening(kind, key, frozenset({cause}), position, previous))
        self._before, self._inside = now, inside
        return events

    def _in_plane(self, position: Position) -> bool:
        circle = self._circle
        dx, dy = position[0] - circle.x, position[1] - circle.y
        away = float(np.hypot(dx, dy)) - circle.r
        if abs(away) > UNSURE * circle.r:
            return away < 0
        exact = [Fraction(value) for value in (*position, circle.x, circle.y, circle.r)]
        return (exact[0] - exact[2]) ** 2 + (exact[1] - exact[3]) ** 2 <= exact[4] ** 2


class _OnGlobe:
    """A circle of metres: the polygon of great circles between places at its radius, every half degree of azimuth."""

    def __init__(self, circle: Circle, center: Position) -> None:
        from pyproj import Geod

        self._geod = Geod(ellps="WGS84")
        self._circle = circle
        ones = np.ones(CORNERS)
        azimuths = -np.linspace(0, 360, CORNERS, endpoint=False)
        lon, lat, _ = self._geod.fwd(circle.x * ones, circle.y * ones, azimuths, circle.r * ones)
        self._polygon = GeoHull(np.column_stack([lon, lat]), center)

    def holds(self, position: Position) -> bool:
        """Whether a position is inside; the distance decides, unless the position is near the edges of the polygon."""
        _, _, metres = self._geod.inv(self._circle.x, self._circle.y, *position)
        away = metres / self._circle.r - 1
        if abs(away) > SAGITTA:
            return bool(away < 0)
        return bool(self._polygon.contains([position])[0])


class Rivals:
    """The expected events of a fence between the hulls of two groups of points."""

    def __init__(self, groups: tuple[str, str], center: Position | None) -> None:
        self._groups = groups
        self._frame = None if center is None else Gnomonic(center)
        self._meet = False

    def expected(self, frame: Frame) -> list[Happening]:
        """The event of a frame, if there is one."""
        positions = frame.positions if self._frame is None else self._frame.project_all(frame.positions)
        first, second = (convex_hull(positions[_rows(frame, group)]) for group in self._groups)
        before, self._meet = self._meet, _intersect(first, second)
        if before == self._meet:
            return []
        return [Happening("begin" if self._meet else "cease", None, frozenset(), None, None)]


def members(frame: Frame, group: str) -> Mapping[str, list[float]]:
    """The positions of the points of a group by name: those whose names begin with it."""
    rows = _rows(frame, group)
    return dict(zip((frame.names[row] for row in rows), frame.positions[rows].tolist(), strict=True))


def _rows(frame: Frame, group: str) -> list[int]:
    return [row for row, name in enumerate(frame.names) if name.startswith(f"{group} ")]


def _intersect(first: Points, second: Points) -> bool:
    """Whether two convex polygons have a point in common: exact."""
    if not len(first) or not len(second):
        return False
    if DynamicHull(first).contains(second).any() or DynamicHull(second).contains(first).any():
        return True
    # Without a vertex of one in the other, they have a point in common only where two edges cross.
    a, b = first[:, None], np.roll(first, -1, axis=0)[:, None]
    c, d = second[None], np.roll(second, -1, axis=0)[None]
    crossing = (orient2d(a, b, c) * orient2d(a, b, d) < 0) & (orient2d(c, d, a) * orient2d(c, d, b) < 0)
    return bool(np.any(crossing))
