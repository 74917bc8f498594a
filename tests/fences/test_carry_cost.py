"""Many subjects go over from one index to another."""

import numpy as np
import pytest
from hulls import KEYED_HULLS

from dynhull import FenceIndex

MANY = 100_000


@pytest.mark.parametrize("kind", [kind for kind in KEYED_HULLS if not kind.startswith("python")])
def test_a_hundred_thousand_change_hulls_together(kind: str) -> None:
    """In proportion to their number, that is a fifth of a second; with its square, half an hour."""
    yard, road = KEYED_HULLS[kind]("int"), KEYED_HULLS[kind]("int")
    before, after = FenceIndex(yard), FenceIndex(road)
    for fences in (before, after):
        fences.set_circle(7, 0, 0, 5)
    keys, places = np.arange(MANY, dtype=np.uint64), np.random.default_rng(0).random((MANY, 2))
    yard.put_many(keys, places)
    before.take()
    yard.remove_many(keys)
    road.put_many(keys, places)
    assert after.carry(before, keys).all()
    assert len(after.take()) == MANY
    assert len(before.take()) == 0
