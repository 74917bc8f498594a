"""Hulls on the globe: their points are places on a parabola of degrees across 180 degrees.

It is convex seen from everywhere, so all of its points are vertices, as those of the parabola in the plane. A place
stands for the point with the same x, and the model knows points only.
"""

import numpy as np

from dynhull.arrays import Points
from dynhull.globe import Gnomonic
from dynhull_server.state.records import Center

# The names of these hulls.
GLOBE = ("g", "gk", "gw")
# The longitude of x = 0, and the degrees of a unit of x and of y: sums and products of these are exact.
FIRST, X_DEGREES, Y_DEGREES = 179.5, 2.0**-6, 2.0**-16
# Centres that reach the parabola, and a place on the other side of the globe, also as a centre that reaches none of it.
CENTERS = ((-180.0, 0.0), (170.0, 30.0), (-170.0, -20.0))
FAR = 3.0, -3.0


def places(name: str, points: Points) -> Points:
    """What is sent to a hull for (k, 2) points of the parabola."""
    if name not in GLOBE:
        return points
    lon = FIRST + points[:, 0] * X_DEGREES
    return np.column_stack((np.where(lon >= 180, lon - 360, lon), points[:, 1] * Y_DEGREES))


def points(name: str, lonlat: Points) -> Points:
    """The points for which (k, 2) places of a hull stand."""
    if name not in GLOBE:
        return lonlat
    lon = np.where(lonlat[:, 0] < 0, lonlat[:, 0] + 360, lonlat[:, 0])
    return np.column_stack(((lon - FIRST) / X_DEGREES, lonlat[:, 1] / Y_DEGREES))


def mean(name: str, content: Points) -> Center:
    """The centre that points choose."""
    return Gnomonic.about(places(name, content)).center
