"""Updates of the hull tree as pictures: the points and bridges above, the tree's nodes as bars over x below."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from dynhull.trace import Begin, Climb, Descent, End, Reshape, TracedTree, TreeEvent, View, Visit

from .scene import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PALE,
    VERMILION,
    Mark,
    Picture,
    Places,
    Point,
    Position,
    Story,
    Style,
    names_of,
    places,
    plural,
    text,
)

MOST_POINTS = 200  # with more, the leaves' bars are thinner than their points
EDGE = 1.1  # around the points, which lie in [-1, 1]²
TREE_TOP, TREE_BOTTOM, MOST_BETWEEN = -1.3, -2.4, 0.3  # heights of the root and of the lowest leaves; between levels
LEAST_WIDTH = 0.02  # of a bar
SIDES = ("upper", "lower")

STYLES = {
    "hull": Style("area", PALE, 4, opacity=0.1),
    "link": Style("line", PALE, 0.8),
    "bridge": Style("line", PALE, 1),
    "point": Style("dots", BLACK, 4),
    "node": Style("line", PALE, 6),
    "path": Style("line", GREY, 6),
    "visited": Style("line", BLUE, 6),
    "changed": Style("line", ORANGE, 6),
    "chain": Style("line", GREEN, 1.8),
    "chain vertex": Style("dots", GREEN, 5),
    "old bridge": Style("line", VERMILION, 1.5, dashed=True),
    "standing bridge": Style("line", BLUE, 2.6),
    "new bridge": Style("line", ORANGE, 2.6),
    "inserted": Style("dots", VERMILION, 8),
    "deleted": Style("crosses", VERMILION, 8),
}
LEGEND = {
    "path": "way down",
    "visited": "visited, bridge stays",
    "changed": "new bridge",
    "old bridge": "old bridge",
    "chain": "chains of a node's children",
    "hull": "hull, other bridges",
}
RESHAPED = {
    "split": "the leaf has too many points: it is split",
    "drop": "the leaf is empty: its sibling takes\nits parent's place",
    "merge": "the leaf has few points:\nit is joined with its neighbour",
    "rotate": "out of balance: the higher child\ntakes its parent's place",
}


class SmallLeaves(TracedTree):
    """The tree with leaves of up to 4 points instead of 64, so that a few points make a tree of several levels."""

    LEAF = 4


@dataclass(frozen=True, slots=True)
class Plan:
    """Where to draw points and the levels of the tree."""

    where: Places
    between: float

    def bar(self, node: View, depth: int) -> tuple[Position, Position]:
        """The ends of a node's bar."""
        left, right = self.where[node.points[0]][0], self.where[node.points[-1]][0]
        spread = max(LEAST_WIDTH - (right - left), 0) / 2
        height = TREE_TOP - depth * self.between
        return (left - spread, height), (right + spread, height)


def tree_story(name: str, points: Sequence[Point]) -> Story:
    """A window over the points: three in four are there at first, each later one is inserted and the oldest deleted.

    Raises:
        ValueError: there are more points than a picture has room for.
    """
    if len(points) > MOST_POINTS:
        raise ValueError(f"{name} has {len(points):,} points: a picture of the tree has room for {MOST_POINTS}")
    first = len(points) * 3 // 4
    tree = SmallLeaves(points[:first])
    start = tree.view()
    for new, old in zip(points[first:], points, strict=False):
        tree.insert(*new)
        tree.delete(*old)
    views = [start, *(event.tree for event in tree.events)]
    height = max((depth for view in views for _, depth in _nodes(view)), default=0)
    where = places(list(dict.fromkeys(points)), stretched=True)
    plan = Plan(where, min(MOST_BETWEEN, (TREE_TOP - TREE_BOTTOM) / max(height, 1)))
    pictures = [Picture(f"the tree of the first {plural(first, 'point', 'points')}", tuple(_tree(start, plan, {})))]
    pictures += [picture for update in _updates(tree.events) for picture in _pictures(update, plan)]
    updates = sum(isinstance(event, Begin) for event in tree.events)
    return Story(
        title=f"tree: {name}",
        styles=STYLES,
        legend=LEGEND,
        names=names_of(where),
        backdrop=[],
        pictures=pictures,
        low=(-EDGE, TREE_TOP - height * plan.between - 0.15),
        high=(EDGE, EDGE),
        result=plural(updates, "update", "updates"),
    )


def _updates(events: Sequence[TreeEvent]) -> Iterator[Sequence[TreeEvent]]:
    starts = [i for i, event in enumerate(events) if isinstance(event, Begin)]
    for i, j in zip(starts, [*starts[1:], len(events)], strict=True):
        yield events[i:j]


def _pictures(update: Sequence[TreeEvent], plan: Plan) -> Iterator[Picture]:
    begin, end = update[0], update[-1]
    assert isinstance(begin, Begin)
    assert isinstance(end, End)
    mark = Mark("inserted" if begin.kind == "insert" else "deleted", (plan.where[begin.point],))
    what = f"{begin.kind} {text(begin.point)}"
    sides = [SIDES[event.side] for event in update if isinstance(event, Climb)]
    colours: dict[int, str] = {}
    for event in update:
        match event:
            case Descent():
                colours = dict.fromkeys((*event.path, event.leaf), "path")
                caption = f"{what}:\n{_in_leaf(begin, end, sides)}"
                yield Picture(caption, (*_tree(event.tree, plan, colours), mark))
            case Visit():
                if colours.get(event.node) != "changed":
                    colours[event.node] = "visited" if event.before == event.after else "changed"
                tree = _tree(event.tree, plan, colours)
                yield Picture(_visited(begin, event), (*tree, *_bridge(event, plan), mark))
            case Reshape():
                yield Picture(RESHAPED[event.kind], (*_tree(event.tree, plan, {}), mark))
            case End() if sides or len(update) == 2:
                verdict = "the hull has changed" if event.changed else "the hull is as before"
                yield Picture(f"{what}: done,\n{verdict}", tuple(_tree(event.tree, plan, {})))


def _in_leaf(begin: Begin, end: End, sides: Sequence[str]) -> str:
    if sides:
        return f"{'is' if begin.kind == 'insert' else 'was'} on its leaf's {' and '.join(sides)} chain"
    seen = begin.tree if begin.kind == "insert" else end.tree
    if begin.point in _points(seen):
        return "there more than once: only its count changes"
    return "on no chain of its leaf: no bridge changes"


def _visited(begin: Begin, visit: Visit) -> str:
    bridge = f"the {SIDES[visit.side]} bridge"
    if not visit.on_chain:
        return f"{bridge} passes outside\nthe point: it stays, and the climb ends"
    if visit.before != visit.after and begin.kind == "insert":
        return f"{bridge} is now\nthe tangent from the point"
    if visit.probes:
        return f"{bridge} lost an end:\nits search compares {plural(len(visit.probes), 'pair', 'pairs')} of edges"
    return f"{bridge} stays:\nthe point {'is' if begin.kind == 'insert' else 'was'} on the node's chain"


def _tree(view: View | None, plan: Plan, colours: dict[int, str]) -> Iterator[Mark]:
    """The whole tree: hull, bridges and points, and the bars in their colours."""
    if view is None:
        return
    yield Mark("hull", tuple(plan.where[p] for p in _hull(view)))
    for node, depth in _nodes(view):
        middle = _middle(plan.bar(node, depth))
        for child in node.children:
            yield Mark("link", (middle, _middle(plan.bar(child, depth + 1))))
        for bridge in node.bridges:
            yield Mark("bridge", tuple(plan.where[p] for p in bridge))
    for node, depth in _nodes(view):
        yield Mark(colours.get(node.name, "node"), plan.bar(node, depth))
        if not node.children:
            yield Mark("point", tuple((plan.where[p][0], TREE_TOP - depth * plan.between) for p in node.points))
    yield Mark("point", tuple(plan.where[p] for p in _points(view)))


def _bridge(visit: Visit, plan: Plan) -> Iterator[Mark]:
    """The chains below the visited node, and its bridge before and after."""
    node = next(node for node, _ in _nodes(visit.tree) if node.name == visit.node)
    for child in node.children:
        chain = tuple(plan.where[p] for p in child.chains[visit.side])
        yield Mark("chain", chain)
        yield Mark("chain vertex", chain)
    after = tuple(plan.where[p] for p in visit.after)
    if visit.before == visit.after:
        yield Mark("standing bridge", after)
    else:
        yield Mark("old bridge", tuple(plan.where[p] for p in visit.before))
        yield Mark("new bridge", after)


def _nodes(view: View | None, depth: int = 0) -> Iterator[tuple[View, int]]:
    """All nodes with their depths, parents first."""
    if view is not None:
        yield view, depth
        for child in view.children:
            yield from _nodes(child, depth + 1)


def _points(view: View | None) -> list[Point]:
    return [p for node, _ in _nodes(view) if not node.children for p in node.points]


def _hull(view: View) -> list[Point]:
    upper, lower = view.chains
    return [*lower, *upper[-2:0:-1]]


def _middle(bar: tuple[Position, Position]) -> Position:
    (left, height), (right, _) = bar
    return (left + right) / 2, height
