"""Areas of fences in the forms that people have them in; what is wrong with one is named, and nothing is sent."""

import numpy as np
import pytest
from shapely.geometry import Point
from shapely.geometry import Polygon as Shape

from dynhull_client import Circle, HullClient, Polygon, Prefix

SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]
HOLE = [[1, 1], [2, 1], [2, 2]]
HOLED = Shape(SQUARE, [HOLE])


@pytest.fixture
def nowhere(connect: type[HullClient]) -> HullClient:
    """A client that nobody answers: what is refused is refused before anything is sent."""
    return connect("127.0.0.1:1", retries=0)


@pytest.mark.parametrize(
    ("area", "complaint"),
    [
        ([], "area is empty: give the corners of a polygon"),
        ([[0, 0], [1, 0]], "area has 2 corners: a polygon has at least 3"),
        ([[0, 0], [1, 0], [0, 0]], "area has 2 corners: a polygon has at least 3"),
        ([[0, 0], [1, 0], [float("nan"), 1]], "area row 2 is (nan, 1.0): coordinates must be finite"),
        ([SQUARE, [[0, 0], [1, float("inf")], [1, 1]]], "area[1] row 1 is (1.0, inf): coordinates must be finite"),
        ([[0, 0, 0], [1, 0, 0], [1, 1, 0]], "area must have shape (n, 2), got (3, 3)"),
        (Point(1, 2), "area is of the type 'Point': must be a Polygon or a MultiPolygon"),
        ({"type": "Feature", "geometry": None}, "area is a Feature without geometry: leave it out"),
        (
            {"type": "Polygon", "coordinates": [SQUARE, [[1, 1], [2, None], [2, 2]]]},
            "area.holes[0] row 1: coordinates must be real numbers, got None",
        ),
        (
            {"type": "MultiPolygon", "coordinates": [[SQUARE], [[[0, 0], [1, 1]]]]},
            "area.coordinates[1].exterior has 2 corners: a polygon has at least 3",
        ),
        (Shape(), "area is an empty Polygon: it has no corners"),
        ("POLYGON ((0 0, 4 O, 4 3, 0 0))", "area is not WKT: character 18: 'O' is not a number"),
        ("POLYGON EMPTY", "area is an empty Polygon: it has no corners"),
        (7, "area is 7: must be the name of a hull, a Circle, a Polygon or (n, 2) corners"),
    ],
)
def test_what_is_no_area(nowhere: HullClient, area: object, complaint: str) -> None:
    with pytest.raises((ValueError, TypeError)) as refused:
        nowhere.create_fence("zone", area=area, subjects="fleet")
    assert str(refused.value) == complaint


@pytest.mark.parametrize(
    ("settings", "complaint"),
    [
        ({}, "give either subjects or other_hull"),
        ({"subjects": "a", "other_hull": "b"}, "give either subjects or other_hull"),
        (
            {"subjects": "a", "expected": ["k"], "expected_by": "18:00 UTC", "expected_within": 60},
            "give either expected_by or expected_within, not both",
        ),
        ({"subjects": "a", "without_self": True}, "without_self is for an area that is a hull"),
        ({"subjects": "a", "boundary": "half"}, "boundary must be one of 'closed', 'open', got 'half'"),
        ({"subjects": "a", "initial": "all"}, "initial must be one of 'snapshot', 'events', 'none', got 'all'"),
        ({"subjects": "a", "margin": float("nan")}, "margin is nan: coordinates must be finite"),
        ({"subjects": "a", "confirmations": -1}, "confirmations must be at least 0, got -1"),
        (
            {"subjects": "a", "dwell": "soon"},
            (
                "dwell is 'soon': must be a finite number of seconds, "
                "a timedelta, or text such as 500ms, 90s, 30m, 2h or 7d"
            ),
        ),
    ],
)
def test_settings_that_cannot_be(nowhere: HullClient, settings: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValueError) as refused:  # noqa: PT011  # compared below
        nowhere.create_fence("zone", area=SQUARE, **settings)
    assert str(refused.value) == complaint


def test_a_place_is_given_once(nowhere: HullClient) -> None:
    with pytest.raises(ValueError, match="give either consumer, which knows its place, or after, not both"):
        nowhere.watch_fence("zone", consumer="alarm", after=3)
    with pytest.raises(ValueError, match="conflate is for a watch without a consumer"):
        nowhere.watch_fence("zone", consumer="alarm", conflate=True)
    with pytest.raises(ValueError, match="after must be at least 0, got -1"):
        nowhere.watch_fence("zone", after=-1)


def test_polygons_are_values() -> None:
    polygon = Polygon([*SQUARE, SQUARE[0]], [HOLE])
    assert polygon == Polygon(np.array(SQUARE, np.float32), (np.array(HOLE),))
    assert hash(polygon) == hash(Polygon(SQUARE, [HOLE]))
    assert polygon != Polygon(SQUARE)
    assert repr(polygon).endswith("holes=([[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]],))")
    assert repr(Polygon(HOLE)) == "Polygon(exterior=[[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]], holes=())"
    assert Shape(polygon.__geo_interface__["coordinates"][0], polygon.__geo_interface__["coordinates"][1:]).equals(
        HOLED
    )
    assert not polygon.exterior.flags.writeable
    with pytest.raises(ValueError, match=r"holes\[1\] has 2 corners: a polygon has at least 3"):
        Polygon(SQUARE, [HOLE, [[0, 0], [1, 1]]])


def test_circles_and_prefixes_are_values() -> None:
    assert Circle(1, 2, 3) == Circle(1.0, 2.0, 3.0)
    assert repr(Circle(1, 2, 3)) == "Circle(x=1.0, y=2.0, r=3.0)"
    assert len({Prefix("a/"), Prefix("a/"), Prefix("b/")}) == 2
    with pytest.raises(ValueError, match=r"the circle's r is -1\.0: must be at least 0"):
        Circle(0, 0, -1)
    with pytest.raises(ValueError, match="the circle's y is inf: coordinates must"):
        Circle(0, float("inf"), 1)
