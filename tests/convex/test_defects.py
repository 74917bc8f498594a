"""Convexity defects, against OpenCV's on integers, and beyond what OpenCV takes."""

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from inputs import stars

from dynhull.defects import convexity_defects


def by_opencv(contour):
    points = np.array(contour, dtype=np.int32).reshape(-1, 1, 2)
    found = cv2.convexityDefects(points, cv2.convexHull(points, returnPoints=False))
    rows = [] if found is None else found.reshape(-1, 4).tolist()
    return {tuple(row[:2]): (row[2], row[3] / 256) for row in rows}


@given(stars(), st.booleans(), st.integers(0, 8))
def test_agrees_with_opencv(corners, clockwise, first):
    contour = corners[first:] + corners[:first]
    contour = contour[::-1] if clockwise else contour
    found, expected = convexity_defects(contour), by_opencv(contour)
    ends = list(zip(found.start.tolist(), found.end.tolist(), strict=True))
    assert set(ends) == set(expected)
    assert found.farthest.tolist() == [expected[end][0] for end in ends]
    np.testing.assert_allclose(found.depth, [expected[end][1] for end in ends], rtol=0, atol=1 / 256)


def test_of_a_hand():
    """Five fingers have four valleys between them, and two outer sides."""
    fingers = [(3, 8), (5, 12), (7, 13), (9, 12), (12, 7)]
    valleys = [(5, 5), (6, 6), (8, 6), (9, 5)]
    contour = [(3, 0), *(p for pair in zip(fingers, [*valleys, (10, 0)], strict=True) for p in pair)]
    deep = convexity_defects(contour).depth > 1
    assert deep.sum() == 4


def test_less_than_integers():
    tiny = 2.0**-60
    assert convexity_defects([[0, 0], [0.5, tiny], [1, 0], [1, 1]]).depth.tolist() == [tiny]
    huge = convexity_defects([[0, 0], [2e300, 1e300], [4e300, 0], [0, 4e300]])
    assert huge.depth.tolist() == [1e300]


def test_of_equally_deep_points_the_first():
    found = convexity_defects([[0, 4], [0, 0], [1, 1], [2, 1], [3, 1], [4, 0], [4, 4]])
    assert (found.start.tolist(), found.end.tolist(), found.farthest.tolist()) == ([1], [5], [2])


@pytest.mark.parametrize("contour", [[], [[0, 0]], [[0, 0], [1, 1], [2, 2], [1, 1]], [[0, 0], [1, 0], [1, 0], [0, 1]]])
def test_without_defects(contour):
    assert len(convexity_defects(contour).depth) == 0


def test_bad_contours():
    with pytest.raises(ValueError, match="contour crosses itself"):
        convexity_defects([[0, 0], [4, 4], [4, 0], [0, 4]])
    with pytest.raises(ValueError, match="contour row 1"):
        convexity_defects([[0, 0], [np.nan, 4]])
