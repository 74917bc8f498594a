"""The fastest static hull here: the kernel's, or the monotone chain where it is not built."""

import numpy.typing as npt

from ..arrays import Points, as_points
from ..implementation import kernel
from .monotone_chain import monotone_chain


def convex_hull(xy: npt.ArrayLike) -> Points:
    """Convex hull by the fastest algorithm here. O(n log n), with the kernel O(n) on most inputs.

    The kernel throws away what lies inside the hull of a sample (after Akl and Toussaint, "A fast convex hull
    algorithm", 1978) and runs the monotone chain algorithm (Andrew, 1979) on the rest.

    Args:
        xy: (n, 2) array-like of finite numbers.

    Returns:
        (h, 2) strict vertices, counter-clockwise from the lexicographically smallest. All points on one line: two.

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.

    >>> convex_hull([[0, 0], [1, 0], [2, 0], [1, 1]]).tolist()
    [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0]]
    """
    points = as_points(xy)
    if kernel is None:
        return monotone_chain(points)
    vertices: Points = kernel.convex_hull(points)
    return vertices
