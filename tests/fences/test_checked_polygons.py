"""Which polygons with holes are valid: the kernel's sweep and the reference agree, and what was checked stays so."""

import random

import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import FenceIndex, KeyedHull, _rings
from dynhull.polygons import CheckedPolygons

compiled = pytest.mark.skipif("cpp" not in KEYED_HULLS, reason="the kernel is not built")
SQUARE = [(0, 0), (8, 0), (8, 8), (0, 8)]


def ring_at_random(pick):
    """A ring of a few corners on a small grid, so that rings often touch and share corners and edges."""
    size, x, y = pick.randrange(2, 6), pick.randrange(6), pick.randrange(6)
    return [(pick.randrange(size) + x, pick.randrange(size) + y) for _ in range(pick.choice((3, 3, 3, 4, 5)))]


def checked(rings):
    """The rings in the direction in which they are used, or None."""
    try:
        (polygon,) = _rings.as_polygons([[np.array(ring, float) for ring in rings]])
    except ValueError:
        return None
    return [ring.tolist() for ring in polygon]


@compiled
def test_the_kernel_and_the_reference_agree(monkeypatch):
    pick = random.Random(4)
    polygons = [
        [pick.choice((SQUARE, SQUARE[::-1], ring_at_random(pick))), *(ring_at_random(pick) for _ in range(number % 4))]
        for number in range(800)
    ]
    found = [checked(polygon) for polygon in polygons]
    monkeypatch.setattr(_rings, "kernel", None)
    for polygon, rings in zip(polygons, found, strict=True):
        assert rings == checked(polygon), polygon
    assert sum(rings is not None and len(rings) > 1 for rings in found) > 50


CHAINS = {
    "each other": [(float(k), 5.0) for k in range(2000)],
    "the exterior": [(float(k), 0.0) for k in range(2000)],
}


@compiled
@pytest.mark.parametrize("at", CHAINS.values(), ids=CHAINS)
def test_thousands_of_holes_that_touch(at):
    """Each touches its neighbours, or the exterior between two of its corners or at one."""
    holes = [[(x, y), (x + 1, y), (x + 0.5, y + 0.5)] for x, y in at] if at[0][1] else []
    holes = holes or [[(x, y), (x + 0.5, y + 1), (x - 0.5, y + 1)] for x, y in at[1:-1]]
    floor = [(float(k), 0.0) for k in range(2001)]
    exterior = [(-1.0, 0.0), *floor, (2000.0, 9.0), (-1.0, 9.0)]
    index = FenceIndex(KeyedHull())
    index.set_polygons(1, [[exterior, *holes]])
    assert index.distances(1, [holes[0][0], (1000.5, 5.1), (1000.5, 8), (1000.5, 10)]).tolist()[0::3] == [0.0, 1.0]


def test_what_was_checked_cannot_change():
    ring = np.array(SQUARE, float)
    checked = CheckedPolygons([[ring, [(1, 1), (2, 1), (2, 2)]]])
    ring[:] = 0
    hull = KeyedHull.from_entities(["in", "hole", "out"], [[4, 4], [1.5, 1.2], [9, 9]])
    index = FenceIndex(hull)
    index.set_polygons(1, checked)
    assert list(index.inside(1)) == ["in"]
    with pytest.raises(ValueError, match="read-only"):
        checked.rings[0][0][0, 0] = 3
    with pytest.raises(ValueError, match="polygon 0 ring 0 has 2 distinct corners"):
        CheckedPolygons([[[(0, 0), (1, 1), (0, 0)]]])
