"""GJK on many pairs of small polygons at once: each step advances all pairs that have not finished."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from .._predicates import ORIENT_BOUND, UNDERFLOW
from ..arrays import finite_pairs
from ..convex import polygon
from ._contact import contact, intersect
from ._difference import SURE

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

MOST_STEPS = 24  # pairs that have not finished by then are decided one by one
GAIN = 1e-15


def intersect_many(a: npt.ArrayLike, b: npt.ArrayLike) -> Bools:
    """(k,) whether the hulls of each of k pairs of small sets of points intersect; touching counts. Exact.

    Args:
        a: (k, m, 2) points; repeat a point for polygons with fewer corners.
        b: (k, n, 2) points.

    Raises:
        ValueError, TypeError: a coordinate is not finite or not a number, or the shapes do not fit.

    O(m + n) a step, and a few steps. Pairs that floats cannot decide are decided one by one, exactly.

    >>> import numpy as np
    >>> from dynhull.gjk import intersect_many
    >>> squares = np.array([[[0, 0], [1, 0], [1, 1], [0, 1]]])
    >>> intersect_many(np.repeat(squares, 3, axis=0), squares + [[[1, 1]], [[0.5, 0]], [[1, 1.01]]])
    array([ True,  True, False])
    """
    first, second = _checked(a, b)
    walk = _walk(first, second, to_the_end=False)
    result = walk.inside
    for row in np.flatnonzero(~walk.inside & ~walk.apart).tolist():
        result[row] = intersect(polygon(first[row]), polygon(second[row]))
    return result


def distance_many(a: npt.ArrayLike, b: npt.ArrayLike) -> Floats:
    """(k,) distances of the hulls of each of k pairs, 0.0 if they intersect. Arguments as for `intersect_many`.

    Whether a distance is 0.0 is exact; other distances are as accurate as in `contact`.
    """
    first, second = _checked(a, b)
    walk = _walk(first, second, to_the_end=True)
    result = np.where(walk.inside, 0.0, walk.distance)
    for row in np.flatnonzero(~walk.inside & ~(walk.apart & walk.arrived)).tolist():
        result[row] = contact(polygon(first[row]), polygon(second[row])).distance
    return result


@dataclass(frozen=True)
class _Walks:
    """For each pair: certainly intersecting, certainly apart, certainly at the closest points; the distance so far."""

    inside: Bools
    apart: Bools
    arrived: Bools
    distance: Floats


def _checked(a: npt.ArrayLike, b: npt.ArrayLike) -> tuple[Floats, Floats]:
    first, second = finite_pairs(a, "a"), finite_pairs(b, "b")
    for array, name in ((first, "a"), (second, "b")):
        if array.ndim != 3 or (array.shape[1] == 0 and len(array)):
            raise ValueError(f"{name} must have shape (k, m, 2), m at least 1, got {array.shape}")
    if len(first) != len(second):
        raise ValueError(f"a and b must have the same length, got {len(first)} and {len(second)}")
    return first, second


def _walk(a: Floats, b: Floats, to_the_end: bool) -> _Walks:
    k = len(a)
    walks = _Walks(np.zeros(k, np.bool_), np.zeros(k, np.bool_), np.zeros(k, np.bool_), np.zeros(k))
    rows = np.arange(k)
    with np.errstate(all="ignore"):  # pairs with extreme coordinates do not finish: they are decided one by one
        s = t = v = _farthest(a, b, np.broadcast_to([1.0, 0.0], (k, 2)))[0]
        size, off = np.abs(v).max(axis=1), np.zeros(k)
        for _ in range(MOST_STEPS):
            if not rows.size:
                break
            w, gap, sure = _farthest(a[rows], b[rows], -v)
            walks.apart[rows] |= gap > sure
            squared = _dot(v, v)
            distance = walks.distance[rows] = np.sqrt(squared)
            size = np.maximum(size, np.abs(w).max(axis=1))
            gain = squared - _dot(v, w)
            arrived = (w == s).all(axis=1) | (w == t).all(axis=1) | (gain <= GAIN * squared)
            walks.arrived[rows] = arrived & (gain + sure <= SURE * size * distance) & (off <= SURE * size)
            inside = walks.inside[rows] = _holds_origin(s, t, w)
            on = ~inside & ~arrived & (squared > 0)
            if not to_the_end:
                on &= ~walks.apart[rows]
            rows, s, t, w, size = rows[on], s[on], t[on], w[on], size[on]
            (by_s, off_s), (by_t, off_t) = _nearest(s, w), _nearest(t, w)
            nearer = _dot(by_s, by_s) <= _dot(by_t, by_t)
            off = np.where(nearer, off_s, off_t)
            v, s, t = np.where(nearer[:, None], by_s, by_t), np.where(nearer[:, None], s, t), w
    return walks


def _farthest(a: Floats, b: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
    """The farthest difference p - q in direction d, the gap between the sets along d, and the error of the gap."""
    p, q = np.einsum("kmi,ki->km", a, d), np.einsum("kmi,ki->km", b, d)
    i, j = p.argmax(axis=1), q.argmin(axis=1)
    all_rows = np.arange(len(a))
    size = np.abs(p).max(axis=1) + np.abs(q).max(axis=1)
    size += np.abs(d).sum(axis=1) * (np.abs(a).max(axis=(1, 2)) + np.abs(b).max(axis=(1, 2)))
    return a[all_rows, i] - b[all_rows, j], q[all_rows, j] - p[all_rows, i], 2 * ORIENT_BOUND * size + UNDERFLOW


def _holds_origin(s: Floats, t: Floats, w: Floats) -> Bools:
    """Whether the triangle certainly does: its corners are differences rounded once, as in `cross_sign`."""
    turns = [_sure_turn(p, q) for p, q in ((s, t), (t, w), (w, s))]
    held: Bools = np.abs(sum(turns)) == 3
    return held


def _sure_turn(p: Floats, q: Floats) -> npt.NDArray[np.int8]:
    left, right = p[:, 0] * q[:, 1], p[:, 1] * q[:, 0]
    bound = ORIENT_BOUND * (np.abs(left) + np.abs(right)) + UNDERFLOW
    return (left - right > bound).astype(np.int8) - (right - left > bound).astype(np.int8)


def _nearest(p: Floats, q: Floats) -> tuple[Floats, Floats]:
    """The point of each segment that is nearest to the origin, and an estimate of its error."""
    way = q - p
    along, whole = -_dot(p, way), _dot(way, way)
    # Inside a segment along the normal, whose direction is accurate however far away the ends are.
    turned = np.stack([way[:, 1], -way[:, 0]], axis=1)
    between = turned * (_dot(p, turned) / whole)[:, None]
    off = np.abs(p + way * (along / whole)[:, None] - between).max(axis=1)
    within = (along > 0) & (along < whole)
    at_end = np.where((along >= whole)[:, None], q, p)
    ends = np.where((along <= 0)[:, None], p, at_end)
    return np.where(within[:, None], between, ends), np.where(within, off, 0.0)


def _dot(p: Floats, q: Floats) -> Floats:
    product: Floats = p[:, 0] * q[:, 0] + p[:, 1] * q[:, 1]
    return product
