"""Maximum margins, against scikit-learn's support vector machine."""

import numpy as np
import pytest
from cases import slow

from dynhull import DynamicHull
from dynhull.margin import max_margin


def hard_margin(a, b):
    """Width of the margin, unit normal from a to b, offset."""
    from sklearn.svm import SVC  # two seconds, which every worker of the tests would spend to find out their names

    machine = SVC(kernel="linear", C=1e10, tol=1e-8).fit(np.concatenate([a, b]), [0] * len(a) + [1] * len(b))
    weights = machine.coef_[0]
    size = np.linalg.norm(weights)
    return 2 / size, weights / size, -machine.intercept_[0] / size


@slow
@pytest.mark.every(3)
@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("seed", range(10))
def test_agrees_with_the_support_vector_machine(d, seed):
    random = np.random.default_rng(seed)
    a, b = random.normal(size=(30, d)), random.normal(size=(40, d))
    b[:, 0] += a[:, 0].max() - b[:, 0].min() + random.random()
    found = max_margin(a, b)
    margin, normal, offset = hard_margin(a, b)
    assert found.separable
    assert found.margin == pytest.approx(margin, rel=1e-5)
    assert found.normal == pytest.approx(normal, abs=1e-4)
    assert found.offset == pytest.approx(offset, abs=1e-4)
    # No point is inside the gap.
    assert (a @ found.normal).max() <= found.offset - found.margin / 2 + 1e-12
    assert (b @ found.normal).min() >= found.offset + found.margin / 2 - 1e-12


def test_two_live_hulls():
    random = np.random.default_rng(0)
    a, b = DynamicHull(random.random((500, 2))), DynamicHull(random.uniform([2, 0], [3, 1], (500, 2)))
    for _ in range(20):
        a.insert(*random.random(2))
        b.delete(*b.points()[random.integers(len(b))])
        live, static = max_margin(a, b), max_margin(a.points(), b.points())
        assert live.margin == pytest.approx(static.margin, rel=1e-14)
        assert live.normal == pytest.approx(static.normal, abs=1e-12)


@pytest.mark.parametrize("n", [100, 1000, 10_000])
def test_a_query_on_live_hulls_takes_about_log_n_steps(n):
    """Of O(log n) each. Circles, where every point is a vertex, are the worst of common inputs."""
    random = np.random.default_rng(n)
    for _ in range(8):
        angle = random.random((2, n)) * 2 * np.pi
        a, b = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        found = max_margin(DynamicHull(a), DynamicHull(b + random.uniform([2.5, 0], [3.5, 1])))
        assert found.iterations <= np.log2(n) + 4


def test_touching_and_overlapping():
    touching = max_margin([[0, 0], [1, 1]], [[1, 1], [2, 0]])
    assert (touching.separable, touching.margin, touching.depth) == (False, 0, 0)
    overlapping = max_margin([[0, 0], [4, 0], [0, 4], [4, 4]], [[3, 1], [9, 1], [9, 2], [3, 2]])
    assert (overlapping.separable, overlapping.depth) == (False, 1)
    same = max_margin([[0, 0], [2, 0], [2, 2], [0, 2]], [[0, 0], [2, 0], [2, 2], [0, 2]])
    assert (same.separable, same.depth) == (False, 2)


@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ([], [[0, 0]], "points are empty"),
        ([[0, 0]], [[0, np.nan]], "points row 0"),
        ([[0, 0]], [[0, 0, 0]], "dimension 2 or 3"),
    ],
)
def test_bad_points(a, b, message):
    with pytest.raises(ValueError, match=message):
        max_margin(a, b)


def test_an_empty_hull():
    with pytest.raises(ValueError, match="empty hull"):
        max_margin(DynamicHull(), [[0, 0]])
