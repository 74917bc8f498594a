// Distances and intersections, rounded once: the double nearest to the exact value, ties to even.
//
// Each value is first computed in double-double arithmetic (Dekker 1971; Joldes, Muller, Popescu 2017) with a bound on
// the error. If both ends of the error interval round to the same double, that is the result (Ziv 1991). Otherwise a
// search among the doubles compares the value exactly with their midpoints.
#pragma once

#include <algorithm>
#include <optional>

#include "../predicates/signs.hpp"

namespace dynhull {

// An unevaluated sum: `low` is at most half a unit in the last place of `high`.
struct DoubleDouble {
  double high, low;
  DoubleDouble operator-() const { return {-high, -low}; }
};

// The relative error of a double-double operation is at most 2^-102, and a difference of coordinates is exact. A value
// here takes fewer than 2^4 operations; the rest covers the rounding of the bound itself.
constexpr double DOUBLE_DOUBLE_ERROR = 0x1p-96;

// Whether a relative error bound holds for values of this size: nothing overflows, and underflow is far below the
// bound.
inline bool safe(double size) { return size > 0x1p-500 && size < 0x1p500; }

inline DoubleDouble fast_sum(double large, double small) {
  const double high = large + small;
  return {high, small - (high - large)};
}
inline DoubleDouble sum(double a, double b) {
  const double high = a + b;
  const double b_part = high - a;
  return {high, (a - (high - b_part)) + (b - b_part)};
}
inline DoubleDouble difference(double a, double b) { return sum(a, -b); }
inline DoubleDouble sum(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble high = sum(a.high, b.high), low = sum(a.low, b.low);
  const DoubleDouble both = fast_sum(high.high, high.low + low.high);
  return fast_sum(both.high, low.low + both.low);
}
inline DoubleDouble product(DoubleDouble a, DoubleDouble b) {
  const double high = a.high * b.high;
  return fast_sum(high, std::fma(a.high, b.high, -high) + (a.high * b.low + a.low * b.high));
}
inline DoubleDouble quotient(DoubleDouble a, DoubleDouble b) {
  const double high = a.high / b.high;
  return fast_sum(high, (std::fma(-high, b.high, a.high) + (a.low - high * b.low)) / b.high);
}
inline DoubleDouble root(DoubleDouble square) {
  const double high = std::sqrt(square.high);
  return fast_sum(high, (std::fma(-high, high, square.high) + square.low) / (2 * high));
}

// The double nearest to a value known up to an error, if the error leaves only one.
inline std::optional<double> rounded(DoubleDouble value, double error) {
  const double least = value.high + (value.low - error), most = value.high + (value.low + error);
  return least == most ? std::optional(least) : std::nullopt;
}

// The double nearest to a value > 0, or infinity. `compare(r, ulp)` returns the sign of the value minus (r + ulp / 2).
// The search starts at the guess, any number >= 0.
template <class Compare>
double nearest_double(double guess, Compare compare) {
  constexpr std::uint64_t INFINITE_BITS = std::uint64_t{0x7ff} << 52;  // positive doubles are ordered as their bits
  const auto reached = [&](std::uint64_t bits) {
    if (bits == INFINITE_BITS) return true;
    const int exponent = std::max(static_cast<int>(bits >> 52), 1);
    const int sign = compare(std::bit_cast<double>(bits), std::ldexp(1.0, exponent - 1 - 1074));
    return sign < 0 || (sign == 0 && bits % 2 == 0);
  };
  std::uint64_t least = 0, most = std::bit_cast<std::uint64_t>(guess);
  std::uint64_t step = 1;
  for (; !reached(most); step *= 2) {
    least = most + 1;
    most = std::min(most + step, INFINITE_BITS);
  }
  for (step = 1; least < most;) {
    const std::uint64_t middle = std::max(least + (most - least) / 2, most - std::min(most, step));
    if (reached(middle)) {
      most = middle;
      step = std::min(2 * step, INFINITE_BITS);  // with a step of 0 the search would not end
    } else {
      least = middle + 1;
    }
  }
  return std::bit_cast<double>(most);
}

inline std::array<Term, 6> squared_length_terms(Point a, Point b) {
  return {{{1, a.x, a.x}, {-2, a.x, b.x}, {1, b.x, b.x}, {1, a.y, a.y}, {-2, a.y, b.y}, {1, b.y, b.y}}};
}

template <std::size_t COUNT>
ExactSum<2> exact_sum(const std::array<Term, COUNT>& terms) {
  ExactSum<2> sum;
  for (const Term& term : terms) sum.add(term.weight, {term.first, term.second});
  return sum;
}

// The square root of a value >= 0.
inline Scaled root(Scaled square) {
  if (square.exponent % 2 != 0) return {std::sqrt(2 * square.mantissa), (square.exponent - 1) / 2};
  return {std::sqrt(square.mantissa), square.exponent / 2};
}

[[gnu::noinline, gnu::cold]] inline double distance_exact(Point p, Point q) {
  const auto square = squared_length_terms(p, q);
  const Scaled guess = root(exact_sum(square).approximate());
  return nearest_double(std::ldexp(guess.mantissa, guess.exponent), [&](double r, double ulp) {
    ExactSum<2> sum;  // 4 square - (2 r + ulp)^2
    for (const Term& term : square) sum.add(4 * term.weight, {term.first, term.second});
    sum.add(-4, {r, r});
    sum.add(-4, {r, ulp});
    sum.add(-1, {ulp, ulp});
    return sum.sign();
  });
}

inline DoubleDouble squared_length(Point a, Point b) {
  const DoubleDouble x = difference(b.x, a.x), y = difference(b.y, a.y);
  return sum(product(x, x), product(y, y));
}

// The distance of two different points.
inline double distance(Point p, Point q) {
  const DoubleDouble square = squared_length(p, q);
  if (safe(square.high)) {
    const DoubleDouble length = root(square);
    if (const auto result = rounded(length, DOUBLE_DOUBLE_ERROR * length.high)) return *result;
  }
  return distance_exact(p, q);
}

// Twice the signed area of a triangle, and the size that its error is relative to: the two products if their factors
// are rounded; the area itself if the factors are exact, because then only exact digits cancel.
struct Triangle {
  DoubleDouble doubled;
  double size;

  Triangle(Point a, Point b, Point c) {
    const DoubleDouble ux = difference(b.x, a.x), uy = difference(b.y, a.y);
    const DoubleDouble vx = difference(c.x, a.x), vy = difference(c.y, a.y);
    const DoubleDouble left = product(ux, vy), right = product(uy, vx);
    doubled = sum(left, -right);
    const bool exact = (ux.low == 0) & (uy.low == 0) & (vx.low == 0) & (vy.low == 0);
    size = exact ? std::abs(doubled.high) : std::abs(left.high) + std::abs(right.high);
  }
};

[[gnu::noinline, gnu::cold]] inline double distance_to_line_exact(Point p, Point a, Point b) {
  const auto area = triangle_terms(a, b, p);
  const auto square = squared_length_terms(a, b);
  const Scaled height = exact_sum(area).approximate(), length = root(exact_sum(square).approximate());
  const double guess = std::ldexp(std::abs(height.mantissa) / length.mantissa, height.exponent - length.exponent);
  return nearest_double(guess, [&](double r, double ulp) {
    ExactSum<4> sum;  // 4 area^2 - (2 r + ulp)^2 square
    for (const Term& s : area)
      for (const Term& t : area) sum.add(4 * s.weight * t.weight, {s.first, s.second, t.first, t.second});
    for (const Term& term : square) {
      sum.add(-4 * term.weight, {term.first, term.second, r, r});
      sum.add(-4 * term.weight, {term.first, term.second, r, ulp});
      sum.add(-1 * term.weight, {term.first, term.second, ulp, ulp});
    }
    return sum.sign();
  });
}

// The distance from p to the line through a and b, which p is not on.
inline double distance_to_line(Point p, Point a, Point b) {
  const Triangle triangle(a, b, p);
  const DoubleDouble square = squared_length(a, b);
  if (safe(triangle.size) && safe(square.high)) {
    const DoubleDouble length = root(square);
    const DoubleDouble height = quotient(triangle.doubled.high < 0 ? -triangle.doubled : triangle.doubled, length);
    if (const auto result = rounded(height, DOUBLE_DOUBLE_ERROR * (triangle.size / length.high))) return *result;
  }
  return distance_to_line_exact(p, a, b);
}

// One coordinate of the intersection of the line through p and q with the segment from a to b, whose ends have the
// coordinates `from` and `to`: (to at_a - from at_b) / (at_a - at_b), where at_a and at_b are the signed areas of the
// triangles p, q, a and p, q, b.
[[gnu::noinline, gnu::cold]] inline double intersection_exact(Point p, Point q, Point a, Point b, double from,
                                                              double to) {
  const auto at_a = triangle_terms(p, q, a), at_b = triangle_terms(p, q, b);
  const auto add = [&](ExactSum<3>& sum, int weight, double value, double other) {  // weight (value at_a - other at_b)
    for (const Term& term : at_a) sum.add(+weight * term.weight, {term.first, term.second, value});
    for (const Term& term : at_b) sum.add(-weight * term.weight, {term.first, term.second, other});
  };
  ExactSum<3> above;
  ExactSum<2> below;
  add(above, 1, to, from);
  for (const Term& term : at_a) below.add(+term.weight, {term.first, term.second});
  for (const Term& term : at_b) below.add(-term.weight, {term.first, term.second});
  if (above.sign() == 0) return 0;
  if (above.sign() != below.sign()) return -intersection_exact(p, q, a, b, -from, -to);
  const Scaled numerator = above.approximate(), denominator = below.approximate();
  const double guess = std::ldexp(numerator.mantissa / denominator.mantissa, numerator.exponent - denominator.exponent);
  return nearest_double(guess, [&](double r, double ulp) {
    ExactSum<3> sum;  // 2 above - (2 r + ulp) below
    add(sum, +2, to, from);
    add(sum, -2, r, r);
    add(sum, -1, ulp, ulp);
    return below.sign() * sum.sign();
  });
}

// The intersection of the line through p and q with the segment from a to b, whose ends are on different sides of it.
inline Point intersection(Point p, Point q, Point a, Point b) {
  const Triangle at_a(p, q, a), at_b(p, q, b);
  const double size = at_a.size + at_b.size;
  const DoubleDouble whole = sum(at_a.doubled, -at_b.doubled);
  const DoubleDouble share = quotient(at_a.doubled, whole);
  const double doubt = size / std::abs(whole.high);  // of the share, as a multiple of DOUBLE_DOUBLE_ERROR; at least 1
  const auto coordinate = [&](double Point::* axis) {
    const double from = a.*axis, to = b.*axis;
    if (from == to) return from;
    if (p.*axis == q.*axis) return p.*axis;
    const DoubleDouble way = difference(to, from);
    const DoubleDouble value = sum({from, 0}, product(share, way));
    const double bound = std::abs(way.high) * doubt + std::abs(value.high);
    if (safe(size) && safe(bound))
      if (const auto result = rounded(value, DOUBLE_DOUBLE_ERROR * bound)) return *result;
    return intersection_exact(p, q, a, b, from, to);
  };
  return {coordinate(&Point::x), coordinate(&Point::y)};
}

}  // namespace dynhull
