"""Shapes that a few bad points cannot spoil: depth in convex layers, and the points nearest to the centre of all."""

from ._depth import depth
from ._nearest import nearest_points

__all__ = ["depth", "nearest_points"]
