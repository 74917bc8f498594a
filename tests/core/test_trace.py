"""The events of the hull tree, replayed against hulls of the same points."""

import random
from bisect import insort

import oracle
import pytest

from dynhull._nodes import SIDES
from dynhull.trace import Begin, Climb, Descent, End, Reshape, TracedTree, View, Visit


class SmallLeaves(TracedTree):
    LEAF = 8


def leaves(view):
    return [view] if not view.children else [leaf for child in view.children for leaf in leaves(child)]


def vertices(view: View | None):
    if view is None:
        return []
    upper, lower = view.chains
    return [*lower, *upper[-2:0:-1]]


def names(view: View):
    return {view.name}.union(*(names(child) for child in view.children))


def updates_of(tree):
    """The events of each update."""
    starts = [i for i, event in enumerate(tree.events) if isinstance(event, Begin)]
    return [tree.events[i:j] for i, j in zip(starts, [*starts[1:], None], strict=True)]


@pytest.fixture(scope="module")
def lived():
    """A tree after some 200 updates on a small grid, and the updates in order."""
    draw = random.Random(7)
    tree, points, done = SmallLeaves(), [], []
    for kind in draw.choices(["insert", "insert", "delete"], k=120) + ["delete"] * 80:
        if kind == "delete" and not points:
            continue
        p = (float(draw.randrange(12)), float(draw.randrange(12))) if kind == "insert" else draw.choice(points)
        changed = getattr(tree, kind)(*p)
        insort(points, p) if kind == "insert" else points.remove(p)
        done.append((kind, p, changed, list(points)))
    return tree, done


def test_each_update_has_its_events(lived):
    tree, done = lived
    tree.check()
    for events, (kind, p, changed, points) in zip(updates_of(tree), done, strict=True):
        begin, end = events[0], events[-1]
        assert (begin.kind, begin.point) == (kind, p)
        assert isinstance(end, End)
        assert end.changed == changed == (vertices(begin.tree) != vertices(end.tree))
        assert vertices(end.tree) == oracle.hull(points)
        left = [p for leaf in leaves(end.tree) for p in leaf.points] if end.tree else []
        assert left == sorted(set(points))


def test_a_climb_goes_up_the_path_until_the_point_is_on_no_chain(lived):
    tree, _ = lived
    searched = 0
    for events in updates_of(tree):
        path = next((list(event.path) for event in events if isinstance(event, Descent)), [])
        dropped = any(isinstance(event, Reshape) and event.kind == "drop" for event in events)
        for side in SIDES:
            climbs = [event for event in events if isinstance(event, Climb) and event.side == side]
            visits = [event for event in events if isinstance(event, Visit) and event.side == side]
            above = path[:-1] if dropped else path
            assert [visit.node for visit in visits] == above[::-1][: len(visits)]
            assert all(visit.on_chain for visit in visits[:-1])
            assert bool(climbs) >= bool(visits)
            if climbs and (not visits or visits[-1].on_chain):
                assert len(visits) == len(above)
            for visit in visits:
                assert visit.node in names(visit.tree)
                assert not visit.probes or events[0].point in visit.before
                searched += len(visit.probes)
                assert not visit.probes or (visit.probes[-1][0][0], visit.probes[-1][1][0]) == visit.after
    assert searched


def test_every_change_of_shape_is_seen(lived):
    tree, _ = lived
    assert {event.kind for event in tree.events if isinstance(event, Reshape)} == {"split", "drop", "merge", "rotate"}


def test_building_leaves_no_events():
    tree = TracedTree([[0, 0], [1, 1]])
    assert not tree.events
    assert tree.view().points == ((0.0, 0.0), (1.0, 1.0))
    assert TracedTree().view() is None
