"""Hulls in three and more dimensions: counts that theory gives, orientation, flat input."""

import subprocess
import sys
from fractions import Fraction
from itertools import combinations, product
from math import comb

import numpy as np
import oracle
import pytest

from dynhull.static import hull_nd

CUBE = np.array(list(product((0.0, 1.0), repeat=3)))


def cyclic_polytope(n, d):
    """n points on the moment curve, moved into the middle so that their powers stay small."""
    t = np.linspace(-1, 1, n)
    return np.stack([t**k for k in range(1, d + 1)], axis=1)


def most_facets(n, d):
    """McMullen's upper bound, reached by cyclic polytopes."""
    half = d // 2
    if d % 2:
        return 2 * comb(n - half - 1, half)
    return comb(n - half, half) + comb(n - half - 1, half - 1)


def ridges(faces):
    """How often each oriented edge of polygons occurs."""
    return [(int(face[i - 1]), int(face[i])) for face in faces for i in range(len(face))]


def assert_outside_is_outside(hull, points):
    """Every point is behind every face; the order of a simplex's vertices agrees with its normal."""
    size = np.abs(points).max()
    for simplex, normal in zip(hull.faces, hull.normals, strict=True):
        corners = hull.vertices[simplex]
        assert np.linalg.norm(normal) == pytest.approx(1)
        assert ((points - corners[0]) @ normal).max() <= 1e-12 * size
        if hull.dimension == points.shape[1]:
            assert np.linalg.det(np.concatenate([normal[None], corners[1:] - corners[0]])) > 0


@pytest.mark.parametrize("d", [3, 4, 5])
def test_random_points(d):
    points = np.random.default_rng(d).normal(size=(60, d))
    hull = hull_nd(points)
    assert hull.dimension == d
    from scipy.spatial import ConvexHull  # here: each process that collects tests would wait for scipy

    np.testing.assert_array_equal(hull.vertices, np.unique(points[ConvexHull(points).vertices], axis=0))
    assert hull.faces.shape[1] == d
    assert_outside_is_outside(hull, points)


@pytest.mark.parametrize("points", [CUBE, np.random.default_rng(1).normal(size=(500, 3))], ids=["cube", "random"])
def test_euler(points):
    """Vertices - edges + faces = 2, with each edge passed once in each direction."""
    for merge in (False, True):
        hull = hull_nd(points, merge=merge)
        edges = ridges(hull.faces)
        assert len(set(edges)) == len(edges)
        assert {(b, a) for a, b in edges} == set(edges)
        assert len(hull.vertices) - len(edges) // 2 + len(hull.faces) == 2


@pytest.mark.parametrize(("n", "d"), [(12, 4), (20, 4), (12, 5), (15, 5), (12, 6), (14, 6)])
def test_cyclic_polytopes_reach_the_upper_bound(n, d):
    hull = hull_nd(cyclic_polytope(n, d))
    assert len(hull.vertices) == n
    assert len(hull.faces) == most_facets(n, d)
    assert_outside_is_outside(hull, cyclic_polytope(n, d))


def test_merged_faces_of_a_grid_of_points():
    """Points inside faces and edges are no vertices; six squares, each counter-clockwise seen from outside."""
    grid = np.array(list(product((0.1, 0.2, 0.3, 0.4), repeat=3)))
    hull = hull_nd(np.concatenate([grid, grid]), merge=True)
    assert hull.vertices.tolist() == [list(p) for p in product((0.1, 0.4), repeat=3)]
    assert sorted(len(face) for face in hull.faces) == [4] * 6
    expected = {(sign * axis[0], sign * axis[1], sign * axis[2]) for axis in np.eye(3) for sign in (-1, 1)}
    assert {tuple(np.round(normal) + 0.0) for normal in hull.normals} == {tuple(np.add(n, 0.0)) for n in expected}
    for face, normal in zip(hull.faces, hull.normals, strict=True):
        a, b, c, _ = hull.vertices[face]
        assert np.cross(b - a, c - b) @ normal > 0


def test_two_dimensions_are_the_exact_hull():
    points = [(0.5 + i * 2.0**-53, 0.5 + j * 2.0**-53) for i in range(9) for j in range(9)] + [
        (12.0, 12.0),
        (24.0, 24.0),
    ]
    hull = hull_nd(points)
    corners = oracle.hull(points)
    assert list(map(tuple, hull.vertices.tolist())) == sorted(corners)
    assert list(map(tuple, hull.vertices[hull.faces[:, 0]].tolist())) == corners
    assert_outside_is_outside(hull, np.array(points))


@pytest.mark.parametrize("d", [2, 3, 4, 5])
def test_flat_input_gives_the_hull_of_its_dimension(d):
    rng = np.random.default_rng(d)
    point = rng.integers(-9, 9, d).astype(float)
    assert hull_nd([point] * 3).dimension == 0
    assert hull_nd([point] * 3).vertices.tolist() == [point.tolist()]
    assert hull_nd([point]).faces.shape == (0, 0)
    assert hull_nd([point], merge=True).faces == []

    line = point + np.outer([0, 3, 1, 2, 3], rng.integers(1, 9, d))
    hull = hull_nd(line)
    assert hull.dimension == 1
    assert hull.vertices.tolist() == sorted(line[[0, 1]].tolist())
    assert hull.faces.tolist() == [[0], [1]]
    assert_outside_is_outside(hull, line)

    for dimension in range(2, d):
        low = rng.integers(-20, 20, (40, dimension)).astype(float)
        shear = np.concatenate([np.eye(dimension), rng.integers(-3, 3, (dimension, d - dimension))], axis=1)
        flat = point + low @ shear
        hull, expected = hull_nd(flat), hull_nd(low)
        assert hull.dimension == dimension
        np.testing.assert_array_equal(hull.vertices, np.unique(point + expected.vertices @ shear, axis=0))
        assert len(hull.faces) == len(expected.faces)
        assert_outside_is_outside(hull, flat)


def test_nearly_flat_is_not_flat():
    """One unit in the last place thick, far from the origin: too flat for the coordinates that Qhull computes with."""
    thin = CUBE * (1.0, 1.0, 2.0**-30) + (2.0**22, 2.0**22, 2.0**22)
    hull = hull_nd(thin, merge=True)
    assert hull.dimension == 3
    np.testing.assert_array_equal(hull.vertices, thin)
    edges = ridges(hull.faces)
    assert {(b, a) for a, b in edges} == set(edges)
    a, b, c = (hull.vertices[hull.faces[0][i]] for i in range(3))
    inwards = (thin - a).mean(axis=0)  # the mean of the points themselves would be rounded to a face
    assert np.cross(b - a, c - b) @ inwards < 0


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_tiny_and_huge_coordinates(scale):
    assert hull_nd(CUBE * scale, merge=True).vertices.tolist() == (CUBE * scale).tolist()
    assert len(hull_nd(CUBE * scale, merge=True).faces) == 6


def test_empty():
    for points in ([], np.empty((0, 3))):
        hull = hull_nd(points)
        assert hull.dimension == -1
        assert len(hull.vertices) == len(hull.faces) == len(hull.normals) == 0


@pytest.mark.parametrize(
    ("points", "error", "message"),
    [
        ([[0, 0, 0], [1, np.nan, 0]], ValueError, r"points row 1 is \(1\.0, nan, 0\.0\)"),
        ([[0], [1]], ValueError, r"must have shape \(n, d\), d at least 2, got \(2, 1\)"),
        ([1, 2, 3], ValueError, r"must have shape \(n, d\)"),
        ([[0, 0, "x"]], TypeError, "row 0"),
        ([[0, 0, 2**60 + 1]], ValueError, "row 0 is 1152921504606846977"),
    ],
)
def test_bad_input(points, error, message):
    with pytest.raises(error, match=message):
        hull_nd(points)


@pytest.mark.parametrize(("points", "answer"), [("np.eye(2)", "1"), ("np.eye(4)", "")])
def test_without_scipy_the_message_says_what_to_install(points, answer):
    without = "import sys; sys.modules['scipy'] = None; import numpy as np; from dynhull.static import hull_nd"
    code = f"{without}; print(hull_nd({points}).dimension)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == answer
    assert ("need scipy: pip install 'dynhull[nd]'" in done.stderr) == (not answer)


def exact_rank(points):
    """Of the smallest flat that holds the points, in rational numbers."""
    origin, *others = ([Fraction(value) for value in point] for point in points.tolist())
    rows = [[a - b for a, b in zip(row, origin, strict=True)] for row in others]
    rank = 0
    for axis in range(points.shape[1]):
        pivot = next((row for row in rows if row[axis]), None)
        if pivot is not None:
            rank += 1
            rows = [[a - row[axis] / pivot[axis] * b for a, b in zip(row, pivot, strict=True)] for row in rows]
    return rank


def assert_closed(faces):
    """Each ridge of simplices is passed twice, in opposite directions."""
    passed = {}
    for face in np.asarray(faces).tolist():
        parity = sum(a > b for a, b in combinations(face, 2))
        for i, corner in enumerate(sorted(face)):
            passed.setdefault(frozenset(face) - {corner}, []).append((parity + i) % 2)
    assert all(sorted(ways) == [0, 1] for ways in passed.values())


def assert_a_hull(hull, points):
    """Of the right dimension, closed, outward normals: no point outside by more than 1e-9 of the extent."""
    assert hull.dimension == exact_rank(points)
    wide = points.astype(np.longdouble)
    extent = np.ptp(wide, axis=0).max()
    for face, normal in zip(hull.faces, hull.normals, strict=True):
        assert np.linalg.norm(normal) == pytest.approx(1)
        assert ((wide - hull.vertices[face[0]]) @ normal).max() <= 1e-9 * extent
    if hull.dimension > 1 and not isinstance(hull.faces, list):
        assert_closed(hull.faces)
    elif hull.dimension == 3:
        edges = ridges(hull.faces)
        assert len(set(edges)) == len(edges)
        assert {(b, a) for a, b in edges} == set(edges)
        assert len(hull.vertices) - len(edges) // 2 + len(hull.faces) == 2


def near_a_flat(random, d, dimension, thickness):
    """Points of a few kinds beside a flat of some dimension, turned, moved and scaled at random."""
    n = random.integers(d + 1, 25)
    points = [
        random.normal(size=(n, d)),
        random.integers(0, 3, (n, d)).astype(float),
        random.normal(size=(n, d)) * 10.0 ** random.integers(-12, 1, (n, 1)),
    ][random.integers(3)]
    points[:, dimension:] *= thickness
    turn = [np.eye(d), np.linalg.qr(random.normal(size=(d, d)))[0]][random.integers(2)]
    offset = random.choice([0, 1, 1e8, 1e15]) * random.normal(size=d)
    return (points @ turn + offset) * random.choice([1, 1e-300, 1e290])


@pytest.mark.every(5)
@pytest.mark.parametrize("d", [2, 3, 4, 5])
@pytest.mark.parametrize("thickness", [1e-9, 1e-12, 1e-13, 1e-14, 1e-15, 1e-16, 1e-17, 0])
def test_points_near_a_flat(thickness, d):
    random = np.random.default_rng([d, int(thickness * 1e18)])
    for dimension in range(1, d):
        for _ in range(4):
            points = near_a_flat(random, d, dimension, thickness)
            for merge in (False, True):
                assert_a_hull(hull_nd(points, merge), points)


@pytest.mark.parametrize("dimension", [1, 2, 3, 4])
def test_a_flat_turned_in_space_by_whole_numbers(dimension):
    """Exactly flat wherever it lies: its hull is the same simplices as before the turn."""
    random = np.random.default_rng(dimension)
    low = random.integers(-1000, 1000, (30, dimension)).astype(float)
    for _ in range(20):
        flat = low @ random.integers(-1000, 1000, (dimension, 5)) + random.integers(-(2**50), 2**50, 5)
        hull = hull_nd(flat)
        assert hull.dimension == dimension
        assert_a_hull(hull, flat)
        assert len(hull.vertices) == (len(hull_nd(low).vertices) if dimension > 1 else 2)


def test_a_flat_cloud_of_many_points_is_exact():
    """Too thin for floats: every vertex is extreme, every other point inside, in rational arithmetic."""
    random = np.random.default_rng(3)
    points = (random.normal(size=(500, 3)) * (1, 1, 0)) @ np.linalg.qr(random.normal(size=(3, 3)))[0] + 5
    hull = hull_nd(points)
    assert hull.dimension == 3
    rows = [[Fraction(value) for value in row] for row in points.tolist()]
    for face in hull.faces.tolist():
        a, b, c = ([Fraction(value) for value in hull.vertices[i].tolist()] for i in face)
        (ux, uy, uz), (vx, vy, vz) = ([q - p for p, q in zip(a, corner, strict=True)] for corner in (b, c))
        normal = (uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx)
        level = sum(n * x for n, x in zip(normal, a, strict=True))
        assert max(sum(n * x for n, x in zip(normal, row, strict=True)) for row in rows) <= level
