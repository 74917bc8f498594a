"""Python's garbage collector, which looks for cycles of objects that nobody refers to."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from time import monotonic
from typing import Any

# So many objects more than at the last collection bring the next one: batches that wait for their commit are thousands,
# and to look at them finds nothing.
YOUNG = 10_000
OLDEST = 2
# A collection of all objects is followed by a pause of at least so many times its duration.
PAUSE_FACTOR = 1000.0


@contextmanager
def without_collections() -> Iterator[None]:
    """A block that makes much and drops little: searching it for garbage again and again takes a fifth of the time.

    Within `few_collections`, what it has made is set aside as what was there before: not searched until it is time.
    """
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if gc.get_freeze_count():
            gc.freeze()
        if enabled:
            gc.enable()


@contextmanager
def few_collections() -> Iterator[None]:
    """Collect what requests leave behind, and seldom look at all objects: among many hulls that takes 100 ms and more.

    What has outlived a collection of the oldest generation is set aside, until the next one for which it is time. What
    was set aside before stays so, with what came to it: a collector has one place for both.
    """
    before, collections, aside = gc.get_threshold(), _Collections(), gc.get_freeze_count()
    gc.freeze()
    gc.set_threshold(YOUNG, *before[1:])
    gc.callbacks.append(collections.noticed)
    try:
        yield
    finally:
        gc.callbacks.remove(collections.noticed)
        gc.set_threshold(*before)
        if not aside:
            gc.unfreeze()


class _Collections:
    def __init__(self) -> None:
        self._begun = self._next = monotonic()
        self._all = False

    def noticed(self, phase: str, info: dict[str, Any]) -> None:
        """A collection begins or has ended."""
        if info["generation"] < OLDEST:
            return
        if phase == "start":
            self._begun = monotonic()
            self._all = self._begun >= self._next
            if self._all:
                gc.unfreeze()
        else:
            gc.freeze()
            if self._all:
                ended = monotonic()
                self._next = ended + PAUSE_FACTOR * (ended - self._begun)
