"""The hulls that the tests run on: dynamic, and static."""

from itertools import product

from dynhull import DynamicHull, KeyedHull, convex_hull, static
from dynhull._entities import Entities
from dynhull._implementation import kernel
from dynhull._tree import HullTree
from dynhull.arrays import as_points


class PythonHull(DynamicHull):
    __slots__ = ()
    _tree_type = HullTree


class TinyLeafTree(HullTree):
    """Splits, merges and rotates all the time."""

    LEAF = 4


class TinyLeafHull(DynamicHull):
    __slots__ = ()
    _tree_type = TinyLeafTree


class PythonKeyedHull(KeyedHull):
    __slots__ = ()
    _tree_type = Entities


class TinyLeafEntities(Entities):
    LEAF = 4


class TinyLeafKeyedHull(KeyedHull):
    __slots__ = ()
    _tree_type = TinyLeafEntities


HULLS = {"python": PythonHull, "python, tiny leaves": TinyLeafHull}
KEYED_HULLS = {"python": PythonKeyedHull, "python, tiny leaves": TinyLeafKeyedHull}

if kernel is not None:

    class KernelHull(DynamicHull):
        __slots__ = ()
        _tree_type = kernel.HullTree

    HULLS["cpp"] = KernelHull

    class KernelKeyedHull(KeyedHull):
        __slots__ = ()
        _tree_type = kernel.Entities

    KEYED_HULLS["cpp"] = KernelKeyedHull


def chan_step_by_step(xy, collinear="drop"):
    """In Python, whether there is a kernel or not."""
    return static.chan(xy, collinear, trace=[])


# These take `collinear`.
ALGORITHMS = {
    f.__name__: f
    for f in (static.graham_scan, static.jarvis_march, static.monotone_chain, static.chan, chan_step_by_step)
}
ONE_SHOT = {"convex_hull": convex_hull}

if kernel is not None:

    def one_shot(discard, threads):
        return lambda xy: kernel.convex_hull(as_points(xy), discard, threads)

    for discard, threads in product((False, True), repeat=2):
        ONE_SHOT[f"convex_hull, discard {discard}, threads {threads}"] = one_shot(discard, threads)
