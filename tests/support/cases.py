"""Tests that take too long for every run."""

import os

import pytest

ALL_CASES = os.environ.get("CLUSTER_CASES") == "all"
with_all_cases = pytest.mark.only_with("CLUSTER_CASES")  # many servers start, or again and again
slow = pytest.mark.only_with("SLOW_CASES")  # tortures, fuzzers and the like, in short runs
