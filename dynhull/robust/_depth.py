"""Depth of points in convex layers."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from .._implementation import kernel
from .._tree import HullTree
from ..arrays import Points


def depth(layers: Sequence[Points], xy: Points) -> npt.NDArray[np.int64]:
    """How many of the hulls of nested layers hold each of (k, 2) points, boundary included. O(log h) each and layer."""
    depths = np.zeros(len(xy), np.int64)
    tree_type = HullTree if kernel is None else kernel.HullTree
    held = np.arange(len(xy))
    for layer in layers:
        held = held[tree_type(layer).locate(xy[held]) >= 0]
        depths[held] += 1
    return depths
