// Predicates: the orientation of three points and related signs, exact for every finite double.
//
// Each predicate evaluates its determinant in floating point, with a bound on the rounding error (Shewchuk 1997, stage
// A, with slack for underflow). If the bound does not decide the sign, an exact sum does. Compile with
// -ffp-contract=off: the bounds hold for the operations as written.
#pragma once

#include <cmath>
#include <optional>

#include "exact_sum.hpp"
#include "point.hpp"

#ifdef __FAST_MATH__
#error "exact predicates need every rounding as written: compile without -ffast-math"
#endif

namespace dynhull {

constexpr double EPSILON = 0x1p-53;
constexpr double ORIENT_BOUND = (3.0 + 16.0 * EPSILON) * EPSILON;
// Two products and a difference more than an orientation: at most eight roundings, doubled for safety.
constexpr double CROSSING_BOUND = 16.0 * EPSILON;
// A product that underflows has an error of up to 2^-1075; this is far above that and far below usual values.
constexpr double UNDERFLOW_SLACK = 1e-300;
// The same for a product that is multiplied by a difference of up to 2^1024.
constexpr double UNDERFLOW_FACTOR = 1e-280;
// Above this, a double represents the rounding error of a product exactly.
constexpr double EXACT_ERROR = 1e-250;

inline int sign_of(double value) { return (value > 0) - (value < 0); }

// Whether the rounded difference equals a - b.
inline bool exact_difference(double a, double b, double difference) {
  const double b_part = a - difference;
  const double a_part = difference + b_part;
  return (a - a_part) + (b_part - b) == 0;
}

// A weighted product of two coordinates: one term of a determinant.
struct Term {
  int weight;
  double first, second;
};

// Twice the signed area of a triangle, positive if it turns left.
inline std::array<Term, 6> triangle_terms(Point a, Point b, Point c) {
  return {{{+1, a.x, b.y}, {-1, a.x, c.y}, {-1, c.x, b.y}, {-1, a.y, b.x}, {+1, a.y, c.x}, {+1, c.y, b.x}}};
}

// The sign of ux vy - uy vx, if the rounding errors of the products are doubles.
inline std::optional<int> determinant_sign(double ux, double uy, double vx, double vy) {
  const double left = ux * vy, right = uy * vx;  // rounding is monotone
  if (left != right && std::isfinite(left) && std::isfinite(right)) return sign_of(left - right);
  if (left == right && std::abs(left) > EXACT_ERROR && std::isfinite(left))
    return sign_of(std::fma(ux, vy, -left) - std::fma(uy, vx, -right));
  if ((ux == 0 || vy == 0) && (uy == 0 || vx == 0)) return 0;
  return std::nullopt;
}

[[gnu::noinline, gnu::cold]] inline int orientation_exact(Point a, Point b, Point c) {
  const double ux = a.x - c.x, uy = a.y - c.y, vx = b.x - c.x, vy = b.y - c.y;
  if (exact_difference(a.x, c.x, ux) && exact_difference(a.y, c.y, uy) && exact_difference(b.x, c.x, vx) &&
      exact_difference(b.y, c.y, vy))
    if (const std::optional<int> sign = determinant_sign(ux, uy, vx, vy)) return *sign;
  ExactSum<2> sum;
  for (const Term& term : triangle_terms(a, b, c)) sum.add(term.weight, {term.first, term.second});
  return sum.sign();
}

// With three roundings, as in the filters.
inline double difference_of_products(double a, double b, double c, double d) {
  const double left = a * b;
  const double right = c * d;
  return left - right;
}

// Twice the area of a triangle, rounded; positive if it turns left.
inline double doubled_area(Point a, Point b, Point c) {
  return difference_of_products(a.x - c.x, b.y - c.y, a.y - c.y, b.x - c.x);
}

// What bounds the error of that area for each triangle in a box of this size: rounding is monotone, so that no bound of
// orientation_filter is greater.
inline double orientation_bound(double width, double height) {
  return ORIENT_BOUND * (2 * (width * height)) + UNDERFLOW_SLACK;
}

// The sign of the orientation, or 0 if floating point does not decide it.
inline int orientation_filter(Point a, Point b, Point c) {
  const double left = (a.x - c.x) * (b.y - c.y);
  const double right = (a.y - c.y) * (b.x - c.x);
  const double det = left - right;
  // On overflow the bound is infinite or the determinant is NaN, and both comparisons are false.
  const double bound = ORIENT_BOUND * (std::abs(left) + std::abs(right)) + UNDERFLOW_SLACK;
  return (det > bound) - (-det > bound);
}

// The filter for one line, from a to b, and many points: their distances outside it, up to a common factor.
class Chord {
 public:
  struct Distance {
    double value, bound;
    bool certainly_inside() const { return -value > bound; }
  };

  Chord(Side side, Point a, Point b)
      : b_(b), width_(turned(side, 1) * (a.x - b.x)), rise_(turned(side, 1) * (a.y - b.y)) {}

  Distance distance(Point p) const {
    const double left = (p.x - b_.x) * rise_;
    const double right = (p.y - b_.y) * width_;
    return {left - right, ORIENT_BOUND * (std::abs(left) + std::abs(right)) + UNDERFLOW_SLACK};
  }

 private:
  Point b_;
  double width_, rise_;
};

// +1 if a, b, c turn left, -1 if they turn right, 0 if they are collinear.
inline int orientation(Point a, Point b, Point c) {
  const int sign = orientation_filter(a, b, c);
  return sign != 0 ? sign : orientation_exact(a, b, c);
}

// +1 if b is farther than a in direction d, -1 if it is less far, 0 if neither.
inline int direction_sign(Point d, Point a, Point b) {
  const double along = d.x * (b.x - a.x);
  const double up = d.y * (b.y - a.y);
  const double dot = along + up;
  const double bound = ORIENT_BOUND * (std::abs(along) + std::abs(up)) + UNDERFLOW_SLACK;
  if (dot > bound) return 1;
  if (-dot > bound) return -1;
  ExactSum<2> sum;
  sum.add(+1, {d.x, b.x});
  sum.add(-1, {d.x, a.x});
  sum.add(+1, {d.y, b.y});
  sum.add(-1, {d.y, a.y});
  return sum.sign();
}

[[gnu::noinline, gnu::cold]] inline int cross_exact(Point a, Point b, Point c, Point d) {
  const double ux = b.x - a.x, uy = b.y - a.y, vx = d.x - c.x, vy = d.y - c.y;
  if (exact_difference(b.x, a.x, ux) && exact_difference(b.y, a.y, uy) && exact_difference(d.x, c.x, vx) &&
      exact_difference(d.y, c.y, vy))
    if (const std::optional<int> sign = determinant_sign(ux, uy, vx, vy)) return *sign;
  ExactSum<2> sum;
  for (const auto& [weight, p] : {std::pair{+1, b}, {-1, a}})
    for (const auto& [other, q] : {std::pair{+1, d}, {-1, c}}) {
      sum.add(+weight * other, {p.x, q.y});
      sum.add(-weight * other, {p.y, q.x});
    }
  return sum.sign();
}

// The sign of the cross product (b - a) x (d - c): +1 if the vector from c to d turns left of that from a to b.
inline int cross_sign(Point a, Point b, Point c, Point d) {
  const double left = (b.x - a.x) * (d.y - c.y);
  const double right = (b.y - a.y) * (d.x - c.x);
  const double det = left - right;
  const double bound = ORIENT_BOUND * (std::abs(left) + std::abs(right)) + UNDERFLOW_SLACK;
  if (det > bound) return 1;
  if (-det > bound) return -1;
  return cross_exact(a, b, c, d);
}

// The sign of the dot product (b - a) . (d - c).
inline int dot_sign(Point a, Point b, Point c, Point d) {
  return cross_sign(a, b, {-c.y, c.x}, {-d.y, d.x});  // the second vector, rotated left
}

// The sign of det(c, d, z) (b.x - a.x) - det(a, b, z) (d.x - c.x), of degree three.
[[gnu::noinline, gnu::cold]] inline int crossing_exact(Point a, Point b, Point c, Point d, Point z) {
  ExactSum<3> sum;
  for (const Term& term : triangle_terms(c, d, z)) {
    sum.add(+term.weight, {term.first, term.second, b.x});
    sum.add(-term.weight, {term.first, term.second, a.x});
  }
  for (const Term& term : triangle_terms(a, b, z)) {
    sum.add(-term.weight, {term.first, term.second, d.x});
    sum.add(+term.weight, {term.first, term.second, c.x});
  }
  return sum.sign();
}

// The sign of height(ab) - height(cd), where the lines through a, b and c, d cross the vertical through z.
//
// For a < b < z <= c < d in lexicographic order, one of the edges not vertical. A vertical edge is as steep as an
// infinitesimal shear makes it: beside z it is infinitely high (ab) or low (cd) there, and on the vertical through z it
// passes through z.
inline int crossing(Point a, Point b, Point c, Point d, Point z) {
  if (a.x == z.x) return orientation(c, d, z);
  if (d.x == z.x) return -orientation(a, b, z);
  const double width_ab = b.x - a.x, width_cd = d.x - c.x;
  const double left_ab = (a.x - z.x) * (b.y - z.y), right_ab = (a.y - z.y) * (b.x - z.x);
  const double left_cd = (c.x - z.x) * (d.y - z.y), right_cd = (c.y - z.y) * (d.x - z.x);
  const double value = (left_cd - right_cd) * width_ab - (left_ab - right_ab) * width_cd;
  const double size_ab = std::abs(left_ab) + std::abs(right_ab) + UNDERFLOW_FACTOR;
  const double size_cd = std::abs(left_cd) + std::abs(right_cd) + UNDERFLOW_FACTOR;
  const double bound = CROSSING_BOUND * (size_cd * width_ab + size_ab * width_cd) + UNDERFLOW_SLACK;
  if (value > bound) return 1;
  if (-value > bound) return -1;
  return crossing_exact(a, b, c, d, z);
}

}  // namespace dynhull
