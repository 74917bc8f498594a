"""The quarantine of keyed hulls through both clients and a real server."""

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from math import inf, nan
from typing import Any

import pytest

from dynhull_client import (
    Applied,
    Batch,
    DuplicateKeyError,
    HeldPosition,
    HullClient,
    HullUnsuitableError,
    InvalidRequestError,
    Quarantine,
)

NOON = datetime(2026, 3, 1, 12, tzinfo=UTC)
FLEET = ["a", "b", "c", "d"]
SQUARE = [[0, 0], [4, 0], [4, 4], [0, 4]]


@pytest.fixture
def client(address: str, connect: type[HullClient]) -> Iterator[HullClient]:
    with connect(address) as client:
        yield client


def at(seconds: float, rows: int = 1) -> list[datetime]:
    return [NOON + timedelta(seconds=seconds)] * rows


def held(client: HullClient, name: str) -> list[str | int]:
    return [each.key for each in client.list_held(name)]


@pytest.fixture
def fleet(client: HullClient, name: str) -> str:
    """A square of four keys, one of which has just claimed to be a thousand units away."""
    client.create_hull(name, keyed="str", quarantine=Quarantine(max_speed=10))
    client.put(name, FLEET, SQUARE, at(0, 4))
    client.put(name, ["a", "b"], [[1000, 0], [5, 0]], at(1, 2))
    return name


def test_a_bad_position_is_held_and_listed(client: HullClient, name: str) -> None:
    created = client.create_hull(name, keyed="str", quarantine=Quarantine(max_speed=10, max_growth=1.5))
    assert (created.quarantine, created.held) == (Quarantine(10, 1.5, 1), 0)
    client.put(name, FLEET, SQUARE, at(0, 4))
    put = client.put(name, ["b", "a", "e"], [[5, 0], [1000, 0], [4, 40]], at(2, 3))
    assert (put.held, put.held_rows, put.moved, put.inserted) == (2, (1, 2), 1, 0)
    assert client.get_hull(name).vertices.tolist() == [[0, 0], [5, 0], [4, 4], [0, 4]]
    assert client.get_hull(name).info.held == 2
    speeding, growing = client.list_held(name)
    assert speeding == HeldPosition("a", (1000, 0), at(2)[0], 500, 125.5, 2, 0)
    assert (growing.key, growing.position, growing.speed, growing.growth) == ("e", (4, 40), None, 5.5)
    assert client.verify(name).keys_equal
    assert client.positions(name, ["e"]).present.tolist() == [False]


def test_it_leaves_when_confirmed_contradicted_released_dropped_or_removed(client: HullClient, fleet: str) -> None:
    assert held(client, fleet) == ["a"]
    confirmed = client.put(fleet, ["a"], [[1001, 0]], at(2))
    assert (confirmed.released, confirmed.held, confirmed.moved) == (1, 0, 1)
    client.put(fleet, FLEET[1:], [[-999, 0]] * 3, at(2, 3))
    assert held(client, fleet) == FLEET[1:]
    assert client.put(fleet, ["b"], [[6, 0]], at(3)).dropped == 1
    released = client.release(fleet, ["c", "x", "b"])
    assert (released.released, released.missing, released.moved) == (1, 2, 1)
    assert client.positions(fleet, ["c"]).positions.tolist() == [[-999, 0]]
    dropped = client.drop(fleet, ["d", "c"])
    assert (dropped.dropped, dropped.missing, dropped.hull_changed) == (1, 1, False)
    client.put(fleet, ["d"], [[-999, 0]], at(4))
    removed = client.remove(fleet, ["d"])
    assert (removed.deleted, removed.dropped) == (1, 1)
    assert held(client, fleet) == []


def test_numbered_batches_are_carried_out_once(client: HullClient, fleet: str) -> None:
    def send(sequence: int, **batch: Any) -> Applied:
        return client.put(fleet, ["a"], times=at(sequence), producer="gps", sequence=sequence, **batch)

    assert send(1, points=[[2000, 0]]).held_rows == (0,)
    again = send(1, points=[[2000, 0]])
    assert (again.duplicate, again.held, again.held_rows) == (True, 0, ())
    release: dict[str, Any] = {"keys": ["a"], "producer": "gps", "sequence": 2}
    assert client.release(fleet, **release).released == 1
    assert client.release(fleet, **release).duplicate
    assert client.get_hull(fleet).info.revision == 4


def test_rules_change_while_positions_are_held(client: HullClient, fleet: str) -> None:
    off = client.set_quarantine(fleet, None)
    assert (off.quarantine, off.held, off.revision) == (Quarantine(), 1, 3)
    assert client.put(fleet, ["b"], [[500, 0]], at(2)).held == 0
    assert held(client, fleet) == ["a"]
    by_hand = Quarantine(max_growth=1, confirmations=0)
    assert client.set_quarantine(fleet, by_hand).quarantine == by_hand
    for seconds in (3, 4, 5):
        assert client.put(fleet, ["a"], [[999, 0]], at(seconds)).held == 1
    assert client.release(fleet, ["a"]).released == 1


def test_integer_keys_in_pages_and_two_hulls_together(client: HullClient, name: str) -> None:
    north, south = f"{name}/n", f"{name}/s"
    for hull in (north, south):
        client.create_hull(hull, keyed="int", quarantine=Quarantine(max_growth=2))
        client.put(hull, [1, 2, 3], [[0, 0], [4, 0], [0, 4]])
    numbers = [2**64 - each for each in range(1, 2502)]
    assert client.put(north, numbers, [[100, 100]] * len(numbers)).held == len(numbers)
    assert held(client, north) == sorted(numbers)
    assert client.get_hull(north).info.held == len(numbers)
    moved = client.transfer({north: Batch(drop=numbers[:1]), south: Batch(keys=numbers[:1], points=[[100, 100]])})
    assert (moved[north].dropped, moved[south].held) == (1, 1)
    moved = client.transfer({north: Batch(drop=[1]), south: Batch(release=numbers[:1], drop=[7])})
    assert (moved[north].missing, moved[south].released, moved[south].missing) == (1, 1, 1)


def test_what_is_refused(client: HullClient, fleet: str, name: str) -> None:
    bad: dict[str, Any] = {"max_speed": (0, -1, nan, inf), "max_growth": (0.99, nan, inf, -2), "confirmations": (1001,)}
    for field, values in bad.items():
        for value in values:
            with pytest.raises(InvalidRequestError, match=f"quarantine.{field}"):
                client.set_quarantine(fleet, Quarantine(**{field: value}))
    with pytest.raises(InvalidRequestError, match=r"^quarantine.max_speed is 0.0"):
        client.create_hull(f"{name}-bad", keyed="str", quarantine=Quarantine(max_speed=0))
    with pytest.raises(InvalidRequestError, match=r"^quarantine is present"):
        client.create_hull(f"{name}-points", quarantine=Quarantine(max_growth=2))
    client.create_hull(f"{name}-points")
    for call in (
        lambda: client.set_quarantine(f"{name}-points", Quarantine()),
        lambda: list(client.list_held(f"{name}-points")),
    ):
        with pytest.raises(HullUnsuitableError, match="points without keys"):
            call()
    with pytest.raises(HullUnsuitableError, match="points without keys"):
        client.release(f"{name}-points", ["a"])
    with pytest.raises(HullUnsuitableError, match="integers"):
        client.release(fleet, [1])
    both = Batch(keys=["a"], points=[[0, 0]], release=["b"])
    with pytest.raises(InvalidRequestError, match="has no puts and removes"):
        client.transfer({fleet: both, f"{name}-points": Batch(insert=[[0, 0]])})
    with pytest.raises(DuplicateKeyError, match="release row 0"):
        client.transfer({fleet: Batch(release=["a"], drop=["a"]), f"{name}-points": Batch(insert=[[0, 0]])})
    with pytest.raises(ValueError, match="either puts and removes keys"):
        Batch(insert=[[0, 0]], drop=["a"])
    assert (client.get_hull(fleet).info.revision, held(client, fleet)) == (2, ["a"])
