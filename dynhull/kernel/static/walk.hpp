// What boxes inside and outside a hull are laid with: strips of x, and the edges of a chain above or below them.
#pragma once

#include <span>

#include "../predicates/signs.hpp"
#include "../sort/columns.hpp"

namespace dynhull {

// The edge of a chain at an increasing x, strictly between the chain's ends.
struct Walk {
  explicit Walk(std::span<const Point> chain) : edge(chain.data()) {}
  void advance(double x) {
    while (edge[1].x < x) ++edge;
  }
  double height(double x) const {
    return edge[0].y + (x - edge[0].x) / (edge[1].x - edge[0].x) * (edge[1].y - edge[0].y);
  }
  int side(Point p) const { return orientation(edge[0], edge[1], p); }
  const Point* edge;
};

// Columns between two coordinates, and strips that reach into both neighbours of a column.
struct Strips {
  struct Strip {
    double from, to;
    bool covers;  // whether it has all coordinates of its column, and none beyond the two
  };
  Strips(double left, double right, unsigned count)
      : columns(left, right, count), left(left), right(right), width((right - left) / (count - 1)) {}

  Strip operator()(unsigned column) const {
    const double from = left + (column - OVERLAP) * width, to = left + (column + 1 + OVERLAP) * width;
    return {from, to, left < from && to < right && columns(from) == column - 1 && columns(to) == column + 1};
  }

  Columns columns;

 private:
  static constexpr double OVERLAP = 0x1p-6;  // of adjacent columns, as a part of their width, to cover rounding
  double left, right, width;
};

}  // namespace dynhull
