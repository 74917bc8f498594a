"""The point of a simplex that is nearest to the origin.

By signed areas and volumes, largest simplex first, as in Montanari, Petrinic and Barbieri, "Improving the GJK
algorithm for faster and more reliable distance queries between convex objects" (2017).
"""

from itertools import combinations

from ._vectors import Vector, cross, dot, normal, scale, subtract

# The corners whose weighted sum is the nearest point, and their weights: positive, with sum one.
Place = tuple[tuple[int, ...], tuple[float, ...]]


def nearest(corners: list[Vector]) -> Place:
    """The nearest part of a point, segment, triangle or tetrahedron; all of it if it contains the origin."""
    inside = (_on_point, _in_segment, _in_triangle, _in_tetrahedron)[len(corners) - 1](corners)
    if inside is not None:
        return tuple(range(len(corners))), inside
    places = []
    for kept in combinations(range(len(corners)), len(corners) - 1):
        within, weights = nearest([corners[i] for i in kept])
        places.append((tuple(kept[i] for i in within), weights))
    return min(places, key=lambda place: squared(place, corners))


def squared(place: Place, corners: list[Vector]) -> float:
    """The squared distance of a place from the origin."""
    v = foot([corners[i] for i in place[0]])
    return dot(v, v)


def foot(corners: list[Vector]) -> Vector:
    """The nearest point of the line or plane through up to three corners, if it is between them.

    Computed along the normal, whose direction is accurate even if the corners are too far away for a weighted sum.
    """
    if len(corners) == 1:
        return corners[0]
    if len(corners) == 2:
        way = subtract(corners[1], corners[0])
        across = cross(way, cross(corners[0], way))
        return scale(1 / dot(way, way), across)
    n = normal(*corners)
    return scale(dot(n, corners[0]) / dot(n, n), n)


def _on_point(_: list[Vector]) -> tuple[float, ...]:
    return (1.0,)


def _in_segment(corners: list[Vector]) -> tuple[float, ...] | None:
    a, b = corners
    way = subtract(b, a)
    along, whole = -dot(a, way), dot(way, way)
    return (1 - along / whole, along / whole) if 0 < along < whole else None


def _in_triangle(corners: list[Vector]) -> tuple[float, ...] | None:
    a, b, c = corners
    n = normal(a, b, c)
    whole = dot(n, n)
    areas = dot(n, cross(b, c)), dot(n, cross(c, a)), dot(n, cross(a, b))
    if whole == 0 or min(areas) <= 0:
        return None
    return areas[0] / whole, areas[1] / whole, areas[2] / whole


def _in_tetrahedron(corners: list[Vector]) -> tuple[float, ...] | None:
    a, b, c, d = corners
    volumes = -dot(b, cross(c, d)), dot(a, cross(c, d)), -dot(a, cross(b, d)), dot(a, cross(b, c))
    whole = sum(volumes)
    if not (min(volumes) > 0 or max(volumes) < 0):
        return None
    return tuple(volume / whole for volume in volumes)
