"""Static convex hulls, the reference for the dynamic one. All return the same vertices in the same order."""

from ._chan import chan
from ._convex_hull import convex_hull
from ._graham import graham_scan
from ._hull_nd import HullND, hull_nd
from ._jarvis import jarvis_march
from ._monotone_chain import monotone_chain

__all__ = ["HullND", "chan", "convex_hull", "graham_scan", "hull_nd", "jarvis_march", "monotone_chain"]
