"""Chan's algorithm: hulls of small groups, wrapped as one."""

from __future__ import annotations

from bisect import bisect_left
from math import log2
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from .._implementation import kernel
from .._predicates import Point, orientation
from ..arrays import Points, as_points
from ._boundary import check_collinear, with_boundary_points
from ._half_chain import half_chain
from ._jarvis import rightmost
from .trace import Collinear, Groups, Round, Rounds, Trace, Wrap

if TYPE_CHECKING:
    from collections.abc import Sequence

Chains = tuple[list[Point], list[Point]]  # lower and upper, left to right


def chan(xy: npt.ArrayLike, collinear: Collinear = "drop", trace: Trace | None = None) -> Points:
    """Convex hull by Chan's algorithm. O(n log h) for h vertices.

    Chan, "Optimal output-sensitive convex hull algorithms in two and three dimensions" (1996). Each round guesses the
    number of vertices: 2, then the square of the last guess. Points are cut into groups of that size, each group's hull
    is computed, and gift wrapping runs across the groups, finding each group's tangent by binary search. A round that
    does not close within `guess` steps is discarded. The kernel runs it unless single steps are traced; other Python
    threads run meanwhile.

    Args:
        xy: (n, 2) array-like of finite numbers.
        collinear: "drop" returns true vertices only, "keep" every distinct point on the boundary.
        trace: a list to fill, for each round, with a `Groups`, the `Wrap` steps and a `Round`. A `Rounds` is filled
            with the `Round` only.

    Returns:
        (h, 2) points, counter-clockwise from the lexicographically smallest. All points on one line: two under "drop",
        all distinct points in order under "keep".

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.

    >>> from dynhull.static import chan
    >>> trace = []
    >>> chan([[0, 0], [4, 0], [5, 2], [4, 4], [2, 3], [0, 4], [1, 2], [2, 1]], trace=trace).tolist()
    [[0.0, 0.0], [4.0, 0.0], [5.0, 2.0], [4.0, 4.0], [0.0, 4.0]]
    >>> from dynhull.static.trace import Round
    >>> [(event.guess, event.steps, event.closed) for event in trace if isinstance(event, Round)]
    [(2, 2, False), (4, 4, False), (16, 5, True)]
    """
    check_collinear(collinear)
    if kernel is not None and (trace is None or isinstance(trace, Rounds)):
        return _by_kernel(as_points(xy), collinear, trace)
    steps_trace = None if isinstance(trace, Rounds) else trace
    points: list[Point] = list(map(tuple, as_points(xy).tolist()))
    hull: list[Point] | None = None if points else []
    guess = 2
    while hull is None:
        groups = [_chains(points[i : i + guess]) for i in range(0, len(points), guess)]
        if steps_trace is not None:
            steps_trace.append(Groups(guess, tuple(_cycle(*chains) for chains in groups)))
        steps, closed = _wrap(min(points), groups, guess, steps_trace)
        if trace is not None:
            trace.append(Round(guess, len(groups), len(steps), len(points) * log2(guess), closed))
        if closed:
            hull = steps
        guess *= guess
    if collinear == "keep":
        hull = with_boundary_points(hull, points)
    return np.array(hull, dtype=np.float64).reshape(len(hull), 2)


def _by_kernel(points: Points, collinear: Collinear, trace: Trace | None) -> Points:
    assert kernel is not None
    hull, rounds = kernel.chan(points)
    if trace is not None:
        trace += [
            Round(guess, groups, steps, len(points) * log2(guess), closed) for guess, groups, steps, closed in rounds
        ]
    if collinear == "keep":
        kept = with_boundary_points(list(map(tuple, hull.tolist())), list(map(tuple, points.tolist())))
        return np.array(kept, dtype=np.float64).reshape(len(kept), 2)
    return hull


def _chains(group: Sequence[Point]) -> Chains:
    points = sorted(set(group))
    return half_chain(points, -1), half_chain(points, 1)


def _cycle(lower: Sequence[Point], upper: Sequence[Point]) -> tuple[Point, ...]:
    return (*lower, *upper[-2:0:-1])


def _wrap(start: Point, groups: Sequence[Chains], limit: int, trace: Trace | None) -> tuple[list[Point], bool]:
    """Gift wrapping from the least point: the vertices found, at most `limit`, and whether they close the hull."""
    vertices = [start]
    while True:
        p = vertices[-1]
        tangents = [_next(p, lower, upper) for lower, upper in groups]
        best = rightmost(p, tangents)
        if trace is not None:
            trace.append(Wrap(p, tuple(tangents), best))
        if best in (start, p):
            return vertices, True
        if len(vertices) == limit:
            return vertices, False
        vertices.append(best)


def _next(p: Point, lower: Sequence[Point], upper: Sequence[Point]) -> Point:
    """The group's point that has all of the group on or to the left of the ray from p; the farthest of several.

    p is a vertex of the whole hull, so it is a vertex of the group's hull or strictly outside. Returns p where the
    group is p alone. O(log m).
    """
    i = bisect_left(lower, p)
    if i < len(lower) and (lower[i] == p or (i > 0 and orientation(lower[i - 1], lower[i], p) < 0)):
        return _rightward(p, lower, i + (lower[i] == p), upper)
    if i == 0:
        return _rightward(p, lower, 0, upper)
    i = bisect_left(upper, p)
    return _leftward(p, upper, i - 1)


def _rightward(p: Point, lower: Sequence[Point], first: int, upper: Sequence[Point]) -> Point:
    """The tangent from p to the lower chain from index `first` on."""
    if first == len(lower):  # p is the greatest point: back along the upper chain
        return upper[-2] if len(upper) > 1 else p
    last = len(lower) - 1
    while first < last:
        middle = (first + last) // 2
        if orientation(lower[middle], lower[middle + 1], p) <= 0:
            first = middle + 1
        else:
            last = middle
    return lower[first]


def _leftward(p: Point, upper: Sequence[Point], last: int) -> Point:
    """The tangent from p to the upper chain up to index `last`."""
    first = 0
    while first < last:
        middle = (first + last) // 2
        if orientation(upper[middle], upper[middle + 1], p) >= 0:
            last = middle
        else:
            first = middle + 1
    return upper[first]
