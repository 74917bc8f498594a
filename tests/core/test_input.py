"""Bad input is refused with the first bad row named, and changes nothing; good input of any type is taken exactly."""

from decimal import Decimal
from fractions import Fraction
from inspect import signature

import numpy as np
import pytest

from dynhull import DynamicHull

BAD = [
    ([[0, 0], [np.nan, 1]], ValueError, r"points row 1 is \(nan, 1\.0\): coordinates must be finite"),
    ([[0, np.inf], [0, 0]], ValueError, r"points row 0 .*must be finite"),
    (np.full((3, 2), -np.inf, np.float32), ValueError, r"row 0"),
    ([1.0, 2.0], ValueError, r"must have shape \(n, 2\), got \(2,\); one point is \[\[1\.0, 2\.0\]\]"),
    ([[1, 2, 3]], ValueError, r"must have shape \(n, 2\), got \(1, 3\)"),
    (np.zeros((2, 2, 2)), ValueError, r"\(2, 2, 2\)"),
    (7, ValueError, r"must have shape \(n, 2\), got 7$"),
    ({(1, 2), (3, 4)}, ValueError, r"must have shape \(n, 2\), got a set: use list\(points\)"),
    ({1: (1, 2)}.values(), ValueError, r"must have shape \(n, 2\), got a dict_values: use list\(points\)"),
    ({"x": 1}, ValueError, r"must have shape \(n, 2\), got a dict"),
    ([[0, 0], [1]], ValueError, r"row 1 is \[1\]: must be two numbers"),
    ([[0, 0], 5], ValueError, r"row 1 is 5: must be two numbers"),
    ([[0, 0], [1, "x"]], TypeError, r"row 1: coordinates must be real numbers"),
    ([[0, 0], [1, None]], TypeError, r"row 1: coordinates must be real numbers, got None"),
    (np.array([["1", "2"]]), TypeError, r"row 0: coordinates must be real numbers"),
    (np.array([["2020-01-01", "2020-01-01"]], "M8[D]"), TypeError, r"real numbers"),
    (np.array([[0, 0], [2**53 + 1, 0]]), ValueError, r"points row 1 is 9007199254740993: no double has this value"),
    (np.array([[0, 0], [0, 2**64 - 1]], np.uint64), ValueError, r"points row 1 is 18446744073709551615"),
    ([[0, 0], [0, 10**400]], ValueError, r"points row 1 is 10{36}\.\.\.0{37}: too large for a double"),
    (
        [[0, 0], [0, 10**5000]],
        ValueError,
        r"points row 1 is an int with too many digits to show: too large for a double",
    ),
    (
        [[0, Fraction(1, 10**5000)]],
        ValueError,
        r"row 0 is a Fraction with too many digits to show: no double has",
    ),
    ([[Fraction(1, 2), Fraction(1, 3)]], ValueError, r"row 0 is Fraction\(1, 3\): no double has this value"),
    ([[Decimal("0.1"), 0]], ValueError, r"row 0 is Decimal\('0\.1'\)"),
    ([[0, 0], [1, 1j]], ValueError, r"row 1 .*not exactly a pair of doubles"),
    (np.array([[0, 1 + np.finfo(np.longdouble).eps]], np.longdouble), ValueError, r"row 0"),
]

GOOD = [
    ([(0, 1), (2, 3)], [[0, 1], [2, 3]]),
    ([], []),
    (np.empty((0, 2), int), []),
    (np.array([[1.5, 2.5]], np.float32), [[1.5, 2.5]]),
    (np.array([[1.5, 2.5]], np.float16), [[1.5, 2.5]]),
    (np.array([[1, 2], [2**60, -(2**63)]]), [[1, 2], [2.0**60, -(2.0**63)]]),
    (np.array([[1, 2]], np.uint8), [[1, 2]]),
    (np.array([[1 + 0j, 2]]), [[1, 2]]),
    (np.array([[1, 2]], np.longdouble), [[1, 2]]),
    ([[Fraction(1, 2), Decimal("0.25")]], [[0.5, 0.25]]),
    ([[2**70, True]], [[2.0**70, 1.0]]),
    (np.asfortranarray([[1.0, 2.0], [3.0, 4.0]]), [[1, 2], [3, 4]]),
    (np.arange(8.0).reshape(4, 2)[::2], [[0, 1], [4, 5]]),
    (((i, i) for i in range(2)), [[0, 0], [1, 1]]),
]


@pytest.mark.parametrize(("value", "error", "message"), BAD)
@pytest.mark.parametrize("method", ["insert_many", "delete_many", "locate", "contains", "tangents"])
def test_bad_points(method, value, error, message):
    hull = DynamicHull([[0, 0], [1, 1]])
    with pytest.raises(error, match=message):
        getattr(hull, method)(value)
    assert hull == DynamicHull([[0, 0], [1, 1]])
    with pytest.raises(error, match=message):
        DynamicHull(value)


@pytest.mark.parametrize(("value", "rows"), GOOD)
def test_good_points(value, rows):
    assert DynamicHull(value).points().tolist() == rows


@pytest.mark.parametrize("method", ["insert", "delete", "count"])
@pytest.mark.parametrize(
    ("x", "y", "error", "message"),
    [
        (np.nan, 0, ValueError, "x is nan: coordinates must be finite"),
        (0, float("inf"), ValueError, "y is inf: coordinates must be finite"),
        ("1", 0, TypeError, "x: coordinates must be real numbers, got '1'"),
        (0, None, TypeError, "y: coordinates must be real numbers, got None"),
        (0, 2**53 + 1, ValueError, "y is 9007199254740993: no double has this value"),
        (10**400, 0, ValueError, "too large for a double"),
        (1j, 0, TypeError, "x: coordinates must be real numbers, got 1j"),
    ],
)
def test_bad_coordinates(method, x, y, error, message):
    hull = DynamicHull([[0, 0]])
    with pytest.raises(error, match=message):
        getattr(hull, method)(x, y)
    assert len(hull) == 1


def test_a_number_too_long_to_show():
    hull = DynamicHull()
    with pytest.raises(ValueError, match="y is an int with too many digits to show: too large for a double"):
        hull.insert(0, 10**5000)


@pytest.mark.parametrize("point", ["a", "ab", 5, None, (1,), (1, 2, 3)])
def test_what_is_no_point_is_not_in_a_hull(point):
    with pytest.raises((TypeError, ValueError), match=r"a point is \(x, y\), got|must be real numbers"):
        point in DynamicHull([[0, 0]])  # noqa: B015


def test_good_coordinates():
    hull = DynamicHull()
    hull.insert(np.float32(0.5), np.int64(3))
    hull.insert(Fraction(1, 4), True)
    assert hull.points().tolist() == [[0.25, 1.0], [0.5, 3.0]]


def test_methods_of_one_point_by_name_and_in_subclasses():
    class Noted(DynamicHull):
        __slots__ = ("notes",)

        def insert(self, x, y):
            self.notes = [x, y]
            return super().insert(y=y, x=x)

    hull = Noted()
    assert hull.insert(1, 2)
    assert hull.notes == [1, 2]
    assert (hull.count(x=1, y=2), hull.count(2, 1), hull.delete(1, y=2), len(hull)) == (1, 0, True, 0)
    assert [*signature(DynamicHull.insert).parameters] == ["self", "x", "y"]


@pytest.mark.parametrize("arguments", [(), (1,), (1, 2, 3)])
@pytest.mark.parametrize("method", ["insert", "delete", "count"])
def test_wrong_number_of_arguments(method, arguments):
    hull = DynamicHull([[0, 0]])
    with pytest.raises(TypeError, match=rf"{method}\(\)"):
        getattr(hull, method)(*arguments)
    assert len(hull) == 1


@pytest.mark.parametrize(
    ("ops", "error", "message"),
    [
        ([1], ValueError, r"ops must have shape \(2,\)"),
        ([1, 0], ValueError, r"ops row 1 is 0: must be \+1 \(insert\) or -1 \(delete\)"),
        ([1, 257], ValueError, r"ops row 1 is 257"),
        (["a", "b"], TypeError, r"ops must be numbers"),
    ],
)
def test_bad_operations(ops, error, message):
    hull = DynamicHull()
    with pytest.raises(error, match=message):
        hull.apply(ops, [[0, 0], [1, 1]])
    assert len(hull) == 0


@pytest.mark.parametrize("method", ["insert_many", "delete_many"])
def test_errors_from_within_the_points(method):
    """A KeyError of the caller's own is not taken for a missing point."""
    hull = DynamicHull([[0, 0]])
    with pytest.raises(KeyError, match=r"^'b'$"):
        getattr(hull, method)({"a": (1, 1)}[name] for name in "ab")
    assert len(hull) == 1


def test_bad_directions():
    hull = DynamicHull([[0, 0]])
    with pytest.raises(ValueError, match=r"directions row 1 is \(0\.0, 0\.0\): no direction"):
        hull.support([[1, 0], [0, -0.0]])
    with pytest.raises(ValueError, match="an empty hull has no extreme points"):
        DynamicHull().support([[1, 0]])
    assert DynamicHull().support([]).shape == (0, 2)
