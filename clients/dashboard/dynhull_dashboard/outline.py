"""The part of a hull that is drawn, and the frame around it."""

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from .drawing import Points

Box = tuple[float, float, float, float]  # least x, least y, greatest x, greatest y

# No eye distinguishes more vertices, and twenty viewers would be sent megabytes.
MOST_DRAWN = 2_000
# The frame is larger than its content by this share on each side.
MARGIN = 0.08
# A new frame is made when the content fills less than this share of the old one.
LEAST_FILLED = 0.5


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


def frame_around(boxes: Iterable[Box], frame: Box | None, same_scale: bool = True) -> Box | None:
    """The region that a picture shows: the old frame while the boxes fit and fill it, else a new one.

    The picture therefore stands still while the hulls in it move. With one scale for both axes the boxes fill the
    frame along either of them, otherwise along both.
    """
    corners = np.array(list(boxes))
    if not len(corners):
        return frame
    low, high = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
    if frame is not None:
        inside = bool((low >= frame[:2]).all() and (high <= frame[2:]).all())
        sizes = np.subtract(frame[2:], frame[:2])
        filled = (high - low) >= LEAST_FILLED * sizes
        if inside and (filled.any() if same_scale else filled.all()):
            return frame
    size = high - low
    if same_scale or not size.any():
        size = np.full(2, size.max())
    # Points in a row, or a single point, have no size along an axis: their distance from zero serves instead.
    size = np.where(size > 0, size, np.maximum(np.abs(high), np.abs(low)))
    size = np.where(size > 0, size, 1.0)
    low, high = low - MARGIN * size, high + MARGIN * size
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
