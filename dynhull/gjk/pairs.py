"""GJK on many pairs of small polygons at once: a step of the walk for all that are still on their way."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..arrays import finite_pairs
from ..convex import polygon
from ..predicates import ORIENT_BOUND, UNDERFLOW
from .contact import contact, intersect

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

MOST_STEPS = 24  # who is not there by then goes alone
GAIN = 1e-15


def intersect_many(a: npt.ArrayLike, b: npt.ArrayLike) -> Bools:
    """(k,) whether the hulls of each of k pairs of small sets of points intersect; touching counts. Exact.

    Args:
        a: (k, m, 2) points; repeat one where a polygon has fewer.
        b: (k, n, 2).

    Raises:
        ValueError, TypeError: a coordinate is not finite or no number, or the shapes do not fit.

    O(m + n) a step, a handful of steps. Pairs that floats cannot tell are decided one by one, exactly.

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
    """(k,) distances of the hulls of each of k pairs, 0.0 where they intersect: like `intersect_many`.

    Zero or not is exact; the distance is within 1e-12 of the polygons' size.
    """
    first, second = _checked(a, b)
    walk = _walk(first, second, to_the_end=True)
    result = np.where(walk.inside, 0.0, walk.distance)
    for row in np.flatnonzero(~walk.inside & ~(walk.apart & walk.arrived)).tolist():
        result[row] = contact(polygon(first[row]), polygon(second[row])).distance
    return result


@dataclass(frozen=True)
class _Walks:
    """Of each pair: surely intersecting, surely apart, and how far up to now."""

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
    with np.errstate(all="ignore"):  # pairs with extreme coordinates do not get there: they go alone
        s = t = v = _farthest(a, b, np.broadcast_to([1.0, 0.0], (k, 2)))[0]
        for _ in range(MOST_STEPS):
            if not rows.size:
                break
            w, gap, sure = _farthest(a[rows], b[rows], -v)
            walks.apart[rows] |= gap > sure
            squared = _dot(v, v)
            walks.distance[rows] = np.sqrt(squared)
            again = (w == s).all(axis=1) | (w == t).all(axis=1)
            arrived = walks.arrived[rows] = again | (squared - _dot(v, w) <= GAIN * squared)
            inside = walks.inside[rows] = _holds_origin(s, t, w)
            on = ~inside & ~arrived & (squared > 0)
            if not to_the_end:
                on &= ~walks.apart[rows]
            rows, s, t, w = rows[on], s[on], t[on], w[on]
            by_s, by_t = _nearest(s, w), _nearest(t, w)
            nearer = (_dot(by_s, by_s) <= _dot(by_t, by_t))[:, None]
            v, s, t = np.where(nearer, by_s, by_t), np.where(nearer, s, t), w
    return walks


def _farthest(a: Floats, b: Floats, d: Floats) -> tuple[Floats, Floats, Floats]:
    """Of the differences p - q the farthest in direction d; how far the sets are apart along it; the error of that."""
    p, q = np.einsum("kmi,ki->km", a, d), np.einsum("kmi,ki->km", b, d)
    i, j = p.argmax(axis=1), q.argmin(axis=1)
    all_rows = np.arange(len(a))
    size = np.abs(p).max(axis=1) + np.abs(q).max(axis=1)
    size += np.abs(d).sum(axis=1) * (np.abs(a).max(axis=(1, 2)) + np.abs(b).max(axis=(1, 2)))
    return a[all_rows, i] - b[all_rows, j], q[all_rows, j] - p[all_rows, i], 2 * ORIENT_BOUND * size + UNDERFLOW


def _holds_origin(s: Floats, t: Floats, w: Floats) -> Bools:
    """Whether the triangle surely does: its corners are differences rounded once, as `cross_sign` has them."""
    turns = [_sure_turn(p, q) for p, q in ((s, t), (t, w), (w, s))]
    held: Bools = np.abs(sum(turns)) == 3
    return held


def _sure_turn(p: Floats, q: Floats) -> npt.NDArray[np.int8]:
    left, right = p[:, 0] * q[:, 1], p[:, 1] * q[:, 0]
    bound = ORIENT_BOUND * (np.abs(left) + np.abs(right)) + UNDERFLOW
    return (left - right > bound).astype(np.int8) - (right - left > bound).astype(np.int8)


def _nearest(p: Floats, q: Floats) -> Floats:
    """The point of each segment that is nearest to the origin."""
    way = q - p
    along, whole = -_dot(p, way), _dot(way, way)
    # Between the ends along the normal, whose direction is right however far away the ends are.
    turned = np.stack([way[:, 1], -way[:, 0]], axis=1)
    between = turned * (_dot(p, turned) / whole)[:, None]
    at_end = np.where((along >= whole)[:, None], q, p)
    return np.where(((along > 0) & (along < whole))[:, None], between, np.where((along <= 0)[:, None], p, at_end))


def _dot(p: Floats, q: Floats) -> Floats:
    product: Floats = p[:, 0] * q[:, 0] + p[:, 1] * q[:, 1]
    return product
