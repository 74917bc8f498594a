"""Vectors of three floats as tuples: for a handful of them much faster than arrays. The plane has a third zero."""

from math import hypot

Vector = tuple[float, float, float]

ORIGIN: Vector = (0.0, 0.0, 0.0)


def add(a: Vector, b: Vector) -> Vector:
    """The sum."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def subtract(a: Vector, b: Vector) -> Vector:
    """The way from b to a."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def scale(s: float, a: Vector) -> Vector:
    """So many times as long."""
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
    """Of length one; zero stays zero."""
    largest = max(map(abs, a))
    if not largest:
        return a
    b = a[0] / largest, a[1] / largest, a[2] / largest  # the reciprocal of a subnormal length would be infinite
    return scale(1 / length(b), b)


def normal(a: Vector, b: Vector, c: Vector) -> Vector:
    """At right angles to a triangle, counter-clockwise seen from its tip. As long as the parallelogram is large."""
    return cross(subtract(b, a), subtract(c, a))


def combine(weights: tuple[float, ...], vectors: list[Vector]) -> Vector:
    """The weighted sum."""
    total = ORIGIN
    for weight, vector in zip(weights, vectors, strict=True):
        total = add(total, scale(weight, vector))
    return total
