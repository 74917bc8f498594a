// Bounds of a hull, a pair for each column of x: a fast test that settles most of the points outside.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "walk.hpp"

namespace dynhull {

// The hull is on one side of the line through any of its edges. Rounded arithmetic chooses a height over a column at
// which the line of the edge in its middle has been left; exact orientations verify that both ends of the column at
// that height are outside the edge, and a bound that fails is dropped. What lies beyond it is then outside, too.
class OuterBounds {
 public:
  // For a hull given by its chains, from left to right.
  OuterBounds(std::span<const Point> lower, std::span<const Point> upper) {
    bounds_.fill({-INFINITY, INFINITY});
    if (lower.size() < 2 || upper.size() < 2) return;
    const Strips strips(lower.front().x, lower.back().x, COLUMNS);
    columns_ = strips.columns;
    Walk below(lower), above(upper);
    for (unsigned j = 1; j + 1 < COLUMNS; ++j) {
      const auto [from, to, covers] = strips(j);
      if (!covers) continue;
      below.advance(from + (to - from) / 2);
      above.advance(from + (to - from) / 2);
      const double low = std::min(below.height(from), below.height(to));
      const double high = std::max(above.height(from), above.height(to));
      const double margin = MARGIN * (high - low);
      const Bound bound = {low - margin, high + margin};
      if (std::isfinite(bound.low) && below.side({from, bound.low}) < 0 && below.side({to, bound.low}) < 0)
        bounds_[j].low = bound.low;
      if (std::isfinite(bound.high) && above.side({from, bound.high}) > 0 && above.side({to, bound.high}) > 0)
        bounds_[j].high = bound.high;
    }
  }

  // True only for points strictly outside the hull; false for some of them too. The point is finite.
  bool leave_out(Point p) const {
    const Bound& bound = bounds_[columns_(p.x)];
    return (p.y < bound.low) | (p.y > bound.high);
  }

 private:
  static constexpr unsigned COLUMNS = 1024;
  static constexpr double MARGIN = 0x1p-20;  // of the height between two bounds, to cover rounding
  struct Bound {
    double low, high;
  };

  Columns columns_;
  std::array<Bound, COLUMNS> bounds_;
};

}  // namespace dynhull
