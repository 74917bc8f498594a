"""Tests that take too long for every run."""

import os

import pytest

with_all_cases = pytest.mark.skipif(
    os.environ.get("CLUSTER_CASES") != "all", reason="with `make cluster`: many servers start, or again and again"
)
