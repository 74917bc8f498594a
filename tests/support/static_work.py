"""Counted work of the static algorithms: orientations, and comparisons by sorts and binary searches."""

import functools
import math
from bisect import bisect_left
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np

from dynhull import static

ALGORITHMS: dict[str, Callable[..., np.ndarray]] = {
    "graham_scan": static.graham_scan,
    "monotone_chain": static.monotone_chain,
    "jarvis_march": static.jarvis_march,
    "chan": static.chan,
}


@dataclass(frozen=True)
class Work:
    algorithm: str
    n: int
    h: int
    orientations: int
    comparisons: int  # of coordinates, by a sort or a binary search

    @property
    def steps(self) -> int:
        return self.orientations + self.comparisons


def points_with_vertices(n: int, h: int) -> np.ndarray:
    """n points in random order: h vertices on the unit circle, the others in a disk inside their polygon."""
    rng = np.random.default_rng(n + h)
    angle = 2 * math.pi * np.arange(h) / h
    corners = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    angle = 2 * math.pi * rng.random(n - h)
    radius = 0.99 * math.cos(math.pi / h) * np.sqrt(rng.random(n - h))
    inside = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return rng.permutation(np.concatenate([corners, inside]))


@contextmanager
def counted() -> Iterator[dict[str, int]]:
    """Count orientations, and comparisons of points by sorts and binary searches, in all static algorithms."""
    counts = {"orientations": 0, "comparisons": 0}
    names = [function.__globals__ for function in ALGORITHMS.values()]
    orientation = names[0]["orientation"]

    def counting_orientation(a, b, c):
        counts["orientations"] += 1
        return orientation(a, b, c)

    def counting_sorted(values, key=None):
        def compare(p, q):
            counts["comparisons"] += 1
            return -1 if p < q else 1

        return sorted(values, key=key or functools.cmp_to_key(compare))

    def counting_bisect(chain, p):
        counts["comparisons"] += len(chain).bit_length()  # one more than it needs, now and then
        return bisect_left(chain, p)

    chan = static.chan.__globals__
    kernel, chan["kernel"] = chan["kernel"], None  # what it does cannot be counted from here
    chan["bisect_left"] = counting_bisect
    for module in names:
        module["orientation"], module["sorted"] = counting_orientation, counting_sorted
    try:
        yield counts
    finally:
        chan["bisect_left"], chan["kernel"] = bisect_left, kernel
        for module in names:
            module["orientation"] = orientation
            del module["sorted"]


def count(algorithm: str, n: int, h: int) -> Work:
    xy = points_with_vertices(n, h)
    with counted() as counts:
        hull = ALGORITHMS[algorithm](xy)
    assert len(hull) == h
    return Work(algorithm, n, h, counts["orientations"], counts["comparisons"])
