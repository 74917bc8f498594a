"""Vectors of three floats as tuples, which are much faster than arrays for a few. In the plane the third is zero."""

from math import hypot

Vector = tuple[float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)


def add(a: Vector, b: Vector) -> Vector:
    """The sum of two vectors."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """The vector from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: float, a: Vector) -> Vector:
    """A multiple of a vector."""
    return s * a[0], s * a[1], s * a[2]


def dot(a: Vector, b: Vector) -> float:
    """The dot product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vector, b: Vector) -> Vector:
    """The cross product."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def length(a: Vector) -> float:
    """The Euclidean length."""
    return hypot(*a)


def unit(a: Vector) -> Vector:
    """The vector scaled to length one; zero stays zero."""
    largest = max(map(abs, a))
    if not largest:
        return a
    b = a[0] / largest, a[1] / largest, a[2] / largest  # the reciprocal of a subnormal length would be infinite
    return scale(1 / length(b), b)


def normal(a: Vector, b: Vector, c: Vector) -> Vector:
    """A normal of a triangle that is counter-clockwise seen from its tip; its length is the parallelogram's area."""
    return cross(subtract(b, a), subtract(c, a))


def combine(weights: tuple[float, ...], vectors: list[Vector]) -> Vector:
    """The weighted sum of vectors."""
    total = ORIGIN
    for weight, vector in zip(weights, vectors, strict=True):
        total = add(total, scale(weight, vector))
    return total
