"""Fences about geographic hulls: edges are great circles, distances metres, positions the very doubles."""

import numpy as np
import pytest
from patience import PATIENCE, wait_until
from pyproj import Geod
from server_process import server_process

import dynhull
from dynhull_client import (
    Circle,
    HullClient,
    HullFencedError,
    HullUnsuitableError,
    InvalidRequestError,
    Polygon,
    Prefix,
)

# Around Taveuni, across 180 degrees.
ZONE = [(179.5, -17.5), (-179.5, -17.5), (-179.5, -16.5), (179.5, -16.5)]
WGS84 = Geod(ellps="WGS84")


@pytest.fixture
def fleet(client, name):
    client.create_hull(name, keyed="str", geographic=True, center=(180, -17))
    return name


def told(client, name):
    found = []
    with client.watch_fence(name, after=0) as watch:
        last = client.get_fence(name).last_sequence
        while last and (not found or found[-1].sequence < last):
            found.append(next(watch))
    return found


def lines(events):
    return [(event.type, event.key, event.position, event.previous_position) for event in events]


def test_a_zone_across_180_degrees_reports_the_very_doubles(client, fleet):
    zone = f"{fleet}/zone"
    client.create_fence(zone, area=ZONE, subjects=fleet, initial="none")
    client.put(fleet, ["a", "b"], [(179.9, -17), (0.1 + 178.8, -17.0)])
    client.put(fleet, ["a"], [(-178.3, -17.1)])
    client.put(fleet, ["a", "b"], [(180.2, -17), (181, -17)])
    client.remove(fleet, ["a"])
    events = told(client, zone)
    assert lines(events) == [
        ("enter", "a", (179.9, -17), None),
        ("exit", "a", (-178.3, -17.1), (179.9, -17)),
        ("enter", "a", (180.2, -17), (-178.3, -17.1)),
        ("exit", "a", None, (180.2, -17)),
    ]
    expected = dynhull.GeoHull(ZONE).distance([(-178.3, -17.1)])[0]
    assert events[1].distance == pytest.approx(expected, abs=1e-6)
    assert events[0].distance == 0


def test_edges_of_a_zone_are_great_circles(client, name):
    client.create_hull(name, keyed="str", geographic=True, center=(0, 60))
    client.create_fence(f"{name}/zone", area=[(-30, 60), (30, 60), (0, 80)], subjects=name, initial="none")
    client.put(name, ["over", "under"], [(0, 63), (0, 64)])  # the great circle reaches 63.43 degrees
    assert lines(told(client, f"{name}/zone")) == [("enter", "under", (0, 64), None)]


def test_a_circle_has_its_radius_on_the_ellipsoid(client, fleet):
    client.create_fence(f"{fleet}/near", area=Circle(180, -17, 50_000), subjects=fleet, initial="none")
    azimuths = np.linspace(0, 359, 40)
    placed = {}
    for share, word in ((0.9999, "in"), (1.0001, "out")):
        lon, lat, _ = WGS84.fwd([180] * 40, [-17] * 40, azimuths, [50_000 * share] * 40)
        placed |= {f"{word}{i}": place for i, place in enumerate(zip(lon, lat, strict=True))}
    client.put(fleet, list(placed), list(placed.values()))
    entered = {event.key for event in told(client, f"{fleet}/near")}
    assert entered == {f"in{i}" for i in range(40)}


def test_a_hull_as_an_area_moves_over_keys(client, fleet, name):
    zone = f"{name}-zone"
    client.create_hull(zone, geographic=True, center=(180, -17))
    client.apply(zone, insert=ZONE[:2])
    client.create_fence(f"{name}/fence", area=zone, subjects=fleet, initial="none")
    client.put(fleet, ["a"], [(178, -17)])
    client.put(fleet, ["a"], [(180, -17)])
    client.apply(zone, insert=ZONE[2:])
    client.apply(zone, delete=[ZONE[2], ZONE[3]], insert=[(180, -17.2)])
    events = told(client, f"{name}/fence")
    assert lines(events) == [
        ("enter", "a", (180, -17), (180, -17)),
        ("exit", "a", (180, -17), (180, -17)),
    ]
    now = dynhull.GeoHull([*ZONE[:2], (180, -17.2)])
    assert events[1].distance == pytest.approx(now.distance([(180, -17)])[0], abs=1e-6)


def test_rules_that_delay_hold_on_the_globe(client, fleet):
    zone = f"{fleet}/zone"
    client.put(fleet, ["a", "b"], [(178, -17), (180, -17)])
    client.create_fence(zone, area=ZONE, subjects=fleet, initial="none", confirmations=2, crosses=True)
    client.put(fleet, ["a", "b"], [(179.9, -17.1), (-178.4, -17.1)])
    client.put(fleet, ["a", "b"], [(179.9, -17.1), (-178.3, -17.1)])
    client.put(fleet, ["b"], [(0.1 + 178.8, -17.0)])
    events = told(client, zone)
    assert lines(events) == [
        ("enter", "a", (179.9, -17.1), None),
        ("exit", "b", (-178.3, -17.1), None),
        ("cross", "b", (0.1 + 178.8, -17.0), (-178.3, -17.1)),
    ]
    assert [event.first_time is not None and event.first_time < event.time for event in events] == [True, True, False]
    east, west = dynhull.GeoHull(ZONE).distance([(-178.3, -17.1), (0.1 + 178.8, -17.0)])
    assert [event.distance for event in events] == [0, pytest.approx(east), pytest.approx(west)]


def test_a_stay_on_the_globe_is_reported_where_it_is(client, fleet):
    for rule, kinds in (("dwell", ["enter", "dwell"]), ("min_dwell", ["enter"])):
        zone = f"{fleet}/{rule}"
        client.create_fence(zone, area=Circle(180, -17, 5_000), subjects=fleet, initial="none", **{rule: 0.05})
        client.put(fleet, ["a"], [(179.97, -17)])
        wait_until(lambda zone=zone, kinds=kinds: client.get_fence(zone).last_sequence == len(kinds))
        found = told(client, zone)
        assert [(event.type, event.position, event.distance) for event in found] == [
            (kind, (179.97, -17), 0) for kind in kinds
        ]
        assert (found[-1].time - found[-1].first_time).total_seconds() >= 0.05
        client.delete_fence(zone)
        client.remove(fleet, ["a"])


def test_two_hulls_meet_or_are_near_in_metres(client, fleet, name):
    other = f"{name}-other"
    client.create_hull(other, keyed="str", geographic=True, center=(180, -17))
    client.put(other, ["x", "y"], [(-179, -17), (-178, -17)])
    client.put(fleet, ["a", "b", "c"], [(178, -17), (179, -16), (179, -18)])
    client.create_fence(f"{name}/near", area=fleet, other_hull=other, near=150_000, initial="none")
    client.put(fleet, ["b"], [(179.7, -17)])
    client.put(fleet, ["b"], [(-178.5, -17)])
    client.put(fleet, ["b"], [(179, -16)])
    events = told(client, f"{name}/near")
    assert [event.type for event in events] == ["begin", "cease"]
    _, _, metres = WGS84.inv(179.7, -17, -179, -17)
    assert events[0].distance == pytest.approx(metres, abs=1e-3)


def test_a_replaced_zone_and_those_that_expire(client, name):
    client.create_hull(name, keyed="str", geographic=True, center=(180, -17), max_points=2)
    zone = f"{name}/zone"
    client.create_fence(zone, area=ZONE, subjects=name, initial="none")
    client.put(name, ["a"], [(179.9, -17.25)])
    client.put(name, ["b"], [(-179.8, -17.25)])
    client.put(name, ["c"], [(170.0, -17)])  # a is the oldest
    client.replace_fence(zone, area=[(177, -18), (178, -18), (178, -17)], subjects=name)
    assert lines(told(client, zone)) == [
        ("enter", "a", (179.9, -17.25), None),
        ("enter", "b", (-179.8, -17.25), None),
        ("exit", "a", None, (179.9, -17.25)),
        ("exit", "b", (-179.8, -17.25), (-179.8, -17.25)),
    ]


def test_fences_on_the_globe_that_cannot_be_are_refused(client, fleet, name):
    plane, elsewhere = f"{name}-plane", f"{name}-elsewhere"
    client.create_hull(plane, keyed="str")
    client.create_hull(elsewhere, keyed="str", geographic=True, center=(0, 0))
    for area, subjects, words in (
        (fleet, plane, "is a plane, and the other hull is geographic"),
        (plane, fleet, "is a plane, and the other hull is geographic"),
        (elsewhere, fleet, "has another centre"),
        (ZONE, Prefix(name), f"-plane' is a plane, and '{fleet}"),
    ):
        with pytest.raises(HullUnsuitableError, match=words):
            client.create_fence(f"{name}/fence", area=area, subjects=subjects)
    far, nowhere = Polygon([(0, 0), (1, 0), (0, 1)]), Polygon([(179, -91), (180, 0), (178, 1)])
    with pytest.raises(InvalidRequestError, match=r"exterior is 3 corners: has the corner \(0\.0, 0\.0\): 163\.0"):
        client.create_fence(f"{name}/fence", area=far, subjects=fleet)
    with pytest.raises(InvalidRequestError, match=r"has the corner \(179\.0, -91\.0\): a latitude is from -90 to 90"):
        client.create_fence(f"{name}/fence", area=nowhere, subjects=fleet)
    with pytest.raises(InvalidRequestError, match=r"margin is 250001\.0: at most 250000 metres on the globe"):
        client.create_fence(f"{name}/fence", area=ZONE, subjects=fleet, margin=250_001)
    client.create_fence(f"{name}/fence", area=ZONE, subjects=fleet)
    with pytest.raises(HullFencedError):
        client.recenter(fleet, (179, -17))
    client.put(fleet, ["a"], [(180, -17)])
    assert client.get_fence(f"{name}/fence").inside == 1
    client.delete_fence(f"{name}/fence")
    assert client.recenter(fleet, (179, -17)).center == (179, -17)


def mean_direction(places):
    lon, lat = np.radians(places).T
    x, y, z = (np.cos(lat) * np.cos(lon)).sum(), (np.cos(lat) * np.sin(lon)).sum(), np.sin(lat).sum()
    return np.degrees(np.arctan2(y, x)), np.degrees(np.arctan2(z, np.hypot(x, y)))


def test_a_fence_before_the_first_position_gives_its_middle_as_the_centre(client, name):
    """Every kind of area; who enters is who is inside of the area by the library."""
    zone = f"{name}-zone"
    client.create_hull(zone, geographic=True, center=(181, -17.5))
    client.apply(zone, insert=ZONE)
    rng = np.random.default_rng(3)
    places = rng.uniform([178, -19], [182, -15], (60, 2))
    around = np.column_stack(WGS84.fwd([180.0] * 720, [-17.0] * 720, -np.arange(0, 360, 0.5), [80_000.0] * 720)[:2])
    mean = mean_direction(ZONE)
    for number, (area, center, corners) in enumerate(
        [
            (ZONE, mean, ZONE),
            (Polygon([*ZONE, ZONE[0]]), mean, ZONE),
            (Circle(180, -17, 80_000), (-180, -17), around),
            (zone, (-179, -17.5), ZONE),
        ]
    ):
        fleet, fence = f"{name}/{number}", f"{name}/fence{number}"
        client.create_hull(fleet, keyed="int", geographic=True)
        client.create_fence(fence, area=area, subjects=fleet, initial="none")
        hull = client.get_hull(fleet).info
        assert hull.revision == 1
        assert [hull.center[0] % 360, hull.center[1]] == pytest.approx([center[0] % 360, center[1]], abs=1e-9)
        client.create_fence(f"{fence}-second", area=Circle(170, -17, 10_000), subjects=fleet, initial="none")
        client.put(fleet, range(60), places)
        assert client.get_hull(fleet).info.center == hull.center
        expected = dynhull.GeoHull(corners, center=hull.center).contains(places)
        assert [event.key for event in told(client, fence)] == np.flatnonzero(expected).tolist()
        verified = client.verify(fleet)
        assert (verified.fences, verified.fence_differences) == (2, ())
        with pytest.raises(InvalidRequestError, match="degrees from the centre"):
            client.put(fleet, [60], [(0, 50)])


def test_hulls_about_which_a_fence_asks_get_the_centre_of_the_area(client, name):
    other, area = f"{name}-other", f"{name}-area"
    client.create_hull(other, geographic=True)
    client.create_hull(area, geographic=True, center=(180, -17))
    client.apply(area, insert=ZONE)
    client.create_fence(f"{name}/near", area=area, other_hull=other, initial="none")
    assert client.get_hull(other).info.center == (-180, -17)
    client.apply(other, insert=[(180, -17)])
    assert [event.type for event in told(client, f"{name}/near")] == ["begin"]


def test_a_fence_that_is_refused_gives_no_centre(client, name):
    client.create_hull(name, keyed="str", geographic=True)
    client.create_hull(f"{name}-bare", geographic=True)
    client.create_hull(f"{name}-zone", geographic=True)
    fence = f"{name}/fence"
    for area, options, words in (
        (Circle(180, -91, 5), {}, "a latitude is from -90 to 90"),
        (Polygon([(179, -91), (180, 0), (178, 1)]), {}, r"exterior is 3 corners: has the corner \(179\.0, -91\.0\)"),
        (Polygon([(0, 0), (1, 0), (179, 0)]), {}, "degrees from the centre"),
        (Polygon([(0, 0), (2, 2), (2, 0), (0, 2)]), {}, "edges 0 and 2 cross"),
        (ZONE, {"margin": 3e5}, "at most 250000 metres on the globe"),
    ):
        with pytest.raises(InvalidRequestError, match=words):
            client.create_fence(fence, area=area, subjects=name, **options)
    for area, subjects in ((ZONE, f"{name}-bare"), (f"{name}-zone", name)):
        with pytest.raises(HullUnsuitableError, match="has no centre so far"):
            client.create_fence(fence, area=area, subjects=subjects)
    for each in (name, f"{name}-bare", f"{name}-zone"):
        hull = client.get_hull(each).info
        assert (hull.center, hull.revision) == (None, 0)


@pytest.mark.parametrize("sudden", [True, False])
def test_a_restart_continues_the_events(tmp_path, sudden):
    options = ["--data", str(tmp_path / "data")]
    rng = np.random.default_rng(1)
    keys = [f"k{i}" for i in range(40)]
    moves = [rng.uniform([178, -19], [182, -15], (40, 2)) for _ in range(12)]
    with server_process(*options, killed=sudden) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str", geographic=True)
        client.create_fence("circle", area=Circle(180, -17, 80_000), subjects="fleet", initial="none")
        client.create_fence("zone", area=ZONE, subjects="fleet", initial="none")
        for points in moves[:6]:
            client.put("fleet", keys, points)
        if sudden:
            server.process.kill()
            server.process.wait(PATIENCE)
    with server_process(*options) as server, HullClient(server.address) as client:
        assert client.get_hull("fleet").info.center == (-180, -17)  # that of the circle
        for points in moves[6:]:
            client.put("fleet", keys, points)
        events = told(client, "zone")
        circled = told(client, "circle")
    hull = dynhull.GeoHull(ZONE, center=(180, -17))
    around = dynhull.GeoHull(
        np.column_stack(WGS84.fwd([180.0] * 720, [-17.0] * 720, -np.arange(0, 360, 0.5), [80_000.0] * 720)[:2]),
        center=(180, -17),
    )
    for found, area in ((events, hull), (circled, around)):
        expected, before, inside = [], None, np.zeros(40, bool)
        for points in moves:
            now = area.contains(points)
            for row in sorted(np.flatnonzero(now != inside), key=lambda row: keys[row]):
                previous = None if before is None else tuple(before[row].tolist())
                kind = "enter" if now[row] else "exit"
                expected.append((kind, keys[row], tuple(points[row].tolist()), previous))
            before, inside = points, now
        assert lines(found) == expected
