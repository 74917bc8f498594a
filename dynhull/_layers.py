"""Convex layers, and what each vertex contributes to the area: the hull of what is left without some points."""

from bisect import bisect_left
from collections.abc import Iterator, Sequence
from copy import copy

import numpy as np
import numpy.typing as npt

from . import measure
from ._nodes import LOWER, UPPER, Leaf, Tree, bridge, chain_of, ring_of
from ._predicates import Point


def layers(tree: Tree | None) -> Iterator[list[Point]]:
    """The vertices of the hull, then those of the hull of the points left without them, and so on. O(log² n) a vertex.

    Each counter-clockwise from the least. Chazelle, "On the convex layers of a planar set" (1985).
    """
    while tree is not None:
        layer = ring_of(tree)
        yield layer
        tree = without(tree, sorted(layer))


def influence(tree: Tree) -> npt.NDArray[np.float64]:
    """For each vertex, counter-clockwise from the least, the area that the hull loses without it, rounded once.

    O(log² n) a vertex, and O(log n) for each vertex that appears.
    """
    vertices = ring_of(tree)
    areas = np.zeros(len(vertices))
    if len(vertices) > 2:
        turning = vertices.index(max(vertices))
        for i, vertex in enumerate(vertices):
            rest = without(tree, [vertex])
            assert rest is not None
            before, after = vertices[i - 1], vertices[(i + 1) % len(vertices)]
            new = _new_chain(rest, before, after, first=i == 0, last=i == turning, side=LOWER if i < turning else UPPER)
            areas[i] = measure.area(np.array([before, vertex, *new]))
    return areas


def _new_chain(tree: Tree, before: Point, after: Point, *, first: bool, last: bool, side: int) -> list[Point]:
    """The chain back from the vertex after one that is gone to the one before it, around an end if it was one."""
    if first:
        return chain_of(tree, LOWER, highest=after)[::-1] + chain_of(tree, UPPER, highest=before)
    if last:
        return chain_of(tree, UPPER, lowest=after) + chain_of(tree, LOWER, lowest=before)[::-1]
    if side == LOWER:
        return chain_of(tree, LOWER, before, after)[::-1]
    return chain_of(tree, UPPER, after, before)


def without(tree: Tree, gone: Sequence[Point]) -> Tree | None:
    """A tree without some of its points, given in order; None if none are left. O(log² n) a point.

    It shares subtrees with the first, which stays as it is. Points only go, so it is not balanced anew: it is to be
    read, not to be changed.
    """
    if not gone:
        return tree
    if isinstance(tree, Leaf):
        left_over = sorted(set(tree.points).difference(gone))
        return Leaf(left_over) if left_over else None
    middle = bisect_left(gone, tree.separator)
    left, right = without(tree.left, gone[:middle]), without(tree.right, gone[middle:])
    if left is None or right is None:
        return left or right
    new = copy(tree)
    new.left, new.right = left, right
    new.bridges = [
        bridge(left, right, side) if _holds(gone, a) or _holds(gone, b) else (a, b)  # it is above all that stay
        for side, (a, b) in enumerate(tree.bridges)
    ]
    return new


def _holds(points: Sequence[Point], p: Point) -> bool:
    i = bisect_left(points, p)
    return i < len(points) and points[i] == p
