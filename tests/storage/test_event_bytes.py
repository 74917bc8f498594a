"""Events become the same bytes in C++ as in Python."""

import math
import random

import pytest

from dynhull_server.compiled import native, numbers
from dynhull_server.state.fences.events.block import EventBlock, block_of, joined
from dynhull_server.state.fences.model.config import CircleArea, FenceConfig
from dynhull_server.state.fences.model.records import EventType, FenceEvent, FenceRow, Origin
from dynhull_server.state.records import NO_TIME
from dynhull_server.storage.rows import event_blocks, fence_runs
from dynhull_server.storage.rows.event_blocks import decode_block, encode_block
from dynhull_server.storage.rows.fence_runs import FenceRuns

HULLS = "fleet", "others/1", "others/2"


def coordinate(dice: random.Random, *, decimal: bool) -> float:
    if decimal:
        return dice.choice([0.0, 180.0, dice.randrange(-(10**9), 10**9) / 1e7])
    return dice.choice([0.0, -0.0, 5e-324, -1.5e308, dice.uniform(-1, 1), float(dice.randrange(-4, 4))])


def place(dice: random.Random, *, decimal: bool) -> tuple[float, float] | None:
    return None if dice.random() < 0.2 else (coordinate(dice, decimal=decimal), coordinate(dice, decimal=decimal))


def events(dice: random.Random, number: int, *, timed: bool) -> dict[int, list[FenceEvent]]:
    """Events of some fences, with keys of both kinds, and without some of what an event may have."""
    made: dict[int, list[FenceEvent]] = {}
    decimal = dice.random() < 0.5
    for _ in range(number):
        fence = dice.randrange(1, 2**40)
        position = place(dice, decimal=decimal)
        key = dice.choice([2**64 - 1, dice.randrange(1000), "é" * dice.randrange(1, 100)])
        event = FenceEvent(
            dice.choice([1, 2**53]),
            dice.choice([EventType.ENTER, EventType.EXIT, EventType.CROSS]),
            dice.randrange(256),
            dice.choice(HULLS),
            key,
            dice.randrange(2**48),
            dice.choice([0, 7]),
            position,
            place(dice, decimal=decimal),
            None if position is None else dice.choice([0.0, math.inf, dice.random()]),
            dice.randrange(-(2**50), 2**50) if timed and dice.random() < 0.7 else NO_TIME,
            dice.randrange(2**50),
            dice.randrange(2**50) if timed and dice.random() < 0.3 else NO_TIME,
            origin=Origin("yard", 3) if timed and dice.random() < 0.2 else None,
        )
        made.setdefault(fence, []).append(event)
    return made


def encoded(block: EventBlock, own: str) -> bytes:
    return encode_block(block, block.runs["hull"] == (block.names.index(own) if own in block.names else -1))


def in_order(block: EventBlock) -> list[FenceEvent]:
    return [event for run in range(len(block.runs)) for event in block.events(run)]


@pytest.mark.parametrize("number", [1, 2, 3, 17, 64, 65])
@pytest.mark.parametrize("timed", [False, True], ids=["plain", "timed"])
@pytest.mark.skipif(native is None, reason="the server runs on pure Python")
def test_events_become_the_same_bytes_in_both_implementations(
    number: int, timed: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    for seed in range(10):
        made = events(random.Random(f"{number} {timed} {seed}"), number, timed=timed)
        block = block_of(made)
        found = []
        for implementation in (native, None):
            monkeypatch.setattr(event_blocks, "native", implementation)
            found.append(encoded(block, HULLS[0]))
        assert found[0] == found[1]
        read = decode_block(found[0], lambda _: HULLS[0])
        assert repr(read.by_fence()) == repr(made)


def test_blocks_are_joined_and_parted() -> None:
    dice = random.Random(7)
    made = [events(dice, number, timed=True) for number in (3, 1, 20)]
    blocks = [block_of(each) for each in made]
    together = joined(blocks)
    expected = [event for each in made for of_fence in each.values() for event in of_fence]
    assert repr(in_order(together)) == repr(expected)
    parts = [together.part(start, min(start + 5, len(together))) for start in range(0, len(together), 5)]
    assert repr([event for part in parts for event in in_order(part)]) == repr(expected)
    some = together.only(together.fences % 2 == 0)
    left = {number: of_fence for each in made for number, of_fence in each.items() if number % 2 == 0}
    assert repr(some.by_fence()) == repr(left)


@pytest.mark.skipif(native is None, reason="the server runs on pure Python")
def test_runs_are_kept_alike_in_both_implementations(monkeypatch: pytest.MonkeyPatch) -> None:
    def kept() -> tuple[list[object], list[object]]:
        dice, noted = random.Random("runs"), []
        rows = {number: fence_rows(number) for number in range(1, 20)}
        runs = FenceRuns(rows)
        for number in rows:
            runs.begin(number)
        lasts = numbers()

        def so_far() -> dict[int, int]:
            return {number: lasts[number] for number in rows if number in lasts}

        for place in range(30):
            made: dict[int, list[FenceEvent]] = {}
            for number in dice.choices(range(1, 20), k=dice.choice([1, 3, 30])):
                sequence = so_far().get(number, 0) + len(made.get(number, [])) + 1
                moment = dice.randrange(3)
                made.setdefault(number, []).append(event(sequence, dice.choice(HULLS), moment))
            block = block_of(made)
            runs.follow(block, lasts)
            noted += [runs.own(block).tolist(), so_far()]
            runs.add(block, place)
            for wrong, error in ((made, ValueError), ({99: [event(1, "fleet", 0)]}, KeyError)):
                with pytest.raises(error):
                    runs.follow(block_of(wrong), lasts)
            noted.append(so_far())
        found = []
        for each in rows.values():
            runs.update(each)
            found.append((list(each.firsts), list(each.places), each.last))
        return noted, found

    first = kept()
    monkeypatch.setattr(fence_runs, "native", None)
    assert kept() == first
    assert {own for each in first[0][::3] for own in each} == {True, False}


def fence_rows(number: int) -> fence_runs.FenceRows:
    config = FenceConfig(CircleArea(0.0, 0.0, 1.0), "hull", HULLS[number % 3])
    return fence_runs.FenceRows(FenceRow(number, f"fence/{number}", "uid", 0.0, config), 0, 0)


def event(sequence: int, hull: str, moment: int) -> FenceEvent:
    return FenceEvent(sequence, EventType.ENTER, 1, hull, 7, moment, 0, (0.0, 0.0), None, 0.0, NO_TIME, moment)
