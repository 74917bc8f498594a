"""Masked arrays are refused wherever points, values or directions are taken: what stands behind a mask is no value."""

import numpy as np
import pytest

from dynhull import DynamicHull, convex_hull, orient2d, static
from dynhull._implementation import kernel
from dynhull._tree import HullTree
from dynhull.convex import (
    Cloud,
    Mapped,
    ball,
    box,
    capsule,
    moved,
    point,
    polygon,
    rotated,
    scaled,
    segment,
    sum_of_polygons,
)
from dynhull.decompose import convex_pieces
from dynhull.defects import convexity_defects
from dynhull.envelope import Frontier, PhaseDiagram, energy_above_hull_nd
from dynhull.gjk import distance_many, intersect_many
from dynhull.margin import max_margin

ROWS = [[0.0, 0.5], [1.0, 0.25], [0.5, 1.0]]


def masked(values, row=None):
    """As a masked array, the row hidden."""
    array = np.ma.array(values, mask=np.zeros(np.shape(values), bool))
    if row is not None:
        array[row] = np.ma.masked
    return array


TAKE_POINTS = {
    "DynamicHull": DynamicHull,
    "insert_many": lambda xy: DynamicHull().insert_many(xy),
    "delete_many": lambda xy: DynamicHull(ROWS).delete_many(xy),
    "apply": lambda xy: DynamicHull(ROWS).apply([1, 1, 1], xy),
    "locate": lambda xy: DynamicHull(ROWS).locate(xy),
    "contains": lambda xy: DynamicHull(ROWS).contains(xy),
    "support": lambda xy: DynamicHull(ROWS).support(xy),
    "tangents": lambda xy: DynamicHull(ROWS).tangents(xy),
    "distance": lambda xy: DynamicHull(ROWS).distance(xy),
    "intersect_lines p": lambda xy: DynamicHull(ROWS).intersect_lines(xy, ROWS),
    "intersect_lines q": lambda xy: DynamicHull(ROWS).intersect_lines(np.add(ROWS, 1), xy),
    "HullTree": HullTree,
    "HullTree.apply": lambda xy: HullTree().apply(1, xy, False),
    "orient2d": lambda xy: orient2d(xy, (0, 0), (1, 1)),
    "orient2d c": lambda xy: orient2d((0, 0), (1, 1), xy),
    "convex_hull": convex_hull,
    "graham_scan": static.graham_scan,
    "jarvis_march": static.jarvis_march,
    "monotone_chain": static.monotone_chain,
    "chan": static.chan,
    "chan traced": lambda xy: static.chan(xy, trace=[]),
    "hull_nd": static.hull_nd,
    "Cloud": Cloud,
    "polygon": polygon,
    "Cloud.support": lambda xy: Cloud(ROWS).support(xy),
    "sum_of_polygons": lambda xy: sum_of_polygons(ROWS, xy),
    "intersect_many": lambda xy: intersect_many([ROWS], [xy]),
    "distance_many": lambda xy: distance_many([xy], [ROWS]),
    "max_margin": lambda xy: max_margin(xy, ROWS),
    "convexity_defects": convexity_defects,
    "convex_pieces": convex_pieces,
    "Frontier": Frontier,
    "PhaseDiagram": PhaseDiagram,
    "energy_above_hull": lambda xy: PhaseDiagram(ROWS).energy_above_hull(xy),
    "compositions": lambda xy: energy_above_hull_nd(xy, [0, 0, 0]),
}
if kernel is not None:
    TAKE_POINTS |= {
        "kernel.HullTree": kernel.HullTree,
        "kernel.apply": lambda xy: kernel.HullTree().apply(1, xy, False),
    }

TAKE_VALUES = {
    "ops": lambda values: DynamicHull().apply(values, ROWS[:2]),
    "decompose": lambda values: PhaseDiagram(ROWS).decompose(values),
    "energies": lambda values: energy_above_hull_nd([[1, 0], [0, 1]], values),
    "point": point,
    "segment": lambda values: segment([0, 0], values),
    "box": lambda values: box(values, [9, 9]),
    "ball": lambda values: ball(values, 1),
    "capsule": lambda values: capsule([0, 0], values, 1),
    "offset": lambda values: moved(point([0, 0]), values),
    "factor": lambda values: scaled(point([0, 0]), values),
    "matrix": lambda values: Mapped(point([0, 0]), [values, [0, 1]], [0, 0]),
    "rotation": lambda values: rotated(point([0, 0]), [values, [0, 1]]),
}


@pytest.mark.parametrize("row", [1, None], ids=["a row hidden", "nothing hidden"])
@pytest.mark.parametrize("take", TAKE_POINTS.values(), ids=TAKE_POINTS)
def test_points(take, row):
    with pytest.raises(ValueError, match=r"must not be or contain a masked array.*np\.ma\.compress_rows"):
        take(masked(ROWS, row))


@pytest.mark.parametrize("row", [1, None], ids=["an entry hidden", "nothing hidden"])
@pytest.mark.parametrize("take", TAKE_VALUES.values(), ids=TAKE_VALUES)
def test_values(take, row):
    with pytest.raises(ValueError, match="must not be or contain a masked array"):
        take(masked([1.0, 1.0], row))


@pytest.mark.parametrize(
    "rows",
    [
        [masked([0, 0]), masked([1, 1], 0)],
        (masked([0, 0]), [1, 1]),
        [[0, np.ma.masked], [1, 1]],
        (row for row in [masked([0, 0]), [1, 1]]),
        masked([[0, 0], [1, 1]]).astype(int),
    ],
    ids=["rows", "one row", "one entry", "generator", "integers"],
)
def test_within_lists(rows):
    hull = DynamicHull([[5, 5]])
    with pytest.raises(ValueError, match="points must not be or contain a masked array"):
        hull.insert_many(rows)
    assert hull.points().tolist() == [[5, 5]]


@pytest.mark.parametrize("method", ["insert", "delete", "count"])
def test_coordinates(method):
    hull = DynamicHull([[0, 0]])
    for value in (np.ma.masked, np.ma.array(0.0)):
        with pytest.raises(ValueError, match="y must not be or contain a masked array"):
            getattr(hull, method)(0, value)
    assert len(hull) == 1


def test_what_the_message_says_helps():
    hidden = masked(ROWS, 1)
    assert DynamicHull(np.ma.compress_rows(hidden)).points().tolist() == [ROWS[0], ROWS[2]]
    assert len(DynamicHull(hidden.filled(7))) == 3
