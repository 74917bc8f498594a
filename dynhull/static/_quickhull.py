"""Quickhull in exact arithmetic: for points too flat for floats, or with too many in one hyperplane."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import gcd, lcm
from operator import mul
from typing import Any

import numpy as np
import numpy.typing as npt

Integers = npt.NDArray[Any]
# A normal and an offset without a common divisor; inside, normal @ x <= offset.
Plane = tuple[int, ...]


@dataclass(eq=False, slots=True)
class Facet:
    """A simplex of the boundary.

    Attributes:
        corners: numbers of points, in an order with det(normal, v1 - v0, v2 - v0, ...) > 0.
        plane: with its normal outwards.
        neighbours: each opposite the corner at its place.
        outside: points that see this facet, each with how far it is from the plane.
    """

    corners: tuple[int, ...]
    plane: Plane
    neighbours: list["Facet"] = field(default_factory=list)
    outside: list[tuple[int, int]] = field(default_factory=list)


def quickhull(points: Integers) -> list[Facet]:
    """The boundary of the convex hull of (n, k) distinct points that span the space, k at least 2.

    Barber, Dobkin, Huhdanpaa, "The Quickhull algorithm for convex hulls" (1996). Simplices in one hyperplane have the
    same plane. Only extreme points are corners.
    """
    facets = _boundary(points)
    used = {corner for facet in facets for corner in facet.corners}
    extreme = np.array(sorted(used - _within_faces(facets)))
    if len(extreme) == len(used):
        return facets
    facets = _boundary(points[extreme])
    for facet in facets:
        facet.corners = tuple(extreme[list(facet.corners)].tolist())
    return facets


def independent(vectors: Integers) -> tuple[list[int], list[int]]:
    """Numbers of vectors that span all others, and of as many axes on which they still do.

    By Gauss-Jordan elimination on integers, without fractions (Bareiss 1968). O(n d²).
    """
    matrix = vectors.copy()
    basis: list[int] = []
    axes: list[int] = []
    pivot = 1
    for _ in range(matrix.shape[1]):
        rest = [axis for axis in range(matrix.shape[1]) if axis not in axes]
        i, k = divmod(int(np.abs(matrix[:, rest]).argmax()), len(rest))
        axis = rest[k]
        if matrix[i, axis] == 0:
            break
        last, pivot = pivot, matrix[i, axis]
        for other in range(matrix.shape[1]):
            if other != axis:
                matrix[:, other] = (matrix[:, other] * pivot - matrix[:, axis] * matrix[i, other]) // last
        basis.append(i)
        axes.append(axis)
    return basis, axes


def inverse(matrix: Integers) -> Integers:
    """The inverse in rational numbers. The determinant must not be zero."""
    k = len(matrix)
    rows = np.concatenate([matrix, np.eye(k, dtype=np.int64).astype(object)], axis=1) * Fraction(1)
    for i in range(k):
        first = next(j for j in range(i, k) if rows[j, i])
        rows[[i, first]] = rows[[first, i]]
        rows[i] = rows[i] / rows[i, i]
        for j in range(k):
            if j != i:
                rows[j] = rows[j] - rows[j, i] * rows[i]
    return np.asarray(rows[:, k:])


def determinant_sign(matrix: Integers) -> int:
    """The sign of the determinant, by Gaussian elimination in rational numbers."""
    rows = matrix * Fraction(1)
    sign = 1
    for i in range(len(rows)):
        first = next((j for j in range(i, len(rows)) if rows[j, i]), None)
        if first is None:
            return 0
        if first != i:
            rows[[i, first]] = rows[[first, i]]
            sign = -sign
        sign = sign if rows[i, i] > 0 else -sign
        for j in range(i + 1, len(rows)):
            rows[j] = rows[j] - rows[j, i] / rows[i, i] * rows[i]
    return sign


def whole(ratios: Iterable[Fraction]) -> list[int]:
    """Integers in the same ratios."""
    ratios = list(ratios)
    scale = lcm(*(ratio.denominator for ratio in ratios))
    return [int(ratio * scale) for ratio in ratios]


def _boundary(points: Integers) -> list[Facet]:
    """A triangulation of the boundary; a corner may lie within a face of the hull."""
    # Height above a plane is one product.
    homogeneous = [(*row, -1) for row in points.tolist()]
    facets = _simplex(points, homogeneous)
    _share_out(range(len(points)), homogeneous, facets)
    waiting, gone = list(facets), set[Facet]()
    while waiting:
        facet = waiting.pop()
        if facet in gone or not facet.outside:
            continue
        # Of the points farthest from the plane the last one: rows in lexicographic order have no other between them.
        _, number = max(facet.outside)
        seen, heights = _visible(facet, homogeneous[number])
        new = _cone(seen, heights, number)
        _share_out((i for old in seen for _, i in old.outside if i != number), homogeneous, new)
        gone.update(seen)
        facets += new
        waiting += new
    return [facet for facet in facets if facet not in gone]


def _simplex(points: Integers, homogeneous: Sequence[Sequence[int]]) -> list[Facet]:
    """The facets of a simplex of points."""
    basis, _ = independent(points - points[0])
    corners = [0, *basis]
    # The columns: how each point's share of a sum of corners grows along the axes.
    edges = points[basis] - points[0]
    shares, sign = inverse(edges), determinant_sign(edges)
    outwards = [shares.sum(axis=1), *-shares.T]
    facets = []
    for i, normal in enumerate(outwards):
        others = corners[:i] + corners[i + 1 :]
        if sign * (-1) ** i < 0:
            others[-2:] = others[:-3:-1]
        offset = sum(map(mul, normal, homogeneous[others[0]]))
        facets.append(Facet(tuple(others), _plane(whole((*normal, offset)))))
    for facet in facets:
        facet.neighbours = [facets[corners.index(corner)] for corner in facet.corners]
    return facets


def _height(plane: Plane, point: Sequence[int]) -> int:
    return sum(map(mul, plane, point))


def _share_out(numbers: Iterable[int], homogeneous: Sequence[Sequence[int]], facets: list[Facet]) -> None:
    """Give each point to a facet that it sees. One that sees none is inside."""
    for number in numbers:
        point = homogeneous[number]
        for facet in facets:
            height = _height(facet.plane, point)
            if height > 0:
                facet.outside.append((height, number))
                break


def _visible(first: Facet, point: Sequence[int]) -> tuple[list[Facet], dict[Facet, int]]:
    """The facets that a point sees, connected to one of them, and its height above these and those next to them."""
    seen, heights = [first], {first: _height(first.plane, point)}
    for facet in seen:
        for neighbour in facet.neighbours:
            if neighbour not in heights:
                heights[neighbour] = _height(neighbour.plane, point)
                if heights[neighbour] > 0:
                    seen.append(neighbour)
    return seen, heights


def _cone(seen: list[Facet], heights: dict[Facet, int], number: int) -> list[Facet]:
    """New facets from the horizon of those that a point sees to the point."""
    new = []
    unpaired: dict[frozenset[int], tuple[Facet, int]] = {}
    for facet in seen:
        for i, beyond in enumerate(facet.neighbours):
            above, below = heights[facet], heights[beyond]
            if below > 0:
                continue
            # Planes through their common ridge are sums of the two; this one goes through the point.
            plane = _plane([above * b - below * a for a, b in zip(facet.plane, beyond.plane, strict=True)])
            corners = (*facet.corners[:i], number, *facet.corners[i + 1 :])
            cone = Facet(corners, plane, [beyond] * len(corners))
            beyond.neighbours[beyond.neighbours.index(facet)] = cone
            new.append(cone)
            for j in range(len(corners)):
                if j == i:
                    continue
                ridge = frozenset(corners[:j] + corners[j + 1 :])
                if ridge not in unpaired:
                    unpaired[ridge] = cone, j
                    continue
                other, place = unpaired.pop(ridge)
                cone.neighbours[j], other.neighbours[place] = other, cone
    return new


def _plane(values: list[int]) -> Plane:
    divisor = gcd(*values)
    return tuple(value // divisor for value in values)


def _within_faces(facets: list[Facet]) -> set[int]:
    """Corners that are not extreme points: the normals of the faces around them do not span the space."""
    around: dict[int, set[Plane]] = {}
    for facet in facets:
        for corner in facet.corners:
            around.setdefault(corner, set()).add(facet.plane[:-1])
    dimension = len(facets[0].corners)
    return {
        corner
        for corner, normals in around.items()
        if len(normals) < dimension or len(independent(np.array(list(normals), dtype=object))[0]) < dimension
    }
