"""Hulls of places on the globe, given in degrees: GeoHull, GeoKeyedHull and GeoWindowHull."""

from __future__ import annotations

from math import nan
from typing import TYPE_CHECKING, Any, ClassVar, cast

import numpy as np

from . import _ellipsoid, _flat_map, _globe_extent, _globe_layers, _globe_sketch
from ._base import UNMEASURED, Live, as_percent
from ._globe import Gnomonic, as_center, as_lonlat, as_place
from ._globe_tree import GlobeEntities, GlobeTree, GlobeWindowTree
from ._hull import Multiset
from ._implementation import kernel
from ._keyed import Keyed, known_kind
from ._window import Windowed, checked_limits
from .arrays import as_count

if TYPE_CHECKING:
    import numpy.typing as npt

    from . import _kernel
    from ._entities import Only
    from ._predicates import Point
    from .arrays import Points
    from .keys import KeyType


class Globe(Live):
    """A live hull on the globe."""

    __slots__ = ()
    _coordinates = "(lon, lat)"

    @staticmethod
    def _as_points(points: npt.ArrayLike) -> Points:
        return as_lonlat(points)

    @staticmethod
    def _as_point(x: float, y: float) -> Point:
        return as_place(x, y)

    def _same_frame(self, other: Live) -> bool:
        return isinstance(other, Globe) and self.center == other.center

    @property
    def _globe(self) -> GlobeTree | _kernel.GlobeTree:
        return cast("GlobeTree | _kernel.GlobeTree", self._tree)

    @property
    def center(self) -> tuple[float, float] | None:
        """The centre as longitude, from -180 to below 180, and latitude; None before the first points. O(1)."""
        return self._globe.center

    def recenter(self, center: tuple[float, float] | None = None) -> None:
        """Move the centre, by default to the mean direction of the present points. O(n log n).

        Counts as a change if a vertex does: decisions that hang on nanometres may fall differently.

        Raises:
            ValueError: a point is beyond 85 degrees from the new centre; or there is no centre and no point. Nothing
                changes.
        """
        if center is None:
            points = self.points()
            if not len(points):
                raise ValueError("center is None, and there are no points to choose it from")
            center = Gnomonic.about(points).center
        self._globe.recenter(as_center(center))

    def vertices(self) -> Points:
        """(h, 2) vertices, counter-clockwise from the lexicographically smallest, strictly convex. O(h log n).

        Of several points at one place, the smallest. No points: shape (0, 2). All points at one place: one vertex. All
        points on one great circle, as the projection has them: two vertices.
        """
        return self._tree.vertices()

    # Queries

    def locate(self, lonlat: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """(k,) signs of (k, 2) places: +1 inside, 0 on the boundary, -1 outside. O(log n) each.

        Exact for the projections. Everything beyond 85 degrees from the centre is outside.
        """
        return super().locate(lonlat)

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

    # What a few bad points cannot spoil

    def layers(self, k: int) -> list[Points]:
        """The (h, 2) vertices of the k outermost convex layers, outermost first, each as `vertices`.

        Exact for the projections: layer i + 1 is the hull of the points left when all points at the vertices of layers
        1 to i are taken out. Fewer layers where no points are left. O(n log n), and O(log² n) a vertex.

        Raises:
            ValueError: k is negative.
        """
        return [] if (frame := self._frame()) is None else self._peeled(frame, k).layers

    def depth(self, lonlat: npt.ArrayLike, k: int) -> npt.NDArray[np.int64]:
        """(m,) depths of (m, 2) places: how many of the first k layers' hulls hold each, boundary included.

        Exact for the projections; 0 beyond 85 degrees from the centre. O(n log n), and O(k log n) a place.

        Raises:
            ValueError: k is negative.
        """
        places, frame = as_lonlat(lonlat), self._frame()
        if frame is None:
            return np.zeros(len(places), np.int64)
        return _globe_layers.depth(self._peeled(frame, k), frame, places)

    def influence(self) -> npt.NDArray[np.float64]:
        """(h,) for each of `vertices` the square metres that the hull loses without it (all points at its place).

        As `area`, of polygons of geodesics: within 0.1 m² for each vertex that goes or comes. O(n log n), and O(h) a
        vertex.
        """
        frame = self._frame()
        return np.zeros(0) if frame is None else _globe_layers.influence(self._peeled(frame, 2))

    def mcp(self, percent: float) -> Points:
        """(h, 2) vertices of the hull of the points nearest to the mean direction of all.

        The minimum convex polygon of ecology: of n points, those whose angle from the mean direction is at most the one
        with index (n - 1) percent / 100, rounded down, of all angles in order (Calenge 2006). Angles are rounded, to a
        nanometre or so on the ground. No points: shape (0, 2). O(n log n).

        Args:
            percent: 0, or from 1 to 100.
        """
        share = as_percent(percent)
        points = self.points()
        return GeoHull(_globe_layers.nearest(points, share), self.center).vertices() if len(points) else points

    def sketch(self, k: int) -> tuple[Points, float]:
        """(m, 2) vertices, m at most k, that show the hull's shape, and how many metres it reaches beyond theirs.

        The hull is certainly within that distance on WGS84 of the hull of the vertices, and all vertices have 0.0: it
        is Hausdorff's distance, rounded up by 1.1 % and a micrometre at most. Vertices are in the order of `vertices`:
        the first one, and again and again the one farthest from those there are, after the adaptive sampling of
        Hershberger and Suri, "Adaptive sampling for geometric problems over data streams" (2008). O(h log k) as a rule.

        Raises:
            ValueError: k is less than 1.
        """
        return _globe_sketch.sketch(self.vertices(), as_count(k, "k", least=1))

    def _frame(self) -> Gnomonic | None:
        return None if self.center is None else Gnomonic(self.center)

    def _peeled(self, frame: Gnomonic, k: int) -> _globe_layers.Peeled:
        return _globe_layers.Peeled(self.points(), frame, as_count(k, "k"))

    # Measures, each kept until the hull changes

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

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """West, south, east and north in degrees, as the `bbox` of GeoJSON (RFC 7946). O(h log n).

        West is greater than east across the antimeridian. With a pole inside, from -180 to 180, and to the pole. An
        edge that reaches beyond its ends is within 1e-13 degrees; all else is exact. NaN without points.
        """
        return self._measure(_globe_extent.bounds)

    def label_point(self) -> tuple[float, float]:
        """A place strictly inside, for a label: about the middle. O(h log n).

        A vertex where rounding leads outside, and for fewer than three vertices; NaN without points.
        """
        center = self.center
        return (nan, nan) if center is None else _globe_extent.label_point(self.vertices(), center)

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
        return _flat_map.boundary(self.vertices(), max_segment)

    def geojson(self, max_segment: float | None = None) -> dict[str, Any]:
        """The hull as a GeoJSON geometry by RFC 7946, with longitudes from -180 to 180.

        Rings are counter-clockwise. A hull across the antimeridian is cut there, which makes it a MultiPolygon; a hull
        with a pole inside follows the map's border to the pole. Fewer than three vertices: a LineString, also cut, a
        Point; without points an empty Polygon.

        Args:
            max_segment: as for `boundary`.
        """
        return _flat_map.geojson(self.vertices(), max_segment)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry of its vertices: `geojson()`."""
        return self.geojson()


class GeoHull(Multiset, Globe):
    """The convex hull of a multiset of places on the globe, under inserts and deletes. Edges are great circles.

    Args:
        lonlat: (n, 2) array-like of longitudes from -360 to 360 and latitudes from -90 to 90, in degrees; by default
            the hull starts empty. O(n log n).
        center: (longitude, latitude) in degrees. By default the first points choose it: the direction of their mean
            vector. After that it stays, until `recenter`.

    All points are within 85 degrees of the centre: a hull on the globe needs a hemisphere. The antimeridian and the
    poles are places like others. A point is the pair of numbers that was given, and is returned as given; (180, 0) and
    (-180, 0) are two points at one place.

    The hull is that of the points' gnomonic projections about the centre, doubles that are at most 2 nanometres away
    from the points; all decisions about these are exact.

    Methods raise ValueError or TypeError for bad points, and for points to insert beyond 85 degrees. The message names
    the first bad row, and nothing changes. Points may come in all forms that `DynamicHull` takes.

    Measures are those of WGS84, in metres, and need pyproj: `pip install 'dynhull[geo]'`.

    >>> from dynhull import GeoHull
    >>> fiji = GeoHull([(177.4, -17.8), (178.4, -18.1), (-179.9, -16.8), (179.4, -16.4)])
    >>> fiji.vertices().tolist()
    [[-179.9, -16.8], [179.4, -16.4], [177.4, -17.8], [178.4, -18.1]]
    >>> fiji.contains([(179, -17), (0, 0)]).tolist()
    [True, False]
    """

    __slots__ = ()
    _tree_type: ClassVar[type[GlobeTree | _kernel.GlobeTree]] = GlobeTree if kernel is None else kernel.GlobeTree

    def __init__(self, lonlat: npt.ArrayLike | None = None, center: tuple[float, float] | None = None) -> None:
        self._tree = self._tree_type(None if center is None else as_center(center))
        self._measured = UNMEASURED
        if lonlat is not None:
            self._tree.apply(+1, lonlat, False)
            self._tree.changes = 0

    def insert(self, lon: float, lat: float) -> bool:
        """Add a point. Returns whether the hull changed. O(log² n)."""
        return super().insert(lon, lat)

    def delete(self, lon: float, lat: float) -> bool:
        """Remove one copy of a point. Returns whether the hull changed. O(log² n).

        Raises:
            MissingPointError: the hull does not hold the point.
        """
        return super().delete(lon, lat)

    def count(self, lon: float, lat: float) -> int:
        """The number of copies of the point. O(1)."""
        return super().count(lon, lat)

    # As a value

    def __getstate__(self) -> tuple[Points, tuple[float, float] | None, int]:
        return self.points(), self.center, self.changes

    def __setstate__(self, state: tuple[Points, tuple[float, float] | None, int]) -> None:
        points, center, changes = state
        self._tree = self._tree_type(center)
        self._tree.apply(+1, points, False)
        self._tree.changes = changes
        self._measured = (changes, {})


class GeoKeyedHull(Keyed, Globe):
    """The convex hull of entities on the globe, each a place with a key and perhaps a time. Edges are great circles.

    Args:
        key_type: as for `KeyedHull`.
        ordered: as for `KeyedHull`.
        center: as for `GeoHull`; the first batch that puts points chooses it.

    Keys, times and batches are those of `KeyedHull`, places, vertices and measures those of `GeoHull`. An entity has
    the pair of numbers that was given last. `vertex_keys` names, for each vertex, the least key with this pair.

    >>> from dynhull import GeoKeyedHull
    >>> fleet = GeoKeyedHull()
    >>> fleet.put_many(["Suva", "Taveuni", "Nadi"], [(178.6, -18), (-179.9, -16.7), (177.4, -17.8)])
    3
    >>> fleet.vertex_keys()
    ['Taveuni', 'Nadi', 'Suva']
    >>> fleet.put("Taveuni", 180.1, -16.7)  # the same place: another way to write it
    True
    >>> fleet.position("Taveuni")
    (180.1, -16.7)
    """

    __slots__ = ()
    _tree_type: ClassVar[type[GlobeEntities | _kernel.GlobeEntities]] = (
        GlobeEntities if kernel is None else kernel.GlobeEntities
    )

    def __init__(
        self, key_type: KeyType = "str", *, ordered: bool = False, center: tuple[float, float] | None = None
    ) -> None:
        self._tree = self._tree_type(known_kind(key_type), bool(ordered), None if center is None else as_center(center))
        self._measured = UNMEASURED

    @classmethod
    def from_entities(
        cls,
        keys: Any,
        lonlat: npt.ArrayLike,
        times: npt.ArrayLike | None = None,
        key_type: KeyType = "str",
        *,
        ordered: bool = False,
        center: tuple[float, float] | None = None,
    ) -> GeoKeyedHull:
        """A hull of n entities, as `entities` returns them: a time that is NaN means none. O(n log n).

        Raises:
            DuplicateKeyError: a key comes twice.
        """
        hull = cls(key_type, ordered=ordered, center=center)
        hull._tree.load(keys, lonlat, times)
        return hull

    def put(
        self, key: str | int, lon: float, lat: float, time: float | None = None, *, only: Only | None = None
    ) -> bool:
        """Insert an entity or move it. Returns whether the hull changed. O(log² n).

        Args:
            key: the entity's key.
            lon: the longitude of the new place.
            lat: the latitude.
            time: replaces the entity's time; None leaves it without one.
            only: "absent" to insert and never move, "present" to move and never insert.
        """
        return super().put(key, lon, lat, time, only=only)

    # As a value

    def __getstate__(self) -> tuple[Any, ...]:
        return self.key_type, self.ordered, self.center, self.entities(), self.changes

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        key_type, ordered, center, entities, changes = state
        self._tree = self._tree_type(key_type, ordered, center)
        self._tree.load(*entities)
        self._tree.changes = changes
        self._measured = (changes, {})


class GeoWindowHull(Windowed, Globe):
    """The convex hull of recent places on the globe. Edges are great circles.

    Args:
        max_age: as for `WindowHull`.
        max_points: as for `WindowHull`.
        center: as for `GeoHull`; the first batch with points chooses it, those that are late included.

    Times and limits are those of `WindowHull`, places, vertices and measures those of `GeoHull`.

    >>> from dynhull import GeoWindowHull
    >>> window = GeoWindowHull(max_age=60.0)
    >>> window.add([(179, 0), (-179, 0), (180, 2)], times=[0.0, 10.0, 20.0])
    3
    >>> window.advance(60.0)
    1
    >>> window.vertices().tolist()
    [[-179.0, 0.0], [180.0, 2.0]]
    """

    __slots__ = ()
    _tree_type: ClassVar[type[GlobeWindowTree | _kernel.GlobeWindowTree]] = (
        GlobeWindowTree if kernel is None else kernel.GlobeWindowTree
    )

    def __init__(
        self,
        max_age: float | None = None,
        max_points: int | None = None,
        center: tuple[float, float] | None = None,
    ) -> None:
        limits = checked_limits(max_age, max_points)
        self._tree = self._tree_type(*limits, None if center is None else as_center(center))
        self._measured = UNMEASURED

    def delete(self, lon: float, lat: float) -> bool:
        """Remove the oldest copy of a point. Returns whether the hull changed. O(log² n).

        Raises:
            MissingPointError: the window does not hold the point.
        """
        return super().delete(lon, lat)

    # As a value

    def __getstate__(self) -> tuple[Any, ...]:
        return self.max_age, self.max_points, self.center, self._tree.state()

    def __setstate__(self, state: tuple[Any, ...]) -> None:
        max_age, max_points, center, contents = state
        self._tree = self._tree_type(max_age, max_points, center)
        self._tree.restore(*contents)
        self._measured = UNMEASURED
