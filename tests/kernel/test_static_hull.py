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
