// Boxes inside a hull, one for each column of x: a fast test that settles most of the points inside.
#pragma once

#include <algorithm>
#include <array>
#include <iterator>
#include <vector>

#include "../memory/prefetch.hpp"
#include "../sort/columns.hpp"
#include "chain.hpp"
#include "walk.hpp"

namespace dynhull {

// Rounded arithmetic chooses the box; exact orientations verify that each corner is in the hull, and a box that fails
// is dropped. A hull that contains the corners contains the box, so a point in the open box is no vertex. The box
// reaches into both neighbouring columns, so that it covers all points of its own column in x.
class InnerBoxes {
 public:
  // For a hull given by its vertices, counter-clockwise from the least.
  explicit InnerBoxes(std::span<const Point> vertices) {
    if (vertices.empty()) return;
    const auto greatest = std::max_element(vertices.begin(), vertices.end());
    std::vector<Point> upper = {vertices.front()};
    upper.insert(upper.end(), vertices.rbegin(), std::make_reverse_iterator(greatest));
    lay_boxes({vertices.begin(), greatest + 1}, upper);
  }
  // For a hull given by its chains, from left to right.
  InnerBoxes(std::span<const Point> lower, std::span<const Point> upper) { lay_boxes(lower, upper); }

  // True only for points strictly inside the hull; false for some of them too.
  bool holds(Point p) const {
    const Box& box = boxes_[columns_(p.x)];
    return (box.low < p.y) & (p.y < box.high);
  }

  // Copies the points that no box holds to `outside`, which has room for all, and returns their number. They include
  // all points that are not finite.
  std::size_t discard(std::span<const Point> points, Point* outside) const {
    const Columns columns = columns_;  // a local copy, which cannot alias `outside`, stays in registers
    std::size_t count = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      prefetch(points.data() + std::min(i + AHEAD, points.size() - 1));
      const Point p = points[i];
      const Box& box = boxes_[columns(p.x)];
      if (!((box.low < p.y) & (p.y < box.high))) outside[count++] = p;
    }
    return count;
  }

 private:
  static constexpr unsigned COLUMNS = 1024;
  static constexpr std::size_t AHEAD = 128;  // points: the processor foresees no more than the rest of a page
  static constexpr double MARGIN = 0x1p-20;  // of a box, as a part of its height, to cover rounding
  struct Box {
    double low, high;
  };
  static std::array<Box, COLUMNS> no_boxes() {
    std::array<Box, COLUMNS> boxes;
    boxes.fill({INFINITY, -INFINITY});
    return boxes;
  }

  void lay_boxes(std::span<const Point> lower, std::span<const Point> upper) {
    if (lower.size() + upper.size() < 5) return;
    const Strips strips(lower.front().x, lower.back().x, COLUMNS);
    columns_ = strips.columns;
    Walk lower_from(lower), lower_to(lower), upper_from(upper), upper_to(upper);
    for (unsigned j = 1; j + 1 < COLUMNS; ++j) {
      const auto [from, to, covers] = strips(j);
      if (!covers) continue;
      lower_from.advance(from);
      lower_to.advance(to);
      upper_from.advance(from);
      upper_to.advance(to);
      const double low = std::max(lower_from.height(from), lower_to.height(to));
      const double high = std::min(upper_from.height(from), upper_to.height(to));
      const double margin = MARGIN * (high - low);
      const Box box = {low + margin, high - margin};
      if (box.low < box.high && std::isfinite(box.low) && std::isfinite(box.high) &&
          lower_from.side({from, box.low}) >= 0 && lower_to.side({to, box.low}) >= 0 &&
          upper_from.side({from, box.high}) <= 0 && upper_to.side({to, box.high}) <= 0)
        boxes_[j] = box;
    }
  }

  Columns columns_;
  std::array<Box, COLUMNS> boxes_ = no_boxes();
};

}  // namespace dynhull
