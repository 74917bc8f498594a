"""A sample of many points."""

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points

# Odd, so that multiplication is invertible: the fraction of the golden ratio, and the second constant of MurmurHash3's
# finalizer.
FACTORS = np.array([0x9E3779B97F4A7C15, 0xC4CEB9FE1A85EC53], np.uint64)
HALF = np.uint64(32)


def sample(points: Points, size: int) -> Points:
    """The `size` points of smallest hash, in their given order; `points` must have more rows. O(n)."""
    return points[sample_rows(points, size)]


def sample_rows(points: Points, size: int) -> npt.NDArray[np.intp]:
    """The rows of the `size` points of smallest hash, ascending; `points` must have more rows. O(n).

    An insert or delete changes at most one point of the sample, so a picture of it does not flicker: bottom-k sampling
    (Cohen and Kaplan, "Summarizing data using bottom-k sketches", 2007). Of points with equal hashes the first ones are
    taken, so that a sample of samples of parts is the sample of all, if all are in the same order.
    """
    mixed = np.ascontiguousarray(points).view(np.uint64) * FACTORS
    mixed ^= mixed >> HALF
    hashes = (mixed[:, 0] + mixed[:, 1]) * FACTORS[1]
    hashes ^= hashes >> HALF
    hashes *= FACTORS[0]
    least_left_out = np.partition(hashes, size)[size]
    below = np.flatnonzero(hashes < least_left_out)
    equal = np.flatnonzero(hashes == least_left_out)[: size - len(below)]
    return np.sort(np.concatenate([below, equal]))
