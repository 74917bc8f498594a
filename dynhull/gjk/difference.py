"""GJK's walk through the difference of two sets, towards the origin."""

from dataclasses import dataclass

from ..convex import Convex
from .simplex import foot, nearest
from .vectors import ORIGIN, Vector, combine, dot, length, scale, subtract

MOST_ITERATIONS = 256  # polytopes take a few; a curve is followed to the tolerance
# Relative to the squared distance: what a further step could still gain.
GAIN = 1e-15
# Relative to the largest coordinates met: below this the difference of two points is rounding.
TOUCHING = 2.0**-50


@dataclass(frozen=True, slots=True)
class Corner:
    """A point of the difference, and the points of both sets that it is the difference of."""

    w: Vector
    p: Vector
    q: Vector


@dataclass(frozen=True)
class Walk:
    """Where a walk ended.

    Attributes:
        simplex: the corners around the point of the difference that is nearest to the origin.
        last: the farthest corner on the way to the origin from there.
        nearest: that point; zero where the origin is inside, up to rounding.
        distance: its length.
        points: of the two sets; their difference is `nearest`.
    """

    simplex: list[Corner]
    last: Corner
    nearest: Vector
    distance: float
    points: tuple[Vector, Vector]
    iterations: int


class Difference:
    """The set of all p - q, p of a and q of b."""

    __slots__ = ("_a", "_b", "dimension")

    def __init__(self, a: Convex, b: Convex) -> None:
        self._a = a
        self._b = b
        self.dimension = a.dimension

    def farthest(self, direction: Vector) -> Corner:
        """The farthest corner in a direction, which is not zero."""
        # Of a length near one: its negation, its square and its products with coordinates are all in range.
        size = max(map(abs, direction))
        d = [x / size for x in direction[: self.dimension]]
        p, q = self._point(self._a, d), self._point(self._b, [-x for x in d])
        return Corner(subtract(p, q), p, q)

    def _point(self, shape: Convex, direction: list[float]) -> Vector:
        x, y, *others = shape.support([direction])[0].tolist()
        return x, y, others[0] if others else 0.0


def walk(difference: Difference, enough: float) -> Walk:
    """Walk until the origin is held, no corner is nearer to it than the simplex, or its distance surely is enough."""
    last = difference.farthest((1.0, 0.0, 0.0))
    simplex = [last]
    weights: tuple[float, ...] = (1.0,)
    v = last.w
    size = length(last.p) + length(last.q)
    iterations = 0
    while iterations < MOST_ITERATIONS:
        if length(v) <= TOUCHING * size:
            v = ORIGIN
            break
        last = difference.farthest(scale(-1.0, v))
        iterations += 1
        size = max(size, length(last.p) + length(last.q))
        if dot(v, last.w) > (enough + TOUCHING * size) * length(v):
            break
        if dot(v, v) - dot(v, last.w) <= GAIN * dot(v, v) or any(last.w == corner.w for corner in simplex):
            break
        corners = [*simplex, last]
        kept, closer = nearest([corner.w for corner in corners])
        if len(kept) > difference.dimension:
            simplex, weights, v = corners, closer, ORIGIN
            break
        u = foot([corners[i].w for i in kept])
        if not dot(u, u) < dot(v, v):  # rounding, or a square out of range: there is no nearer
            break
        simplex, weights, v = [corners[i] for i in kept], closer, u
    on_a = combine(weights, [corner.p for corner in simplex])
    on_b = combine(weights, [corner.q for corner in simplex])
    return Walk(simplex, last, v, length(v), (on_a, on_b), iterations)
