"""Degenerate input of static hulls: points on the boundary that are not vertices.

Each algorithm drops duplicates when it reads its input; what remains are points on one line with others. "drop" needs
no code: a turn that is not a left turn never makes a vertex. This module implements "keep".
"""

from bisect import bisect_left
from collections.abc import Sequence

from .._predicates import Point, orientation


def check_collinear(collinear: str) -> None:
    """Raise ValueError unless the argument is "drop" or "keep"."""
    if collinear not in ("drop", "keep"):
        raise ValueError(f'collinear must be "drop" or "keep", got {collinear!r}')


def with_boundary_points(hull: Sequence[Point], points: Sequence[Point]) -> list[Point]:
    """Add to strict vertices, counter-clockwise from the least, all distinct points on the edges. O(n log n)."""
    if len(hull) < 3:
        return sorted(set(points))
    turning = hull.index(max(hull))
    lower, upper = list(hull[: turning + 1]), [hull[0], *reversed(hull[turning:])]
    on_lower, on_upper = (sorted(p for p in set(points) if _on_chain(chain, p)) for chain in (lower, upper))
    return on_lower + on_upper[-2:0:-1]


def farther_first_on_last_ray(order: list[Point]) -> None:
    """Reverse the points at the last angle, for a Graham scan that keeps boundary points. O(n).

    `order` is a pivot and then the others by angle around it, the nearer first. The scan goes out along its first ray
    and comes back along its last; points on one line have the first ray only.
    """
    if len(order) < 3 or orientation(order[0], order[1], order[-1]) == 0:
        return
    pivot, farthest = order[0], order[-1]
    first = len(order) - 1
    while orientation(pivot, order[first - 1], farthest) == 0:
        first -= 1
    order[first:] = order[first:][::-1]


def _on_chain(chain: Sequence[Point], p: Point) -> bool:
    i = bisect_left(chain, p)
    return (i < len(chain) and chain[i] == p) or (0 < i < len(chain) and orientation(chain[i - 1], chain[i], p) == 0)
