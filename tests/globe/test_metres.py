"""Metres between places and great circles: a micrometre of error, the same bits everywhere; and fences with margins."""

import numpy as np
import pytest
from globes import random_center
from hulls import KEYED_HULLS
from pyproj import Geod

from dynhull import FenceIndex, convex_hull
from dynhull._ellipsoid import along
from dynhull._metres import MOST_METRES, Metres
from dynhull.globe import Gnomonic

WGS84 = Geod(ellps="WGS84")
MICROMETRE = 1e-6


def geodesic(place, edge):
    """The distance of a place to a great circle by the geodesics of pyproj: the least one along the edge."""
    from scipy.optimize import minimize_scalar  # each worker of the tests imports this file, and one runs it

    start, end = np.array(edge)

    def metres(share):
        lon, lat = along(start[None], end[None], np.array([share]))[0]
        return WGS84.inv(lon, lat, *place)[2]

    found = [metres(0), metres(1)]
    if (start != end).any():
        best, width = int(np.argmin([metres(share) for share in np.linspace(0, 1, 33)])) / 32, 1 / 32
        for _ in range(3):  # its tolerance is relative to the distance from 0
            low, high = max(-width, -best), min(width, 1 - best)
            least = minimize_scalar(lambda more: metres(best + more), bounds=(low, high), options={"xatol": 1e-15})  # noqa: B023
            best, width = best + least.x, width / 1000
        found.append(least.fun)
    return min(found)


def moved(place, bearing, metres):
    """The place that far away."""
    return WGS84.fwd(*place, bearing, metres)[:2]


def cases(seed, count):
    """Frames with a place in reach and an edge whose distance from it is anything up to the most."""
    random = np.random.default_rng(seed)
    while count:
        frame = Gnomonic(random_center(random))
        angle, turn = np.radians(random.uniform(0, 84.9)), random.uniform(0, 2 * np.pi)
        place = frame.unproject(np.tan(angle) * np.array([[np.sin(turn), np.cos(turn)]]))[0]
        near, bearing = moved(place, random.uniform(0, 360), 10 ** random.uniform(-3, 5.39)), random.uniform(0, 360)
        length, share = 10 ** random.uniform(-1, 6.5) * random.integers(2), random.uniform(-0.2, 1.2)
        edge = np.array([moved(near, bearing, length * share), moved(near, bearing, length * (share - 1))])
        places, within = frame.project(np.vstack([place, edge]))
        if within.all():
            count -= 1
            yield frame, place, edge, places


def test_a_micrometre_up_to_the_most():
    for frame, place, edge, (p, a, b) in cases(seed=1, count=40):
        expected, (found,) = geodesic(place, edge), Metres(frame).to_edges(p[None], a[None], b[None])
        if expected > MOST_METRES + MICROMETRE:
            assert found > MOST_METRES
        else:
            assert abs(found - expected) < MICROMETRE


def test_far_away_is_infinite():
    metres = Metres(Gnomonic((10, 50)))
    found = metres.to_edges(np.array([[0, 0], [0.1, 0], [11.0, 0]]), np.array([[0, 0.04]] * 3), np.array([[0, 11]] * 3))
    assert found.tolist() == [np.inf] * 3


def hull_around(frame, random, extent):
    xy = frame.unproject(random.normal(size=(20, 2)) * extent)
    return convex_hull(frame.project_all(xy))


def around_a_place(random, kind):
    """A frame, and a place of its plane that is 0 to 84 degrees from the centre."""
    frame = Gnomonic([(0, 90), (179.99, -17), (20, 0), (-60, -89.9)][kind])
    turn = random.uniform(0, 2 * np.pi)
    return frame, np.tan(np.radians([0, 60, 84, 30][kind])) * np.array([np.sin(turn), np.cos(turn)])


@pytest.mark.skipif("cpp" not in KEYED_HULLS, reason="the kernel is not built")
@pytest.mark.parametrize("kind", range(4))
def test_fences_of_the_kernel_and_of_the_reference(kind):
    """The same crossings and distances, bit for bit, while subjects walk beside boundaries and areas change."""
    random = np.random.default_rng(kind)
    frame, middle = around_a_place(random, kind)
    stretch = 1 + middle @ middle
    hulls = [KEYED_HULLS[name]("int") for name in ("python", "cpp")]
    indexes = [FenceIndex(hull, frame) for hull in hulls]
    keys, seen = np.arange(150, dtype=np.uint64), 0
    places = middle + random.normal(size=(150, 2)) * 2e-3 * stretch
    for step in range(12):
        for fence in range(3):
            if step % 4 == fence:
                corners = middle + random.normal(size=(30, 2)) * 1e-3 * stretch
                margin = float(10 ** random.uniform(1, 5.3)) * (fence > 0)
                for index in indexes:
                    index.set_hull(fence, convex_hull(corners[: 1 + 13 * fence]), margin=margin, cross=True)
        for hull in hulls:
            hull.put_many(keys, places)
        expected, found = (index.take() for index in indexes)
        for name in ("fences", "changes", "causes", "keys", "points", "previous", "distances"):
            np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        seen += len(found)
        for fence in range(3):
            if fence in indexes[0]:
                some = middle + random.normal(size=(40, 2)) * 5e-3 * stretch
                np.testing.assert_array_equal(*(index.distances(fence, some) for index in indexes))
                assert indexes[0].inside(fence).tolist() == indexes[1].inside(fence).tolist()
        indexes[1]._fences.check()
        places += random.normal(size=(150, 2)) * 10 ** random.uniform(-5, -2.7) * stretch
    assert seen > 100


@pytest.mark.parametrize("hull_type", KEYED_HULLS)
@pytest.mark.parametrize("kind", range(4))
def test_a_subject_leaves_beyond_the_margin(hull_type, kind):
    """A millimetre decides, over a pole, across 180 degrees and 84 degrees from the centre."""
    random = np.random.default_rng(kind)
    frame, middle = around_a_place(random, kind)
    hull = KEYED_HULLS[hull_type]("str")
    fences = FenceIndex(hull, frame)
    corners = frame.unproject(middle[None])[0], moved(frame.unproject(middle[None])[0], 77, 3000)
    edge = frame.project_all(np.array(corners))
    for margin in (5.0, 800.0, 90_000.0):
        fences.set_hull(7, convex_hull(edge), margin=margin)
        hull.put("van", *edge[0])
        assert fences.take().changes.tolist() == [1]
        beside = [moved(corners[0], 77 - 120, margin + more) for more in (-1e-3, 1e-3)]  # its start is nearest
        inner, outer = frame.project_all(np.array(beside))
        hull.put("van", *inner)
        assert not len(fences.take())
        hull.put("van", *outer)
        found = fences.take()
        assert found.changes.tolist() == [-1]
        assert abs(found.distances[0] - (margin + 1e-3)) < MICROMETRE
        hull.put("van", *inner)
        assert not len(fences.take())  # it enters at the area
        fences.drop(7)


def test_what_has_no_meaning_on_the_globe_is_refused():
    fences = FenceIndex(KEYED_HULLS["python"]("str"), Gnomonic((0, 0)))
    with pytest.raises(ValueError, match="a disk of the plane"):
        fences.set_circle(1, 0, 0, 1)
    with pytest.raises(ValueError, match="without_self is for the plane"):
        fences.set_hull(1, [], margin=1, without_self=True)
    fences.set_hull(1, [[0, 0], [1e-3, 0], [0, 1e-3]])
    with pytest.raises(ValueError, match=r"margin is 250001\.0: at most 250000 metres on the globe"):
        fences.set_hull(1, [], margin=250_001)
