"""The parts of a hull tree: leaves with chains, inner nodes with bridges, and searches along them.

A leaf keeps the chain of its own points for the upper and the lower side; an inner node keeps only the bridge (a, b),
the common tangent of its children's chains:

    chain(node) = chain(left) up to a, then chain(right) from b

Both sides share all code: p is outside the edge from a to b if `SIGNS[side] * orientation(a, b, p) > 0`.
Lexicographic order is the order along x after an infinitesimal shear, so equal x need no special case. Chains are
strict: a point on the segment between two others is not a vertex.
"""

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from math import inf

from ._predicates import Point, crossing, orientation
from .static._half_chain import half_chain

UPPER, LOWER = SIDES = (0, 1)
SIGNS = (1, -1)
LOWEST, HIGHEST = (-inf, -inf), (inf, inf)

Edge = tuple[Point, Point]


class Leaf:
    """Up to LEAF distinct points in order, and the two chains of their hull."""

    __slots__ = ("chains", "points")
    height = 0

    def __init__(self, points: list[Point]) -> None:
        self.points = points
        self.chains = [half_chain(points, sign) for sign in SIGNS]

    def add(self, p: Point, side: int) -> bool:
        """Repair one chain for p, just added to the points. True if p is on it. O(points)."""
        chain, sign = self.chains[side], SIGNS[side]
        i = k = bisect_left(chain, p)
        if 0 < i < len(chain) and sign * orientation(chain[i - 1], chain[i], p) <= 0:
            return False
        while k + 1 < len(chain) and sign * orientation(p, chain[k], chain[k + 1]) >= 0:
            k += 1
        while i > 1 and sign * orientation(chain[i - 2], chain[i - 1], p) >= 0:
            i -= 1
        chain[i:k] = [p]
        return True

    def remove(self, p: Point, side: int) -> bool:
        """Repair one chain for p, just removed from the points. True if p was on it. O(points)."""
        chain = self.chains[side]
        i = bisect_left(chain, p)
        if i == len(chain) or chain[i] != p:
            return False
        first = bisect_left(self.points, chain[i - 1]) if i > 0 else 0
        last = bisect_right(self.points, chain[i + 1]) if i + 1 < len(chain) else len(self.points)
        chain[max(i - 1, 0) : i + 2] = half_chain(self.points[first:last], SIGNS[side])
        return True


class Node:
    """Two children, the point that separates them, and one bridge for each side."""

    __slots__ = ("bridges", "height", "left", "right", "separator")
    bridges: list[Edge]
    height: int

    def __init__(self, left: "Tree", right: "Tree") -> None:
        self.left = left
        self.right = right
        self.separator = first_point(right)
        self.refresh()

    def refresh(self) -> None:
        """Recompute height and bridges from the children. O(log n)."""
        self.height = 1 + max(self.left.height, self.right.height)
        self.bridges = [bridge(self.left, self.right, side) for side in SIDES]


Tree = Leaf | Node


class Cursor:
    """A binary search along the chain of a subtree.

    At every step (a, b) is an edge of the chain, and the caller chooses the side of it that holds the vertex; when one
    vertex is left, a is b.
    """

    __slots__ = ("_chain", "_first", "_highest", "_last", "_lowest", "_node", "_side", "a", "b")
    _chain: list[Point]
    _first: int
    _last: int
    a: Point
    b: Point

    def __init__(self, tree: Tree, side: int, lowest: Point = LOWEST, highest: Point = HIGHEST) -> None:
        """Search the whole chain, or the part between two of its vertices."""
        self._node = tree
        self._side = side
        self._lowest = lowest
        self._highest = highest
        self._descend()

    def go_left(self) -> None:
        """Go on at a and left of it."""
        if isinstance(self._node, Leaf):
            self._last = (self._first + self._last) // 2
            self._halve()
        else:
            self._highest = self.a
            self._node = self._node.left
            self._descend()

    def go_right(self) -> None:
        """Go on at b and right of it."""
        if isinstance(self._node, Leaf):
            self._first = (self._first + self._last) // 2 + 1
            self._halve()
        else:
            self._lowest = self.b
            self._node = self._node.right
            self._descend()

    def _descend(self) -> None:
        """Skip the bridges below the chain: those that reach beyond its ends."""
        node, side, lowest, highest = self._node, self._side, self._lowest, self._highest
        while isinstance(node, Node):
            self.a, self.b = a, b = node.bridges[side]
            if b > highest:
                node = node.left
            elif a < lowest:
                node = node.right
            else:
                self._node = node
                return
        self._node = node
        self._chain = chain = node.chains[side]
        self._first = bisect_left(chain, lowest)
        self._last = bisect_right(chain, highest) - 1
        self._halve()

    def _halve(self) -> None:
        middle = (self._first + self._last) // 2
        self.a = self._chain[middle]
        self.b = self._chain[middle + 1] if middle < self._last else self.a


def chain_of(tree: Tree, side: int, lowest: Point = LOWEST, highest: Point = HIGHEST) -> list[Point]:
    """The chain of a subtree from left to right, or the part between two of its vertices. O(log n) a vertex."""
    chain: list[Point] = []
    stack = [(tree, lowest, highest)]
    while stack:
        node, lowest, highest = stack.pop()
        if isinstance(node, Node):
            a, b = node.bridges[side]
            if b <= highest:
                stack.append((node.right, max(b, lowest), highest))
            if a >= lowest:
                stack.append((node.left, lowest, min(a, highest)))
        else:
            part = node.chains[side]
            chain += part[bisect_left(part, lowest) : bisect_right(part, highest)]
    return chain


def ring_of(tree: Tree) -> list[Point]:
    """The vertices of a subtree, counter-clockwise from the least. O(log n) a vertex."""
    return chain_of(tree, LOWER) + chain_of(tree, UPPER)[-2:0:-1]


def bridge(left: Tree, right: Tree, side: int, probes: list[tuple[Edge, Edge]] | None = None) -> Edge:
    """The edge that joins the chains of two subtrees, all of `left` before all of `right`. O(log n) orientations.

    With (a, b) an edge of the left chain, the bridge starts at a or before exactly when some point of the right chain
    is outside or on the line through a and b; likewise on the right. If both edges have each other's ends inside, their
    lines cross between the chains; on which side of `first`, the least point of the right subtree, decides.

    If `probes` is a list, the search appends the pairs of edges that it compares; an edge from a point to
    itself is the last vertex left.
    """
    sign = SIGNS[side]
    first = None
    left_cursor, right_cursor = Cursor(left, side), Cursor(right, side)
    while True:
        a, b = left_cursor.a, left_cursor.b
        c, d = right_cursor.a, right_cursor.b
        if probes is not None:
            probes.append(((a, b), (c, d)))
        if a is b and c is d:
            return a, c
        start_before = a is not b and (
            sign * orientation(a, b, c) >= 0 or (c is not d and sign * orientation(a, b, d) >= 0)
        )
        end_after = c is not d and (
            sign * orientation(c, d, a) >= 0 or (a is not b and sign * orientation(c, d, b) >= 0)
        )
        if start_before or end_after:
            if start_before:
                left_cursor.go_left()
            if end_after:
                right_cursor.go_right()
        elif c is d:
            left_cursor.go_right()
        elif a is b:
            right_cursor.go_left()
        else:
            first = first or first_point(right)
            if sign * crossing(a, b, c, d, first) >= 0:
                left_cursor.go_right()
            else:
                right_cursor.go_left()


def tangent_to_left(cursor: Cursor, p: Point, sign: int) -> Point:
    """The tangent point of the chain seen from p, which is right of the chain and outside it; the farther of two."""
    while cursor.a is not cursor.b:
        if sign * orientation(cursor.a, cursor.b, p) >= 0:
            cursor.go_left()
        else:
            cursor.go_right()
    return cursor.a


def tangent_to_right(cursor: Cursor, p: Point, sign: int) -> Point:
    """The tangent point of the chain seen from p, which is left of the chain and outside it; the farther of two."""
    while cursor.a is not cursor.b:
        if sign * orientation(cursor.a, cursor.b, p) >= 0:
            cursor.go_right()
        else:
            cursor.go_left()
    return cursor.a


def rotate(node: Node, *, to_right: bool) -> Node:
    """Rotate the higher child above an unbalanced node, in a double rotation if its inner child is higher. O(log n)."""
    if to_right:
        top = node.left
        assert isinstance(top, Node)
        if top.left.height < top.right.height:
            top = rotate(top, to_right=False)
        node.left, top.right = top.right, node
    else:
        top = node.right
        assert isinstance(top, Node)
        if top.right.height < top.left.height:
            top = rotate(top, to_right=True)
        node.right, top.left = top.left, node
    node.refresh()
    top.refresh()
    return top


def balanced(trees: Sequence[Tree]) -> Tree | None:
    """Join trees of equal height, in order, under a balanced top."""
    if len(trees) > 1:
        middle = len(trees) // 2
        left, right = balanced(trees[:middle]), balanced(trees[middle:])
        assert left is not None
        assert right is not None
        return Node(left, right)
    return trees[0] if trees else None


def first_point(tree: Tree) -> Point:
    """The least point of a subtree. O(log n)."""
    while isinstance(tree, Node):
        tree = tree.left
    return tree.points[0]


def last_point(tree: Tree) -> Point:
    """The greatest point of a subtree. O(log n)."""
    while isinstance(tree, Node):
        tree = tree.right
    return tree.points[-1]
