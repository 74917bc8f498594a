"""A hull as it is drawn, made once for all viewers."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Points = npt.NDArray[np.float64]
Box = tuple[float, float, float, float]

# More vertices than this no eye tells apart, and twenty viewers would be sent megabytes.
MOST_DRAWN = 2_000
# The frame is this much larger than what it shows, on each side.
MARGIN = 0.08
# It is drawn anew around what has become so much smaller.
LEAST_FILLED = 0.5


@dataclass(frozen=True, slots=True)
class Outline:
    """The vertices to draw, in boundary order: every one, or where they are too many, every k-th.

    Attributes:
        revision: when the hull became so.
        vertices: (h, 2), at most `MOST_DRAWN`.
        of: how many vertices the hull has.
        bounds: the hull's least x, least y, greatest x, greatest y; None where it is empty.
    """

    revision: int
    vertices: Points
    of: int
    bounds: Box | None

    @classmethod
    def around(cls, revision: int, vertices: Points) -> "Outline":
        """The outline of a hull."""
        if not len(vertices):
            return cls(revision, vertices, 0, None)
        least, greatest = vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()
        every = -(-len(vertices) // MOST_DRAWN)
        return cls(revision, vertices[::every], len(vertices), (*least, *greatest))


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
