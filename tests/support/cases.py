"""Tests that take too long for every run."""

import os

import pytest
from hypothesis import settings

ALL_CASES = os.environ.get("CLUSTER_CASES") == "all"
with_all_cases = pytest.mark.only_with("CLUSTER_CASES")  # many servers start, or again and again
in_browser = pytest.mark.only_with("BROWSER_CASES")  # pages in a real Chromium, but for some
slow = pytest.mark.only_with("SLOW_CASES")  # tortures, fuzzers and the like, in short runs

# Points between snapshots, few or more than there are, and whether the server is killed.
RESTARTS = [
    (1, True),
    (1_000_000, False),
    *[pytest.param(*each, marks=slow) for each in ((1, False), (1_000_000, True))],
]


def one_of(many: int, **more: int) -> settings:
    """One of so many examples of the profile, for properties whose examples take long: `make properties` has more."""
    return settings(max_examples=max(settings.default.max_examples // many, 1), **more)
