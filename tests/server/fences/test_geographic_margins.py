"""Margins on the globe are metres: whoever is inside leaves beyond them, wherever the area is, and after restarts."""

import numpy as np
import pytest
from cases import slow
from pyproj import Geod
from server_process import server_process

import dynhull
from dynhull_client import Batch, Circle, HullClient, Prefix

WGS84 = Geod(ellps="WGS84")
ERROR = 2e-6  # metres: of the distance that decides, and of the one with which it is compared
PLACES = {"antimeridian": (180, -17), "pole": (12, 90), "beside a pole": (-60, -89.97), "Berlin": (13.4, 52.5)}


def moved(place, bearing, metres):
    return WGS84.fwd(*place, bearing, metres)[:2]


def events_of(client, name):
    last, found = client.get_fence(name).last_sequence, []
    with client.watch_fence(name, after=0) as watch:
        while len(found) < last:
            found.append(next(watch))
    return found


@pytest.mark.parametrize("place", PLACES.values(), ids=PLACES)
def test_a_millimetre_beside_the_margin(client, name, place):
    """Of polygons, circles and hulls: inside, on the margin's inner and outer side, and back within it."""
    corners = [moved(place, bearing, 4000) for bearing in (0, 120, 240)]
    client.create_hull(name, keyed="str", geographic=True, center=place)
    client.create_hull(f"{name}-area", geographic=True, center=place)
    client.apply(f"{name}-area", insert=corners)
    areas = {"polygon": corners[::-1], "circle": Circle(*place, 4000), "hull": f"{name}-area"}
    for kind, area in areas.items():
        client.create_fence(f"{name}/{kind}", area=area, subjects=name, margin=750, initial="none")
    for metres in (0, 4749.999, 4750.001, 4749.999):
        client.put(name, ["van"], [moved(place, 0, metres)])
    for kind in areas:
        entered, left = events_of(client, f"{name}/{kind}")
        assert (entered.type, left.type) == ("enter", "exit")
        assert left.distance == pytest.approx(750.001, abs=ERROR)
        assert left.position == moved(place, 0, 4750.001)
    assert client.verify(name).fence_differences == ()


def walks(seed, subjects, steps):
    """Ways around Fiji in steps of some kilometres, here and there of a continent."""
    random = np.random.default_rng(seed)
    at = random.uniform((178, -19), (182, -15), (subjects, 2))
    for _ in range(steps):
        at = at + random.normal(size=at.shape) * 10 ** random.uniform(-3, -0.5)
        yield at
    yield at + np.array([60, 20])


def sides(distance, margin, inside):
    """Who is inside next, and whether a micrometre decides."""
    near = (distance == 0) | (inside & (distance <= margin))
    return near, np.abs(distance - margin) <= ERROR


@pytest.mark.parametrize("sudden", [True, pytest.param(False, marks=slow)])
def test_who_is_inside_after_each_step(tmp_path, sudden):
    """Positions are compared with pyproj's distances; a restart halfway, killed or not, changes nothing."""
    options = ["--data", str(tmp_path / "data")]
    zone = [(179.2, -17.9), (-179.4, -17.6), (-179.3, -16.4), (179.6, -16.1)]
    keys, margins = [f"k{i}" for i in range(60)], {"narrow": 30.0, "wide": 40_000.0}
    inside = {margin: np.zeros(60, np.bool_) for margin in margins}
    judge = dynhull.GeoHull(zone)
    steps = list(walks(1, 60, 24))
    expected = {margin: [] for margin in margins}
    for start in (0, 12):
        with server_process(*options, killed=sudden) as server, HullClient(server.address) as client:
            if not start:
                client.create_hull("fleet/a", keyed="str", geographic=True, center=(180, -17))
                for margin, metres in margins.items():
                    client.create_fence(margin, area=zone, subjects=Prefix("fleet/"), margin=metres, initial="none")
            for at in steps[start:] if start else steps[:12]:
                client.put("fleet/a", keys, at)
                distance = np.where(judge.contains(at), 0.0, judge.distance(at))
                for margin, metres in margins.items():
                    now, close = sides(distance, metres, inside[margin])
                    assert not close.any()
                    changed = np.flatnonzero(now != inside[margin])
                    rows = sorted(changed, key=lambda row: keys[row])
                    expected[margin] += [("enter" if now[row] else "exit", keys[row], distance[row]) for row in rows]
                    inside[margin] = now
            assert client.verify("fleet/a").fence_differences == ()
            if sudden:
                server.process.kill()
    with server_process(*options) as server, HullClient(server.address) as client:
        for margin in margins:
            found = events_of(client, margin)
            assert [(event.type, event.key) for event in found] == [each[:2] for each in expected[margin]]
            assert [event.distance for event in found] == pytest.approx(
                [each[2] for each in expected[margin]], abs=ERROR
            )
            past = list(
                client.fence_events_between(area=zone, subjects="fleet/a", margin=margins[margin], initial="none")
            )
            assert [(event.type, event.key, event.distance) for event in past] == [
                (event.type, event.key, event.distance) for event in found
            ]
        assert client.verify("fleet/a").fence_differences == ()
    assert len(expected["narrow"]) > len(expected["wide"]) > 20


def test_an_area_at_the_end_of_reach_keeps_its_margin(client, name):
    """84 degrees from the centre, and a fence over a prefix of which one hull does not reach the area."""
    zone = [(83.4, 1), (83.4, -1), (84.4, -1), (84.4, 1)]
    client.create_hull(f"{name}/near", keyed="str", geographic=True, center=(0, 0))
    client.create_hull(f"{name}/far", keyed="str", geographic=True, center=(-60, 0))
    client.create_fence(f"{name}-fence", area=zone, subjects=Prefix(f"{name}/"), margin=50_000, initial="none")
    for place in [(84, 0), (84.8, 0), (84.86, 0), (84, 0), (82.96, 0), (82.94, 0)]:
        client.put(f"{name}/near", ["van"], [place])
    found = events_of(client, f"{name}-fence")
    assert [(event.type, event.position[0]) for event in found] == [
        ("enter", 84), ("exit", 84.86), ("enter", 84), ("exit", 82.94)
    ]  # fmt: skip
    assert client.verify(f"{name}/near").fence_differences == ()
    assert client.verify(f"{name}/far").fence_differences == ()


def test_who_is_carried_to_another_hull_stays_within_the_margin(client, name):
    """Two hulls about centres of their own: the state goes over, and the margin counts there."""
    zone = [(179.5, -17.5), (-179.5, -17.5), (-179.5, -16.5), (179.5, -16.5)]
    for hull, center in (("a", (180, -17)), ("b", (170, -10))):
        client.create_hull(f"{name}/{hull}", keyed="str", geographic=True, center=center)
    client.create_fence(f"{name}-fence", area=zone, subjects=Prefix(f"{name}/"), margin=20_000, initial="none")
    client.put(f"{name}/a", ["van"], [(180, -17)])
    client.transfer({f"{name}/a": Batch(remove=["van"]), f"{name}/b": Batch(keys=["van"], points=[(180.65, -17)])})
    client.put(f"{name}/b", ["van"], [(180.7, -17)])
    assert [event.type for event in events_of(client, f"{name}-fence")] == ["enter", "transfer", "exit"]
