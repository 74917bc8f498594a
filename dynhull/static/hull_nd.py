"""Convex hulls in three and more dimensions: Qhull's, by the conventions of this library.

The only part of the library that needs scipy, and the only one whose vertices are not exact.
"""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt

from ..arrays import as_rows
from .monotone_chain import monotone_chain

Rows = npt.NDArray[np.float64]
Indices = npt.NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class HullND:
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
class _Flat:
    """The smallest flat that holds the points. Exact, but for the rounding of `position`.

    Attributes:
        axes: as many axes as the flat has dimensions; the others can be computed from these.
        basis: row numbers of points that, seen from the first point, span the flat.
        position: (n, dimension) coordinates in that basis, none of them large.
    """

    axes: list[int]
    basis: list[int]
    position: Rows


def hull_nd(points: npt.ArrayLike, merge: bool = False) -> HullND:
    """Convex hull in two or more dimensions. O(n log n) in three, O(n^floor(d/2)) in d > 3.

    Barber, Dobkin, Huhdanpaa, "The Quickhull algorithm for convex hulls" (1996): Qhull, through scipy. Qhull works in
    floating point: a point within its rounding error of a face may or may not be a vertex. Whether the input is flat
    is decided exactly, and hulls of points in one plane are exact.

    Args:
        points: (n, d) array-like of finite numbers.
        merge: whether to merge simplices that lie in one hyperplane, up to Qhull's rounding error.

    Raises:
        ValueError, TypeError: bad input; the message names the first bad row.
        ModuleNotFoundError: d is 3 or more, and scipy is not installed.

    >>> hull = hull_nd([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.1, 0.1, 0.1]])
    >>> hull.vertices.tolist()
    [[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]
    >>> hull_nd([[0, 0, 7], [1, 0, 7], [0, 1, 7]]).dimension
    2
    """
    rows = np.unique(as_rows(points), axis=0)
    n, d = rows.shape
    if n < 2:
        return HullND(n - 1, rows, [] if merge else np.empty((0, max(n - 1, 0)), np.int64), np.empty((0, d)))
    dimension, simplices, equations, embedding = _simplices(rows)
    normals = equations[:, :dimension] @ np.linalg.pinv(embedding).T
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    used, numbers = np.unique(simplices, return_inverse=True)
    faces = numbers.reshape(simplices.shape).astype(np.int64)
    if not merge:
        return HullND(dimension, rows[used], faces, normals)
    # Qhull gives the simplices of a face the same equation, bit by bit.
    _, first, group = np.unique(equations, axis=0, return_index=True, return_inverse=True)
    merged = [_merged(faces[group.ravel() == i]) for i in range(len(first))]
    return HullND(dimension, rows[used], merged, normals[first])


def _simplices(rows: Rows) -> tuple[int, Indices, Rows, Rows]:
    """Simplices with outward equations in some coordinates of the rows, and the linear map from these to the space.

    Three ways, each only where the one before found its input flat: the given coordinates, as many of these as the
    points have dimensions, and coordinates in a basis of points, in which nothing is nearly flat.
    """
    d = rows.shape[1]
    largest = np.frexp(np.abs(rows).max())[1]
    scaled = np.ldexp(rows, -largest)  # by a power of two: squares neither overflow nor vanish
    if d > 2 and (found := _qhull(scaled)):
        return d, *found, np.eye(d)
    flat = _smallest_flat(rows)
    spanning = scaled[flat.basis] - scaled[0]
    dimension = len(flat.axes)
    if dimension == 1:
        ends = np.array([[0], [len(rows) - 1]], np.int64)  # in lexicographic order, which on a line is along it
        return 1, ends, np.array([[-1.0], [1.0]]), spanning
    if dimension == d == 2:
        return 2, *_polygon(rows), np.eye(2)
    found = _polygon(rows[:, flat.axes]) if dimension == 2 else _qhull(scaled[:, flat.axes]) if dimension < d else None
    if found:
        simplices, equations = found
        return dimension, simplices, equations[:, :dimension] @ spanning[:, flat.axes].T, spanning
    found = _qhull(flat.position)
    assert found is not None  # the basis is a simplex in these coordinates, with edges of length one
    return dimension, *found, spanning


def _smallest_flat(rows: Rows) -> _Flat:
    """By Gauss-Jordan elimination on integers, without fractions (Bareiss 1968). O(n d²)."""
    columns = [[value.as_integer_ratio() for value in column] for column in rows.T.tolist()]
    scales = [max(denominator for _, denominator in column) for column in columns]
    scale = max(scales)
    matrix = np.array([[a * (scale // b) for a, b in column] for column in columns], dtype=object).T
    matrix = matrix - matrix[0]
    axes: list[int] = []
    basis: list[int] = []
    pivot = 1
    for _ in range(rows.shape[1]):
        rest = [axis for axis in range(rows.shape[1]) if axis not in axes]
        i, k = divmod(int(np.abs(matrix[:, rest]).argmax()), len(rest))
        axis = rest[k]
        if matrix[i, axis] == 0:
            break
        last, pivot = pivot, matrix[i, axis]
        for other in range(rows.shape[1]):
            if other != axis:
                matrix[:, other] = (matrix[:, other] * pivot - matrix[:, axis] * matrix[i, other]) // last
        axes.append(axis)
        basis.append(i)
    # The pivot is the basis' determinant on the axes in this order: it says whether the new coordinates are mirrored.
    mirrored = (pivot < 0) != (sum(a > b for a, b in combinations(axes, 2)) % 2 == 1)
    if mirrored and len(basis) > 1:
        order = [1, 0, *range(2, len(basis))]
        basis, axes = [basis[i] for i in order], [axes[i] for i in order]
    position = (matrix[:, axes] / pivot).astype(np.float64)
    return _Flat(sorted(axes), basis, position)


def _polygon(xy: Rows) -> tuple[Indices, Rows]:
    """The edges of distinct points in the plane, and their equations."""
    number = {point: i for i, point in enumerate(map(tuple, xy.tolist()))}
    corners = monotone_chain(xy)
    ahead = np.roll(corners, -1, axis=0)
    edges = [[number[tuple(p)], number[tuple(q)]] for p, q in zip(corners.tolist(), ahead.tolist(), strict=True)]
    step = np.ldexp(ahead, -1) - np.ldexp(corners, -1)  # half: no difference overflows
    step /= np.abs(step).max(axis=1, keepdims=True)
    return np.array(edges, np.int64), np.stack([step[:, 1], -step[:, 0]], axis=1)


def _qhull(points: Rows) -> tuple[Indices, Rows] | None:
    """Simplices in outward order and outward equations; None where Qhull finds the points flat."""
    spatial = _scipy_spatial()
    try:
        hull = spatial.ConvexHull(points)
    except spatial.QhullError:
        return None
    simplices = hull.simplices.astype(np.int64)
    corners = points[simplices]
    frames = np.concatenate([hull.equations[:, None, :-1], corners[:, 1:] - corners[:, :1]], axis=1)
    inwards = np.linalg.det(frames) < 0
    simplices[inwards, -2:] = simplices[inwards, :-3:-1]
    return simplices, hull.equations


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
