"""The worst case of an update, in counted orientations: O(log² n) whatever the input."""

import math

import pytest
from hulls import TinyLeafTree
from update_steps import WORKLOADS, count_steps


@pytest.mark.every(5)
@pytest.mark.parametrize("name", WORKLOADS)
@pytest.mark.parametrize("n", [1000, 4000, 16000])
def test_no_update_takes_more_than_log_squared(name, n):
    steps = count_steps(name, n, 600, TinyLeafTree)  # tiny leaves: the deepest tree, and no cost hidden in a leaf
    assert 0 < steps.worst <= 5 * math.log2(n) ** 2
    assert sum(steps.inserts + steps.deletes) / 1200 <= 6 * math.log2(n)
