"""Every entry to a hull on the globe, with places that are none, too far, or odd and right."""

import copy
import re

import numpy as np
import pytest
from globes import GEO_HULLS, GEO_KEYED_HULLS, GEO_WINDOW_HULLS
from odd_places import NO_PLACES, TAKEN, TOO_FAR

from dynhull.globe import Gnomonic, as_center

CENTER = 0, 0
GOOD = 1.0, 2.0


def rows(place):
    return [GOOD, place]


# The entries to each kind of hull that change it, and whether they take many rows.
UPDATES = {
    "hull": {
        "insert": lambda hull, place: hull.insert(*place),
        "insert_many": lambda hull, place: hull.insert_many(rows(place)),
        "apply": lambda hull, place: hull.apply([1, 1], rows(place)),
    },
    "keyed": {
        "put": lambda hull, place: hull.put("b", *place),
        "put_many": lambda hull, place: hull.put_many(["a", "b"], rows(place)),
    },
    "window": {"add": lambda hull, place: hull.add(rows(place), times=[5.0, 6.0])},
}
# Those that ask about places, or delete some. Those of FAR refuse places that are too far as well.
QUESTIONS = {
    "delete": lambda hull, place: hull.delete(*place),
    "delete_many": lambda hull, place: hull.delete_many(rows(place), missing="ignore"),
    "apply": lambda hull, place: hull.apply([-1, -1], rows(place), missing="ignore"),
    "count": lambda hull, place: hull.count(*place),
    "count_many": lambda hull, place: hull.count_many(rows(place)),
    "in": lambda hull, place: place in hull,
    "locate": lambda hull, place: hull.locate(rows(place)),
    "contains": lambda hull, place: hull.contains(rows(place)),
    "distance": lambda hull, place: hull.distance(rows(place)),
    "tangents": lambda hull, place: hull.tangents(rows(place)),
    "recenter": lambda hull, place: hull.recenter(place),
    "center": lambda hull, place: type(hull)(center=place),
    "frame": lambda _, place: Gnomonic(place),
}
ONE = {"insert", "put", "delete", "count", "in", "recenter", "center", "frame"}


@pytest.fixture(params=GEO_HULLS)
def hulls(request):
    """A hull of each kind, with three points."""
    points = np.array([(1, 2), (-3, 4), (5, -6)])
    keyed = GEO_KEYED_HULLS[request.param](center=CENTER)
    keyed.put_many(["a", "c", "d"], points)
    window = GEO_WINDOW_HULLS[request.param](max_age=100.0, center=CENTER)
    window.add(points, times=[1.0, 2.0, 3.0])
    return {"hull": GEO_HULLS[request.param](points, CENTER), "keyed": keyed, "window": window}


def refuses(hull, entry, name, place, words):
    before = copy.deepcopy(hull)
    with pytest.raises(ValueError, match=words) as caught:
        entry(hull, place)
    if name not in ONE:
        assert "row 1" in str(caught.value), name
    assert (hull == before, hull.center, hull.changes) == (True, before.center, before.changes), name


@pytest.mark.parametrize(("place", "words"), NO_PLACES)
def test_no_place_goes_in_or_is_asked_about(hulls, place, words):
    for kind, hull in hulls.items():
        for name, entry in UPDATES[kind].items():
            refuses(hull, entry, name, place, words)
    for name, entry in QUESTIONS.items():
        refuses(hulls["hull"], entry, name, place, words)


@pytest.mark.parametrize(("place", "angle"), TOO_FAR)
def test_a_place_that_is_too_far_is_outside_and_not_let_in(hulls, place, angle):
    words = re.escape(f"{angle} degrees from the centre (0.0, 0.0); a hull reaches 85 degrees")
    for kind, hull in hulls.items():
        for name, entry in UPDATES[kind].items():
            refuses(hull, entry, name, place, words)
    hull = hulls["hull"]
    refuses(hull, QUESTIONS["tangents"], "tangents", place, words)
    with pytest.raises(KeyError):
        hull.delete(*place)
    assert (hull.count(*place), place in hull) == (0, False)
    assert hull.count_many(rows(place)).tolist() == [1, 0]
    assert hull.locate(rows(place)).tolist() == [0, -1]
    assert hull.contains(rows(place)).tolist() == [True, False]
    assert hull.distance(rows(place))[1] > 8e6  # metres


@pytest.mark.parametrize(("place", "back"), TAKEN)
def test_odd_places_are_taken_and_come_back(hulls, place, back):
    for kind, hull in hulls.items():
        for name, entry in UPDATES[kind].items():
            taken = hull.copy()
            entry(taken, place)
            points = taken.points()
            found = points[(points == back).all(axis=1)]
            assert len(found) == 1, name
            assert np.array_equal(np.signbit(found), np.signbit([back]))
            assert taken.locate([place])[0] >= 0
            assert taken.distance([place])[0] == 0
            taken.check()


def test_a_pole_has_any_longitude_and_85_degrees_are_reached_from_it(hulls):
    for pole in (90, -90):
        hull = type(hulls["hull"])(center=(30, pole))
        hull.insert_many([(lon, pole) for lon in (0, -180, 180, 360, -360, 77)])
        assert (len(hull), hull.distinct, hull.vertices().tolist()) == (6, 6, [[-360, pole]])
        hull.insert_many([(lon, np.copysign(5, pole)) for lon in (0, 120, -120, 240)])
        assert hull.locate([(12, pole), (12, -pole)]).tolist() == [1, -1]
        hull.check()


def test_antipodes_have_no_centre(hulls):
    for pair in ([(10, 20), (-170, -20)], [(0, 90), (0, -90)], [(0, 0), (180, 0)]):
        hull = type(hulls["hull"])()
        with pytest.raises(ValueError, match="the mean direction of the first points"):
            hull.insert_many(pair)
        assert (len(hull), hull.center) == (0, None)


def test_centres_are_written_in_one_way():
    assert [as_center(each) for each in [(180, 5), (-180, 5), (360, -0.0), (540 - 360, 90), (-181, 0)]] == [
        *[(-180, 5)] * 2,
        *((0, 0), (-180, 90), (179, 0)),
    ]
