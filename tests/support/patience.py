"""Waiting for a condition, with a time limit."""

import time
from collections.abc import Callable

PATIENCE = 60  # seconds


def wait_until(condition: Callable[[], object]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"not within {PATIENCE} s"
        time.sleep(0.001)
