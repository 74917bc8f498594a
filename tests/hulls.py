"""The hulls that the core tests run on."""

from dynhull import DynamicHull
from dynhull.implementation import kernel
from dynhull.tree import HullTree


class PythonHull(DynamicHull):
    __slots__ = ()
    _tree_type = HullTree


class TinyLeafTree(HullTree):
    """Splits, merges and rotates all the time."""

    LEAF = 4


class TinyLeafHull(DynamicHull):
    __slots__ = ()
    _tree_type = TinyLeafTree


HULLS = {"python": PythonHull, "python, tiny leaves": TinyLeafHull}

if kernel is not None:

    class KernelHull(DynamicHull):
        __slots__ = ()
        _tree_type = kernel.HullTree

    HULLS["cpp"] = KernelHull
