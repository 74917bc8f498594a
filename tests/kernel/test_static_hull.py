"""The kernel's static hull discards only points inside the hull."""

import numpy as np
import pytest
from hypothesis import given
from inputs import cloud, points

from dynhull import _kernel, convex_hull
from dynhull.static import monotone_chain


@given(points(60))
def test_few_points(rows):
    np.testing.assert_array_equal(convex_hull(rows), monotone_chain(rows))


@pytest.mark.every(4)
@pytest.mark.parametrize("scale", [1.0, 1e-300, 1e280])
@pytest.mark.parametrize("kind", ["uniform", "circle", "grid", "columns", "clusters"])
def test_many_points(kind, scale):
    """Enough of them for a sample; sorted and shuffled, one outlier, one x."""
    random = np.random.default_rng(3)
    xy = cloud(kind, 20_000, random) * scale
    flat = xy * np.array([1.0, 0.0]) + 0.0
    outlier = np.concatenate([xy, [[xy[:, 0].mean(), -5 * scale]]])
    for rows in (xy, xy[np.lexsort(xy.T[::-1])], outlier, flat, flat[:, ::-1]):
        rows = np.ascontiguousarray(rows)
        expected = _kernel.HullTree(rows).vertices()
        np.testing.assert_array_equal(convex_hull(rows), expected)
    if scale == 1.0:  # in Python alone; `test_large` of tests/static has numbers of all sizes
        np.testing.assert_array_equal(convex_hull(xy), monotone_chain(xy))


def test_a_large_hull_keeps_its_memory():
    """The array of a large hull is the block that it was made in, and such blocks are used again."""
    random = np.random.default_rng(4)
    circles = [cloud("circle", 300_000, random) for _ in range(2)]
    hulls = [convex_hull(rows) for rows in circles]
    copies = [hull.copy() for hull in hulls]
    assert 2 * len(hulls[0]) > 300_000
    del hulls[0]
    again = convex_hull(circles[0])
    trees = [_kernel.HullTree(rows).vertices() for rows in circles]
    for hull, copy, tree in zip([again, hulls[0]], copies, trees, strict=True):
        np.testing.assert_array_equal(hull, copy)
        np.testing.assert_array_equal(hull, tree)
