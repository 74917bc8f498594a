"""The hulls that the core tests run on."""

from dynhull import DynamicHull
from dynhull.tree import HullTree


class TinyLeafTree(HullTree):
    """Splits, merges and rotates all the time."""

    LEAF = 4


class TinyLeafHull(DynamicHull):
    __slots__ = ()
    _tree_type = TinyLeafTree


HULLS = {"python": DynamicHull, "python, tiny leaves": TinyLeafHull}
