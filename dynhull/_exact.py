"""Rational arithmetic on doubles: values stay exact until they are rounded once."""

from fractions import Fraction
from math import inf, isqrt
from typing import Any

import numpy as np
import numpy.typing as npt

from ._predicates import Point
from .arrays import Points

Exact = tuple[Fraction, Fraction]
Integers = npt.NDArray[Any]
Factors = npt.NDArray[np.float64] | float

MANTISSA = 53
HALF = 27  # bits: a double holds the sum of 2**26 halves exactly
# Beyond these the low part of a product of three doubles may underflow.
SMALLEST_FACTOR, LARGEST_FACTOR = 2.0**-280, 2.0**280
SPLITTER = 2.0**27 + 1.0


def exact(p: Point) -> Exact:
    """A point in rational numbers."""
    return Fraction(p[0]), Fraction(p[1])


def squared_length(a: Point, b: Point) -> Fraction:
    """The squared distance of a and b."""
    (ax, ay), (bx, by) = exact(a), exact(b)
    return (bx - ax) ** 2 + (by - ay) ** 2


def doubled_triangle(a: Point, b: Point, c: Point) -> Fraction:
    """Twice the area of the triangle, negative if it turns right."""
    (ax, ay), (bx, by), (cx, cy) = exact(a), exact(b), exact(c)
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


def rounded(value: Fraction) -> float:
    """The nearest double; inf or -inf beyond the doubles."""
    try:
        return float(value)
    except OverflowError:
        return inf if value > 0 else -inf


def root(value: Fraction) -> float:
    """The double nearest to the square root of a rational number; inf beyond the doubles."""
    # A quotient of at least 2 * 64 bits whose power of two is even: its root has 64 bits or more.
    shift = 130 - value.numerator.bit_length() + value.denominator.bit_length()
    shift += shift % 2
    quotient, rest = divmod(value.numerator << max(shift, 0), value.denominator << max(-shift, 0))
    whole = isqrt(quotient)
    cut_off = rest > 0 or whole * whole < quotient  # one more bit: no inexact root looks halfway
    return rounded((2 * whole + cut_off) * Fraction(2) ** (-shift // 2 - 1))


def as_integers(values: npt.NDArray[np.float64]) -> tuple[Integers, Fraction]:
    """An array of Python integers of the same shape, and the power of two by which they are the values."""
    mantissas, exponents = np.frexp(values)
    used = exponents[mantissas != 0]
    least = int(used.min()) if used.size else 0
    shifts = np.where(mantissas != 0, exponents - least, 0)
    integers = np.ldexp(mantissas, MANTISSA).astype(np.int64).astype(object) << shifts.astype(object)
    return integers, Fraction(2) ** (least - MANTISSA)


def exact_sum(terms: npt.NDArray[np.float64]) -> Fraction:
    """The exact sum of up to 2**26 finite doubles. O(k)."""
    mantissas, exponents = np.frexp(terms.ravel())
    if not mantissas.size:
        return Fraction(0)
    least = int(exponents.min())
    scaled = np.ldexp(mantissas, MANTISSA - HALF)
    high = np.floor(scaled)
    low = np.ldexp(scaled - high, HALF)
    places = exponents - least
    total = 0
    for part, shift in ((high, HALF), (low, 0)):
        sums = np.bincount(places, weights=part)
        total += sum(int(value) << (place + shift) for place, value in enumerate(sums.tolist()) if value)
    return total * Fraction(2) ** (least - MANTISSA)


def products(a: npt.NDArray[np.float64], b: Factors) -> npt.NDArray[np.float64]:
    """Two rows whose sum is a * b exactly, for factors that `safe_factors` (Dekker 1971, with Veltkamp's splitting)."""
    high = a * b
    (a_high, a_low), (b_high, b_low) = _split(a), _split(b)
    return np.stack([high, ((a_high * b_high - high) + a_high * b_low + a_low * b_high) + a_low * b_low])


def _split(a: Factors) -> tuple[Factors, Factors]:
    scaled = SPLITTER * a
    high = scaled - (scaled - a)
    return high, a - high


def safe_factors(values: Points) -> bool:
    """Whether no product of three of the values overflows or underflows, low parts included."""
    sizes = np.abs(values)
    return bool(np.all((sizes == 0) | ((sizes > SMALLEST_FACTOR) & (sizes < LARGEST_FACTOR))))
