"""The part of a hull that is drawn, and the box around it."""

import numpy as np
import numpy.typing as npt

from .drawing import Points

Box = tuple[float, float, float, float]  # least x, least y, greatest x, greatest y

# No eye distinguishes more vertices, and twenty viewers would be sent megabytes.
MOST_DRAWN = 2_000


def drawn(count: int) -> slice:
    """The vertices to draw: all of them, or every k-th where there are more than `MOST_DRAWN`."""
    return slice(None, None, max(1, -(-count // MOST_DRAWN)))


def box_around(points: Points) -> Box:
    """The smallest box around some points."""
    (left, bottom), (right, top) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
    return left, bottom, right, top


def apart(points: Points, vertices: Points) -> npt.NDArray[np.bool_]:
    """Whether each point is not a vertex: these have a marker of their own."""
    return ~np.isin(points @ (1, 1j), vertices @ (1, 1j))
