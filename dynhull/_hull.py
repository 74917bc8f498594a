"""Hulls whose points are named by their coordinates: DynamicHull in the plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from ._base import UNMEASURED, Hull, Live
from ._implementation import kernel
from ._tree import HullTree
from .arrays import Points, as_operations, as_pairs

if TYPE_CHECKING:
    import numpy.typing as npt

    from . import _kernel


class MissingPointError(KeyError):
    """A delete names a point that the hull does not hold.

    Attributes:
        point: the coordinates.
        row: the row of the batch; None for a single delete.
    """

    point: tuple[float, float]
    row: int | None

    def __init__(self, point: tuple[float, float], row: int | None = None) -> None:
        super().__init__(point, row)
        self.point = point
        self.row = row

    def __str__(self) -> str:
        where = "" if self.row is None else f"row {self.row}: "
        return f"{where}point {self.point} is missing and cannot be deleted; nothing was changed"


class Multiset(Live):
    """A live hull of a multiset of points."""

    __slots__ = ()
    _tree: HullTree | _kernel.HullTree

    # Updates

    def insert(self, x: float, y: float) -> bool:
        """Add a point. Returns whether the hull changed. O(log² n)."""
        return self._tree.insert(x, y)

    def delete(self, x: float, y: float) -> bool:
        """Remove one copy of a point. Returns whether the hull changed. O(log² n).

        Raises:
            MissingPointError: the hull does not hold the point.
        """
        try:
            return self._tree.delete(x, y)
        except KeyError:
            raise MissingPointError(self._as_point(x, y)) from None

    def insert_many(self, xy: npt.ArrayLike) -> int:
        """Add k points as one batch. Returns k. O(log² n) each, O((n + k) log k) for k >= n."""
        return self._tree.apply(+1, xy, False)

    def delete_many(self, xy: npt.ArrayLike, missing: Literal["raise", "ignore"] = "raise") -> int:
        """Remove points as one batch. Returns the number of points removed. O(log² n) each.

        Args:
            xy: (k, 2) array-like.
            missing: for a row with more copies of a point than the hull holds, "raise" raises MissingPointError with
                the row, before anything changes; "ignore" skips the row.
        """
        return self._apply(-1, xy, missing)

    def apply(self, ops: npt.ArrayLike, xy: npt.ArrayLike, missing: Literal["raise", "ignore"] = "raise") -> int:
        """Apply inserts and deletes as one batch. Returns the number of rows applied. O(log² n) each.

        A batch is a set: the order of its rows does not matter, and a point inserted and deleted in one batch leaves no
        trace.

        Args:
            ops: k numbers, +1 to insert and -1 to delete the point of that row.
            xy: (k, 2) array-like.
            missing: as for `delete_many`.
        """
        points = as_pairs(xy)
        return self._apply(as_operations(ops, len(points)), points, missing)

    def clear(self) -> None:
        """Remove every point."""
        self._tree.clear()

    def _apply(self, ops: int | npt.NDArray[np.int8], xy: npt.ArrayLike, missing: str) -> int:
        if missing not in ("raise", "ignore"):
            raise ValueError(f'missing must be "raise" or "ignore", got {missing!r}')
        try:
            return self._tree.apply(ops, xy, missing == "ignore")
        except KeyError as error:
            if len(error.args) != 3:  # raised by the caller's own array-like
                raise
            x, y, row = error.args
            raise MissingPointError((x, y), row) from None

    # As a value

    def __eq__(self, other: object) -> bool:
        """Whether the other hull holds the same points with the same multiplicities. O(n), on the globe O(n log n)."""
        if not isinstance(other, Multiset):
            return NotImplemented
        return self._same_frame(other) and len(self) == len(other) and np.array_equal(self.points(), other.points())


class DynamicHull(Multiset, Hull):
    """The convex hull of a multiset of points in the plane, under inserts and deletes. Exact for every finite double.

    Args:
        points: (n, 2) array-like of finite numbers; by default the hull starts empty. O(n log n).

    Every method that takes points raises ValueError or TypeError for input that is not finite, not of shape (n, 2), not
    numeric, or not exactly representable as doubles. The message names the first bad row, and nothing changes.

    Overmars and van Leeuwen, "Maintenance of configurations in the plane" (1981): O(log² n) an update, O(log n) a
    query.

    Points may also come as geometries (shapely, geopandas, GeoJSON), which give every vertex once, and as frames
    (pandas, polars, pyarrow) with columns such as x and y, or lon and lat.

    >>> from dynhull import DynamicHull
    >>> hull = DynamicHull([[0, 0], [4, 0], [4, 4], [0, 4], [2, 1]])
    >>> hull.insert(5, 2)
    True
    >>> hull.delete(2, 1)
    False
    >>> hull.vertices().tolist()
    [[0.0, 0.0], [4.0, 0.0], [5.0, 2.0], [4.0, 4.0], [0.0, 4.0]]
    """

    __slots__ = ()
    _tree_type: ClassVar[type[HullTree | _kernel.HullTree]] = HullTree if kernel is None else kernel.HullTree

    def __init__(self, points: npt.ArrayLike | None = None) -> None:
        self._tree = self._tree_type(points)
        self._measured = UNMEASURED

    # As a value

    def __getstate__(self) -> tuple[Points, int]:
        return self.points(), self.changes

    def __setstate__(self, state: tuple[Points, int]) -> None:
        points, changes = state
        self._tree = self._tree_type(points)
        self._tree.changes = changes
        self._measured = (changes, {})
