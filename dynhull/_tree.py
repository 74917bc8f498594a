"""HullTree: a fully dynamic planar convex hull, the readable reference.

Overmars and van Leeuwen, "Maintenance of configurations in the plane" (1981), with bridges only and fat leaves. An AVL
tree holds the points in lexicographic order, up to LEAF of them in a leaf; `_nodes.py` has its parts. An update repairs
chains and bridges from the leaf upwards, and stops as soon as its point is not on the hull of a subtree: for most
updates, early.
"""

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, nullcontext
from itertools import islice, pairwise
from typing import Self

import numpy as np
import numpy.typing as npt

from . import measure
from ._layers import influence, layers
from ._nodes import (
    LOWER,
    SIDES,
    SIGNS,
    UPPER,
    Cursor,
    Edge,
    Leaf,
    Node,
    Tree,
    balanced,
    bridge,
    chain_of,
    first_point,
    ring_of,
    rotate,
    tangent_to_left,
    tangent_to_right,
)
from ._predicates import Point, direction_sign, orientation
from ._sketch import sketch
from .arrays import Points, as_coordinate, as_points


class HullTree:
    """A multiset of points and its convex hull.

    Single coordinates are checked, and so are the arrays of `__init__`, `apply` and `locate`. Callers ensure that other
    arrays hold finite floats without negative zeros.

    O(log² n) an update, O(log n) a query, O(n) space.
    """

    LEAF = 64  # the most distinct points in a leaf: measured, see benchmarks/tree.py

    def __init__(self, xy: npt.ArrayLike | None = None) -> None:
        """Build from an (n, 2) array-like, checked by `as_points`. O(n log n)."""
        self._root: Tree | None = None
        self._copies: dict[Point, int] = {}  # numbers of copies, of the points with more than one
        self._size = 0
        self._distinct = 0
        self.changes = 0
        if xy is not None:
            self._build(Counter(_tuples(as_points(xy))))

    # What a tree of places on the globe does in its own way: see `_globe_tree`.

    @staticmethod
    def _as_points(xy: npt.ArrayLike) -> Points:
        """Points of an argument, checked."""
        return as_points(xy)

    @staticmethod
    def _as_point(x: float, y: float) -> Point:
        """A point of two arguments, checked."""
        return as_coordinate(x, "x"), as_coordinate(y, "y")

    def _in_frame(
        self,
        points: Sequence[Point],  # noqa: ARG002
        name: str = "points row {}",  # noqa: ARG002
        inserted: npt.NDArray[np.bool_] | bool = True,  # noqa: ARG002
    ) -> AbstractContextManager[None]:
        """A context for a batch that inserts points. ValueError if one of them has no place in the tree."""
        return nullcontext()

    def __len__(self) -> int:
        return self._size

    @property
    def distinct(self) -> int:
        """The number of different points."""
        return self._distinct

    def clear(self) -> None:
        """Remove every point."""
        if self._root is not None:
            self._build(Counter())
            self.changes += 1

    def count(self, x: float, y: float) -> int:
        """The number of copies of the point. O(log n)."""
        return self._count(self._as_point(x, y))

    def count_many(self, xy: Points) -> npt.NDArray[np.int64]:
        """The number of copies of each row. O(log n) a row."""
        return np.array([self._count(p) for p in _tuples(xy)], dtype=np.int64)

    def _count(self, p: Point) -> int:
        node = self._root
        if node is None:
            return 0
        while isinstance(node, Node):
            node = node.right if p >= node.separator else node.left
        i = bisect_left(node.points, p)
        if i < len(node.points) and node.points[i] == p:
            return self._copies.get(p, 1)
        return 0

    def copy(self) -> Self:
        """An independent tree of the same points. O(n)."""
        new = type(self)()
        new._build(Counter({p: self._copies.get(p, 1) for p in self._all_points()}))
        new.changes = self.changes
        return new

    # Updates

    def insert(self, x: float, y: float) -> bool:
        """Add a point. True if the hull changed. O(log² n)."""
        changed = self._insert(self._as_point(x, y), 1)
        self.changes += changed
        return changed

    def delete(self, x: float, y: float) -> bool:
        """Remove one copy of a point. True if the hull changed; KeyError if the point is missing. O(log² n)."""
        changed = self._delete(self._as_point(x, y), 1)
        self.changes += changed
        return changed

    def apply(self, ops: int | npt.NDArray[np.int8], xy: npt.ArrayLike, ignore_missing: bool) -> int:
        """Insert the rows with +1 and delete those with -1, as a set: the order of rows does not matter.

        Args:
            ops: one number for each row, or one for all rows.
            xy: (n, 2) array-like, checked by `as_points`.
            ignore_missing: whether to skip rows that delete a missing point.

        Returns:
            The number of rows applied.

        Raises:
            KeyError: x, y and row of the first delete of a missing point; nothing has been applied.
        """
        points = _tuples(self._as_points(xy))
        ops = np.broadcast_to(ops, len(points))
        with self._in_frame(points, inserted=ops > 0):
            return self._apply(ops, points, ignore_missing)

    def _apply(self, ops: npt.NDArray[np.int8], points: list[Point], ignore_missing: bool) -> int:
        net = Counter(p for p, op in zip(points, ops.tolist(), strict=True) if op > 0)
        applied = len(points)
        for row in np.flatnonzero(ops < 0).tolist():
            p = points[row]
            if net[p] + self._count(p) > 0:
                net[p] -= 1
                continue
            if not ignore_missing:
                raise KeyError(*p, row)
            applied -= 1
        self._apply_net(net)
        return applied

    def _apply_net(self, net: Counter[Point]) -> None:
        """Change numbers of copies as one batch. The points with a negative change have enough copies."""
        if self._distinct <= sum(1 for change in net.values() if change > 0):
            changed = self._rebuild(net)
        else:
            changed = False
            for p, change in sorted(net.items()):
                if change > 0:
                    changed |= self._insert(p, change)
                elif change < 0:
                    changed |= self._delete(p, -change)
        self.changes += changed

    def _insert(self, p: Point, copies: int) -> bool:
        self._size += copies
        if self._root is None:
            self._root = Leaf([p])
            self._distinct = 1
            if copies > 1:
                self._copies[p] = copies
            return True
        path, leaf = self._path(p)
        i = bisect_left(leaf.points, p)
        if i < len(leaf.points) and leaf.points[i] == p:
            self._copies[p] = self._copies.get(p, 1) + copies
            return False
        leaf.points.insert(i, p)
        self._distinct += 1
        if copies > 1:
            self._copies[p] = copies
        changed = False
        for side in SIDES:
            if leaf.add(p, side):
                changed |= self._climb_added(path, p, side)
        if len(leaf.points) > self.LEAF:
            self._split(path, leaf)
            self._rebalance(path)
        return changed

    def _delete(self, p: Point, copies: int) -> bool:
        if self._root is None:
            raise KeyError(*p)
        path, leaf = self._path(p)
        i = bisect_left(leaf.points, p)
        if i == len(leaf.points) or leaf.points[i] != p:
            raise KeyError(*p)
        self._size -= copies
        left_over = self._copies.pop(p, 1) - copies
        if left_over > 1:
            self._copies[p] = left_over
        if left_over > 0:
            return False
        del leaf.points[i]
        self._distinct -= 1
        sides = [side for side in SIDES if leaf.remove(p, side)]
        if not leaf.points:
            self._drop(path, leaf)
        changed = False
        for side in sides:
            changed |= self._climb_removed(path, p, side)
        if not leaf.points or (len(leaf.points) < self.LEAF // 4 and self._merge(path, leaf)):
            self._rebalance(path)
        return changed

    def _path(self, p: Point) -> tuple[list[Node], Leaf]:
        """The nodes from the root to the leaf where p belongs, and that leaf."""
        path = []
        node = self._root
        while isinstance(node, Node):
            path.append(node)
            node = node.right if p >= node.separator else node.left
        assert node is not None
        return path, node

    def _climb_added(self, path: list[Node], p: Point, side: int) -> bool:
        """Repair the bridges above p, new on its leaf's chain. True if p reaches the root's chain."""
        for node in reversed(path):  # noqa: SIM110  # a generator would cost a tenth of an update
            if not self._add_at(node, p, side):
                return False
        return True

    def _add_at(self, node: Node, p: Point, side: int) -> bool:
        """Repair a node's bridge for p, new on its child's chain. True if p is on the node's chain."""
        sign = SIGNS[side]
        a, b = node.bridges[side]
        on_left = p < node.separator
        turn = sign * orientation(a, b, p)
        beyond = p < a if on_left else p > b
        if turn > 0 or (turn == 0 and beyond):
            if on_left:
                node.bridges[side] = p, tangent_to_right(Cursor(node.right, side), p, sign)
            else:
                node.bridges[side] = tangent_to_left(Cursor(node.left, side), p, sign), p
            return True
        return beyond

    def _climb_removed(self, path: list[Node], p: Point, side: int) -> bool:
        """Repair the bridges above p, gone from its leaf's chain. True if p was on the root's chain."""
        for node in reversed(path):  # noqa: SIM110  # a generator would cost a tenth of an update
            if not self._remove_at(node, p, side):
                return False
        return True

    def _remove_at(self, node: Node, p: Point, side: int) -> bool:
        """Repair a node's bridge for p, gone from its child's chain. True if p was on the node's chain."""
        a, b = node.bridges[side]
        if p in (a, b):
            node.bridges[side] = bridge(node.left, node.right, side)
            return True
        return not a < p < b

    # Balance

    def _replace(self, path: list[Node], old: Tree, new: Tree) -> None:
        """Replace a subtree below the last node of the path."""
        if not path:
            self._root = new
        elif path[-1].left is old:
            path[-1].left = new
        else:
            path[-1].right = new

    def _split(self, path: list[Node], leaf: Leaf) -> None:
        """Halve a leaf that has too many points."""
        half = len(leaf.points) // 2
        self._replace(path, leaf, Node(Leaf(leaf.points[:half]), Leaf(leaf.points[half:])))

    def _drop(self, path: list[Node], leaf: Leaf) -> None:
        """Remove an empty leaf; its sibling replaces their parent."""
        if not path:
            self._root = None
            return
        parent = path.pop()
        self._replace(path, parent, parent.right if parent.left is leaf else parent.left)

    def _merge(self, path: list[Node], leaf: Leaf) -> bool:
        """Move a small leaf's points into the adjacent leaf below the same parent. False if they do not fit."""
        if not path:
            return False
        parent = path[-1]
        on_left = parent.left is leaf
        sibling = parent.right if on_left else parent.left
        neighbour = sibling
        if isinstance(sibling, Node):
            neighbour = sibling.left if on_left else sibling.right
        assert isinstance(neighbour, Leaf)  # the AVL condition: a leaf's sibling is at most one level higher
        if len(neighbour.points) + len(leaf.points) > self.LEAF * 3 // 4:
            return False
        merged = Leaf(leaf.points + neighbour.points if on_left else neighbour.points + leaf.points)
        path.pop()
        if isinstance(sibling, Node):
            self._replace(path, parent, sibling)
            self._replace([sibling], neighbour, merged)
            sibling.refresh()
        else:
            self._replace(path, parent, merged)
        return True

    def _rebalance(self, path: list[Node]) -> None:
        """Restore the AVL condition along a path, from its end upwards; stop at the first unchanged height."""
        while path:
            node = path.pop()
            lean = node.left.height - node.right.height
            if abs(lean) > 1:
                self._rotate(path, node, to_right=lean > 0)
                continue
            height = 1 + max(node.left.height, node.right.height)
            if height == node.height:
                return
            node.height = height

    def _rotate(self, path: list[Node], node: Node, *, to_right: bool) -> None:
        """Put the higher child of a node in its place."""
        self._replace(path, node, rotate(node, to_right=to_right))

    def _build(self, counts: Counter[Point]) -> None:
        """Replace the contents by distinct points with their numbers of copies."""
        points = sorted(counts)
        self._copies = {p: count for p, count in counts.items() if count > 1}
        self._size = counts.total()
        self._distinct = len(points)
        fill = max(self.LEAF * 3 // 4, 1)
        self._root = balanced([Leaf(points[i : i + fill]) for i in range(0, len(points), fill)])

    def _rebuild(self, net: Counter[Point]) -> bool:
        """Apply a batch as large as the tree by building a new tree."""
        before = self._vertices()
        counts = Counter({p: self._copies.get(p, 1) for p in self._all_points()})
        counts.update(net)
        self._build(+counts)
        return self._vertices() != before

    # The hull

    def points(self) -> Points:
        """All points in lexicographic order, with multiplicity. O(n)."""
        copies = self._copies
        return _array([p for point in self._all_points() for p in [point] * copies.get(point, 1)])

    def vertices(self) -> Points:
        """The hull's vertices, counter-clockwise from the least. O(h log n)."""
        return _array(self._vertices())

    def chain(self, side: int) -> Points:
        """The upper (0) or lower (1) chain from left to right. O(h log n)."""
        return _array(self._chain(side))

    def _all_points(self) -> Iterator[Point]:
        stack = [self._root]
        while stack:
            node = stack.pop()
            if isinstance(node, Node):
                stack += (node.right, node.left)
            elif node is not None:
                yield from node.points

    def _vertices(self) -> list[Point]:
        return [] if self._root is None else ring_of(self._root)

    def _chain(self, side: int) -> list[Point]:
        return [] if self._root is None else chain_of(self._root, side)

    # Queries

    def locate(self, xy: npt.ArrayLike) -> npt.NDArray[np.int8]:
        """+1 inside, 0 on the boundary, -1 outside, for each row. O(log n) a row."""
        return np.array([self._locate(p)[0] for p in _tuples(self._as_points(xy))], dtype=np.int8)

    def support(self, directions: Points) -> Points:
        """The farthest vertex in each direction, the lexicographically smaller of two. O(log n) a row."""
        return _array([self._support(d) for d in _tuples(directions)])

    def tangents(self, xy: Points) -> npt.NDArray[np.float64]:
        """The left and the right tangent point seen from each row, NaN unless the row is outside. O(log n) a row."""
        nothing = ((np.nan, np.nan), (np.nan, np.nan))
        rows = [self._tangents(p) or nothing for p in _tuples(xy)]
        return np.array(rows, dtype=np.float64).reshape(len(rows), 2, 2)

    def distance(self, xy: Points) -> npt.NDArray[np.float64]:
        """The distance of each row to the hull, rounded once; inf without points. O(h + log n a row)."""
        return measure.distance(self.vertices(), self.tangents(xy), xy)

    def intersect_lines(self, p: Points, q: Points) -> npt.NDArray[np.float64]:
        """Where the line through p and q of each row enters and leaves the hull. O(h + log n a row)."""
        return measure.intersect_lines(self.vertices(), p, q)

    def _locate(self, p: Point) -> tuple[int, int, Edge]:
        """Where p is; outside, also the side and the edge beyond which it is: (p, p) if it precedes or follows all."""
        beyond_the_ends = UPPER, (p, p)
        inside = 1
        if self._root is None:
            return -1, *beyond_the_ends
        for side in SIDES:
            node = self._root
            while isinstance(node, Node):
                a, b = node.bridges[side]
                if p <= a:
                    node = node.left
                elif p >= b:
                    node = node.right
                else:
                    break
            else:
                chain = node.chains[side]
                i = bisect_left(chain, p)
                if i < len(chain) and chain[i] == p:
                    return 0, *beyond_the_ends
                if i in (0, len(chain)):
                    return -1, *beyond_the_ends
                a, b = chain[i - 1], chain[i]
            turn = SIGNS[side] * orientation(a, b, p)
            if turn > 0:
                return -1, side, (a, b)
            inside = min(inside, -turn)
        return inside, *beyond_the_ends

    def _support(self, d: Point) -> Point:
        assert self._root is not None
        cursor = Cursor(self._root, UPPER if d[1] > 0 or (d[1] == 0 and d[0] < 0) else LOWER)
        while cursor.a is not cursor.b:
            if direction_sign(d, cursor.a, cursor.b) > 0:
                cursor.go_right()
            else:
                cursor.go_left()
        return cursor.a

    def _tangents(self, p: Point) -> Edge | None:
        where, side, (a, b) = self._locate(p)
        if self._root is None or where >= 0:
            return None
        root = self._root
        if a is not b:
            before = tangent_to_left(Cursor(root, side, highest=a), p, SIGNS[side])
            after = tangent_to_right(Cursor(root, side, lowest=b), p, SIGNS[side])
            return (after, before) if side == UPPER else (before, after)
        if p < first_point(root):
            upper, lower = (tangent_to_right(Cursor(root, side), p, SIGNS[side]) for side in SIDES)
            return upper, lower
        upper, lower = (tangent_to_left(Cursor(root, side), p, SIGNS[side]) for side in SIDES)
        return lower, upper

    # Robust shapes

    def layers(self, count: int) -> list[Points]:
        """The vertices of the outermost convex layers, each counter-clockwise from the least. O(log² n) a vertex."""
        return list(map(_array, islice(layers(self._root), count)))

    def influence(self) -> npt.NDArray[np.float64]:
        """For each vertex the area that goes with it, rounded once. O(log² n) a vertex."""
        return np.zeros(0) if self._root is None else influence(self._root)

    def sketch(self, most: int) -> tuple[Points, Points]:
        """At most that many vertices, at least 4, and what is beyond their edges. O(most log n).

        Three rows for each edge beyond which the hull has vertices: the edge's ends, and the farthest of those.
        """
        if self._root is None:
            return _array([]), _array([])
        ends = self._support((0.0, 1.0)), self._support((0.0, -1.0))
        vertices, beyond = sketch(self._root, ends, most)
        return _array(vertices), _array(beyond)

    # Verification

    def check(self) -> None:
        """Raise AssertionError if an invariant is broken: checks every bridge and chain against its definition.

        O(n log n) orientations, without the code of the searches.
        """
        points = list(self._all_points())
        _require(points == sorted(set(points)), "points out of order")
        _require(len(points) == self._distinct, f"{len(points)} distinct points, {self._distinct} counted")
        _require(set(self._copies) <= set(points), "a count without its point")
        _require(all(count > 1 for count in self._copies.values()), "a count below two")
        extra = sum(self._copies.values()) - len(self._copies)
        _require(self._size == self._distinct + extra, f"{self._size} points, {self._distinct} and {extra} copies")
        if self._root is not None:
            self._check(self._root)

    def _check(self, tree: Tree) -> list[Point]:
        """Check a subtree; return its points."""
        if isinstance(tree, Leaf):
            _require(0 < len(tree.points) <= self.LEAF, f"a leaf of {len(tree.points)} points")
            for side, chain in enumerate(tree.chains):
                _require((chain[0], chain[-1]) == (tree.points[0], tree.points[-1]), "a chain without its ends")
                for edge in pairwise(chain):
                    _check_edge(edge, tree.points, side)
            return tree.points
        left, right = self._check(tree.left), self._check(tree.right)
        _require(left[-1] < tree.separator <= right[0], "separator out of place")
        _require(tree.height == 1 + max(tree.left.height, tree.right.height), "height is wrong")
        _require(abs(tree.left.height - tree.right.height) <= 1, "out of balance")
        for side, (a, b) in enumerate(tree.bridges):
            _require(a in left and b in right, f"the bridge {a} {b} does not join the children")
            _check_edge((a, b), left + right, side)
        return left + right


def _check_edge(edge: Edge, points: Sequence[Point], side: int) -> None:
    a, b = edge
    for p in points:
        turn = SIGNS[side] * orientation(a, b, p)
        _require(turn < 0 or (turn == 0 and a <= p <= b), f"{p} lies outside the edge {edge}")


def _require(condition: bool, what: str) -> None:
    """Assert, also under python -O."""
    if not condition:
        raise AssertionError(what)


def _tuples(xy: Points) -> list[Point]:
    return list(map(tuple, xy.tolist()))


def _array(points: Sequence[Point]) -> Points:
    return np.array(points, dtype=np.float64).reshape(len(points), 2)
