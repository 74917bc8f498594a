"""GJK's walk through the difference of two sets, towards the origin."""

from dataclasses import dataclass, replace
from fractions import Fraction
from math import frexp, inf
from typing import cast

from .._hull import DynamicHull
from ..convex import Cloud, Convex
from ._core import is_polytope
from ._simplex import foot, nearest
from ._vectors import ORIGIN, Vector, combine, dot, length, scale, subtract

MOST_ITERATIONS = 256  # polytopes take a few; a curve is followed to the tolerance
# Relative to the squared distance: what a further step could still gain.
GAIN = 1e-15
# Relative to the size of the difference as far as it was met: a distance below this is rounding.
TOUCHING = 2.0**-50
# Squares, and cross products of cross products, of numbers up to this stay in range.
LARGEST = 2.0**200
# Powers of two from one to the other are doubles, and so are their reciprocals.
LEAST_EXPONENT, GREATEST_EXPONENT = -1000, 1000


# Relative to the same size: how far a walk in floats may end from the nearest point.
SURE = 2.0**-46


@dataclass(frozen=True, slots=True)
class Numbers:
    """What corners are computed in.

    Attributes:
        exponent: of the power of two that has the length one; None before the first corner that is not zero.
        rational: whether in fractions rather than floats, which takes some thirty times as long.
    """

    exponent: int | None = None
    rational: bool = False


class NumbersError(Exception):
    """The numbers did not do; all has to be done again in others.

    Attributes:
        numbers: the others.
    """

    def __init__(self, numbers: Numbers) -> None:
        super().__init__(numbers)
        self.numbers = numbers


@dataclass(frozen=True, slots=True)
class Corner:
    """A point of the difference, to scale, and the points of both sets that it is the difference of, as they are.

    Attributes:
        rounding: relative to this w is accurate.
    """

    w: Vector
    p: Vector
    q: Vector
    rounding: float


@dataclass(frozen=True)
class Walk:
    """Where a walk ended.

    Attributes:
        simplex: the corners around the point of the difference that is nearest to the origin.
        last: the farthest corner on the way to the origin from there.
        nearest: that point, to the difference's scale; zero where the origin is inside, up to rounding.
        distance: its length.
        points: of the two sets; their difference is `nearest`.
        iterations: each of them one corner.
        sure: whether `nearest` is in the difference and nothing nearer is, up to rounding; or the distance is enough.
    """

    simplex: list[Corner]
    last: Corner
    nearest: Vector
    distance: float
    points: tuple[Vector, Vector]
    iterations: int
    sure: bool


class Difference:
    """The set of all p - q, p of a and q of b, scaled by a power of two: squares of its corners are in range."""

    __slots__ = ("_a", "_b", "_exact", "_numbers", "_polytopes", "dimension")

    def __init__(self, a: Convex, b: Convex, numbers: Numbers) -> None:
        self._a = a
        self._b = b
        self._numbers = numbers
        self._exact = isinstance(a, Cloud | DynamicHull) and isinstance(b, Cloud | DynamicHull)
        self._polytopes = is_polytope(a) and is_polytope(b)
        self.dimension = a.dimension

    @property
    def scale(self) -> float:
        """What a length of one is, a power of two."""
        return 2.0 ** (self._numbers.exponent or 0)

    def doubt(self) -> None:
        """Have all done again in fractions, unless it is, or the sets are curved: those are only approached."""
        if self._polytopes and not self._numbers.rational:
            raise NumbersError(replace(self._numbers, rational=True))

    def farthest(self, direction: Vector) -> Corner:
        """The farthest corner in a direction, which is not zero.

        Raises:
            NumbersError: it is far larger than those that the scale was chosen by.
        """
        # Of a length near one: its negation, its square and its products with coordinates are all in range.
        size = max(map(abs, direction))
        d = [float(x / size) for x in direction[: self.dimension]]
        p, q = self._point(self._a, d), self._point(self._b, [-x for x in d])
        w = self._scaled(p, q)
        rounding = length(w) if self._exact else length(w) + (length(p) + length(q)) / self.scale
        return Corner(w, p, q, rounding)

    def _scaled(self, p: Vector, q: Vector) -> Vector:
        """The way from q to p, in floats rounded once. Sets the scale where there is none yet."""
        w = subtract(p, q)
        halves = 1.0
        if max(map(abs, w)) == inf:
            halves = 2.0
            w = subtract(scale(0.5, p), scale(0.5, q))
        largest = max(map(abs, w))
        if self._numbers.exponent is None and largest > 0:
            self._numbers = replace(self._numbers, exponent=_exponent(largest))
        factor = halves / self.scale
        if largest * factor > LARGEST:
            raise NumbersError(replace(self._numbers, exponent=_exponent(largest)))
        if not self._numbers.rational:
            return scale(factor, w)
        x, y, z = ((Fraction(s) - Fraction(t)) / Fraction(self.scale) for s, t in zip(p, q, strict=True))
        return cast("Vector", (x, y, z))

    def _point(self, shape: Convex, direction: list[float]) -> Vector:
        x, y, *others = shape.support([direction])[0].tolist()
        return x, y, others[0] if others else 0.0


def _exponent(size: float) -> int:
    return min(max(frexp(size)[1], LEAST_EXPONENT), GREATEST_EXPONENT)


def walk(difference: Difference, enough: float) -> Walk:
    """Walk until the origin is held, no corner is nearer to it than the simplex, or its distance surely is enough.

    Args:
        difference: of two sets.
        enough: a distance, not to scale.
    """
    last = difference.farthest((1.0, 0.0, 0.0))
    simplex = [last]
    weights: tuple[float, ...] = (1.0,)
    v = last.w
    size = last.rounding
    iterations, far = 0, False
    while iterations < MOST_ITERATIONS:
        if length(v) <= TOUCHING * size:
            v = ORIGIN
            break
        last = difference.farthest(scale(-1.0, v))
        iterations += 1
        size = max(size, last.rounding)
        if dot(v, last.w) > (enough / difference.scale + TOUCHING * size) * length(v):
            far = True
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
    off = length(subtract(combine(weights, [corner.w for corner in simplex]), v))
    gain = dot(v, v) - dot(v, last.w)
    sure = far or (off <= SURE * size and gain <= SURE * size * length(v))
    return Walk(simplex, last, v, length(v), (on_a, on_b), iterations, sure)
