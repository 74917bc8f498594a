// The sign of a measure of a convex polygon less a bound, in floating point with a bound on the error.
#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>

#include "../sort/distinct.hpp"

namespace dynhull {

// What a measure is at least and at most; of the diameter and the width, their squares.
struct Interval {
  double low, high;
};

// Between vertices, counter-clockwise; at least three, for the diameter two.
class Measured {
 public:
  explicit Measured(std::span<const Point> vertices) : vertices_(vertices) {
    double left = vertices[0].x, right = left, bottom = vertices[0].y, top = bottom;
    for (const Point p : vertices) {
      left = std::min(left, p.x);
      right = std::max(right, p.x);
      bottom = std::min(bottom, p.y);
      top = std::max(top, p.y);
    }
    width_ = right - left;
    height_ = top - bottom;
  }

  // Whether nothing overflows, and what underflows is far below the bounds on the errors.
  bool safe() const {
    const double longer = std::max(width_, height_);
    return longer > 0x1p-200 && longer < 0x1p200;
  }
  // Whether there are few enough to compare each with each.
  bool few() const { return vertices_.size() <= 64; }

  // Twice the area.
  Interval doubled_area_in_box() const { return {0, 2 * more(width_ * height_)}; }
  Interval doubled_area() const {
    const Point first = vertices_[0];
    double total = 0, sizes = 0;
    for (std::size_t i = 1; i + 1 < vertices_.size(); ++i) {
      const Point a = vertices_[i], b = vertices_[i + 1];
      const double one = (a.x - first.x) * (b.y - first.y), other = (a.y - first.y) * (b.x - first.x);
      total += one - other;
      sizes += std::abs(one) + std::abs(other);
    }
    // Three roundings of each product, one of its difference, and one of each sum, here and in `sizes`; doubled.
    const double error = 2 * (double(vertices_.size()) + 8) * UNIT * sizes + TINY;
    return {total - error, total + error};
  }

  Interval squared_diameter_in_box() const {
    const double longer = std::max(width_, height_);
    return {less(longer * longer), more(width_ * width_ + height_ * height_)};
  }
  // O(h²).
  Interval squared_diameter() const {
    double longest = 0;
    for (std::size_t i = 0; i < vertices_.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) longest = std::max(longest, square_to(i, j));
    return {less(longest), more(longest)};
  }

  Interval squared_width_in_box() const {
    const double shorter = std::min(width_, height_);
    return {0, more(shorter * shorter) + TINY};
  }
  // The least height over an edge: O(h²).
  Interval squared_width() const {
    Interval least{HUGE_VAL, HUGE_VAL};
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      const Point a = vertices_[i], b = vertices_[next(i)];
      double low = 0, high = 0;
      for (const Point p : vertices_) {
        const double one = (b.x - a.x) * (p.y - a.y), other = (b.y - a.y) * (p.x - a.x);
        const double error = 8 * UNIT * (std::abs(one) + std::abs(other)) + TINY;
        low = std::max(low, one - other - error);
        high = std::max(high, one - other + error);
      }
      const double length = square_to(i, next(i)), shortest = less(length) - TINY;
      if (low * low > SUBNORMAL)
        least.low = std::min(least.low, less(low * low / (more(length) + TINY)));
      else
        least.low = 0;
      if (shortest > 0) least.high = std::min(least.high, more(std::max(high * high, SUBNORMAL) / shortest));
    }
    return least;
  }

  // The sign of what is in an interval less a number that is rounded at most once; nothing if both are possible.
  static std::optional<int> sign(Interval interval, double bound) {
    if (interval.low > more(bound) + TINY) return 1;
    if (interval.high < less(bound) - TINY) return -1;
    return std::nullopt;
  }

 private:
  static constexpr double UNIT = 0x1p-53, TINY = 0x1p-1000, SUBNORMAL = 0x1p-960;

  // More and less than a number that is the result of up to five operations.
  static double more(double value) { return value * (1 + 16 * UNIT); }
  static double less(double value) { return value * (1 - 16 * UNIT); }

  std::size_t next(std::size_t i) const { return i + 1 == vertices_.size() ? 0 : i + 1; }
  double square_to(std::size_t i, std::size_t j) const {
    const double x = vertices_[i].x - vertices_[j].x, y = vertices_[i].y - vertices_[j].y;
    return x * x + y * y;
  }

  std::span<const Point> vertices_;
  double width_, height_;
};

// The sign, or nothing where rounding might decide: first by the box around the vertices, then by themselves, unless
// that would take long. O(h), or O(h²) of few vertices. `measure` is the first letter of area, diameter or width.
inline std::optional<int> certain_sign(std::span<const Point> vertices, char measure, double bound) {
  // Of a point or a segment nothing is rounded: it has neither area nor width, and a point no diameter.
  if (vertices.size() < (measure == 'd' ? 2 : 3)) return bound > 0 ? -1 : 0;
  const Measured hull(vertices);
  if (!hull.safe()) return std::nullopt;
  const auto either = [&](Interval (Measured::*in_box)() const, Interval (Measured::*nearly)() const, bool possible,
                          double number) {
    const std::optional<int> sign = Measured::sign((hull.*in_box)(), number);
    return sign || !possible ? sign : Measured::sign((hull.*nearly)(), number);
  };
  switch (measure) {
    case 'a': return either(&Measured::doubled_area_in_box, &Measured::doubled_area, true, 2 * bound);
    case 'd': return either(&Measured::squared_diameter_in_box, &Measured::squared_diameter, hull.few(), bound * bound);
    case 'w': return either(&Measured::squared_width_in_box, &Measured::squared_width, hull.few(), bound * bound);
    default: return std::nullopt;
  }
}

}  // namespace dynhull
