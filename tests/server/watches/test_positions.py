"""Positions of watches of many hulls: at most 1 kB for any number of partitions, and never more than somebody has."""

from struct import pack

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynhull_server.engine.positions import Standing, decode_position, encode_position
from dynhull_server.state.records import CommitStamp

DAY = 86_400_000_000  # in microseconds
NOW = 1_795_900_000_000_000


def cluster(partitions: int, seed: int = 1) -> list[Standing]:
    """Some partitions have committed just now, others long ago, or never."""
    random = np.random.default_rng(seed)
    ages = (DAY * random.random(partitions) ** 20).astype(int)
    return [Standing(7, 0, 0) if not n % 9 else Standing(n, 1000 + n, NOW - int(age)) for n, age in enumerate(ages)]


@pytest.mark.parametrize("partitions", [1, 50, 51, 64, 100, 500, 1024])
def test_at_most_a_kilobyte_and_nothing_that_was_not_sent(partitions: int) -> None:
    standings = cluster(partitions)
    position = encode_position(standings)
    assert len(position) <= 1000
    found = decode_position(position)
    assert found.precedes(standings)
    for exact, now in zip(standings, found.standings, strict=True):
        for commit in (CommitStamp(exact.number + 1, exact.time), CommitStamp(exact.number + 2, exact.time + 1)):
            assert not now.has(commit)
        if exact.time:  # and what is older than that twice is not sent again
            assert now.has(CommitStamp(exact.number - 1, NOW - 2 * (NOW - exact.time) - 2))


@given(st.lists(st.integers(0, 2**50), min_size=51, max_size=1024), st.integers(-2, 2))
def test_rounded_never_up(times: list[int], beyond: int) -> None:
    standings = [Standing(0, 1, time) for time in times]
    for exact, found in zip(standings, decode_position(encode_position(standings)).standings, strict=True):
        assert not found.has(CommitStamp(1, exact.time + beyond)) or beyond < 0


def test_positions_of_earlier_servers() -> None:
    standings = cluster(64)
    position = decode_position(b"".join(pack(">IQQ", *each) for each in standings))
    assert position.precedes(standings)
    assert list(position.standings) == standings


def test_another_incarnation_or_number_of_partitions() -> None:
    for partitions in (3, 64):
        standings = cluster(partitions)
        position = decode_position(encode_position(standings))
        assert not position.precedes(standings[:-1])
        assert not position.precedes([standings[0]._replace(incarnation=1), *standings[1:]])


def test_none_of_ours() -> None:
    for position in (b"1", bytes(999), b"\xff" * 999):
        with pytest.raises(ValueError, match="not a position"):
            decode_position(position)
