// Whether a ring of corners is simple: its edges meet only at the ends of neighbours.
#pragma once

#include <algorithm>
#include <numeric>
#include <span>
#include <vector>

#include "../predicates/signs.hpp"
#include "area.hpp"

namespace dynhull {

// +1 for a simple ring that has its inside on the left, -1 on the right, and 0 for all others. A corner that repeats
// the one before it makes a ring not simple. Edges are compared in the order of their least x: O(k log k) for k corners
// if few overlap in x, at worst O(k²).
inline int turning_if_simple(std::span<const Point> corners) {
  const std::size_t count = corners.size();
  if (count < 3) return 0;
  const auto after = [&](std::size_t i) { return i + 1 == count ? 0 : i + 1; };
  std::vector<Box> boxes(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Point a = corners[i], b = corners[after(i)];
    if (a == b) return 0;
    boxes[i] = Box::of({a, b});
  }
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(),
            [&](std::size_t i, std::size_t j) { return boxes[i].least.x < boxes[j].least.x; });
  // Neighbours share an end, and overlap only if they are collinear and turn back.
  const auto turns_back = [&](std::size_t i) {
    const Point a = corners[i], b = corners[after(i)], c = corners[after(after(i))];
    return orientation(a, b, c) == 0 && (a < b) != (b < c);
  };
  const auto meet = [&](std::size_t i, std::size_t j) {
    const Point a = corners[i], b = corners[after(i)], c = corners[j], d = corners[after(j)];
    return orientation(a, b, c) * orientation(a, b, d) <= 0 && orientation(c, d, a) * orientation(c, d, b) <= 0;
  };
  for (std::size_t first = 0; first < count; ++first) {
    const std::size_t i = order[first];
    if (turns_back(i)) return 0;
    for (std::size_t later = first + 1; later < count; ++later) {
      const std::size_t j = order[later];
      if (boxes[j].least.x > boxes[i].greatest.x) break;
      if (after(i) != j && after(j) != i && boxes[i].meets(boxes[j]) && meet(i, j)) return 0;
    }
  }
  const std::size_t least = std::min_element(corners.begin(), corners.end()) - corners.begin();
  return orientation(corners[least == 0 ? count - 1 : least - 1], corners[least], corners[after(least)]);
}

}  // namespace dynhull
