"""A fully dynamic planar convex hull with exact answers."""

from . import static
from .hull import DynamicHull, MissingPointError
from .implementation import KERNEL
from .predicates import orient2d
from .static import convex_hull

__all__ = ["KERNEL", "DynamicHull", "MissingPointError", "convex_hull", "orient2d", "static"]
