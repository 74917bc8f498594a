"""Alarms about a vertex that reaches an area, a key that becomes a vertex, and two hulls that come near."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import pytest
from command_line import dynhull
from server_process import server_process

from dynhull_client import AlarmEvent, HullClient, HullFencedError, HullUnsuitableError, InvalidRequestError


@pytest.fixture(scope="module")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("relations")
    with server_process("--data", str(folder), "--create-on-write") as process:
        yield process.address


def seen(client: HullClient, alarm: str) -> list[AlarmEvent]:
    with client.watch_alarm(alarm, after=0) as stream:
        return list(islice(stream, client.get_alarm(alarm).last_sequence))


def facts(events: list[AlarmEvent]) -> list[tuple[object, ...]]:
    return [(each.type, each.value, each.previous, set(each.cause), each.cause_revision) for each in events]


def square(client: HullClient, hull: str, x: float, y: float = 0, side: float = 1) -> None:
    client.put(hull, ["a", "b", "c", "d"], [(x, y), (x + side, y), (x + side, y + side), (x, y + side)])


def test_two_hulls_come_near_whichever_moves(client: HullClient, name: str) -> None:
    client.create_hull(f"{name}/a", keyed="str")
    client.create_hull(f"{name}/b", keyed="str")
    alarm = client.create_alarm(name, hull=f"{name}/a", when=f"near {name}/b 2.0", clear=f"not near {name}/b 3")
    assert (alarm.when, alarm.clear) == (f"near {name}/b 2", f"not near {name}/b 3")
    square(client, f"{name}/a", 0)
    square(client, f"{name}/b", 9)
    square(client, f"{name}/b", 3)  # 2 apart, to the last bit
    square(client, f"{name}/a", -1)  # 3 apart
    square(client, f"{name}/a", -1.5)
    square(client, f"{name}/b", 0)
    client.remove(f"{name}/b", ["a", "b", "c", "d"])
    events = seen(client, name)
    assert facts(events) == [
        ("raised", 2.0, 8.0, {"other_hull"}, 2),
        ("cleared", 3.5, 3.0, {"batch"}, 3),
        ("raised", 0.5, 3.5, {"other_hull"}, 3),
        ("cleared", None, 0.5, {"other_hull"}, 4),
    ]
    assert [each.cause_hull[-1] for each in events] == ["b", "a", "b", "b"]
    assert {each.hull for each in events} == {f"{name}/a"}
    assert [each.bound for each in events] == [2.0, 3.0, 2.0, 3.0]


def test_hulls_with_a_prefix_meet_another_one(client: HullClient, name: str) -> None:
    square(client, f"{name}/port", 0, side=4)
    square(client, f"{name}/one", 9)
    client.create_alarm(name, prefix=f"{name}/", when=f"near {name}/port")
    square(client, f"{name}/two", 4, 4)  # touches
    square(client, f"{name}/port", 0, side=9)
    assert [(each.type, each.hull[-3:], set(each.cause)) for each in seen(client, name)] == [
        ("raised", "two", {"batch"}),
        ("raised", "one", {"other_hull"}),
    ]
    assert client.get_alarm(name).hulls == 2
    assert [each.hull[-3:] for each in client.get_alarm(name).statuses] == ["one", "two"]
    with pytest.raises(HullFencedError):
        client.delete_hull(f"{name}/port")
    client.delete_hull(f"{name}/one")
    assert client.get_alarm(name).raised == 1
    client.delete_alarm(name)
    client.delete_hull(f"{name}/port")


@pytest.mark.parametrize("area", ["circle(5, 0, 1.0)", "polygon(4 0, 6 -1, 6 1)", "HULL"])
def test_a_vertex_reaches_an_area(client: HullClient, name: str, area: str) -> None:
    area = area.replace("HULL", f"{name}/yard")
    client.put(f"{name}/yard", ["a", "b", "c"], [(4, 0), (6, -1), (6, 1)])
    client.put(f"{name}/a", ["left", "right"], [(0, 0), (3.9999999999999996, 0)])
    client.create_alarm(name, hull=f"{name}/a", when=f"vertex in {area}")
    client.put(f"{name}/a", ["right"], [(4, 0)])  # on the boundary
    client.put(f"{name}/a", ["right"], [(6.000000000000001, 0)])  # an edge still crosses it
    if "yard" in area:
        client.put(f"{name}/yard", ["b", "c"], [(7, -1), (7, 1)])
    events = seen(client, name)
    assert facts(events)[:2] == [("raised", 1.0, 0.0, {"batch"}, 2), ("cleared", 0.0, 1.0, {"batch"}, 3)]
    assert events[0].keys == ("right",)
    assert [(each.type, set(each.cause)) for each in events[2:]] == (
        [("raised", {"other_hull"})] if "yard" in area else []
    )


@pytest.mark.parametrize(("keyed", "key"), [("str", "x"), ("int", 7)])
def test_a_key_becomes_a_vertex(client: HullClient, name: str, keyed: str, key: str | int) -> None:
    others = ["a", "b", "c"] if keyed == "str" else [1, 2, 3]
    client.create_hull(name, keyed=keyed)
    client.create_alarm(name, hull=name, when=f"vertex {key}")
    client.put(name, [*others, key], [(0, 0), (4, 0), (0, 4), (1, 1)])
    client.put(name, [key], [(4, 0)])  # where another key is: the vertices stay
    client.put(name, [key], [(2, 0)])  # on an edge
    client.put(name, [key], [(2, -1)])
    client.remove(name, [key])
    events = seen(client, name)
    assert facts(events) == [
        ("raised", 1.0, 0.0, {"batch"}, 2),
        ("cleared", 0.0, 1.0, {"batch"}, 3),
        ("raised", 1.0, 0.0, {"batch"}, 4),
        ("cleared", 0.0, 1.0, {"batch"}, 5),
    ]
    assert [each.keys for each in events] == [(key,), (), (key,), ()]


def test_the_opposite_raises_too(client: HullClient, name: str) -> None:
    square(client, f"{name}/a", 0)
    square(client, f"{name}/b", 3)
    far = client.create_alarm(f"{name}/far", hull=f"{name}/a", when=f"not near {name}/b 5", clear=f"near {name}/b 4")
    client.create_alarm(f"{name}/in", hull=f"{name}/a", when='not vertex "a"')
    assert (far.when, far.raised) == (f"not near {name}/b 5", 0)
    square(client, f"{name}/b", 7)
    client.put(f"{name}/a", ["a"], [(0.5, 0.5)])
    square(client, f"{name}/b", 5)
    assert [each.type for each in seen(client, f"{name}/far")] == ["raised", "cleared"]
    assert [each.type for each in seen(client, f"{name}/in")] == ["raised"]


def test_on_the_globe(client: HullClient, name: str) -> None:
    for hull in ("a", "b"):
        client.create_hull(f"{name}/{hull}", geographic=True, keyed="str")
    client.create_alarm(f"{name}/near", hull=f"{name}/a", when=f"near {name}/b 100 km")
    client.create_alarm(f"{name}/reach", prefix=f"{name}/", when="vertex in circle(13, 52, 20000)")
    client.put(f"{name}/b", ["x", "y", "z"], [(13, 52), (13.1, 52), (13, 52.1)])
    client.put(f"{name}/a", ["x", "y", "z"], [(15, 52), (15.1, 52), (15, 52.1)])
    client.put(f"{name}/a", ["x"], [(14, 52)])
    client.put(f"{name}/a", ["x"], [(15, 52)])
    client.create_hull(f"{name}/far", geographic=True)
    client.apply(f"{name}/far", insert=[(-120, -52)])  # farther than a projection reaches
    client.create_alarm(f"{name}/beyond", hull=f"{name}/far", when=f"near {name}/a 16000 km")
    raised, cleared = seen(client, f"{name}/near")
    assert raised.value == pytest.approx(61_800, rel=1e-2)
    assert (raised.bound, cleared.type) == (1e5, "cleared")
    assert client.get_alarm(f"{name}/beyond").statuses == ()
    client.apply(f"{name}/far", insert=[(-80, -20)])
    assert client.get_alarm(f"{name}/beyond").raised == 1
    (event,) = seen(client, f"{name}/reach")
    assert (event.hull[-1], event.keys) == ("b", ("x", "y", "z"))


@pytest.mark.parametrize("beyond", [False, True])
def test_hulls_cross_without_a_corner_in_each_other(client: HullClient, name: str, beyond: bool) -> None:
    """Also where one reaches beyond the projection about the centre of the other; and one that is inside of another."""
    east = -80 if beyond else 55
    for hull, center in (("long", (0, 0)), ("across", (120, 0)), ("within", (60, 0))):
        client.create_hull(f"{name}/{hull}", geographic=True, center=center)
    for hull in ("across", "within"):
        client.create_alarm(f"{name}/{hull}", hull=f"{name}/long", when=f"near {name}/{hull}")
    client.apply(f"{name}/across", insert=[(60, -40), (64, -40), (60, 40), (64, 40)])
    client.apply(f"{name}/within", insert=[(66, 0), (66, 1), (67, 0)])
    client.apply(f"{name}/long", insert=[(east, -3), (east, 3), (59, -3), (59, 3)])
    assert {each.name for each in client.list_alarms(f"{name}/") if each.raised} == set()
    client.apply(f"{name}/long", insert=[(84, -3), (84, 3)])
    assert {each.name for each in client.list_alarms(f"{name}/") if each.raised} == {f"{name}/across", f"{name}/within"}
    client.apply(f"{name}/long", delete=[(84, -3), (84, 3)])
    assert [each.type for each in seen(client, f"{name}/across")] == ["raised", "cleared"]


@pytest.mark.parametrize(
    ("when", "position", "problem"),
    [
        ("near", 5, "expected the name of a hull"),
        ("near b < 5", 8, "expected a distance"),
        ("near b -5", 8, "expected a distance"),
        ("near b 5 miles", 10, "expected m or km"),
        ("near b 5 km 6", 13, "expected nothing more"),
        ("vertex in circle(1, 2, -3)", 24, "must not be negative"),
        ("vertex in polygon(0 0, 1 1)", 27, "3 to 1000 corners"),
        ("vertex in polygon(0 0, 1, 1 1)", 23, "expected two numbers"),
        ("vertex in box(1, 2)", 11, "expected an area"),
        (f"vertex in circle({'1' * 20_000}", 11, "expected an area"),
        (f"vertex in circle(0, 0, {'1' * 400})", 24, "must be finite"),
        ("near b ٣", 8, "expected a distance"),
        ("vertex a b", 8, "expected a key"),
        ('vertex "a', 8, "a string of JSON"),
        ("vertex", 7, "expected a key"),
    ],
)
def test_what_is_no_condition(client: HullClient, name: str, when: str, position: int, problem: str) -> None:
    with pytest.raises(InvalidRequestError, match=rf"when is .*: at position {position}: .*{problem}"):
        client.create_alarm(name, hull=name, when=when)


def test_what_is_refused(client: HullClient, name: str) -> None:
    client.create_hull(name)
    client.create_hull(f"{name}/globe", geographic=True)
    for when, clear, words in [
        ("near other 5", "not near other 4", "weaker"),
        ("near other 5", "near other 9", "weaker"),
        ("near other 5", "not near another 9", "must be about the same"),
        (f"near {name} 5", None, "another hull"),
        ("vertex in polygon(0 0, 2 2, 2 0, 0 2)", None, "edges 0 and 2 cross"),
    ]:
        with pytest.raises(InvalidRequestError, match=words):
            client.create_alarm(name, hull=name, when=when, clear=clear)
    for when, words in [
        (f"near {name}/globe 5", "is a plane"),
        ("vertex a", "points without keys"),
        (
            "vertex in polygon(0 0, 1 1, 2 2)",
            rf"the hull '{name}' is a plane: 'vertex in .*' does not suit it: .* no area",
        ),
        ("vertex in circle(0, 0, 1)", ""),
    ]:
        if words:
            with pytest.raises(HullUnsuitableError, match=words):
                client.create_alarm(name, hull=name, when=when)
        else:
            client.create_alarm(name, hull=name, when=when)


def test_they_outlive_a_kill(tmp_path: Path) -> None:
    """Whoever moves afterwards: and the folder is as it is to be."""
    with server_process("--data", str(tmp_path), killed=True) as process, HullClient(process.address) as client:
        for hull in ("w/a", "w/b"):
            client.create_hull(hull, keyed="str")
            square(client, hull, 9 * (hull == "w/b"))
        for name, when in [("near", "near w/b 2"), ("in", "vertex in w/b"), ("key", "vertex e")]:
            client.create_alarm(name, prefix="w/", when=when)
        client.create_hull("w/empty", keyed="str")
        client.create_alarm("one", hull="w/a", when="near w/b 2")
        client.create_alarm("apart", hull="w/a", when="not near w/empty 5")
        square(client, "w/b", 1)
        process.process.kill()
    with server_process("--data", str(tmp_path)) as process, HullClient(process.address) as client:
        assert [client.get_alarm(name).raised for name in ("near", "in", "key", "one", "apart")] == [1, 1, 0, 1, 1]
        assert client.verify("w/a").fence_differences == ()
        client.put("w/a", ["e"], [(-1, -1)])
        square(client, "w/b", 7)
        for name in ("near", "one"):
            assert [each.type for each in seen(client, name)] == ["raised", "cleared"]
        assert [each.value for each in seen(client, "apart")] == [None]
        assert [each.type for each in seen(client, "in")] == ["raised", "cleared"]
        (event,) = seen(client, "key")
        assert (event.hull, event.keys) == ("w/a", ("e",))
        square(client, "w/b", 0.5)
    assert dynhull("check", str(tmp_path)).exit_code == 0


def test_hulls_with_alarms_get_another_centre(client: HullClient, name: str) -> None:
    for hull in ("a", "b"):
        client.create_hull(f"{name}/{hull}", geographic=True)
    client.create_alarm(f"{name}/size", prefix=f"{name}/", when="area > 100 km2")
    client.create_alarm(f"{name}/near", hull=f"{name}/a", when=f"near {name}/b 100 km")
    client.apply(f"{name}/a", insert=[(13, 52), (14, 52), (13, 53)])
    for hull in ("a", "b"):
        client.recenter(f"{name}/{hull}", (20, 50))
    client.apply(f"{name}/b", insert=[(14, 52)])
    client.recenter(f"{name}/b", (30, 50))
    client.apply(f"{name}/a", delete=[(14, 52)])
    events = [(each.type, each.revision) for alarm in ("size", "near") for each in seen(client, f"{name}/{alarm}")]
    assert events == [("raised", 1), ("cleared", 3), ("raised", 2)]
    assert client.verify(f"{name}/a").fence_differences == ()
