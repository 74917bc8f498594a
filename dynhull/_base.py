"""What live hulls answer: `Live` wherever the points are, `Hull` in the plane.

They check arguments and return numpy arrays.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self, TypeVar

import numpy as np
import numpy.typing as npt

from . import measure, robust
from ._nodes import LOWER, UPPER
from ._shown import Shown, geometry, svg
from .arrays import Points, as_coordinate, as_count, as_directions, as_points, as_tuples, repr_of
from .robust._sketch_error import few_vertices, sketch_error
from .static import convex_hull

if TYPE_CHECKING:
    from collections.abc import Callable

    from . import _kernel
    from ._predicates import Point
    from ._tree import HullTree

    AnyTree = HullTree | _kernel.HullTree | _kernel.Entities

T = TypeVar("T")

MOST_POINTS_DRAWN = 2000
# The measures of a hull before any of them: at no number of changes. All hulls share it, and it stays empty.
UNMEASURED: tuple[int, dict[str, Any]] = (-1, {})


class Live(Shown):
    """A convex hull of points that come and go, in the plane or on the globe.

    Several threads may ask one hull; each answer belongs to one state of it.
    """

    __slots__ = ("_measured", "_tree")
    __hash__ = None  # type: ignore[assignment]  # mutable, compared by content
    _coordinates: ClassVar[str] = "(x, y)"
    _tree_type: ClassVar[type[AnyTree]]

    _tree: AnyTree
    _measured: tuple[int, dict[str, Any]]

    @staticmethod
    def _as_points(points: npt.ArrayLike) -> Points:
        """(k, 2) points of an argument, checked."""
        return as_points(points)

    @staticmethod
    def _as_point(x: float, y: float) -> Point:
        """A point of two arguments, checked."""
        return as_coordinate(x, "x"), as_coordinate(y, "y")

    def _same_frame(self, other: Live) -> bool:
        """Whether the other hull is in the plane, or on the globe with the same centre, like this one."""
        raise NotImplementedError

    # Contents

    def __len__(self) -> int:
        """The number of points, with multiplicity. O(1)."""
        return len(self._tree)

    @property
    def distinct(self) -> int:
        """The number of different points. O(1)."""
        return self._tree.distinct

    @property
    def changes(self) -> int:
        """The number of updates, single or batch, that changed the hull. O(1)."""
        return self._tree.changes

    def count(self, x: float, y: float) -> int:
        """The number of copies of the point. O(log n), on the globe O(1)."""
        return self._tree.count(x, y)

    def count_many(self, xy: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """(k,) numbers of copies of (k, 2) points. O(log n) each, on the globe O(1)."""
        return self._tree.count_many(self._as_points(xy))

    def __contains__(self, point: tuple[float, float]) -> bool:
        """Whether the point is one of the points. O(log n), on the globe O(1)."""
        try:
            x, y = point
        except (TypeError, ValueError):
            raise ValueError(f"a point is {self._coordinates}, got {repr_of(point)}") from None
        return self.count(x, y) > 0

    def points(self) -> Points:
        """(n, 2) points in lexicographic order, with multiplicity. O(n), on the globe O(n log n)."""
        return self._tree.points()

    def vertices(self) -> Points:
        """(h, 2) vertices, counter-clockwise from the lexicographically smallest, strictly convex. O(h log n).

        No points: shape (0, 2). One point, in any number of copies: one vertex. All points collinear: two vertices.
        """
        return self._tree.vertices()

    def locate(self, xy: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """(k,) signs of (k, 2) points: +1 inside, 0 on the boundary, -1 outside. Exact. O(log n) each."""
        return self._tree.locate(xy)

    def vertex_rows(self, xy: npt.ArrayLike) -> npt.NDArray[np.int64]:
        """(h,) rows of (k, 2) points: for each of `vertices` the first row that is that point. O(k log n).

        With the points that a hull was made of, these are the rows of a table that are its corners, as
        `scipy.spatial.ConvexHull.vertices`.

        Raises:
            ValueError: a vertex is none of the points.

        >>> import dynhull
        >>> places = [[0, 0], [4, 0], [1, 1], [0, 4], [4, 0]]
        >>> dynhull.DynamicHull(places).vertex_rows(places).tolist()
        [0, 1, 3]
        """
        vertices, points = self.vertices(), self._as_points(xy)
        on_boundary = np.flatnonzero(self.locate(points) == 0)
        first: dict[tuple[float, float], int] = {}
        for row, point in zip(on_boundary.tolist(), as_tuples(points[on_boundary]), strict=True):
            first.setdefault(point, row)
        missing = [vertex for vertex in as_tuples(vertices) if vertex not in first]
        if missing:
            raise ValueError(f"the vertex {missing[0]} is none of the points: give all that the hull was made of")
        return np.array([first[vertex] for vertex in as_tuples(vertices)], dtype=np.int64)

    def contains(self, xy: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """(k,) booleans: which of (k, 2) points are inside or on the boundary. Exact. O(log n) each."""
        return self.locate(xy) >= 0

    def _measure(self, measure_of: Callable[[Points], T]) -> T:
        """A measure of the vertices. Reads `changes` first, so that a concurrent update outdates the result."""
        changes = self.changes
        if self._measured[0] != changes:
            self._measured = (changes, {})
        known = self._measured[1]
        name = measure_of.__name__
        if name not in known:
            known[name] = measure_of(self.vertices())
        value: T = known[name]
        return value

    # As a value

    def copy(self) -> Self:
        """An independent hull of the same points. O(n)."""
        new = type(self).__new__(type(self))
        new._tree = self._tree.copy()
        new._measured = UNMEASURED
        return new

    __copy__ = copy

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        return self.copy()

    def __repr__(self) -> str:
        return f"<{type(self).__name__} of {len(self)} points, {len(self.vertices())} vertices>"

    def check(self) -> None:
        """Raise AssertionError if an invariant of the tree is broken, for tests and bug reports. O(n log n)."""
        self._tree.check()


class Hull(Live):
    """A live hull in the plane."""

    __slots__ = ()
    dimension: ClassVar[int] = 2  # a hull is a shape: see dynhull.convex.Convex

    def _same_frame(self, other: Live) -> bool:
        return isinstance(other, Hull)

    def upper(self) -> Points:
        """(k, 2) vertices of the upper chain, left to right. O(h log n)."""
        return self._tree.chain(UPPER)

    def lower(self) -> Points:
        """(k, 2) vertices of the lower chain, left to right. O(h log n)."""
        return self._tree.chain(LOWER)

    # Queries

    def support(self, directions: npt.ArrayLike) -> Points:
        """(k, 2) extreme vertices, one for each of (k, 2) directions of any length. Exact. O(log n) each.

        If a whole edge is extreme, the vertex is its lexicographically smaller end.

        Raises:
            ValueError: a direction is (0, 0), or there are no points.
        """
        vectors = as_directions(directions, self.dimension)
        if len(vectors) and not len(self):
            raise ValueError("an empty hull has no extreme points: insert some first")
        return self._tree.support(vectors)

    def tangents(self, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k, 2, 2) left and right tangent points seen from each of (k, 2) points. Exact. O(log n) each.

        Seen from an outside point, the hull is between the two: no part of it is left of the ray to the left tangent
        point or right of the ray to the right one. Of two vertices on such a ray, the farther. NaN for points that are
        not strictly outside, and for an empty hull.
        """
        return self._tree.tangents(as_points(xy))

    def distance(self, xy: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k,) distances of (k, 2) points to the hull, each the exact value rounded once. O(log n) each.

        0.0 inside and on the boundary; inf from an empty hull.
        """
        return self._tree.distance(as_points(xy))

    def intersect_lines(self, p: npt.ArrayLike, q: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """(k, 2, 2) points where the lines through (k, 2) points p and q enter and leave the hull. O(log n) each.

        In the order from p to q; each coordinate is the exact value rounded once. A line that touches a vertex has it
        twice, a line along an edge has the edge's ends; NaN for a line that misses the hull.

        Raises:
            ValueError: p and q differ in length, or a row of p equals that of q.
        """
        starts, ends = as_points(p, "p"), as_points(q, "q")
        if len(starts) != len(ends):
            raise ValueError(f"p and q must have the same length, got {len(starts)} and {len(ends)}")
        same = np.flatnonzero((starts == ends).all(axis=1))
        if same.size:
            raise ValueError(f"p and q row {same[0]} are the same point, which defines no line")
        return self._tree.intersect_lines(starts, ends)

    # Measures, each kept until the hull changes

    @property
    def area(self) -> float:
        """Area, the exact value rounded once. O(h log n)."""
        return self._measure(measure.area)

    @property
    def perimeter(self) -> float:
        """Length of the boundary, within one unit in the last place an edge; two vertices count twice. O(h log n)."""
        return self._measure(measure.perimeter)

    @property
    def centroid(self) -> tuple[float, float]:
        """Centre of area, the exact value rounded once; the middle of a segment, NaN without points. O(h log n)."""
        return self._measure(measure.centroid)

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least x, least y, greatest x, greatest y; NaN without points. O(h log n)."""
        return self._measure(measure.bounds)

    def diameter(self) -> float:
        """The greatest distance of two points, within one unit in the last place; 0.0 for fewer. O(h log n)."""
        return self._measure(measure.diameter)

    def width(self) -> float:
        """The least distance of parallel lines with all points between, within one unit in the last place. O(h log n).

        0.0 for collinear points, and for no points.
        """
        return self._measure(measure.width)

    def min_box(self) -> Points:
        """(4, 2) corners, counter-clockwise, of the box of least area in any orientation. O(h log n).

        Chosen exactly, each coordinate rounded once. The box of collinear points is flat; NaN without points.
        """
        return self._measure(measure.min_box).copy()

    def min_perimeter_box(self) -> Points:
        """(4, 2) corners of the box of least perimeter, like `min_box`. O(h log n)."""
        return self._measure(measure.min_perimeter_box).copy()

    def min_circle(self) -> tuple[tuple[float, float], float]:
        """Centre and radius of the smallest enclosing circle. O(h log n), and about ten rounds of O(h).

        The exact centre rounded once, the radius within one unit in the last place. (NaN, NaN) and 0.0 without points.
        """
        return self._measure(measure.min_circle)

    def label_point(self) -> tuple[float, float]:
        """A point strictly inside, for a label: the centroid. O(h log n).

        A vertex where rounding leads outside, and for fewer than three vertices; NaN without points.
        """
        return self._measure(measure.label_point)

    # Shapes that a few bad points cannot spoil

    def layers(self, k: int) -> list[Points]:
        """The (h, 2) vertices of the k outermost convex layers, outermost first, each as `vertices`. Exact.

        Layer 1 is the hull; layer i + 1 is the hull of the points left when the vertices of layers 1 to i, all their
        copies, are taken out. Fewer layers where no points are left. O(log² n) a vertex; the hull stays as it is, and
        other threads may ask it meanwhile. Chazelle, "On the convex layers of a planar set" (1985).

        Raises:
            ValueError: k is negative.
        """
        return self._tree.layers(as_count(k, "k"))

    def depth(self, xy: npt.ArrayLike, k: int) -> npt.NDArray[np.int64]:
        """(m,) depths of (m, 2) points: how many of the first k layers' hulls hold each, boundary included. Exact.

        O(log² n) for each vertex of the layers, and O(k log n) a point.

        Raises:
            ValueError: k is negative.
        """
        return robust.depth(self.layers(k), as_points(xy))

    def influence(self) -> npt.NDArray[np.float64]:
        """(h,) for each of `vertices` the area that the hull loses without it (all its copies).

        The exact value rounded once; inf if it is beyond every double. O(log² n) a vertex.
        """
        return self._tree.influence()

    def mcp(self, percent: float, center: Literal["mean", "median"] = "mean") -> Points:
        """(h, 2) vertices of the hull of the points nearest to the centre. Exact.

        The minimum convex polygon of ecology: of n points, with multiplicity, those whose distance from the centre is
        at most the one with index (n - 1) percent / 100, rounded down, of all distances in order, as adehabitatHR
        chooses them (Calenge 2006).
        No points: shape (0, 2). O(n), and O(m log m) for m of them that floating point does not order.

        Args:
            percent: 0, or from 1 to 100.
            center: the mean of the points, or the median of each coordinate.
        """
        share = as_percent(percent)
        if center not in ("mean", "median"):
            raise ValueError(f'center must be "mean" or "median", got {center!r}')
        points = self.points()
        return convex_hull(robust.nearest_points(points, share, center)) if len(points) else points

    def sketch(self, k: int) -> tuple[Points, float]:
        """(m, 2) vertices, m at most k, that show the hull's shape, and how far the hull reaches beyond theirs.

        The vertices are as those of `vertices`; the distance is Hausdorff's, the exact value rounded up. Begins with
        the extreme vertices along the axes, and adds the one farthest from its edge, after the adaptive sampling of
        Hershberger and Suri, "Adaptive sampling for geometric problems over data streams" (2008). O(k log n), and
        O(h log n) for k below 4. No points: shape (0, 2) and 0.0.

        Raises:
            ValueError: k is less than 1.
        """
        most = as_count(k, "k", least=1)
        if most < 4:
            vertices = self.vertices()
            return few_vertices(vertices, most) if len(vertices) else (vertices, 0.0)
        vertices, beyond = self._tree.sketch(most)
        return vertices, sketch_error(beyond)

    @property
    def __geo_interface__(self) -> dict[str, Any]:
        """The hull as a GeoJSON geometry, which shapely, geopandas and other libraries read. O(h log n).

        Polygon, LineString for two vertices, Point for one; without points an empty Polygon.
        """
        return geometry(self.vertices())

    def _repr_svg_(self) -> str:
        points = self.points() if len(self) <= MOST_POINTS_DRAWN else None
        return svg(self.vertices(), repr(self), points)


def as_percent(percent: float) -> float:
    """A share, checked."""
    try:
        share = percent if type(percent) is float else as_coordinate(percent, "percent")
    except TypeError:
        raise TypeError(f"percent must be a real number, got {repr_of(percent)}") from None
    if not 0 <= share <= 100:
        raise ValueError(f"percent is {share}: must be from 0 to 100")
    if 0 < share < 1:  # numpy, pandas and scipy count quantiles from 0 to 1: taken as written, it would drop nearly all
        raise ValueError(f"percent is {share}, less than one percent: for a share of {share} give {100 * share:g}")
    return share
