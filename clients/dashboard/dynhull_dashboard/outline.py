"""What of a hull is drawn, and where."""

from collections.abc import Iterable

import numpy as np

from .drawing import Points

Box = tuple[float, float, float, float]  # least x, least y, greatest x, greatest y

# More vertices than this no eye tells apart, and twenty viewers would be sent megabytes.
MOST_DRAWN = 2_000
# The frame is this much larger than what it shows, on each side.
MARGIN = 0.08
# It is drawn anew around what has become so much smaller.
LEAST_FILLED = 0.5


def outline(vertices: Points) -> Points:
    """The vertices to draw: every one, or where they are too many, every k-th."""
    return vertices[:: max(1, -(-len(vertices) // MOST_DRAWN))]


def without(points: Points, vertices: Points) -> Points:
    """The points that are no vertices: those have a mark of their own."""
    return points[~np.isin(points @ (1, 1j), vertices @ (1, 1j))]


def frame_around(boxes: Iterable[Box], frame: Box | None) -> Box | None:
    """What a picture shows: the frame there was, as long as it holds the boxes and they fill it; else a new one.

    So the picture stands still while the hulls in it move.
    """
    corners = np.array(list(boxes))
    if not len(corners):
        return frame
    low, high = corners[:, :2].min(axis=0), corners[:, 2:].max(axis=0)
    if frame is not None:
        inside = bool((low >= frame[:2]).all() and (high <= frame[2:]).all())
        sizes = np.subtract(frame[2:], frame[:2])
        if inside and ((high - low) >= LEAST_FILLED * sizes).any():
            return frame
    # A single point has no size to go by.
    size = float((high - low).max()) or float(np.abs(high).max()) or 1.0
    low, high = low - MARGIN * size, high + MARGIN * size
    return float(low[0]), float(low[1]), float(high[0]), float(high[1])
