"""What an update does to the hull tree, as data: a `TracedTree` keeps an event for each step, with the tree after it.

>>> from dynhull.trace import TracedTree
>>> tree = TracedTree([[0, 0], [2, 1], [4, 0]])
>>> tree.insert(2, 3)
True
>>> [type(event).__name__ for event in tree.events]
['Begin', 'Descent', 'Climb', 'End']
"""

from dataclasses import dataclass
from typing import Literal

import numpy.typing as npt

from ._nodes import SIDES, Edge, Leaf, Node, Tree, bridge, chain_of
from ._predicates import Point
from ._tree import HullTree


@dataclass(frozen=True, slots=True)
class View:
    """A node of the tree and all below it, as they were at one moment.

    Attributes:
        name: the same for the same node in all events of one update.
        height: 0 for a leaf.
        points: of a leaf; the first and the last one of an inner node.
        chains: the upper and the lower chain of all points below, from left to right, as the bridges stand: during a
            climb, bridges above the node visited last may still be those of before.
        bridges: the upper and the lower bridge of an inner node; () for a leaf.
        children: left and right; () for a leaf.
    """

    name: int
    height: int
    points: tuple[Point, ...]
    chains: tuple[tuple[Point, ...], tuple[Point, ...]]
    bridges: tuple[Edge, ...]
    children: tuple["View", ...]


@dataclass(frozen=True, slots=True)
class Begin:
    """An update begins."""

    tree: View | None
    kind: Literal["insert", "delete"]
    point: Point


@dataclass(frozen=True, slots=True)
class Descent:
    """The search for the point's leaf: the names of the nodes from the root down, and the leaf's."""

    tree: View | None
    path: tuple[int, ...]
    leaf: int


@dataclass(frozen=True, slots=True)
class Climb:
    """The point is on one of its leaf's chains, or was: the climb along this side begins."""

    tree: View | None
    side: int


@dataclass(frozen=True, slots=True)
class Visit:
    """A node on the way up.

    Attributes:
        tree: the tree afterwards.
        node: its name.
        side: of the bridge.
        before: the bridge before.
        after: the bridge now.
        on_chain: whether the point is (or was) on the node's chain; where not, the climb ends here.
        probes: pairs of edges that the search for the new bridge compared; () where a new point is one of its ends, or
            where the bridge stays.
    """

    tree: View | None
    node: int
    side: int
    before: Edge
    after: Edge
    on_chain: bool
    probes: tuple[tuple[Edge, Edge], ...]


@dataclass(frozen=True, slots=True)
class Reshape:
    """The tree's shape changed: a full leaf was split, an empty one dropped, two merged, or a node rotated."""

    tree: View | None
    kind: Literal["split", "drop", "merge", "rotate"]


@dataclass(frozen=True, slots=True)
class End:
    """The update is done."""

    tree: View | None
    changed: bool


TreeEvent = Begin | Descent | Climb | Visit | Reshape | End


class TracedTree(HullTree):
    """A `HullTree` that fills `events`. Each event costs O(n log n) time and O(n) memory: for small trees."""

    def __init__(self, xy: npt.ArrayLike | None = None) -> None:
        """Build from an (n, 2) array-like; this leaves no events."""
        self.events: list[TreeEvent] = []
        super().__init__(xy)

    def view(self) -> View | None:
        """The tree as it is now; None without points."""
        return None if self._root is None else _view(self._root)

    def _insert(self, p: Point, copies: int) -> bool:
        self.events.append(Begin(self.view(), "insert", p))
        changed = super()._insert(p, copies)
        self.events.append(End(self.view(), changed))
        return changed

    def _delete(self, p: Point, copies: int) -> bool:
        self.events.append(Begin(self.view(), "delete", p))
        changed = super()._delete(p, copies)
        self.events.append(End(self.view(), changed))
        return changed

    def _path(self, p: Point) -> tuple[list[Node], Leaf]:
        path, leaf = super()._path(p)
        self.events.append(Descent(self.view(), tuple(map(id, path)), id(leaf)))
        return path, leaf

    def _climb_added(self, path: list[Node], p: Point, side: int) -> bool:
        self.events.append(Climb(self.view(), side))
        return super()._climb_added(path, p, side)

    def _climb_removed(self, path: list[Node], p: Point, side: int) -> bool:
        self.events.append(Climb(self.view(), side))
        return super()._climb_removed(path, p, side)

    def _add_at(self, node: Node, p: Point, side: int) -> bool:
        before = node.bridges[side]
        on_chain = super()._add_at(node, p, side)
        self._visited(node, side, before, on_chain, ())
        return on_chain

    def _remove_at(self, node: Node, p: Point, side: int) -> bool:
        before = node.bridges[side]
        on_chain = super()._remove_at(node, p, side)
        probes: list[tuple[Edge, Edge]] = []
        if p in before:
            bridge(node.left, node.right, side, probes)
        self._visited(node, side, before, on_chain, tuple(probes))
        return on_chain

    def _visited(
        self, node: Node, side: int, before: Edge, on_chain: bool, probes: tuple[tuple[Edge, Edge], ...]
    ) -> None:
        self.events.append(Visit(self.view(), id(node), side, before, node.bridges[side], on_chain, probes))

    def _split(self, path: list[Node], leaf: Leaf) -> None:
        super()._split(path, leaf)
        self.events.append(Reshape(self.view(), "split"))

    def _drop(self, path: list[Node], leaf: Leaf) -> None:
        super()._drop(path, leaf)
        self.events.append(Reshape(self.view(), "drop"))

    def _merge(self, path: list[Node], leaf: Leaf) -> bool:
        merged = super()._merge(path, leaf)
        if merged:
            self.events.append(Reshape(self.view(), "merge"))
        return merged

    def _rotate(self, path: list[Node], node: Node, *, to_right: bool) -> None:
        super()._rotate(path, node, to_right=to_right)
        self.events.append(Reshape(self.view(), "rotate"))


def _view(tree: Tree) -> View:
    upper, lower = (tuple(chain_of(tree, side)) for side in SIDES)
    if isinstance(tree, Leaf):
        return View(id(tree), 0, tuple(tree.points), (upper, lower), (), ())
    left, right = _view(tree.left), _view(tree.right)
    ends = left.points[0], right.points[-1]
    return View(id(tree), tree.height, ends, (upper, lower), tuple(tree.bridges), (left, right))
