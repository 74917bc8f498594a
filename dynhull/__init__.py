"""A fully dynamic planar convex hull with exact answers."""

from . import static
from .hull import DynamicHull, MissingPointError
from .predicates import orient2d
from .static import convex_hull

__all__ = ["DynamicHull", "MissingPointError", "convex_hull", "orient2d", "static"]
