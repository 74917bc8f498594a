"""Convex hulls in three and more dimensions: Qhull with the conventions of this library.

The only part of the library that needs scipy, and the only one whose vertices are not exact; `hull_nd` gives the bound.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from .._exact import as_integers
from .._value import Value
from ..arrays import as_rows
from ._monotone_chain import monotone_chain
from ._quickhull import determinant_sign, independent, inverse, quickhull, whole

Rows = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]
Integers = npt.NDArray[Any]

LARGEST_TO_SUBTRACT = 2.0**1022
# Far above the rounding errors of a determinant of vectors of length one.
DOUBTFUL_VOLUME = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class HullND(Value):
    """A convex hull in d dimensions.

    Attributes:
        dimension: of the smallest flat that holds the points: d where they are not flat, 0 for one point, -1 for none.
        vertices: (k, d) in lexicographic order.
        faces: of dimension `dimension` - 1, as indices of vertices. An (f, `dimension`) array of simplices; merged, a
            list of arrays, one for all simplices in one hyperplane: in three dimensions in order around the face,
            otherwise sorted. The faces of a segment are its ends; a point has none.
        normals: (f, d) unit normals that point outwards, of a flat hull within its flat. As exact as floating point.

    The vertices of a simplex are in an order with det(normal, v1 - v0, v2 - v0, ...) > 0: in three dimensions
    counter-clockwise seen from outside. Those of a flat hull are all seen from the same one of its two sides.
    """

    dimension: int
    vertices: Rows
    faces: Indices | list[Indices]
    normals: Rows


@dataclass(frozen=True, slots=True)
class _Boundary:
    """Simplices in outward order.

    Attributes:
        simplices: row numbers.
        faces: in which hyperplane each lies; equal for those in one.
        normals: (f, d), one for each simplex.
    """

    simplices: Indices
    faces: list[tuple[Any, ...]]
    normals: Rows


def hull_nd(points: npt.ArrayLike, merge: bool = False) -> HullND:
    """Convex hull in two or more dimensions. O(n log n) in three, O(n^floor(d/2)) in d > 3.

    Barber, Dobkin, Huhdanpaa, "The Quickhull algorithm for convex hulls" (1996): Qhull, through scipy. Qhull works in
    floating point: a point within its rounding error of a face may or may not be a vertex. Where rounding errors break
    the boundary, as they do near a hyperplane, the same algorithm runs in exact arithmetic, some twenty times slower.

    For points of any thickness in any position: the dimension is exact, the boundary is closed (each ridge is between
    two simplices), and no point lies outside of a face by more than 1e-9 of the points' extent. Hulls of points in one
    plane are exact.

    Points are flat only where they lie exactly in a hyperplane, as doubles. Points of a plane rotated in space rarely
    do, since their coordinates are rounded: their hull has full dimension and is a few roundings thick.

    Args:
        points: (n, d) array-like of finite numbers.
        merge: whether to merge simplices that lie in one hyperplane, up to Qhull's rounding error.

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.
        ModuleNotFoundError: d is 3 or more, and scipy is not installed.

    >>> from dynhull.static import hull_nd
    >>> hull = hull_nd([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.1]])
    >>> hull.vertices.tolist()
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    >>> hull_nd([[0, 0, 7], [1, 0, 7], [0, 1, 7]]).dimension
    2
    """
    # Without the indices, np.unique imports numpy.ma, which two threads cannot do: python/cpython#149728.
    rows, _ = np.unique(as_rows(points), axis=0, return_index=True)
    n, d = rows.shape
    if n < 2:
        return HullND(n - 1, rows, [] if merge else np.empty((0, max(n - 1, 0)), np.int64), np.empty((0, d)))
    dimension, boundary = _boundary(rows)
    used, numbers = np.unique(boundary.simplices, return_inverse=True)
    faces = numbers.reshape(boundary.simplices.shape).astype(np.int64)
    if not merge:
        return HullND(dimension, rows[used], faces, boundary.normals)
    groups: dict[tuple[Any, ...], list[int]] = {}
    for i, face in enumerate(boundary.faces):
        groups.setdefault(face, []).append(i)
    merged = [_merged(faces[group]) for group in groups.values()]
    return HullND(dimension, rows[used], merged, boundary.normals[[group[0] for group in groups.values()]])


def _boundary(rows: Rows) -> tuple[int, _Boundary]:
    """The dimension of two or more distinct rows, and the boundary of their hull."""
    d = rows.shape[1]
    if d > 2 and (found := _by_qhull(rows)):
        simplices, equations = found
        return d, _Boundary(simplices, _keys(equations), equations[:, :-1])
    points, _ = as_integers(rows)
    basis, axes = independent(points - points[0])
    axes.sort()
    dimension = len(axes)
    seen = points[:, axes]  # in the flat, as many coordinates as it has dimensions tell points apart
    if dimension == 1:
        ends = np.array([[0], [len(rows) - 1]], np.int64)  # in lexicographic order, which on a line is along it
        simplices, outwards = ends, seen[ends[:, 0]] - seen[ends[::-1, 0]]
        faces = _keys(simplices)
    elif dimension == 2:
        simplices = _polygon(rows[:, axes])
        step = seen[simplices[:, 1]] - seen[simplices[:, 0]]
        outwards = np.stack([step[:, 1], -step[:, 0]], axis=1)
        faces = _keys(simplices)
    elif dimension < d and (found := _by_qhull(rows[:, axes])):
        simplices, equations = found
        outwards, _ = as_integers(equations[:, :-1])
        faces = _keys(equations)
    else:
        facets = quickhull(seen)
        simplices = np.array([facet.corners for facet in facets], np.int64)
        planes = np.array([facet.plane for facet in facets], dtype=object)
        faces, outwards = _keys(planes), planes[:, :-1]
    if dimension < d:
        outwards = outwards @ _embedding(points[basis] - points[0], axes).T
    return dimension, _Boundary(simplices, faces, _units(outwards))


def _embedding(basis: Integers, axes: list[int]) -> Integers:
    """The matrix that turns normals given on some of the axes into vectors of the flat in space, of another length.

    A normal is known by its products with the basis, which are the same in the flat and on the axes. Exact.
    """
    gram = inverse(basis @ basis.T)
    matrix = basis.T @ gram @ basis[:, axes]
    return np.array(whole(matrix.ravel()), dtype=object).reshape(matrix.shape)


def _units(vectors: Integers) -> Rows:
    """Of length one, rounded."""
    largest = np.abs(vectors).max(axis=1, keepdims=True)
    units = (vectors / largest).astype(np.float64)
    return np.asarray(units / np.linalg.norm(units, axis=1, keepdims=True))


def _keys(rows: npt.NDArray[Any]) -> list[tuple[Any, ...]]:
    return list(map(tuple, rows.tolist()))


def _polygon(xy: Rows) -> Indices:
    """The edges of distinct points in the plane."""
    number = {point: i for i, point in enumerate(map(tuple, xy.tolist()))}
    corners = [number[tuple(corner)] for corner in monotone_chain(xy).tolist()]
    return np.stack([corners, np.roll(corners, -1)], axis=1).astype(np.int64)


def _by_qhull(rows: Rows) -> tuple[Indices, Rows] | None:
    """Simplices in outward order with equations; None for flat rows, or where rounding errors break the boundary."""
    points = _near_the_origin(rows)
    spatial = _scipy_spatial()
    try:
        hull = spatial.ConvexHull(points)
    except spatial.QhullError:
        return None
    simplices = hull.simplices.astype(np.int64)
    volumes = _volumes(rows, simplices, hull.equations[:, :-1])
    inwards = volumes < 0
    simplices[inwards, -2:] = simplices[inwards, :-3:-1]
    largest = np.abs(volumes).argmax()
    farthest = (points @ hull.equations[largest, :-1]).argmin()
    sample, _ = as_integers(rows[[farthest, *simplices[largest]]])
    spans = len(independent(sample[1:] - sample[0])[0]) == rows.shape[1]
    return (simplices, hull.equations) if spans and volumes.all() and _is_closed(simplices) else None


def _volumes(rows: Rows, simplices: Indices, normals: Rows) -> Rows:
    """det(normal, v1 - v0, v2 - v0, ...) with edges of length one; the sign is exact."""
    corners = _halves_where_large(rows)[simplices]
    edges = corners[:, 1:] - corners[:, :1]
    edges = edges / np.abs(edges).max(axis=2, keepdims=True)
    edges = edges / np.linalg.norm(edges, axis=2, keepdims=True)
    volumes = np.linalg.det(np.concatenate([normals[:, None], edges], axis=1))
    for i in np.flatnonzero(np.abs(volumes) < DOUBTFUL_VOLUME).tolist():
        exactly, _ = as_integers(rows[simplices[i]])
        normal, _ = as_integers(normals[i])
        volumes[i] = determinant_sign(np.stack([normal, *(exactly[1:] - exactly[0])])) * DOUBTFUL_VOLUME
    return np.asarray(volumes)


def _halves_where_large(rows: Rows) -> Rows:
    """The rows, halved where a difference could overflow."""
    return np.ldexp(rows, -1) if np.abs(rows).max() > LARGEST_TO_SUBTRACT else rows


def _near_the_origin(rows: Rows) -> Rows:
    """Moved, and scaled by a power of two: of a size near one. Errors are roundings relative to the extent."""
    halves = _halves_where_large(rows)
    points = halves - halves[0]
    return np.asarray(np.ldexp(points, -np.frexp(np.abs(points).max())[1]))


def _is_closed(simplices: Indices) -> bool:
    """Whether each ridge is between two simplices, which go around it in opposite directions."""
    k = simplices.shape[1]
    ascending = np.sort(simplices, axis=1)
    swaps = sum((simplices[:, i] > simplices[:, j]).astype(np.int64) for i, j in combinations(range(k), 2))
    ridges = np.concatenate([np.delete(ascending, i, axis=1) for i in range(k)])
    signs = np.concatenate([1 - 2 * ((swaps + i) % 2) for i in range(k)])
    _, ridge, count = np.unique(ridges, axis=0, return_inverse=True, return_counts=True)
    return bool((count == 2).all() and not np.bincount(ridge.ravel(), weights=signs).any())


def _scipy_spatial() -> Any:
    try:
        import scipy.spatial
    except ModuleNotFoundError as error:
        error.add_note("Hulls in three and more dimensions need scipy: pip install 'dynhull[nd]'")
        raise
    return scipy.spatial


def _merged(simplices: Indices) -> Indices:
    """The vertices of adjoining simplices in one hyperplane; of triangles, around their union."""
    if simplices.shape[1] != 3:
        return np.unique(simplices)
    edges = {(int(t[i - 1]), int(t[i])) for t in simplices for i in range(3)}
    following = {a: b for a, b in edges if (b, a) not in edges}
    first = min(following)
    around = [first]
    while following[around[-1]] != first:
        around.append(following[around[-1]])
    return np.array(around, np.int64)
