"""GJK's walk through the difference of two sets, towards the origin."""

from dataclasses import dataclass, replace
from fractions import Fraction
from math import frexp, inf
from typing import cast

from .._base import Hull
from ..convex import Cloud, Convex
from ._core import is_polytope
from ._simplex import foot, nearest
from ._vectors import ORIGIN, Vector, combine, dot, length, scale, subtract

MOST_ITERATIONS = 256  # polytopes need a few; curves run until the tolerance
# The most that another step can gain, relative to the squared distance.
GAIN = 1e-15
# Distances below this, relative to the size of the known part of the difference, are rounding errors.
TOUCHING = 2.0**-50
# Squares, and cross products of cross products, of numbers up to this do not overflow.
LARGEST = 2.0**200
# Powers of two between these, and their reciprocals, are doubles.
LEAST_EXPONENT, GREATEST_EXPONENT = -1000, 1000


# The largest error of a walk in floats, relative to the same size.
SURE = 2.0**-46


@dataclass(frozen=True, slots=True)
class Numbers:
    """The number type in which corners are computed.

    Attributes:
        exponent: the power of two that is scaled to length one; None before the first corner that is not zero.
        rational: whether these are fractions rather than floats; they take about thirty times as long.
    """

    exponent: int | None = None
    rational: bool = False


class NumbersError(Exception):
    """These numbers were not sufficient: repeat the search with others.

    Attributes:
        numbers: the others.
    """

    def __init__(self, numbers: Numbers) -> None:
        super().__init__(numbers)
        self.numbers = numbers


@dataclass(frozen=True, slots=True)
class Corner:
    """A point of the difference, scaled, and the points of the two sets whose difference it is, not scaled.

    Attributes:
        rounding: the magnitude to which the error of w is relative.
    """

    w: Vector
    p: Vector
    q: Vector
    rounding: float


@dataclass(frozen=True)
class Walk:
    """The result of a walk.

    Attributes:
        simplex: the corners whose hull contains the point of the difference that is nearest to the origin.
        last: the farthest corner from that point towards the origin.
        nearest: that point, scaled as the difference; zero if the origin is inside, up to rounding.
        distance: the length of `nearest`.
        points: one point of each set; their difference is `nearest`.
        iterations: the number of corners computed.
        sure: whether `nearest` is in the difference and no point is nearer, up to rounding; or the distance is enough.
    """

    simplex: list[Corner]
    last: Corner
    nearest: Vector
    distance: float
    points: tuple[Vector, Vector]
    iterations: int
    sure: bool


class Difference:
    """The set of all p - q, with p in a and q in b, scaled by a power of two so that squares do not overflow."""

    __slots__ = ("_a", "_b", "_exact", "_numbers", "dimension", "polytopes")

    def __init__(self, a: Convex, b: Convex, numbers: Numbers) -> None:
        self._a = a
        self._b = b
        self._numbers = numbers
        self._exact = isinstance(a, Cloud | Hull) and isinstance(b, Cloud | Hull)
        self.polytopes = is_polytope(a) and is_polytope(b)
        self.dimension = a.dimension

    @property
    def scale(self) -> float:
        """The length, a power of two, that is scaled to one."""
        return 2.0 ** (self._numbers.exponent or 0)

    def doubt(self) -> None:
        """Repeat the search in fractions, unless it runs in fractions already, or the sets are curved."""
        if self.polytopes and not self._numbers.rational:
            raise NumbersError(replace(self._numbers, rational=True))

    def farthest(self, direction: Vector) -> Corner:
        """The farthest corner in a direction, which is not zero.

        Raises:
            NumbersError: the corner is far larger than those for which the scale was chosen.
        """
        # Its length is near one: its negation, its square and its products with coordinates do not overflow.
        size = max(map(abs, direction))
        d = [float(x / size) for x in direction[: self.dimension]]
        p, q = self._point(self._a, d), self._point(self._b, [-x for x in d])
        w = self._scaled(p, q)
        rounding = length(w) if self._exact else length(w) + (length(p) + length(q)) / self.scale
        return Corner(w, p, q, rounding)

    def _scaled(self, p: Vector, q: Vector) -> Vector:
        """The vector from q to p, in floats rounded once. Chooses the scale if there is none yet."""
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
    """Walk until the simplex contains the origin, no corner is nearer to it, or its distance is certainly enough.

    Args:
        difference: the difference of two sets.
        enough: a distance, not scaled.
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
        if not dot(u, u) < dot(v, v):  # a rounding error, or a square that underflows: no nearer point
            break
        simplex, weights, v = [corners[i] for i in kept], closer, u
    on_a = combine(weights, [corner.p for corner in simplex])
    on_b = combine(weights, [corner.q for corner in simplex])
    off = length(subtract(combine(weights, [corner.w for corner in simplex]), v))
    gain = dot(v, v) - dot(v, last.w)
    sure = far or (off <= SURE * size and gain <= SURE * size * length(v))
    return Walk(simplex, last, v, length(v), (on_a, on_b), iterations, sure)
