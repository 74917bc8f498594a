// Points sorted by columns of x: count, place, and go on inside each column.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "point.hpp"

namespace dynhull {

// Which of `count` columns of equal width an x lies in. Never falls where x grows, because no rounding turns an order
// round. Every x is in column 0 where the width is no usable number: one x only, or farther apart than any double.
class Columns {
 public:
  Columns() = default;
  Columns(double least, double greatest, unsigned count) : least_(least), last_(static_cast<double>(count - 1)) {
    const double scale = last_ / (greatest - least);
    if (scale > 0 && std::isfinite(scale)) scale_ = scale;
  }

  bool usable() const { return scale_ > 0; }

  // Any double will do, NaN as well.
  unsigned operator()(double x) const {
    double column = (x - least_) * scale_;
    column = column > 0 ? column : 0;
    column = column < last_ ? column : last_;
    return static_cast<unsigned>(static_cast<int>(column));
  }

 private:
  double least_ = 0, last_ = 0, scale_ = 0;
};

// Insertion sort from one place to another, or in place. Linear for points that are almost in order.
inline void insert_in_order(const Point* from, std::size_t count, Point* to) {
  for (std::size_t i = 0; i < count; ++i) {
    const Point p = from[i];
    Point* gap = to + i;
    for (; gap > to && p < gap[-1]; --gap) *gap = gap[-1];
    *gap = p;
  }
}

// Sort in place; `scratch` is as long. O(n) where x is spread evenly over some scale, O(n log n) on all inputs.
inline void sort_points(Point* points, Point* scratch, std::size_t count, int depth = 0) {
  constexpr std::size_t FEW = 24, MOST_COLUMNS = 2048;
  constexpr int DEEPEST = 3;
  if (count <= FEW) return insert_in_order(points, count, points);
  double least = points[0].x, greatest = least;
  bool sorted = true;
  for (std::size_t i = 1; i < count; ++i) {
    least = std::min(least, points[i].x);
    greatest = std::max(greatest, points[i].x);
    sorted &= points[i - 1] <= points[i];
  }
  if (sorted) return;
  const auto width = static_cast<unsigned>(std::min(std::bit_ceil(count / 2), MOST_COLUMNS));
  const Columns columns(least, greatest, width);
  if (depth == DEEPEST || !columns.usable()) return std::sort(points, points + count);
  std::array<std::size_t, MOST_COLUMNS + 1> ends;  // of each column, once all are placed
  std::fill_n(ends.begin(), width + 1, 0);
  for (std::size_t i = 0; i < count; ++i) ++ends[columns(points[i].x) + 1];
  for (unsigned c = 1; c < width; ++c) ends[c] += ends[c - 1];
  for (std::size_t i = 0; i < count; ++i) scratch[ends[columns(points[i].x)]++] = points[i];
  std::size_t from = 0;
  for (unsigned c = 0; c < width; from = ends[c++])
    if (ends[c] - from > FEW) sort_points(scratch + from, points + from, ends[c] - from, depth + 1);
  insert_in_order(scratch, count, points);
}

}  // namespace dynhull
