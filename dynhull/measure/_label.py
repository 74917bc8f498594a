"""A point of a hull for its label."""

import numpy as np

from .._rings import ring_signs
from ..arrays import Points
from ._area import centroid


def label_point(vertices: Points) -> tuple[float, float]:
    """The centroid, which is inside of a convex polygon; NaN for no vertices. O(h).

    A vertex where rounding leads outside, as in slivers, and for fewer than three vertices.
    """
    x, y = centroid(vertices)
    if len(vertices) > 2 and ring_signs(vertices, np.array([(x, y)]))[0] > 0:
        return x, y
    return (x, y) if not len(vertices) else (vertices[0, 0].item(), vertices[0, 1].item())
