"""The gnomonic projection: how many nanometres it rounds off, and what is exact."""

from math import inf, nextafter

import numpy as np
import pytest
from globes import DIGITS, EARTH_RADIUS, around, directions, projection, random_center
from hypothesis import given
from hypothesis import strategies as st

from dynhull._globe import Gnomonic, sin_cos

ANGLES = st.floats(-180, 180)
longitudes = st.one_of(st.sampled_from([-360.0, -180.0, -90.0, 0.0, 90.0, 180.0, 270.0, 360.0]), st.floats(-360, 360))
latitudes = st.one_of(st.sampled_from([-90.0, 0.0, 90.0, 5e-324]), st.floats(-90, 90))


def rounded_off(degrees, center, place):
    """Nanometres between the projection and the exact one: in the plane, and on the ground."""
    (found,), near = Gnomonic(center).project(np.array([place]))
    assert near.all()
    x, y = projection(center, place)
    squared = x * x + y * y
    dx, dy = (float(value) * EARTH_RADIUS * 1e9 for value in (found[0] - x, found[1] - y))
    plane = np.hypot(dx, dy)
    if not degrees:
        return plane, plane
    away = float(squared**0.5)
    along, across = (dx * float(x) + dy * float(y)) / away, (dy * float(x) - dx * float(y)) / away
    return plane, np.hypot(along / (1 + away**2), across / np.hypot(1, away))


# How far from the centre; what may be rounded off in the plane of the projection, and on the ground: docs/maps.md.
@pytest.mark.parametrize(("degrees", "plane", "ground"), [(0, 0.001, 0.001), (10, 0.5, 0.5), (45, 3, 2), (80, 30, 2)])
def test_nanometres(degrees, plane, ground):
    rng = np.random.default_rng(degrees)
    for _ in range(400):
        center = random_center(rng)
        cap = around(rng, center, max(degrees, 0.001), 64)
        projected, near = Gnomonic(center).project(cap)
        assert near.all()
        farthest = tuple(cap[np.hypot(*projected.T).argmax()].tolist())
        in_plane, on_ground = rounded_off(degrees, center, farthest)
        assert in_plane <= plane
        assert on_ground <= ground


@given(ANGLES)
def test_sines_and_cosines(angle):
    """Within 0.7 units in the last place, beside the rounding of fifty digits."""
    sine, cosine = (float(value[0]) for value, _ in sin_cos(np.array([angle])))
    for found, exact in ((sine, DIGITS.sin), (cosine, DIGITS.cos)):
        value = exact(DIGITS.radians(DIGITS.mpf(angle)))
        assert abs(found - value) <= 0.7 * (nextafter(abs(found), inf) - abs(found)) + 1e-45


def test_quarter_turns_are_exact():
    (sine, _), (cosine, _) = sin_cos(np.array([-180.0, -90, 0, 90, 180]))
    assert (sine + 0.0).tolist() == [0, -1, 0, 1, 0]
    assert (cosine + 0.0).tolist() == [-1, 0, 1, 0, -1]


@given(st.tuples(longitudes, latitudes), st.lists(st.tuples(longitudes, latitudes), min_size=1, max_size=40))
def test_a_place_has_one_projection_alone_and_in_a_batch(center, places):
    frame = Gnomonic(center)
    together, near = frame.project(np.array(places))
    alone = np.concatenate([frame.project(np.array([place]))[0] for place in places])
    assert together.tobytes() == alone.tobytes()
    assert (np.isnan(together).any(axis=1) == ~near).all()


@given(st.tuples(ANGLES, latitudes), st.tuples(st.floats(-180, -180 + 1e-9) | st.integers(-180, -1), latitudes))
def test_once_around_is_the_same_place(center, place):
    lon, lat = place
    if (lon + 360) - 360 != lon:
        lon = -170.0
    projected, _ = Gnomonic(center).project(np.array([(lon, lat), (lon + 360, lat)]))
    assert projected[0].tobytes() == projected[1].tobytes()


@given(st.tuples(ANGLES, latitudes), st.lists(longitudes, min_size=2, max_size=9), st.sampled_from([-90.0, 90.0]))
def test_a_pole_is_one_place(center, lons, pole):
    projected, _ = Gnomonic(center).project(np.array([(lon, pole) for lon in lons]))
    assert len({row.tobytes() for row in projected}) == 1


@given(longitudes, st.lists(st.floats(-84, 84), min_size=1, max_size=9))
def test_the_meridian_of_the_centre_and_its_equator_are_straight(lon, steps):
    frame = Gnomonic((0.0, 0.0))
    assert not frame.project(np.array([(step, 0.0) for step in steps]))[0][:, 1].any()
    assert not frame.project(np.array([(0.0, step) for step in steps]))[0][:, 0].any()
    assert not Gnomonic((lon, 0.0)).project(np.array([(lon, step) for step in steps]))[0][:, 0].any()


@given(st.lists(st.tuples(longitudes, latitudes), min_size=1, max_size=30), st.randoms())
def test_the_centre_of_a_set_does_not_depend_on_its_order(places, random):
    shuffled = random.sample(places, len(places))
    assert Gnomonic.about(np.array(places)).center == Gnomonic.about(np.array(shuffled)).center


@given(st.tuples(ANGLES, latitudes), st.integers(0, 2**32))
def test_there_and_back(center, seed):
    frame = Gnomonic(center)
    places = around(np.random.default_rng(seed), center, 84, 20)
    back = frame.unproject(frame.project_all(places))
    assert np.abs(directions(back) - directions(places)).max() < 1e-15 * 4
    assert (np.abs(back[:, 0]) <= 180).all()


def test_places_that_have_no_projection_are_named():
    frame = Gnomonic((190.0, 10.0))
    assert frame.center == (-170.0, 10.0)
    with pytest.raises(
        ValueError, match=r"corners row 1 is \(0\.0, 0\.0\): 165\.\d+ degrees from the centre \(-170\.0"
    ):
        frame.project_all(np.array([(180.0, 0.0), (0.0, 0.0)]), "corners")
    with pytest.raises(ValueError, match="a latitude must be"):
        Gnomonic((0.0, 91.0))
