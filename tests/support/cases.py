"""Tests that take too long for every run."""

import pytest

with_all_cases = pytest.mark.only_with("CLUSTER_CASES")  # many servers start, or again and again
