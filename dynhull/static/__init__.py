"""Static convex hulls: the judges of the dynamic one. All give the same vertices in the same order."""

from .chan import chan
from .monotone_chain import monotone_chain

convex_hull = monotone_chain

__all__ = ["chan", "convex_hull", "monotone_chain"]
