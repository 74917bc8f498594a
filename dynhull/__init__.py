"""A fully dynamic planar convex hull with exact answers."""

from sys import modules as _modules

from . import _hull, static
from ._hull import DynamicHull, MissingPointError
from ._implementation import KERNEL
from ._predicates import orient2d
from .static import convex_hull

__all__ = ["KERNEL", "DynamicHull", "MissingPointError", "convex_hull", "orient2d", "static"]

for _public in (DynamicHull, MissingPointError):
    _public.__module__ = "dynhull"
_modules["dynhull.hull"] = _hull  # where pickles of version 0.1 look for the classes
