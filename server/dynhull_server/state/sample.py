"""A few of many points."""

import numpy as np

from dynhull.arrays import Points

# Odd, so that multiplication loses nothing: the golden ratio's fraction and the second constant of MurmurHash3's end.
FACTORS = np.array([0x9E3779B97F4A7C15, 0xC4CEB9FE1A85EC53], np.uint64)
HALF = np.uint64(32)


def sample(points: Points, size: int) -> Points:
    """The `size` points of smallest hash, in the order given, of more than that. O(n).

    A point that comes or goes changes at most one of the sample, so that a picture of it does not flicker: bottom-k
    sampling (Cohen and Kaplan, "Summarizing data using bottom-k sketches", 2007).
    """
    mixed = np.ascontiguousarray(points).view(np.uint64) * FACTORS
    mixed ^= mixed >> HALF
    hashes = (mixed[:, 0] + mixed[:, 1]) * FACTORS[1]
    hashes ^= hashes >> HALF
    hashes *= FACTORS[0]
    return points[np.sort(np.argpartition(hashes, size)[:size])]
