"""Fences on random inputs, with allocations that fail: a short run of fuzz_fences.cpp."""

import pytest


@pytest.mark.long
def test_random_lives(fuzz):
    fuzz("fuzz_fences.cpp", "-DDYNHULL_HASH_SEED=1", runs=[map(str, range(20)), ["--seconds", "1"]])
