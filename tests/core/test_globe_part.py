"""Hulls in the plane of another centre: where both reach, the same places are inside."""

import numpy as np
import pytest

import dynhull
from dynhull.globe import Gnomonic, project_far, project_hull


def around(rng, center, degrees, count):
    """Places at most so many degrees from a centre, and less than 90."""
    radius, turn = np.tan(np.radians(rng.uniform(0, degrees, count))), rng.uniform(0, 2 * np.pi, count)
    return Gnomonic(center).unproject(np.column_stack([radius * np.cos(turn), radius * np.sin(turn)]))


@pytest.mark.parametrize("seed", range(40))
def test_the_same_places_are_inside_about_another_centre(seed):
    rng = np.random.default_rng(seed)
    own, other = rng.uniform([-180, -90], [180, 90], (2, 2))
    hull = dynhull.GeoHull(around(rng, own, rng.choice([1, 30, 84]), rng.choice([1, 2, 3, 40])), center=own)
    frame = Gnomonic(other)
    places = np.vstack([hull.vertices(), around(rng, other, 84.9, 400)])
    places = places[Gnomonic(own).project(places)[1] & frame.project(places)[1]]
    flat = project_hull(frame, hull.vertices())
    found = dynhull.DynamicHull(flat)
    assert (found.vertices() == flat).all()
    here = frame.project_all(places)
    unsure = np.isin(np.arange(len(places)), np.flatnonzero(found.distance(here) < 1e-9)) & (found.locate(here) <= 0)
    assert (found.contains(here) == hull.contains(places))[~unsure].all()
    assert (found.distance(here)[hull.contains(places)] < 1e-9).all()


def test_a_hull_on_the_other_side_is_nowhere_in_the_plane():
    hull = dynhull.GeoHull([(179, -1), (181, -1), (180, 1)])
    assert project_hull(Gnomonic((0, 0)), hull.vertices()).shape == (0, 2)
    assert project_hull(Gnomonic((0, 0)), np.empty((0, 2))).shape == (0, 2)


def test_places_beyond_reach_have_projections_until_the_plane_ends():
    frame = Gnomonic((0, 0))
    found = project_far(frame, np.array([(45.0, 0.0), (87.0, 0.0), (89.0, 0.0), (100.0, 0.0), (180.0, 0.0)]))
    assert (found[0] == frame.project(np.array([(45.0, 0.0)]))[0][0]).all()
    assert found[1] == pytest.approx((np.tan(np.radians(87)), 0))
    assert np.isnan(found[2:]).all()
