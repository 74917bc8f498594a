"""`check` finds every kind of damage: the other tests rely on it. Only the reference can be damaged from outside."""

import pytest
from hulls import TinyLeafTree

from dynhull._nodes import LOWER, UPPER, Leaf, Node

# A zigzag between two parabolas, all of them vertices, and points on a line below it.
ROWS = [(float(x), 100.0 - (x - 5) ** 2 if x % 2 else (x - 5) ** 2 - 100.0) for x in range(10)]
LINE = [(float(x), 0.0) for x in range(4)]


def leaf(tree):
    node = tree._root
    while isinstance(node, Node):
        node = node.left
    return node


def swap_points(tree):
    points = leaf(tree).points
    points[0], points[1] = points[1], points[0]


def repeat_a_point(tree):
    points = leaf(tree).points
    points[1] = points[0]


def set_bridge(side, a, b):
    def damage(tree):
        tree._root.bridges[side] = a, b

    return damage


def put(name, value):
    return lambda tree: setattr(tree, name, value)


def put_in_root(name, value):
    return lambda tree: setattr(tree._root, name, value)


def lean_by_two(tree):
    one, two, three, four = (Leaf([p]) for p in LINE)
    tree._root = Node(Node(Node(one, two), three), four)


def empty(tree):
    tree._root, tree._distinct, tree._size = Leaf([]), 0, 0


DAMAGE = {
    "points out of order": (swap_points, "points out of order"),
    "a point twice": (repeat_a_point, "points out of order"),
    "distinct points": (put("_distinct", 5), "4 distinct points, 5 counted"),
    "points": (put("_size", 5), "5 points, 4 and 0 copies"),
    "copies that are not counted": (lambda tree: tree._copies.update({LINE[0]: 3}), "4 points, 4 and 2 copies"),
    "copies of no point": (lambda tree: tree._copies.update({(9.0, 9.0): 2}), "a count without its point"),
    "one copy": (lambda tree: tree._copies.update({LINE[0]: 1}), "a count below two"),
    "a full leaf": (put("LEAF", 2), r"a leaf of \d points"),
    "an empty leaf": (empty, r"a leaf of \d points"),
    "a chain without its first point": (lambda tree: leaf(tree).chains[UPPER].pop(0), "a chain without its ends"),
    "a chain without its last point": (lambda tree: leaf(tree).chains[LOWER].pop(), "a chain without its ends"),
    "a vertex on an edge": (
        lambda tree: leaf(tree).chains[UPPER].insert(1, LINE[1]),
        "lies outside the edge",
    ),
    "a separator too low": (put_in_root("separator", LINE[2]), "separator out of place"),
    "a separator too high": (put_in_root("separator", (3.0, 1.0)), "separator out of place"),
    "a height": (put_in_root("height", 2), "height is wrong"),
    "no balance": (lean_by_two, "out of balance"),
    "a bridge from the wrong side": (set_bridge(UPPER, LINE[3], LINE[3]), "does not join the children"),
    "a bridge to the wrong side": (set_bridge(LOWER, LINE[0], LINE[0]), "does not join the children"),
    "a bridge that begins too late": (set_bridge(UPPER, LINE[1], LINE[3]), "lies outside the edge"),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damage_is_named(damage):
    tree = TinyLeafTree(LINE)
    tree.check()
    act, message = DAMAGE[damage]
    act(tree)
    with pytest.raises(AssertionError, match=message):
        tree.check()


@pytest.mark.parametrize("side", [UPPER, LOWER])
def test_points_outside_a_chain_and_a_bridge_are_named(side):
    tree = TinyLeafTree(ROWS)
    chain = next(part for part in map(leaf_chains(side), leaves(tree._root)) if len(part) > 2)
    vertex = chain.pop(1)
    with pytest.raises(AssertionError, match="lies outside the edge"):
        tree.check()
    chain.insert(1, vertex)
    tree.check()
    a, b = tree._root.bridges[side]
    for inner in ((a, ROWS[-1]), (ROWS[0], b)):
        tree._root.bridges[side] = inner
        with pytest.raises(AssertionError, match="lies outside the edge"):
            tree.check()


def leaves(node):
    return [*leaves(node.left), *leaves(node.right)] if isinstance(node, Node) else [node]


def leaf_chains(side):
    return lambda leaf: leaf.chains[side]
