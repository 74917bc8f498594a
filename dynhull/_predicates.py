"""Predicates: the orientation of three points and related signs, exact for every finite double.

Each predicate evaluates its determinant in floating point, with a bound on the rounding error (Shewchuk 1997, stage A,
with slack for underflow). If the bound does not decide the sign, integers do: a double is an integer times a power of
two, and scaling every x by one power of two and every y by another changes no sign.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ._implementation import kernel
from .arrays import Points, finite_pairs

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

Point = tuple[float, float]
Floats = npt.NDArray[np.float64]
Signs = npt.NDArray[np.int8]

EPSILON = 2.0**-53
ORIENT_BOUND = (3.0 + 16.0 * EPSILON) * EPSILON
# Two products and a difference more than `orientation`: at most eight roundings, doubled for safety.
CROSSING_BOUND = 16.0 * EPSILON
# A product that underflows has an error of up to 2**-1075; this is far above that and far below usual values.
UNDERFLOW = 1e-300
# The same for a product that is multiplied by a difference of up to 2**1024.
UNDERFLOW_FACTOR = 1e-280


def orientation(a: Point, b: Point, c: Point) -> int:
    """Return +1 if a, b, c turn left, -1 if they turn right, 0 if they are collinear."""
    ax, ay = a
    bx, by = b
    cx, cy = c
    left = (ax - cx) * (by - cy)
    right = (ay - cy) * (bx - cx)
    det = left - right
    bound = ORIENT_BOUND * (abs(left) + abs(right)) + UNDERFLOW
    # On overflow the bound is infinite or the determinant is NaN: both comparisons are false, and the integers decide.
    if det > bound:
        return 1
    if -det > bound:
        return -1
    ax, bx, cx = _integers((ax, bx, cx))
    ay, by, cy = _integers((ay, by, cy))
    return _sign((ax - cx) * (by - cy) - (ay - cy) * (bx - cx))


def direction_sign(d: Point, a: Point, b: Point) -> int:
    """Return +1 if b is farther than a in direction d, -1 if it is less far, 0 if neither."""
    dx, dy = d
    ax, ay = a
    bx, by = b
    along = dx * (bx - ax)
    up = dy * (by - ay)
    dot = along + up
    bound = ORIENT_BOUND * (abs(along) + abs(up)) + UNDERFLOW
    if dot > bound:
        return 1
    if -dot > bound:
        return -1
    dx, dy = _integers((dx, dy))
    ax, ay, bx, by = _integers((ax, ay, bx, by))
    return _sign(dx * (bx - ax) + dy * (by - ay))


def cross_sign(a: Point, b: Point, c: Point, d: Point) -> int:
    """Return the sign of (b - a) x (d - c): +1 if the vector from c to d turns left of that from a to b."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = a, b, c, d
    left = (bx - ax) * (dy - cy)
    right = (by - ay) * (dx - cx)
    det = left - right
    bound = ORIENT_BOUND * (abs(left) + abs(right)) + UNDERFLOW
    if det > bound:
        return 1
    if -det > bound:
        return -1
    ax, bx, cx, dx = _integers((ax, bx, cx, dx))
    ay, by, cy, dy = _integers((ay, by, cy, dy))
    return _sign((bx - ax) * (dy - cy) - (by - ay) * (dx - cx))


def dot_sign(a: Point, b: Point, c: Point, d: Point) -> int:
    """Return the sign of the dot product (b - a) . (d - c)."""
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = a, b, c, d
    along = (bx - ax) * (dx - cx)
    up = (by - ay) * (dy - cy)
    dot = along + up
    bound = ORIENT_BOUND * (abs(along) + abs(up)) + UNDERFLOW
    if dot > bound:
        return 1
    if -dot > bound:
        return -1
    ax, ay, bx, by, cx, cy, dx, dy = _integers((ax, ay, bx, by, cx, cy, dx, dy))
    return _sign((bx - ax) * (dx - cx) + (by - ay) * (dy - cy))


def crossing(a: Point, b: Point, c: Point, d: Point, z: Point) -> int:
    """Return the sign of height(ab) - height(cd), where the lines through a, b and c, d cross the vertical through z.

    For a < b < z <= c < d in lexicographic order, one of the edges not vertical. A vertical edge is as steep as an
    infinitesimal shear makes it: beside z it is infinitely high (ab) or low (cd) there, and on the vertical through z
    it passes through z.

    The value is det(c, d, z) * (bx - ax) - det(a, b, z) * (dx - cx), of degree three, where det(p, q, z) is the
    determinant of `orientation`.
    """
    ax, ay = a
    bx, by = b
    cx, cy = c
    dx, dy = d
    zx, zy = z
    if ax == zx:
        return orientation(c, d, z)
    if dx == zx:
        return -orientation(a, b, z)
    width_ab = bx - ax
    width_cd = dx - cx
    left_ab = (ax - zx) * (by - zy)
    right_ab = (ay - zy) * (bx - zx)
    left_cd = (cx - zx) * (dy - zy)
    right_cd = (cy - zy) * (dx - zx)
    value = (left_cd - right_cd) * width_ab - (left_ab - right_ab) * width_cd
    size_ab = abs(left_ab) + abs(right_ab) + UNDERFLOW_FACTOR
    size_cd = abs(left_cd) + abs(right_cd) + UNDERFLOW_FACTOR
    bound = CROSSING_BOUND * (size_cd * width_ab + size_ab * width_cd) + UNDERFLOW
    if value > bound:
        return 1
    if -value > bound:
        return -1
    ax, bx, cx, dx, zx = _integers((ax, bx, cx, dx, zx))
    ay, by, cy, dy, zy = _integers((ay, by, cy, dy, zy))
    det_ab = (ax - zx) * (by - zy) - (ay - zy) * (bx - zx)
    det_cd = (cx - zx) * (dy - zy) - (cy - zy) * (dx - zx)
    return _sign(det_cd * (bx - ax) - det_ab * (dx - cx))


def orient2d(a: npt.ArrayLike, b: npt.ArrayLike, c: npt.ArrayLike) -> int | npt.NDArray[np.int8]:
    """The orientation of a, b, c: +1 left turn (counter-clockwise), -1 right turn, 0 collinear. Exact for all doubles.

    Args:
        a: one point (x, y), or an array of points of shape (..., 2).
        b: the same; the three broadcast against each other.
        c: the same.

    Returns:
        An int for three single points, otherwise an int8 array of the broadcast shape.

    Raises:
        ValueError: a coordinate is not finite, or a shape does not fit.
        TypeError: a coordinate is not a real number.

    O(1) a triple. A floating-point filter after Shewchuk, "Adaptive Precision Floating-Point Arithmetic and Fast Robust
    Geometric Predicates" (1997), and exact arithmetic if it does not decide.

    >>> from dynhull.decompose import orient2d
    >>> orient2d((0, 0), (1, 0), (0, 1))
    1
    >>> orient2d((0, 0), [(1, 0), (2, 2)], (1, 1))
    array([1, 0], dtype=int8)
    """
    pairs = [finite_pairs(value, name) for value, name in ((a, "a"), (b, "b"), (c, "c"))]
    if all(pair.ndim == 1 for pair in pairs):
        one, two, three = ((float(x), float(y)) for x, y in pairs)
        return orientation(one, two, three)
    p, q, r = np.broadcast_arrays(*pairs)
    if kernel is not None:
        flat = [np.ascontiguousarray(pair).reshape(-1, 2) for pair in (p, q, r)]
        return kernel.orientations(*flat).reshape(p.shape[:-1])
    return _orientations(p, q, r)


def _orientations(p: Points, q: Points, r: Points) -> Signs:
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        left, right = (
            (p[..., 0] - r[..., 0]) * (q[..., 1] - r[..., 1]),
            (p[..., 1] - r[..., 1]) * (q[..., 0] - r[..., 0]),
        )
    return _decided(left, right, orientation, p, q, r)


def cross_signs(a: Points, b: Points, c: Points, d: Points) -> Signs:
    """`cross_sign` of (k, 2) arrays that broadcast."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        u, v = b - a, d - c
        left, right = u[..., 0] * v[..., 1], u[..., 1] * v[..., 0]
    return _decided(left, right, cross_sign, a, b, c, d)


def dot_signs(a: Points, b: Points, c: Points, d: Points) -> Signs:
    """`dot_sign` of (k, 2) arrays that broadcast."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        u, v = b - a, d - c
        along, down = u[..., 0] * v[..., 0], -u[..., 1] * v[..., 1]
    return _decided(along, down, dot_sign, a, b, c, d)


def _decided(left: Floats, right: Floats, exact_sign: Callable[..., int], *points: Points) -> Signs:
    """The signs of left - right: in floats if the bound on their error decides, otherwise by the exact predicate."""
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        det = left - right
        bound = ORIENT_BOUND * (np.abs(left) + np.abs(right)) + UNDERFLOW
        signs: Signs = (det > bound).astype(np.int8) - (-det > bound).astype(np.int8)
    doubtful = np.nonzero(signs == 0)
    rows = [np.broadcast_to(p, (*signs.shape, 2))[doubtful].tolist() for p in points]
    signs[doubtful] = [exact_sign(*row) for row in zip(*rows, strict=True)]
    return signs


def _integers(values: Iterable[float]) -> list[int]:
    """The numbers times the least power of two that makes all of them integers."""
    ratios = [value.as_integer_ratio() for value in values]
    scale = max(denominator for _, denominator in ratios)
    return [numerator * (scale // denominator) for numerator, denominator in ratios]


def _sign(value: int) -> int:
    return (value > 0) - (value < 0)
