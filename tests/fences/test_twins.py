"""Many subjects and fences on the kernel and in the reference: the same crossings, bit for bit."""

import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import FenceIndex, convex_hull

pytestmark = pytest.mark.skipif("cpp" not in KEYED_HULLS, reason="the kernel is not built")


class Twins:
    """Two hulls with an index each, of which the same is asked."""

    def __init__(self, key_type):
        self.hulls = [KEYED_HULLS[kind](key_type) for kind in ("python", "cpp")]
        self.indexes = [FenceIndex(hull) for hull in self.hulls]

    def change(self, method, *arguments, **options):
        for hull in self.hulls:
            getattr(hull, method)(*arguments, **options)

    def ask(self, method, *arguments, **options):
        expected, answer = (getattr(index, method)(*arguments, **options) for index in self.indexes)
        if isinstance(expected, np.ndarray):
            np.testing.assert_array_equal(answer, expected)
        else:
            assert answer == expected
        return answer


def star(random, center, size, corners):
    angles = (np.arange(corners) + 0.8 * random.random(corners)) * 2 * np.pi / corners
    radii = size * (0.3 + 0.7 * random.random(corners))
    return center + np.column_stack([radii * np.cos(angles), radii * np.sin(angles)])


def set_some(random, twins, fence, extent):
    options = {
        "closed": bool(random.integers(2)),
        "margin": float(random.integers(2) * extent / 20 * random.random()),
        "cross": bool(random.integers(2)),
    }
    center, size = random.random(2) * extent, extent * 0.3 * random.random() ** 2 + extent / 100
    match random.integers(6):
        case 0:
            twins.ask("set_circle", fence, *center, size, **options)
        case 1:
            points = center + random.normal(size=(int(random.integers(40)), 2)) * size
            twins.ask("set_hull", fence, convex_hull(points), **options)
        case 2:
            rings = [star(random, center, size, 40), star(random, center, size * 0.2, 6)]
            twins.ask("set_polygons", fence, [rings], **options)
        case _:
            polygons = [[star(random, center + k * size / 2, size, 7)] for k in range(1 + int(random.integers(2)))]
            twins.ask("set_polygons", fence, polygons, **options)


@pytest.mark.every(3)
@pytest.mark.parametrize(
    ("seed", "extent", "key_type"), [(3, 64.0, "str"), (1, 1.0, "str"), (2, 1e6, "int"), (4, 1e-3, "int")]
)
def test_a_busy_day(seed, extent, key_type):
    """Subjects by the hundred in several scales walk, come and go, while areas are set, moved and dropped."""
    random = np.random.default_rng(seed)
    twins = Twins(key_type)
    keys = [f"{k}" for k in range(400)] if key_type == "str" else [*range(400)]
    places = random.random((len(keys), 2)) * extent
    if seed == 3:
        places = np.round(places)  # many at one place, and on boundaries
    corners = random.random((60, 2)) * extent
    seen = 0
    for step in range(12):
        for fence in random.integers(0, 25, 4).tolist():
            set_some(random, twins, fence, extent)
        if step % 3 == 0:
            corners[random.integers(60, size=3)] = random.random((3, 2)) * extent
            twins.ask("set_hull", 100, convex_hull(corners), margin=extent / 50 * (step % 2), cross=True)
            twins.ask("set_hull", 101, [], margin=extent / 10, without_self=True)
        rows = random.permutation(len(keys))[: int(random.integers(1, 150))]
        scale = extent * float(random.choice([1e-4, 1e-2, 0.3]))
        places[rows] += random.normal(size=(len(rows), 2)) * scale
        if seed == 3:
            places = np.round(places)
        twins.change("put_many", [keys[row] for row in rows], places[rows], np.full(len(rows), float(step)))
        if step % 4 == 3:
            twins.change("remove_many", [keys[row] for row in random.permutation(len(keys))[:30]], missing="ignore")
        if step % 7 == 6:
            twins.change("expire", step - 5.0)
        if step % 5 == 4:
            for fence in random.integers(0, 25, 3).tolist():
                if fence in twins.indexes[0]:
                    twins.ask("drop", fence)
        if step % 3:
            seen += len(twins.ask("take"))
            twins.indexes[1]._fences.check()
        for fence in (*range(25), 100, 101):
            if fence in twins.indexes[0]:
                twins.ask("inside", fence)
                twins.ask("count", fence)
    assert seen > 100
