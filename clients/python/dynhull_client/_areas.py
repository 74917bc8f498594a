"""Areas and subjects of fences as people write them, and as messages."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynhull._value import Value
from dynhull.arrays import Points, as_coordinate, as_points
from dynhull_proto.v1 import fence_pb2

from ._messages import decode_points, encode_points
from .wkt import is_wkt, polygons_of


@dataclass(frozen=True, slots=True)
class Circle:
    """A disk as the area of a fence: center and radius, which is at least 0. Whether a point is inside is exact.

    For hulls on the globe the center is a longitude and a latitude in degrees, and the radius is in metres.
    """

    x: float
    y: float
    r: float

    def __post_init__(self) -> None:
        for name in ("x", "y", "r"):
            object.__setattr__(self, name, as_coordinate(getattr(self, name), f"the circle's {name}"))
        if self.r < 0:
            raise ValueError(f"the circle's r is {self.r}: must be at least 0")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Polygon(Value):
    """A simple polygon with holes as the area of a fence.

    Attributes:
        exterior: (n, 2) corners in either direction; a last one that repeats the first is dropped.
        holes: the corners of each hole, in the same form.
    """

    exterior: Points
    holes: tuple[Points, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "exterior", _ring(self.exterior, "exterior"))
        holes = tuple(_ring(hole, f"holes[{i}]") for i, hole in enumerate(self.holes))
        object.__setattr__(self, "holes", holes)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """A GeoJSON Polygon."""
        rings = [[*ring.tolist(), *ring[:1].tolist()] for ring in (self.exterior, *self.holes)]
        return {"type": "Polygon", "coordinates": rings}


@dataclass(frozen=True, slots=True)
class Prefix:
    """All keyed hulls whose names begin with `text`, those created later too, as the subjects of a fence."""

    text: str


Area = str | Circle | tuple[Polygon, ...]
"""Type of the area of a fence: the name of a hull, a disk, or polygons joined by "or"."""


def as_area(area: Any) -> Area:
    """An area in one of its forms.

    Args:
        area: the name of a hull, a `Circle`, a `Polygon`, (n, 2) corners, GeoJSON or WKT of polygons, a geometry with
            `__geo_interface__`, or a list of polygons in these forms.

    Raises:
        ValueError: a polygon has fewer than three corners, or a corner that is not finite; the message names its row.
        TypeError: it is in none of these forms.
    """
    if isinstance(area, Circle) or (isinstance(area, str) and not is_wkt(area)):
        return area
    return tuple(_polygons(area, "area"))


def encode_area(area: Area, config: fence_pb2.FenceConfig) -> None:
    """Add an area to the settings of a fence."""
    if isinstance(area, str):
        config.hull_area.name = area
        config.hull_area.SetInParent()
    elif isinstance(area, Circle):
        config.circle_area.CopyFrom(fence_pb2.CircleArea(center_x=area.x, center_y=area.y, radius=area.r))
    else:
        config.polygon_area.polygons.extend(
            fence_pb2.Polygon(exterior=encode_points(each.exterior), holes=map(encode_points, each.holes))
            for each in area
        )


def decode_area(config: fence_pb2.FenceConfig) -> Area:
    """The area in the settings of a fence."""
    if config.HasField("hull_area"):
        return config.hull_area.name
    if config.HasField("circle_area"):
        circle = config.circle_area
        return Circle(circle.center_x, circle.center_y, circle.radius)
    return tuple(
        Polygon(decode_points(each.exterior), tuple(map(decode_points, each.holes)))
        for each in config.polygon_area.polygons
    )


def _polygons(area: Any, name: str) -> Iterator[Polygon]:
    if isinstance(area, Polygon):
        yield area
    elif isinstance(area, str) and is_wkt(area):
        yield from _polygons(polygons_of(area, name), name)
    elif isinstance(area, Mapping) or hasattr(type(area), "__geo_interface__"):
        yield from _of_geojson(area if isinstance(area, Mapping) else area.__geo_interface__, name)
    elif isinstance(area, list | tuple | np.ndarray):
        if not len(area):
            raise ValueError(f"{name} is empty: give the corners of a polygon")
        if _is_corner(area[0]):
            yield Polygon(_ring(area, name))
            return
        for i, each in enumerate(area):
            yield from _polygons(each, f"{name}[{i}]")
    else:
        raise TypeError(f"{name} is {area!r}: must be the name of a hull, a Circle, a Polygon or (n, 2) corners")


def _is_corner(value: Any) -> bool:
    """Whether it is a row of an (n, 2) array rather than a polygon."""
    return isinstance(value, list | tuple | np.ndarray) and len(value) > 0 and np.isscalar(value[0])


def _of_geojson(geojson: Mapping[str, Any], name: str) -> Iterator[Polygon]:
    match geojson.get("type"):
        case "FeatureCollection":
            for i, feature in enumerate(geojson["features"]):
                yield from _of_geojson(feature, f"{name}.features[{i}]")
        case "GeometryCollection":
            for i, geometry in enumerate(geojson["geometries"]):
                yield from _of_geojson(geometry, f"{name}.geometries[{i}]")
        case "Feature" if geojson["geometry"] is None:
            raise ValueError(f"{name} is a Feature without geometry: leave it out")
        case "Feature":
            yield from _of_geojson(geojson["geometry"], name)
        case "Polygon":
            yield _of_rings(geojson["coordinates"], name)
        case "MultiPolygon":
            for i, rings in enumerate(geojson["coordinates"]):
                yield _of_rings(rings, f"{name}.coordinates[{i}]")
        case kind:
            raise ValueError(f"{name} is of the type {kind!r}: must be a Polygon or a MultiPolygon")


def _of_rings(rings: Any, name: str) -> Polygon:
    if not len(rings):
        raise ValueError(f"{name} is an empty Polygon: it has no corners")
    plane = [[corner[:2] for corner in ring] for ring in rings]  # a third number is a height
    exterior, *holes = plane
    return Polygon(
        _ring(exterior, f"{name}.exterior"), tuple(_ring(hole, f"{name}.holes[{i}]") for i, hole in enumerate(holes))
    )


def _ring(corners: Any, name: str) -> Points:
    points = as_points(corners, name, on_globe=None)
    if len(points) > 1 and (points[0] == points[-1]).all():
        points = points[:-1]
    if len(points) < 3:
        raise ValueError(f"{name} has {len(points)} corners: a polygon has at least 3")
    points.flags.writeable = False  # of a copy
    return points
