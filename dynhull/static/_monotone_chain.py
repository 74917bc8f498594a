"""The monotone chain algorithm: sort, then one pass a side."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._predicates import Point, orientation
from ..arrays import Points, as_points
from ._boundary import check_collinear
from ._half_chain import half_chain
from .trace import Collinear, Pop, Push, Scan, Trace, Turn

if TYPE_CHECKING:
    from collections.abc import Sequence


def monotone_chain(xy: npt.ArrayLike, collinear: Collinear = "drop", trace: Trace | None = None) -> Points:
    """Convex hull by the monotone chain algorithm. O(n log n).

    Andrew, "Another efficient algorithm for convex hulls in two dimensions" (1979).

    Args:
        xy: (n, 2) array-like of finite numbers.
        collinear: "drop" returns true vertices only, "keep" every distinct point on the boundary.
        trace: a list to fill with a `Scan` and then `Turn`, `Push` and `Pop` events, first of the lower chain, then of
            the upper chain, both from left to right.

    Returns:
        (h, 2) points, counter-clockwise from the lexicographically smallest. All points on one line: two under "drop",
        all distinct points in order under "keep".

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.

    >>> from dynhull.static import monotone_chain
    >>> monotone_chain([[0, 0], [1, 0], [2, 0], [1, 1]]).tolist()
    [[0.0, 0.0], [2.0, 0.0], [1.0, 1.0]]
    """
    check_collinear(collinear)
    points = sorted(set(map(tuple, as_points(xy).tolist())))
    if trace is None and collinear == "drop":
        lower, upper = half_chain(points, -1), half_chain(points, 1)
    else:
        trace = [] if trace is None else trace
        trace.append(Scan("lower chain", tuple(points)))
        lower = _traced_half_chain(points, -1, collinear, trace)
        trace.append(Scan("upper chain", tuple(points)))
        upper = _traced_half_chain(points, 1, collinear, trace)
    hull = lower if lower == upper else lower + upper[-2:0:-1]
    return np.array(hull, dtype=np.float64).reshape(len(hull), 2)


def _traced_half_chain(points: Sequence[Point], sign: int, collinear: Collinear, trace: Trace) -> list[Point]:
    """`half_chain` with a trace; with "keep" it keeps the points between vertices."""
    pops_from = 0 if collinear == "drop" else 1
    chain: list[Point] = []
    for p in points:
        while len(chain) > 1:
            turn = orientation(chain[-2], chain[-1], p)
            trace.append(Turn(chain[-2], chain[-1], p, turn))
            if sign * turn < pops_from:
                break
            trace.append(Pop(chain.pop()))
        chain.append(p)
        trace.append(Push(p))
    return chain
