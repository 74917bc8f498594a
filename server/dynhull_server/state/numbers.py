"""Points as single numbers: numpy sorts and compares only these."""

import numpy as np
import numpy.typing as npt

from dynhull.arrays import Points


def as_numbers(points: Points) -> npt.NDArray[np.complex128]:
    """One complex number for each of (k, 2) points; they are ordered as the points are, by x, then by y."""
    return np.ascontiguousarray(points).view(np.complex128).ravel()


def rows_of(points: Points, among: Points) -> npt.NDArray[np.intp]:
    """The row of each point among different ones, all of which are there. O((k + n) log n)."""
    numbers = as_numbers(among)
    order = np.argsort(numbers)
    return order[np.searchsorted(numbers, as_numbers(points), sorter=order)]
