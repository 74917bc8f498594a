"""Measures of a convex polygon given by its (h, 2) vertices, in the order of `DynamicHull.vertices`.

O(h log h) at most. Choices between vertices and edges are exact: most are made in floating point with a bound on the
error, and exact integers decide the rest.
"""

from ._area import area, centroid, perimeter
from ._box import min_box, min_perimeter_box
from ._circle import min_circle
from ._comparison import Compared, LastVertices, compare
from ._extent import bounds, diameter, width
from ._label import label_point
from ._lines import distance, intersect_lines
from ._summary import FEW, Summary, summary

__all__ = [
    "FEW",
    "Compared",
    "LastVertices",
    "Summary",
    "area",
    "bounds",
    "centroid",
    "compare",
    "diameter",
    "distance",
    "intersect_lines",
    "label_point",
    "min_box",
    "min_circle",
    "min_perimeter_box",
    "perimeter",
    "summary",
    "width",
]
