// Whether a ring of corners is simple: its edges meet only at the ends of neighbours.
#pragma once

#include <algorithm>
#include <numeric>
#include <set>
#include <span>
#include <vector>

#include "../predicates/signs.hpp"
#include "area.hpp"

namespace dynhull {

// +1 for a simple ring that has its inside on the left, -1 on the right, and 0 for all others. A corner that repeats
// the one before it makes a ring not simple. O(k log k) for k corners: a line sweeps over them in their order, and
// edges that get neighbours on it are compared (Shamos and Hoey 1976).
inline int turning_if_simple(std::span<const Point> corners) {
  const std::size_t count = corners.size();
  if (count < 3) return 0;
  const auto after = [&](std::size_t i) { return i + 1 == count ? 0 : i + 1; };
  const auto before = [&](std::size_t i) { return i == 0 ? count - 1 : i - 1; };
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return corners[i] < corners[j]; });
  for (std::size_t k = 0; k + 1 < count; ++k)
    if (corners[order[k]] == corners[order[k + 1]]) return 0;
  for (std::size_t i = 0; i < count; ++i) {  // neighbours overlap only if they are collinear and turn back
    const Point a = corners[i], b = corners[after(i)], c = corners[after(after(i))];
    if (orientation(a, b, c) == 0 && (a < b) != (b < c)) return 0;
  }
  const auto meet = [&](std::size_t i, std::size_t j) {
    if (after(i) == j || after(j) == i) return false;
    const Point a = corners[i], b = corners[after(i)], c = corners[j], d = corners[after(j)];
    return Box::of({a, b}).meets(Box::of({c, d})) && orientation(a, b, c) * orientation(a, b, d) <= 0 &&
           orientation(c, d, a) * orientation(c, d, b) <= 0;
  };

  // The edges on the line, upwards. As long as none of them meet, their order on it does not change.
  const auto below = [&](std::size_t i, std::size_t j) {
    const auto [a, b] = std::minmax(corners[i], corners[after(i)]);
    const auto [c, d] = std::minmax(corners[j], corners[after(j)]);
    const auto side = [](Point from, Point to, Point p, Point q) {
      const int turn = orientation(from, to, p);
      return turn != 0 ? turn : orientation(from, to, q);
    };
    return a < c ? side(a, b, c, d) > 0 : side(c, d, a, b) < 0;
  };
  std::set<std::size_t, decltype(below)> line(below);
  std::vector<decltype(line)::iterator> at(count, line.end());
  for (const std::size_t corner : order) {
    const std::size_t edges[] = {before(corner), corner}, others[] = {before(corner), after(corner)};
    for (unsigned k = 0; k < 2; ++k) {
      if (!(corners[others[k]] < corners[corner])) continue;
      const auto above = line.erase(at[edges[k]]);
      if (above != line.begin() && above != line.end() && meet(*std::prev(above), *above)) return 0;
    }
    for (unsigned k = 0; k < 2; ++k) {
      if (corners[others[k]] < corners[corner]) continue;
      const auto [place, is_new] = line.insert(edges[k]);
      if (!is_new) return 0;
      at[edges[k]] = place;
      if (place != line.begin() && meet(*std::prev(place), *place)) return 0;
      if (const auto above = std::next(place); above != line.end() && meet(*place, *above)) return 0;
    }
  }
  const std::size_t least = order[0];
  return orientation(corners[before(least)], corners[least], corners[after(least)]);
}

}  // namespace dynhull
