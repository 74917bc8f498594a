"""Static convex hulls, the reference for the dynamic one. All return the same vertices in the same order."""

from .chan import chan
from .convex_hull import convex_hull
from .graham import graham_scan
from .hull_nd import HullND, hull_nd
from .jarvis import jarvis_march
from .monotone_chain import monotone_chain

__all__ = ["HullND", "chan", "convex_hull", "graham_scan", "hull_nd", "jarvis_march", "monotone_chain"]
