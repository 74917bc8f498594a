"""Convex sets given by their support functions: the farthest point in each direction.

A shape is any object with the two members of `Convex`; a `DynamicHull` is one. Moving, turning, scaling and adding
shapes makes new shapes that query the old ones, so a live hull inside one stays live. Points, and what points may come
from, stand for their hull (see `as_convex`).

>>> from dynhull.convex import ball, box, capsule, minkowski_sum, moved
>>> square = box([0, 0], [2, 2])
>>> capsule([0, 0], [5, 0], radius=1).support([[1, 0], [0, 1]]).tolist()
[[6.0, 0.0], [0.0, 1.0]]
>>> moved(minkowski_sum(square, ball([0, 0], 1)), [10, 0]).support([[1, 0]]).tolist()
[[13.0, 0.0]]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from fractions import Fraction
from functools import cmp_to_key
from itertools import product
from math import cos, isfinite, sin
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

import numpy as np
import numpy.ma  # np.unique needs it, and two threads cannot import it at its first call: python/cpython#149728
import numpy.typing as npt

from ._base import Live
from ._exact import Integers, as_integers, root
from ._predicates import EPSILON, Point, cross_sign
from ._rings import ring_signs
from ._sources import coordinates_of, geojson_of, is_geometry
from .arrays import Points, as_array, as_directions, as_points, as_rows, as_tuples, as_vector
from .static import convex_hull

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

Way = tuple[Point, Point, int]


@runtime_checkable
class Convex(Protocol):
    """A convex set in two or three dimensions (most functions accept more)."""

    @property
    def dimension(self) -> int:
        """Of the space: 2 or 3."""

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, d) points of the set, each farthest in one of (k, d) directions, which need no unit length.

        Raises:
            ValueError: a direction is zero or not finite, or the set is empty.
        """


@dataclass(frozen=True, eq=False, slots=True)
class Cloud:
    """The convex hull of (n, d) points. Support is exact, O(n); of equally far points the lexicographically smallest.

    Raises:
        ValueError, TypeError: there are no points, or bad ones; the message names the first bad row.
    """

    points: Points
    _reach: Points = field(init=False, repr=False)

    def __post_init__(self) -> None:
        points = np.unique(as_rows(self.points), axis=0)
        if not len(points):
            raise ValueError("points are empty: an empty set has no support function")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "_reach", np.abs(points).max(axis=0))

    @property
    def dimension(self) -> int:
        """Of the space."""
        return int(self.points.shape[1])

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, d) points, each farthest in one of (k, d) directions."""
        vectors = as_directions(directions, self.dimension)
        if len(self.points) == 1:
            return np.repeat(self.points, len(vectors), axis=0)
        return np.asarray(self.points[[self._farthest(vector) for vector in vectors]])

    def _farthest(self, vector: Points) -> int:
        """The number of the first of the farthest points."""
        largest = np.frexp(np.abs(vector).max())[1] + np.frexp(self._reach.max())[1]
        with np.errstate(all="ignore"):
            far = self.points @ vector
            error = 4 * len(vector) * EPSILON * (self._reach @ np.abs(vector))
            # Overflow and underflow would invalidate the error bound: then every point is compared exactly.
            safe = -900 < largest < 1000
            near = np.flatnonzero(far >= far.max() - 2 * error) if safe else np.arange(len(far))
        if len(near) == 1:
            return near.item()
        points, _ = as_integers(self.points[near])
        scaled, _ = as_integers(vector)
        exactly = (points @ scaled).tolist()
        return int(near[exactly.index(max(exactly))])


@dataclass(frozen=True, eq=False, slots=True)
class Ball:
    """All points within a radius of a centre. Support within two units in the last place of the largest coordinate.

    Raises:
        ValueError: the radius is negative or not finite, or the centre is no point.
    """

    centre: Points
    radius: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", as_vector(self.centre, "centre"))
        _check_radius(self.radius)

    @property
    def dimension(self) -> int:
        """Of the space."""
        return len(self.centre)

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, d) points, each farthest in one of (k, d) directions."""
        vectors = as_directions(directions, self.dimension)
        vectors = vectors / np.abs(vectors).max(axis=1, keepdims=True)
        farthest: Points = self.centre + self.radius * vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        return farthest


@dataclass(frozen=True, eq=False, slots=True)
class Disk:
    """A disk in space, at right angles to an axis. Support in exact arithmetic, each coordinate then rounded twice.

    Seen along the axis all its points are equally far; support is the centre.

    Attributes:
        centre: (3,).
        axis: (2, 3), two points; only the direction from one to the other matters.
        radius: of the disk.

    Raises:
        ValueError: the radius is negative or not finite, the points are not in space, or those of the axis are equal.
    """

    centre: Points
    axis: Points
    radius: float
    _axis: Integers = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", _in_space(self.centre, "centre"))
        object.__setattr__(self, "axis", np.stack([_in_space(end, "axis") for end in self.axis]))
        object.__setattr__(self, "_axis", _direction(self.axis)[0])
        _check_radius(self.radius)

    @property
    def dimension(self) -> int:
        """3."""
        return 3

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, 3) points, each farthest in one of (k, 3) directions."""
        vectors = as_directions(directions, 3)
        rims = [_rim(_along_and_across(self._axis, vector)[1], self.radius) for vector in vectors]
        farthest: Points = self.centre + np.array(rims).reshape(-1, 3)
        return farthest


@dataclass(frozen=True, eq=False, slots=True)
class Cone:
    """A cone: the hull of a disk and an apex above its centre. Whether the apex is farthest is decided exactly.

    Support is the apex, or a point of the disk as `Disk` gives it. Where they are equally far, the apex.

    Attributes:
        base: (3,), the centre of the disk.
        apex: (3,).
        radius: of the disk.

    Raises:
        ValueError: the radius is negative or not finite, base or apex is not a point in space, or they are equal.
    """

    base: Points
    apex: Points
    radius: float
    _axis: Integers = field(init=False, repr=False)
    _unit: Fraction = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "base", _in_space(self.base, "base"))
        object.__setattr__(self, "apex", _in_space(self.apex, "apex"))
        axis, unit = _direction(np.stack([self.base, self.apex]))
        object.__setattr__(self, "_axis", axis)
        object.__setattr__(self, "_unit", unit)
        _check_radius(self.radius)

    @property
    def dimension(self) -> int:
        """3."""
        return 3

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, 3) points, each farthest in one of (k, 3) directions."""
        vectors = as_directions(directions, 3)
        return np.array([self._farthest(vector) for vector in vectors]).reshape(-1, 3)

    def _farthest(self, vector: Points) -> Points:
        along, across = _along_and_across(self._axis, vector)
        height = along * self._unit * int(self._axis @ self._axis)
        # The apex is higher by `height`, the rim by radius * |across|: compared by their squares.
        if along >= 0 and height**2 >= Fraction(self.radius) ** 2 * int(across @ across):
            return self.apex
        farthest: Points = self.base + _rim(across, self.radius)
        return farthest


def _direction(ends: Points) -> tuple[Integers, Fraction]:
    """The way from one point to another in integers, and their unit."""
    (start, end), unit = as_integers(ends)
    axis = end - start
    if not axis.any():
        raise ValueError(f"the axis starts and ends at {tuple(ends[0].tolist())!r}: it has no direction")
    return axis, unit


def _along_and_across(axis: Integers, vector: Points) -> tuple[int, Integers]:
    """A direction's product with an axis, and its part at right angles times the axis' squared length; exactly."""
    way, _ = as_integers(vector)
    along = int(axis @ way)
    return along, way * int(axis @ axis) - axis * along


def _rim(across: Integers, radius: float) -> list[float]:
    """The vector of length radius in a direction, each coordinate rounded once; zeros where the direction is zero."""
    square = int(across @ across)
    if not square:
        return [0.0, 0.0, 0.0]
    scale = Fraction(radius) ** 2 / square
    return [root(x * x * scale) * ((x > 0) - (x < 0)) for x in across.tolist()]


def _check_radius(radius: float) -> None:
    if not (isfinite(radius) and radius >= 0):
        raise ValueError(f"radius is {radius!r}: must be finite and not negative")


def _in_space(value: npt.ArrayLike, name: str) -> Points:
    vector = as_vector(value, name)
    if len(vector) != 3:
        raise ValueError(f"{name} must have shape (3,), got {vector.shape}")
    return vector


@dataclass(frozen=True, eq=False, slots=True)
class Sum:
    """The Minkowski sum of shapes: all sums of one point of each. Each addition rounds the support once."""

    parts: Sequence[Convex]

    def __post_init__(self) -> None:
        dimensions = {part.dimension for part in self.parts}
        if len(dimensions) != 1:
            raise ValueError(
                f"a sum needs at least one shape, and all of one dimension; got dimensions {sorted(dimensions)}"
            )

    @property
    def dimension(self) -> int:
        """Of the space."""
        return self.parts[0].dimension

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, d) points, each farthest in one of (k, d) directions."""
        first, *others = (part.support(directions) for part in self.parts)
        return sum(others, first)


@dataclass(frozen=True, eq=False, slots=True)
class Mapped:
    """The image of a shape under x -> matrix @ x + offset, by turning the direction back.

    Support is that of the shape in the direction rounded once, then rounded once more.

    Attributes:
        stretch: the factor of every length where it is the same in all directions, else None.

    Raises:
        ValueError: the matrix or the offset does not fit the shape, or is not finite.
    """

    shape: Convex
    matrix: Points
    offset: Points
    stretch: float | None = None

    def __post_init__(self) -> None:
        d = self.shape.dimension
        matrix, offset = as_rows(self.matrix, "matrix"), as_vector(self.offset, "offset")
        if matrix.shape != (d, d) or offset.shape != (d,):
            raise ValueError(
                f"matrix and offset must have shapes ({d}, {d}) and ({d},), got {matrix.shape} and {offset.shape}"
            )
        object.__setattr__(self, "matrix", matrix)
        object.__setattr__(self, "offset", offset)

    @property
    def dimension(self) -> int:
        """Of the space."""
        return self.shape.dimension

    def support(self, directions: npt.ArrayLike, /) -> Points:
        """(k, d) points, each farthest in one of (k, d) directions."""
        vectors = as_directions(directions, self.dimension)
        turned = vectors @ self.matrix
        # The map flattens the shape along this direction: every point is farthest.
        turned[~turned.any(axis=1)] = np.eye(self.dimension)[0]
        image: Points = self.shape.support(turned) @ self.matrix.T + self.offset
        return image


Set = Convex | Any
"""A shape, or points, a frame or a geometry in place of one."""


def as_convex(shape: Set, name: str = "shape") -> Convex:
    """The convex set of an argument: a shape as it is; points, a frame or a geometry as the convex hull.

    Raises:
        ValueError: there are no points, or a line or polygon of a geometry is not convex: its hull is another set.
        TypeError, ValueError: a point is bad, or it is a hull on the globe.
    """
    if isinstance(shape, Convex):
        return shape
    if isinstance(shape, Live):
        raise TypeError(f"{name} is {shape!r}: shapes are in the plane or in space, not on the globe")
    points = as_rows(coordinates_of(shape, name), name)
    if not len(points):
        raise ValueError(f"{name} has no points: an empty set has no support function")
    if points.shape[1] != 2:
        return Cloud(points)
    hull = convex_hull(points)
    if is_geometry(shape) and not _is_convex(geojson := geojson_of(shape), points, hull):
        raise ValueError(
            f"{name} is a {geojson['type']} that is not convex: give its convex hull, or a list of convex parts, as "
            "dynhull.decompose.convex_pieces makes of a polygon"
        )
    return Cloud(hull)


def _is_convex(geojson: Mapping[str, Any], points: Points, hull: Points) -> bool:
    """Whether the set of a geometry is its hull. Points by themselves stand for theirs, as everywhere."""
    match geojson["type"]:
        case "Feature":
            return _is_convex(geojson["geometry"], points, hull)
        case "Point" | "MultiPoint":
            return True
        case "LineString":
            return len(hull) <= 2
        case "Polygon":  # a simple ring is convex if all of its corners are on the boundary of its hull
            return len(geojson["coordinates"]) == 1 and (len(hull) <= 2 or not ring_signs(hull, points).any())
        case _:
            return False


def point(p: npt.ArrayLike) -> Cloud:
    """One point, in any dimension."""
    return Cloud(as_vector(p, "p")[None])


def segment(p: npt.ArrayLike, q: npt.ArrayLike) -> Cloud:
    """All points between two."""
    ends = [as_vector(p, "p"), as_vector(q, "q")]
    if len(ends[0]) != len(ends[1]):
        raise ValueError(f"p and q must have the same dimension, got {len(ends[0])} and {len(ends[1])}")
    return Cloud(np.stack(ends))


def polygon(points: npt.ArrayLike) -> Cloud:
    """The convex hull of points in the plane; support O(h)."""
    return Cloud(convex_hull(as_points(points)))


def ball(centre: npt.ArrayLike, radius: float) -> Ball:
    """A disk in the plane, a ball in space."""
    return Ball(as_vector(centre, "centre"), radius)


def box(low: npt.ArrayLike, high: npt.ArrayLike) -> Cloud:
    """The box between two opposite corners, sides along the axes."""
    sides = segment(low, high).points.T
    return Cloud(np.array(list(product(*sides))))


def capsule(p: npt.ArrayLike, q: npt.ArrayLike, radius: float) -> Sum:
    """All points within a radius of a segment."""
    ends = segment(p, q)
    return Sum((ends, Ball(np.zeros(ends.dimension), radius)))


def cylinder(p: npt.ArrayLike, q: npt.ArrayLike, radius: float) -> Sum:
    """The cylinder in space whose axis goes from p to q: all points within a radius of it, between its two disks.

    Support is rounded three times a coordinate.

    Raises:
        ValueError: the radius is negative or not finite, p or q is not a point in space, or they are equal.
    """
    ends = np.stack([_in_space(p, "p"), _in_space(q, "q")])
    return Sum((Cloud(ends), Disk(np.zeros(3), ends, radius)))


def cone(base: npt.ArrayLike, apex: npt.ArrayLike, radius: float) -> Cone:
    """The cone in space from a disk around `base` to `apex`, the axis at right angles to the disk."""
    return Cone(_in_space(base, "base"), _in_space(apex, "apex"), radius)


def moved(shape: Set, offset: npt.ArrayLike) -> Mapped:
    """The shape, moved by an offset."""
    shape = as_convex(shape)
    return Mapped(shape, np.eye(shape.dimension), as_vector(offset, "offset"), 1.0)


def rotated(shape: Set, rotation: float | npt.ArrayLike) -> Mapped:
    """The shape turned around the origin: by an angle in radians, counter-clockwise (2D), or by a rotation matrix.

    Raises:
        ValueError: the matrix is not orthogonal up to 1e-12, or an angle is given in three dimensions.
    """
    shape = as_convex(shape)
    if np.ndim(rotation) == 0:
        if shape.dimension != 2:
            raise ValueError("rotation is an angle, but the shape is not in the plane: give a rotation matrix")
        angle = float(np.asarray(rotation))
        if not isfinite(angle):
            raise ValueError(f"rotation is {angle!r}: must be finite")
        rotation = [[cos(angle), -sin(angle)], [sin(angle), cos(angle)]]
    matrix = as_rows(rotation, "rotation")
    if matrix.shape[0] != matrix.shape[1] or not np.allclose(
        matrix @ matrix.T, np.eye(len(matrix)), rtol=0, atol=1e-12
    ):
        raise ValueError("rotation is not an orthogonal matrix")
    return Mapped(shape, matrix, np.zeros(shape.dimension), 1.0)


def scaled(shape: Set, factor: float | npt.ArrayLike) -> Mapped:
    """The shape scaled about the origin, by one factor or by one for each axis (an ellipse is a scaled ball)."""
    shape = as_convex(shape)
    factors = as_array(factor, "factor").astype(np.float64)
    matrix = np.diag(np.broadcast_to(factors, (shape.dimension,)))
    stretch = abs(float(factors)) if factors.ndim == 0 else None
    return Mapped(shape, matrix, np.zeros(shape.dimension), stretch)


def minkowski_sum(a: Set, b: Set) -> Sum:
    """All points p + q, p of a and q of b."""
    return Sum((as_convex(a, "a"), as_convex(b, "b")))


def minkowski_difference(a: Set, b: Set) -> Sum:
    """All points p - q, p of a and q of b: it holds the origin exactly where a and b intersect."""
    return Sum((as_convex(a, "a"), scaled(as_convex(b, "b"), -1.0)))


def convex_combination(a: Set, b: Set, share: float) -> Sum:
    """(1 - share) a + share b: share 0 is a, share 1 is b, and between them a changes into b.

    Raises:
        ValueError: the share is not within 0 and 1.
    """
    if not 0 <= share <= 1:
        raise ValueError(f"share is {share!r}: must be from 0 to 1")
    return Sum((scaled(as_convex(a, "a"), 1 - share), scaled(as_convex(b, "b"), share)))


def sum_of_polygons(p: npt.ArrayLike, q: npt.ArrayLike) -> Points:
    """(h, 2) vertices of the Minkowski sum of the hulls of two sets of points, counter-clockwise. O(n log n).

    Edges are merged by direction, exactly; each coordinate is a sum of two, rounded once. No points: (0, 2).
    """
    a, b = convex_hull(p), convex_hull(q)
    if not len(a) or not len(b):
        return np.empty((0, 2))
    # Both hulls begin at their least vertex, and so does the sum: its edges are those of both, in order of direction.
    ways = [(u, v, one) for one, corners in ((1, a), (0, b)) for u, v in _ways(corners)]
    ones = np.array([one for *_, one in sorted(ways, key=cmp_to_key(_compare_directions))], dtype=np.int64)
    steps = np.concatenate([[0], np.cumsum(ones)]) % len(a), np.concatenate([[0], np.cumsum(1 - ones)]) % len(b)
    return convex_hull(a[steps[0]] + b[steps[1]])


def _ways(corners: Points) -> list[tuple[Point, Point]]:
    rows = as_tuples(corners)
    return list(zip(rows, rows[1:] + rows[:1], strict=True)) if len(rows) > 1 else []


def _compare_directions(s: Way, t: Way) -> int:
    """Counter-clockwise from straight down: edges of the lower chain before those of the upper one."""
    upper_s, upper_t = s[1] < s[0], t[1] < t[0]
    return upper_s - upper_t or cross_sign(t[0], t[1], s[0], s[1])
