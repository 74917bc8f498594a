"""GeoHull: a hull of places on the globe, given in degrees."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from . import _ellipsoid, _flat_map
from ._globe import as_center, as_lonlat, as_place
from ._globe_tree import GlobeTree
from ._hull import MissingPointError
from .arrays import as_operations, as_pairs, repr_of

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy.typing as npt

    from .arrays import Points

T = TypeVar("T")


class GeoHull:
    """The convex hull of a multiset of places on the globe, under inserts and deletes. Edges are great circles.

    Args:
        lonlat: (n, 2) array-like of longitudes from -360 to 360 and latitudes from -90 to 90, in degrees; by default
            the hull starts empty. O(n log n).
        center: (longitude, latitude) in degrees. By default the first points choose it: the direction of their mean
            vector. After that it stays, until `recenter`.

    All points are within 85 degrees of the centre: a hull on the globe needs a hemisphere. The antimeridian and the
    poles are places like others. A point is the pair of numbers that was given, and is returned as given; (180, 0) and
    (-180, 0) are two points at one place.

    The hull is that of the points' gnomonic projections about the centre, doubles that are at most 3 nanometres away
    from the points; all decisions about these are exact.

    Methods raise ValueError or TypeError for bad points, and for points to insert beyond 85 degrees. The message names
    the first bad row, and nothing changes. Points may come in all forms that `DynamicHull` takes.

    Measures are those of WGS84, in metres, and need pyproj: `pip install 'dynhull[geo]'`.

    >>> fiji = GeoHull([(177.4, -17.8), (178.4, -18.1), (-179.9, -16.8), (179.4, -16.4)])
    >>> fiji.vertices().tolist()
    [[-179.9, -16.8], [179.4, -16.4], [177.4, -17.8], [178.4, -18.1]]
    >>> fiji.contains([(179, -17), (0, 0)]).tolist()
    [True, False]
    """

    __slots__ = ("_measured", "_tree")
    __hash__ = None  # type: ignore[assignment]  # mutable, compared by content
    _tree_type: ClassVar[type[GlobeTree]] = GlobeTree

    _tree: GlobeTree
    _measured: tuple[int, dict[str, float]]

    def __init__(self, lonlat: npt.ArrayLike | None = None, center: tuple[float, float] | None = None) -> None:
        self._tree = self._tree_type(None if center is None else as_center(center))
        self._measured = (0, {})
        if lonlat is not None:
            self._tree.apply(+1, lonlat, False)
            self._tree.changes = 0

    # Contents

    @property
    def center(self) -> tuple[float, float] | None:
        """The centre as longitude, from -180 to below 180, and latitude; None before the first points. O(1)."""
        return self._tree.center

    def __len__(self) -> int:
        """The number of points, with multiplicity. O(1)."""
        return len(self._tree)

    @property
    def distinct(self) -> int:
        """The number of different points. O(1)."""
        return self._tree.distinct

    @property
    def changes(self) -> int:
        """The number of updates, single or batch, that changed the vertices. O(1)."""
        return self._tree.changes

    def count(self, lon: float, lat: float) -> int:
        """The number of copies of the point. O(1)."""
        return self._tree.count(lon, lat)

    def count_many(self, lonlat: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """(k,) numbers of copies of (k, 2) points. O(1) each."""
        return self._tree.count_many(as_lonlat(lonlat))

    def __contains__(self, point: tuple[float, float]) -> bool:
        """Whether (lon, lat) is one of the points. O(1)."""
        try:
            lon, lat = point
        except (TypeError, ValueError):
            raise ValueError(f"a point is (lon, lat), got {repr_of(point)}") from None
        return self.count(lon, lat) > 0

    def points(self) -> Points:
        """(n, 2) points in lexicographic order, with multiplicity. O(n log n)."""
        return self._tree.points()

    def vertices(self) -> Points:
        """(h, 2) vertices, counter-clockwise from the lexicographically smallest, strictly convex. O(h log n).

        Of several points at one place, the smallest. No points: shape (0, 2). All points at one place: one vertex. All
        points on one great circle, as the projection has them: two vertices.
        """
        return self._tree.vertices()

    # Updates

    def insert(self, lon: float, lat: float) -> bool:
        """Add a point. Returns whether the hull changed. O(log² n)."""
        return self._tree.insert(lon, lat)

    def delete(self, lon: float, lat: float) -> bool:
        """Remove one copy of a point. Returns whether the hull changed. O(log² n).

        Raises:
            MissingPointError: the hull does not hold the point.
        """
        try:
            return self._tree.delete(lon, lat)
        except KeyError:
            (point,) = as_place(lon, lat).tolist()
            raise MissingPointError((point[0], point[1])) from None

    def insert_many(self, lonlat: npt.ArrayLike) -> int:
        """Add k points as one batch. Returns k. O(log² n) each."""
        return self._apply(+1, lonlat, "raise")

    def delete_many(self, lonlat: npt.ArrayLike, missing: Literal["raise", "ignore"] = "raise") -> int:
        """Remove points as one batch. Returns the number of points removed. O(log² n) each.

        Args:
            lonlat: (k, 2) array-like.
            missing: for a row with more copies of a point than the hull holds, "raise" raises MissingPointError with
                the row, before anything changes; "ignore" skips the row.
        """
        return self._apply(-1, lonlat, missing)

    def apply(self, ops: npt.ArrayLike, lonlat: npt.ArrayLike, missing: Literal["raise", "ignore"] = "raise") -> int:
        """Apply inserts and deletes as one batch. Returns the number of rows applied. O(log² n) each.

        A batch is a set: the order of its rows does not matter, and a point inserted and deleted in one batch leaves no
        trace.

        Args:
            ops: k numbers, +1 to insert and -1 to delete the point of that row.
            lonlat: (k, 2) array-like.
            missing: as for `delete_many`.
        """
        points = as_pairs(lonlat)
        return self._apply(as_operations(ops, len(points)), points, missing)

    def clear(self) -> None:
        """Remove every point. The centre stays."""
        self._tree.clear()

    def recenter(self, center: tuple[float, float] | None = None) -> None:
        """Move the centre, by default to the mean direction of the present points. O(n log n).

        Counts as a change if a vertex does: decisions that hang on nanometres may fall differently.

        Raises:
            ValueError: a point is beyond 85 degrees from the new centre; or there is no centre and no point. Nothing
                changes.
        """
        self._tree.recenter(None if center is None else as_center(center))

    def _apply(self, ops: int | npt.NDArray[np.int8], lonlat: npt.ArrayLike, missing: str) -> int:
        if missing not in ("raise", "ignore"):
            raise ValueError(f'missing must be "raise" or "ignore", got {missing!r}')
        try:
            return self._tree.apply(ops, lonlat, missing == "ignore")
        except KeyError as error:
            if len(error.args) != 3:  # raised by the caller's own array-like
                raise
            lon, lat, row = error.args
            raise MissingPointError((lon, lat), row) from None

    # Queries

    def locate(self, lonlat: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """(k,) signs of (k, 2) places: +1 inside, 0 on the boundary, -1 outside. O(log n) each.

        Exact for the projections. Everything beyond 85 degrees from the centre is outside.
        """
        return self._tree.locate(as_lonlat(lonlat))

    def contains(self, lonlat: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(k,) booleans: which of (k, 2) places are inside or on the boundary. O(log n) each."""
        return self.locate(lonlat) >= 0

    def tangents(self, lonlat: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k, 2, 2) left and right tangent points seen from each of (k, 2) places. Exact for the projections.

        The great circles through a place and its tangent points have the hull between them. Of two vertices on such a
        great circle, the farther. NaN for places that are not strictly outside, and for an empty hull. O(log n) each.

        Raises:
            ValueError: a place is beyond 85 degrees from the centre.
        """
        return self._tree.tangents(as_lonlat(lonlat))

    def distance(self, lonlat: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k,) distances of (k, 2) places to the hull on WGS84, in metres. O(h) each, and about thirty geodesics.

        Within a micrometre. 0.0 inside and on the boundary; inf from an empty hull. Places may be anywhere.
        """
        places = as_lonlat(lonlat)
        result = np.zeros(len(places))
        outside = self.locate(places) < 0
        result[outside] = _ellipsoid.distance(self.vertices(), places[outside])
        return result

    # Measures, each kept until the hull changes

    def _measure(self, measure_of: Callable[[Points], float]) -> float:
        """A measure of the vertices. Reads `changes` first, so that a concurrent update outdates the result."""
        changes = self.changes
        if self._measured[0] != changes:
            self._measured = (changes, {})
        known = self._measured[1]
        name = measure_of.__name__
        if name not in known:
            known[name] = measure_of(self.vertices())
        return known[name]

    @property
    def area(self) -> float:
        """Area in square metres on WGS84 of the polygon of geodesics between the vertices. O(h log n).

        Within 0.1 m² a vertex (Karney 2013). Geodesics of WGS84 differ from the hull's great circles: for the area
        within these, measure `boundary(max_segment)`.
        """
        return self._measure(_ellipsoid.area)

    @property
    def perimeter(self) -> float:
        """Length in metres on WGS84 of the same polygon; two vertices count twice. O(h log n).

        Within 15 nanometres an edge (Karney 2013).
        """
        return self._measure(_ellipsoid.perimeter)

    def diameter(self) -> float:
        """The greatest distance of two vertices in metres on WGS84; 0.0 for fewer. O(h²).

        Within 15 nanometres (Karney 2013). Of points more than a quarter of the globe apart, two that are no vertices
        may be farther from each other.
        """
        return self._measure(_ellipsoid.diameter)

    # For maps

    def boundary(self, max_segment: float | None = None) -> Points:
        """(k, 2) places along the boundary, counter-clockwise from the first vertex, no two neighbours far apart.

        A straight line on a flat map is no great circle; short enough, it is close to one. Two vertices: there and
        not back.

        Args:
            max_segment: the greatest distance of neighbours in metres; None for the vertices alone.

        Raises:
            ValueError: `max_segment` is not positive, or leads to more than 10,000,000 places.
        """
        vertices = self.vertices()
        return _flat_map.dense(vertices, max_segment, closed=len(vertices) > 2)

    def geojson(self, max_segment: float | None = None) -> dict[str, Any]:
        """The hull as a GeoJSON geometry by RFC 7946, with longitudes from -180 to 180.

        Rings are counter-clockwise. A hull across the antimeridian is cut there, which makes it a MultiPolygon; a hull
        with a pole inside follows the map's border to the pole. Fewer than three vertices: a LineString, also cut, a
        Point; without points an empty Polygon.

        Args:
            max_segment: as for `boundary`.
        """
        return _flat_map.geometry(self.vertices(), max_segment)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry of its vertices: `geojson()`."""
        return self.geojson()

    # As a value

    def copy(self) -> Self:
        """An independent hull of the same points about the same centre. O(n)."""
        new = type(self).__new__(type(self))
        new._tree = self._tree.copy()
        new._measured = (0, {})
        return new

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __getstate__(self) -> tuple[Points, tuple[float, float] | None, int]:
        return self.points(), self.center, self.changes

    def __setstate__(self, state: tuple[Points, tuple[float, float] | None, int]) -> None:
        points, center, changes = state
        self._tree = self._tree_type(center)
        self._tree.apply(+1, points, False)
        self._tree.changes = changes
        self._measured = (changes, {})

    def __eq__(self, other: object) -> bool:
        """Whether the other hull holds the same points, as often, about the same centre. O(n log n)."""
        if not isinstance(other, GeoHull):
            return NotImplemented
        return self.center == other.center and np.array_equal(self.points(), other.points())

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self)} points, {len(self.vertices())} vertices>"

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken, for tests and bug reports. O(n log n)."""
        self._tree.check()
