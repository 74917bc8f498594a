// Exact comparisons of the distance from a point to a point or a segment with a radius, and distances to segments and
// circles.
#pragma once

#include "../query/constructions.hpp"

namespace dynhull {

// Far above the relative error of the few operations of a filter here.
constexpr double NEARNESS_BOUND = 64 * EPSILON;
constexpr double SMALLEST_SQUARE = 1e-250;  // below it the operands may have underflowed

// The sign of |pq| - (r + s + t), for a sum that is not negative, and in which at most the second term is.
inline int compare_distance(Point p, Point q, double r, double s, double t = 0) {
  const double dx = p.x - q.x, dy = p.y - q.y, reach = r + s + t;
  const double square = dx * dx + dy * dy, most = reach * reach;
  const double bound = NEARNESS_BOUND * (square + most) + SMALLEST_SQUARE;
  if (square - most > bound) return 1;
  if (most - square > bound) return -1;
  ExactSum<2> sum;
  for (const Term& term : squared_length_terms(p, q)) sum.add(term.weight, {term.first, term.second});
  sum.add(-1, {r, r});
  sum.add(-2, {r, s});
  sum.add(-1, {s, s});
  if (t != 0) {
    sum.add(-2, {r, t});
    sum.add(-2, {s, t});
    sum.add(-1, {t, t});
  }
  return sum.sign();
}

// The sign of the distance from p to the line through a and b, minus r + s, for radii r, s >= 0.
inline int compare_distance_to_line(Point p, Point a, Point b, double r, double s = 0) {
  const double left = (a.x - p.x) * (b.y - p.y), right = (a.y - p.y) * (b.x - p.x);
  const double ux = b.x - a.x, uy = b.y - a.y;
  const double area = std::abs(left - right), error = ORIENT_BOUND * (std::abs(left) + std::abs(right));
  const double most = (r + s) * std::hypot(ux, uy);
  const double bound = error + NEARNESS_BOUND * (area + most) + SMALLEST_SQUARE;
  if (area - most > bound) return 1;
  if (most - area > bound) return -1;
  ExactSum<4> sum;
  const auto terms = triangle_terms(a, b, p);
  for (const Term& one : terms)
    for (const Term& other : terms)
      sum.add(one.weight * other.weight, {one.first, one.second, other.first, other.second});
  for (const Term& term : squared_length_terms(a, b)) {
    sum.add(-term.weight, {term.first, term.second, r, r});
    if (s == 0) continue;
    sum.add(-2 * term.weight, {term.first, term.second, r, s});
    sum.add(-term.weight, {term.first, term.second, s, s});
  }
  return sum.sign();
}

// The part of a segment nearest to p: one of its ends, twice, or itself.
inline Edge nearest_part(Point p, Edge edge) {
  if (edge.a == edge.b || dot_sign(edge.a, p, edge.a, edge.b) <= 0) return {edge.a, edge.a};
  if (dot_sign(edge.b, p, edge.a, edge.b) >= 0) return {edge.b, edge.b};
  return edge;
}

// The sign of the distance from p to such a part, minus r + s.
inline int compare_distance(Point p, Edge part, double r, double s = 0) {
  return part.a == part.b ? compare_distance(p, part.a, r, s) : compare_distance_to_line(p, part.a, part.b, r, s);
}

// The distance from p to a segment, rounded once.
inline double distance_to_segment(Point p, Edge edge) {
  const Edge part = nearest_part(p, edge);
  if (!(part.a == part.b)) return orientation(part.a, part.b, p) == 0 ? 0 : distance_to_line(p, part.a, part.b);
  return p == part.a ? 0 : distance(p, part.a);
}

// Bounds of the distance from a point to a segment.
struct AboutDistance {
  double least = 0, most = INFINITE;

  AboutDistance(Point p, Edge edge) {
    const double ux = edge.b.x - edge.a.x, uy = edge.b.y - edge.a.y, vx = p.x - edge.a.x, vy = p.y - edge.a.y;
    const double square = ux * ux + uy * uy;
    if (!(square > SMALLEST_SQUARE && square < 1 / SMALLEST_SQUARE)) return;
    const double share = std::clamp((ux * vx + uy * vy) / square, 0.0, 1.0);
    const double x = vx - share * ux, y = vy - share * uy, distance = std::sqrt(x * x + y * y);
    const double error = NEARNESS_BOUND * (std::abs(ux) + std::abs(uy) + std::abs(vx) + std::abs(vy));
    if (!(distance + error < INFINITE)) return;
    least = distance - error;
    most = distance + error;
  }
};

// The distance from p to the nearest of some segments, rounded once. Infinite if there are none. `for_each` is called
// with a distance and a visit, and may leave out segments that are farther than that; a visit may lower it.
template <class ForEach>
double distance_to_nearest(Point p, ForEach for_each) {
  double most = INFINITE, nearest = INFINITE;
  double least = INFINITE, others = INFINITE;  // of the segment with the least `most`, and of all others
  Edge first{};
  for_each(most, [&](Edge edge) {
    const AboutDistance about(p, edge);
    others = std::min(others, about.most < most ? least : about.least);
    if (!(about.most < most)) return;
    first = edge;
    least = about.least;
    most = about.most;
  });
  if (most < others) return distance_to_segment(p, first);
  for_each(most, [&](Edge edge) {
    if (AboutDistance(p, edge).least <= most) nearest = std::min(nearest, distance_to_segment(p, edge));
  });
  return nearest;
}

[[gnu::noinline, gnu::cold]] inline double distance_to_circle_exact(Point p, Point center, double radius) {
  const auto square = squared_length_terms(p, center);
  const Scaled length = root(exact_sum(square).approximate());
  const double guess = std::max(std::ldexp(length.mantissa, length.exponent) - radius, 0.0);
  return nearest_double(std::isfinite(guess) ? guess : 0, [&](double r, double ulp) {
    ExactSum<2> sum;  // 4 square - (2 radius + 2 r + ulp)^2
    for (const Term& term : square) sum.add(4 * term.weight, {term.first, term.second});
    sum.add(-4, {radius, radius});
    sum.add(-4, {r, r});
    sum.add(-1, {ulp, ulp});
    sum.add(-8, {radius, r});
    sum.add(-4, {radius, ulp});
    sum.add(-4, {r, ulp});
    return sum.sign();
  });
}

// The distance from p, which is outside, to a circle, rounded once.
inline double distance_to_circle(Point p, Point center, double radius) {
  const DoubleDouble square = squared_length(p, center);
  if (safe(square.high) && (radius == 0 || safe(radius))) {
    const DoubleDouble length = root(square);
    if (const auto result = rounded(sum(length, {-radius, 0}), DOUBLE_DOUBLE_ERROR * (length.high + radius)))
      return *result;
  }
  return distance_to_circle_exact(p, center, radius);
}

}  // namespace dynhull
