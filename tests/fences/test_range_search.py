"""RangeSearch against rational arithmetic, and against the index that keeps the same up to date."""

import numpy as np
import pytest
from fence_oracle import Area
from hypothesis import given
from hypothesis import strategies as st

from dynhull import FenceIndex, KeyedHull, convex_hull
from dynhull.range_search import RangeSearch

HOLED = [[[0, 0], [6, 0], [6, 6], [0, 6]], [[1, 1], [3, 1], [3, 3], [1, 3]]]
FLAG = [[[6, 2], [9, 2], [8, 3], [9, 5], [6, 5]]]
SCALES = [1.0, 0.1, 1e-200, 1e200, 1.6e307]
PLACES = st.lists(st.tuples(st.integers(-2, 11), st.integers(-2, 11)), min_size=1, max_size=40)


def scaled(polygons, scale):
    return [[(np.array(ring, float) * scale).tolist() for ring in polygon] for polygon in polygons]


def tuples(polygons):
    return [[[tuple(corner) for corner in ring] for ring in polygon] for polygon in polygons]


@given(PLACES, st.sampled_from(SCALES), st.booleans(), st.sampled_from([0.0, 1.0, 1.4142135623730951]))
def test_rows_are_those_of_rational_arithmetic(places, scale, closed, margin):
    points = np.array(places, float) * scale
    margin *= scale
    search = RangeSearch(points)
    polygons = scaled([HOLED, FLAG], scale)
    hulls = [convex_hull(points[:k]) for k in (0, 1, 2, 9)]
    areas = [(("polygons", tuples(polygons)), search.polygons(polygons, closed=closed, margin=margin))]
    for radius in (0.0, 3 * scale):
        disk = search.disk(5 * scale, scale, radius, closed=closed, margin=margin)
        areas.append((("circle", (5 * scale, scale), radius), disk))
    for vertices in hulls:
        corners = [tuple(corner) for corner in vertices.tolist()]
        areas.append((("hull", corners), search.hull(vertices, closed=closed, margin=margin)))
    for described, rows in areas:
        area = Area(described, closed)
        if margin and described[0] != "polygons" and not area.closed and area.kind == "polygons" and not area.parts[0]:
            expected = []
        else:
            held = (area.within(tuple(p), margin) if margin else area.holds(tuple(p)) for p in points.tolist())
            expected = [row for row, holds in enumerate(held) if holds]
        assert rows.tolist() == expected, described


@pytest.mark.parametrize("margin", [0.0, 0.02])
def test_many_points_and_corners_as_the_index_says(margin):
    random = np.random.default_rng(3)
    angles = np.linspace(0, 2 * np.pi, 3000, endpoint=False)
    wave = (1 + 0.2 * np.sin(40 * angles))[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    points = np.vstack([random.uniform(-1.5, 1.5, (20_000, 2)), wave[::7]])
    keys = np.arange(len(points), dtype=np.uint64)
    index = FenceIndex(KeyedHull.from_entities(keys, points, key_type="int"))
    hole = 0.5 * wave[::-1]
    index.set_polygons(1, [[wave, hole]], margin=margin, inside=keys)
    index.take()
    found = RangeSearch(points).polygons([[wave, hole]], margin=margin)
    assert found.tolist() == index.inside(1).tolist()
    assert 0 < len(found) < len(points)


@pytest.mark.parametrize(
    ("select", "complaint"),
    [
        (lambda search: search.polygons([]), "at least one polygon"),
        (lambda search: search.polygons([[[[0, 0], [1, 1], [2, 2]]]]), "polygon 0 ring 0 has no area"),
        (lambda search: search.polygons([[[[0, 0], [1, 0], [1, 1]]]], margin=-1), "margin is -1.0"),
        (lambda search: search.disk(float("nan"), 0, 1), "x is nan"),
        (lambda search: search.disk(0, 0, -1), "radius is -1.0"),
        (lambda search: search.hull([[0, 0], [1, 1], [2, 0]]), "vertices row 0"),
    ],
)
def test_bad_areas_are_refused(select, complaint):
    with pytest.raises(ValueError, match=complaint):
        select(RangeSearch([[0.0, 0.0]]))
