"""The fastest hull of a fixed set of points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._implementation import kernel
from ..arrays import Points, as_pairs, as_points

if TYPE_CHECKING:
    import numpy.typing as npt


def convex_hull(xy: npt.ArrayLike) -> Points:
    """Convex hull by the fastest method of the library. O(n log n), and O(n) where few points are near the hull.

    With the kernel, the exact hull of a sample discards most points unsorted: those in boxes that are proven to lie
    inside it (in the manner of Akl and Toussaint, "A fast convex hull algorithm", 1978). The others are sorted and
    chained (Andrew 1979), every turn exact, large inputs in two threads. Other Python threads run meanwhile. Without
    the kernel, this is `monotone_chain`. A contiguous float64 array is read in place; anything else is converted.

    Args:
        xy: (n, 2) array-like of finite numbers.

    Returns:
        (h, 2) vertices, counter-clockwise from the lexicographically smallest; a point on an edge is not a vertex.
        All points on one line: two vertices.

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.

    >>> from dynhull.defects import convex_hull
    >>> convex_hull([[0, 0], [1, 0], [2, 0], [1, 1], [1, 0.5]]).tolist()
    [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0]]
    """
    if kernel is None:
        from ._monotone_chain import monotone_chain  # and with it the events of traces: most programs need neither

        return monotone_chain(xy)
    # The kernel returns None where a coordinate is not finite; the check then names it.
    pairs = as_pairs(xy)
    hull = kernel.convex_hull(pairs)
    if hull is None:
        hull = kernel.convex_hull(as_points(pairs))
        assert hull is not None
    return hull
