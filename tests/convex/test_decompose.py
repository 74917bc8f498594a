"""Convex pieces of simple polygons: convex, of the same area, apart but for their boundaries."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inputs import stars

from dynhull import convex_hull, measure, orient2d
from dynhull.convex import polygon
from dynhull.decompose import convex_pieces
from dynhull.gjk import contact


def doubled_area(corners):
    x, y = np.asarray(corners).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1))


@given(stars(), st.booleans())
def test_pieces_are_convex_and_fill_the_polygon(corners, clockwise):
    pieces = convex_pieces(corners[::-1] if clockwise else corners)
    for piece in pieces:
        assert np.all(orient2d(piece, np.roll(piece, -1, axis=0), np.roll(piece, -2, axis=0)) > 0)
        assert {tuple(p) for p in piece.tolist()} <= {(float(x), float(y)) for x, y in corners}
    assert sum(measure.area(convex_hull(piece)) for piece in pieces) * 2 == abs(doubled_area(corners))
    reflex = sum(
        orient2d(p, q, r) < 0
        for p, q, r in zip(corners, corners[1:] + corners[:1], corners[2:] + corners[:2], strict=True)
    )
    assert len(pieces) <= 2 * reflex + 1  # Hertel and Mehlhorn: four times the optimum, which is reflex / 2 + 1


def comb(teeth):
    top = [(2 * i + 1 - j, [9, 1][j]) for i in reversed(range(teeth)) for j in (0, 1)]
    return [(0, 0), (2 * teeth - 1, 0), *top]


def test_a_comb_is_cut_into_as_many_pieces_as_teeth():
    corners = comb(40)
    pieces = convex_pieces(corners)
    assert sum(doubled_area(piece) for piece in pieces) == doubled_area(corners)
    between_teeth = polygon([[1.95, 5], [2, 4], [2.02, 5]])
    assert not contact([polygon(piece) for piece in pieces], [between_teeth]).intersect


def test_straight_and_repeated_corners_are_left_out():
    assert len(convex_pieces([[0, 0], [1, 0], [2, 0], [2, 0], [2, 2], [0, 2], [0, 0]])) == 1


def test_polygons_without_area():
    assert [piece.tolist() for piece in convex_pieces([[1, 1], [1, 1]])] == [[[1, 1]]]
    assert [piece.tolist() for piece in convex_pieces([[0, 0], [2, 2], [1, 1]])] == [[[0, 0], [2, 2]]]


@pytest.mark.parametrize(
    ("contour", "message"),
    [
        ([], "contour is empty"),
        ([[0, 0], [2, 2], [2, 0], [0, 2]], r"edges from \(0.0, 0.0\) to \(2.0, 2.0\) and .* meet"),
        ([[0, 0], [4, 0], [4, 4], [2, 0], [0, 4]], "not a simple polygon"),
        ([[0, 0], [4, 0], [4, 4], [4, 2], [9, 9], [0, 4]], "not a simple polygon"),
        ([[0, 0], [1, np.inf]], "contour row 1"),
    ],
)
def test_bad_contours(contour, message):
    with pytest.raises(ValueError, match=message):
        convex_pieces(contour)
