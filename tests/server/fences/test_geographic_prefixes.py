"""Fences over a prefix of geographic hulls, each with a centre of its own."""

import numpy as np
import pytest
from patience import PATIENCE
from pyproj import Geod
from server_process import server_process

import dynhull
from dynhull_client import (
    Batch,
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
CENTERS = {"a": (180, -17), "b": (150, 10), "c": (10, 50), "d": (-110, -40), "e": (93, -10)}
# Of which hulls reach all, some or none.
PLACES = np.random.default_rng(5).uniform([178, -19], [182, -15], (200, 2))


@pytest.fixture
def fleet(client, name):
    for each, center in CENTERS.items():
        client.create_hull(f"{name}/{each}", keyed="int", geographic=True, center=center)
    return name


def reached(center):
    return dynhull.globe.Gnomonic(center).project(PLACES)[1]


def told(client, name):
    found = []
    with client.watch_fence(name, after=0) as watch:
        last = client.get_fence(name).last_sequence
        while last and (not found or found[-1].sequence < last):
            found.append(next(watch))
    return found


def sides(client, fence):
    """Who is inside, by the events."""
    inside = set()
    for event in told(client, fence):
        if event.type in ("enter", "transfer"):
            inside.add((event.hull[-1], event.key))
        if event.type == "exit":
            inside.remove((event.hull[-1], event.key))
    return inside


@pytest.mark.parametrize("area", ["polygon", "circle", "hull"])
def test_each_hull_compares_what_it_reaches_about_its_own_centre(client, fleet, area):
    around = np.column_stack(WGS84.fwd([180.0] * 720, [-17.0] * 720, -np.arange(0, 360, 0.5), [80_000.0] * 720)[:2])
    corners = around if area == "circle" else ZONE
    if area == "hull":
        client.create_hull(f"{fleet}-zone", geographic=True, center=(181, -17.5))
        client.apply(f"{fleet}-zone", insert=ZONE)
    given = {"polygon": ZONE, "circle": Circle(180, -17, 80_000), "hull": f"{fleet}-zone"}[area]
    fence = f"{fleet}/fence"
    client.create_fence(fence, area=given, subjects=Prefix(f"{fleet}/"), initial="none")
    near = {each: np.flatnonzero(reached(center)) for each, center in CENTERS.items()}
    assert 0 < len(near["e"]) < len(PLACES) == len(near["a"])
    assert not len(near["c"])
    for each, keys in near.items():
        client.put(f"{fleet}/{each}", keys, PLACES[keys])
    client.put(f"{fleet}/c", [0], [(10, 50)])
    held = set(np.flatnonzero(dynhull.GeoHull(corners).contains(PLACES)).tolist())
    assert held
    assert sides(client, fence) == {(each, key) for each, keys in near.items() for key in held & set(keys.tolist())}
    for each in CENTERS:
        verified = client.verify(f"{fleet}/{each}")
        assert (verified.fences, verified.fence_differences) == (1, ())


def test_an_area_that_moves_around_the_globe_is_left_and_entered(client, fleet):
    zone, fence = f"{fleet}-zone", f"{fleet}/fence"
    between = dynhull.GeoHull([(180, -17), (10, 50)]).center  # 80 degrees from both
    client.create_hull(zone, keyed="int", geographic=True, center=between)
    client.put(zone, range(4), ZONE)
    client.put(f"{fleet}/b", [1], [(180, -17)])
    client.put(f"{fleet}/c", [1], [(10, 50)])
    client.create_fence(fence, area=zone, subjects=Prefix(f"{fleet}/"), initial="none")
    client.put(zone, range(4), [(9, 49), (11, 49), (11, 51), (9, 51)])
    left, entered = told(client, fence)
    assert (left.type, left.hull, left.key, entered.type, entered.hull) == (
        *("exit", f"{fleet}/b", 1, "enter"),
        f"{fleet}/c",
    )
    apart = dynhull.GeoHull([(9, 49), (11, 49), (11, 51), (9, 51)]).distance([(180, -17)])[0]
    assert left.distance == pytest.approx(apart, abs=1e-6)


def test_a_key_goes_from_one_hull_to_another_one_about_another_centre(client, fleet):
    fence = f"{fleet}/fence"
    client.create_fence(fence, area=ZONE, subjects=Prefix(f"{fleet}/"), initial="none", crosses=True)
    client.put(f"{fleet}/a", [1, 2], [(180, -17), (178, -17)])
    client.transfer(
        {
            f"{fleet}/a": Batch(remove=[1, 2]),
            f"{fleet}/b": Batch(keys=[1, 2], points=[(179.9, -17.1), (182, -17)]),
        }
    )
    client.put(f"{fleet}/b", [1, 2], [(170, -17), (178, -17)])
    found = [
        (event.type, event.key, event.hull[-1], event.position, event.previous_position)
        for event in told(client, fence)
    ]
    assert found == [
        ("enter", 1, "a", (180, -17), None),
        ("transfer", 1, "b", (179.9, -17.1), (180, -17)),  # the way of 2 is in no plane
        ("exit", 1, "b", (170, -17), (179.9, -17.1)),
        ("cross", 2, "b", (178, -17), (182, -17)),
    ]


def test_hulls_without_a_centre_get_the_middle_of_the_area(client, name):
    client.create_hull(f"{name}/old", keyed="str", geographic=True)
    fence = f"{name}/fence"
    client.create_fence(fence, area=Circle(-180, -17, 80_000), subjects=Prefix(f"{name}/"), initial="none")
    client.create_hull(f"{name}/new", keyed="str", geographic=True)
    client.create_hull(f"{name}/own", keyed="str", geographic=True, center=(10, 50))
    client.create_hull(f"{name}/points", geographic=True)
    centers = {each: client.get_hull(f"{name}/{each}").info.center for each in ("old", "new", "own", "points")}
    assert centers == {"old": (-180, -17), "new": (-180, -17), "own": (10, 50), "points": None}
    for each in ("old", "new"):
        client.put(f"{name}/{each}", ["x"], [(179.9, -17)])
        with pytest.raises(HullFencedError):
            client.recenter(f"{name}/{each}", (179, -17))
    assert sides(client, fence) == {("d", "x"), ("w", "x")}
    client.delete_fence(fence)
    assert client.recenter(f"{name}/new", (179, -17)).center == (179, -17)


def test_a_fence_that_is_refused_by_one_hull_gives_no_other_one_a_centre(client, name):
    client.create_hull(f"{name}/a", keyed="str", geographic=True)
    client.create_hull(f"{name}/b", keyed="str")
    client.create_hull(f"{name}-far/a", keyed="str", geographic=True)
    client.create_hull(f"{name}-far/b", keyed="str", geographic=True, center=(100, 0))
    vast = [(-60, -30), (60, -30), (60, 30), (-60, 30)]
    for area, prefix, options, error in (
        (ZONE, f"{name}/", {}, HullUnsuitableError),
        (vast, f"{name}-far/", {}, InvalidRequestError),
        (ZONE, f"{name}-far/", {"margin": 3e5}, InvalidRequestError),
    ):
        with pytest.raises(error):
            client.create_fence(f"{name}/fence", area=area, subjects=Prefix(prefix), **options)
        hull = client.get_hull(f"{prefix}a").info
        assert (hull.center, hull.revision) == (None, 0)


def test_hulls_of_one_prefix_have_frames_of_one_kind(client, name):
    fence = f"{name}/fence"
    client.create_fence(fence, area=ZONE, subjects=Prefix(f"{name}/"))
    client.create_hull(f"{name}/globe", keyed="str", geographic=True)
    with pytest.raises(HullUnsuitableError, match="is geographic; the hull is a plane"):
        client.create_hull(f"{name}/plane", keyed="str")
    with pytest.raises(InvalidRequestError, match="at most 250000 metres on the globe"):
        client.replace_fence(fence, area=ZONE, subjects=Prefix(f"{name}/"), margin=3e5)
    client.delete_hull(f"{name}/globe")
    client.create_hull(f"{name}/plane", keyed="str")
    with pytest.raises(HullUnsuitableError, match="is a plane; the hull is geographic"):
        client.create_hull(f"{name}/globe", keyed="str", geographic=True)
    client.delete_hull(f"{name}/plane")
    client.replace_fence(fence, area=ZONE, subjects=Prefix(f"{name}/"), margin=3e5)
    with pytest.raises(HullUnsuitableError, match="has a margin of more than 250000 metres"):
        client.create_hull(f"{name}/globe", keyed="str", geographic=True)
    client.create_fence(f"{name}-far", area=Polygon([(0, 0), (1000, 0), (0, 1000)]), subjects=Prefix(f"{name}-far/"))
    with pytest.raises(HullUnsuitableError, match=r"has an area that is not on the globe: .* a longitude is from -360"):
        client.create_hull(f"{name}-far/globe", keyed="str", geographic=True)
    bow = [(179, 0), (-179, 1), (179, 1), (-179, 0), (180, -9)]  # its edges cross in the plane and on the globe
    with pytest.raises(InvalidRequestError, match="cross"):
        client.create_fence(f"{name}-bow", area=bow, subjects=Prefix(f"{name}-bow/"))
    across = [(179, 0), (-179, 0), (179.5, 1), (-178, 2), (178, 2)]  # its edges cross in the plane only
    client.create_fence(f"{name}-across", area=across, subjects=Prefix(f"{name}-across/"))
    with pytest.raises(HullUnsuitableError, match=r"has an area that does not suit it: .* cross"):
        client.create_hull(f"{name}-across/plane", keyed="str")
    client.create_hull(f"{name}-across/globe", keyed="str", geographic=True)


def test_a_hull_that_reaches_a_part_of_an_area_only(client, name):
    vast = [(-60, -30), (60, -30), (60, 30), (-60, 30)]
    client.create_hull(f"{name}/east", keyed="str", geographic=True, center=(100, 0))
    with pytest.raises(InvalidRequestError, match="which reaches other parts of the area"):
        client.create_fence(f"{name}/fence", area=vast, subjects=Prefix(f"{name}/"))
    client.create_hull(f"{name}-zone", geographic=True, center=(0, 0))
    client.apply(f"{name}-zone", insert=vast)
    client.create_fence(f"{name}/fence", area=f"{name}-zone", subjects=Prefix(f"{name}/"), initial="none")
    places = np.random.default_rng(2).uniform([20, -50], [90, 50], (60, 2))
    names = [f"k{row:02}" for row in range(60)]
    client.put(f"{name}/east", names, places)
    held = dynhull.GeoHull(vast, center=(0, 0)).contains(places)
    assert [event.key for event in told(client, f"{name}/fence")] == [names[row] for row in np.flatnonzero(held)]
    assert 10 < held.sum() < 50
    assert client.verify(f"{name}/east").fence_differences == ()


def test_a_killed_server_continues_the_events_of_a_prefix(tmp_path):
    options = ["--data", str(tmp_path / "data")]
    inside = dynhull.GeoHull(ZONE).contains(PLACES[:80]).reshape(2, 40)
    with server_process(*options, killed=True) as server, HullClient(server.address) as client:
        client.create_fence("zone", area=ZONE, subjects=Prefix("fleet/"), initial="none")
        client.create_hull("fleet/a", keyed="int", geographic=True)
        client.create_hull("fleet/b", keyed="int", geographic=True, center=(150, 10))
        for each in "ab":
            client.put(f"fleet/{each}", range(40), PLACES[:40])
        server.process.kill()
        server.process.wait(PATIENCE)
    with server_process(*options) as server, HullClient(server.address) as client:
        assert sides(client, "zone") == {(each, key) for each in "ab" for key in np.flatnonzero(inside[0]).tolist()}
        for each in "ab":
            client.put(f"fleet/{each}", range(40), PLACES[40:80])
        assert sides(client, "zone") == {(each, key) for each in "ab" for key in np.flatnonzero(inside[1]).tolist()}
        assert client.verify("fleet/b").fence_differences == ()
