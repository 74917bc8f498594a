"""Fences whose area is an inner convex layer: one far point does not let everybody in."""

from pathlib import Path

import numpy as np
import pytest
from server_process import run, server_process

from dynhull_client import FenceEvent, HullClient, InvalidRequestError

RING = [[0, 0], [100, 0], [100, 100], [0, 100]]
SQUARE = [[10, 10], [20, 10], [20, 20], [10, 20]]
KEYS = [f"k{i:02}" for i in range(12)]


def events_of(client: HullClient, fence: str) -> list[FenceEvent]:
    last = client.get_fence(fence).last_sequence
    with client.watch_fence(fence, after=0, timeout=60) as watch:
        return [next(watch) for _ in range(last)]


def test_inside_the_second_layer(client: HullClient, name: str) -> None:
    area, fleet = f"{name}/area", f"{name}/fleet"
    client.create_hull(area)
    client.apply(area, insert=[*RING, *SQUARE])
    client.create_hull(fleet, keyed="str")
    client.put(fleet, ["a", "b"], [[15, 15], [50, 50]])
    fence = client.create_fence(f"{name}/inner", area=area, subjects=fleet, layer=2)
    assert fence.layer == 2
    assert client.get_fence(fence.name).layer == 2
    client.apply(area, insert=[[1000, 1000]])  # now the corner (100, 100) is in the second layer
    assert client.fence_inside(fence.name).subjects[0].keys == ("a", "b")
    client.apply(area, delete=[[1000, 1000]])
    client.apply(area, insert=[[60, 60]])  # inside of the hull, which stays as it is
    client.put(fleet, ["a"], [[99, 99]])
    told = [(event.type, event.key, event.cause) for event in events_of(client, fence.name)[1:]]
    moved = frozenset({"area_moved"})
    assert told == [
        ("enter", "b", moved),
        ("exit", "b", moved),
        ("enter", "b", moved),
        ("exit", "a", frozenset({"subject_moved"})),
    ]
    assert client.verify(fleet).whole
    client.replace_fence(fence.name, area=area, subjects=fleet)
    assert client.fence_inside(fence.name).subjects[0].keys == ("a", "b")


def test_the_events_are_those_of_the_exact_sides_and_outlive_a_restart(tmp_path: Path) -> None:
    """A hull whose own second layer is the area, with keys that move, appear and leave."""
    random = np.random.default_rng(3)
    with server_process("--data", str(tmp_path)) as server, HullClient(server.address) as client:
        client.create_hull("fleet", keyed="str")
        client.create_fence("core", area="fleet", subjects="fleet", layer=2, initial="events")
        client.create_fence("band", area="fleet", subjects="fleet", layer=3, margin=2.0)
        inside: set[str] = set()
        for _ in range(40):
            chosen = random.choice(KEYS, 4, replace=False).tolist()
            client.put("fleet", chosen[:3], random.integers(0, 9, (3, 2)))
            client.remove("fleet", chosen[3:])
            present = [key for key in KEYS if key not in chosen[3:]]
            sides = client.locate("fleet", keys=present, layer=2).sides
            inside = {key for key, side in zip(present, sides.tolist(), strict=True) if side in (0, 1)}
            found = client.fence_inside("core").subjects
            assert {key for each in found for key in each.keys} == inside
        assert client.verify("fleet").whole
        followed: set[str] = set()
        for event in events_of(client, "core"):
            assert (event.key in followed) == (event.type == "exit")
            followed ^= {str(event.key)}
        assert followed == inside
    done = run("check", str(tmp_path))
    assert done.returncode == 0, done.stdout + done.stderr
    with server_process("--data", str(tmp_path)) as server, HullClient(server.address) as client:
        assert client.get_fence("band").layer == 3
        assert {key for each in client.fence_inside("core").subjects for key in each.keys} == inside
        assert client.verify("fleet").whole


@pytest.mark.parametrize(
    ("settings", "field"),
    [
        ({"subjects": "{fleet}", "layer": 1001}, "config.hull_area.layer"),
        ({"other_hull": "{other}", "layer": 2}, "config.hull_area.layer"),
        ({"subjects": "{fleet}", "layer": 2, "without_self": True, "margin": 1.0}, "config.hull_area.layer"),
    ],
)
def test_refusals_name_the_field(client: HullClient, name: str, settings: dict, field: str) -> None:
    names = {"fleet": f"{name}/fleet", "other": f"{name}/other"}
    client.create_hull(names["fleet"], keyed="str")
    client.create_hull(names["other"])
    given = {key: each.format(**names) if isinstance(each, str) else each for key, each in settings.items()}
    with pytest.raises(InvalidRequestError) as refused:
        client.create_fence(f"{name}/fence", area=names["fleet"], **given)
    assert refused.value.field == field
