// Convex layers, and what each vertex contributes to the area.
#pragma once

#include "../hull_tree.hpp"
#include "constructions.hpp"
#include "peeled.hpp"

namespace dynhull {

// The vertices of the outermost layers, counter-clockwise from the least: those of the hull, then those of the hull of
// the points left without them, and so on; fewer layers where no points are left. O(log² n) a vertex. Chazelle, "On the
// convex layers of a planar set" (1985).
inline std::vector<std::vector<Point>> layers_of(const HullTree& tree, std::size_t count) {
  std::vector<std::vector<Point>> layers;
  Peeled rest(tree.nodes());
  std::vector<Point> lower, upper, gone;
  while (layers.size() < count && rest.root() != NONE) {
    lower.clear();
    upper.clear();
    gone.clear();
    rest.collect(LOWER, LOWEST, HIGHEST, lower);
    rest.collect(UPPER, LOWEST, HIGHEST, upper);
    std::merge(lower.begin(), lower.end(), upper.begin() + 1, upper.end() - (upper.size() > 1),
               std::back_inserter(gone));
    rest.take(gone);
    layers.push_back(ring_of(lower, upper));
  }
  return layers;
}

// Half of a sum >= 0, rounded once.
inline double half_of(const ExactSum<2>& doubled) {
  const Scaled guess = doubled.approximate();
  return nearest_double(std::ldexp(guess.mantissa, guess.exponent - 1), [&](double r, double ulp) {
    ExactSum<2> rest = doubled;  // doubled - (2 r + ulp)
    rest.add(-2, {r, 1.0});
    rest.add(-1, {ulp, 1.0});
    return rest.sign();
  });
}

// The area inside a closed line, rounded once.
inline double area_of(const std::vector<Point>& ring) {
  ExactSum<2> doubled;
  Point p = ring.back();
  for (Point q : ring) {
    doubled.add(+1, {p.x, q.y});
    doubled.add(-1, {p.y, q.x});
    p = q;
  }
  return half_of(doubled);
}

// For each vertex, in the order of vertices_of, the area that the hull loses without it (all its copies): the exact
// value rounded once. O(log² n) a vertex, and O(log n) for each vertex that appears.
inline std::vector<double> influence_of(const HullTree& tree) {
  const std::vector<Point> vertices = vertices_of(tree);
  const std::size_t count = vertices.size();
  std::vector<double> areas(count, 0.0);
  if (count < 3) return areas;
  Peeled rest(tree.nodes());
  std::vector<Point> ring, part;
  const std::size_t turning =
      static_cast<std::size_t>(std::max_element(vertices.begin(), vertices.end()) - vertices.begin());
  const auto append = [&](Side side, Point from, Point to) {  // the new chain from one point to another
    part.clear();
    rest.collect(side, std::min(from, to), std::max(from, to), part);
    from < to ? ring.insert(ring.end(), part.begin(), part.end()) : ring.insert(ring.end(), part.rbegin(), part.rend());
  };
  for (std::size_t i = 0; i < count; ++i) {
    const Point before = vertices[(i + count - 1) % count], after = vertices[(i + 1) % count];
    rest.take({&vertices[i], 1});
    ring.assign({before, vertices[i], after});
    // Back from `after` to `before`, on one side, or on both around an end.
    if (i == 0) {
      append(LOWER, after, LOWEST);
      append(UPPER, LOWEST, before);
    } else if (i == turning) {
      append(UPPER, after, HIGHEST);
      append(LOWER, HIGHEST, before);
    } else {
      append(i < turning ? LOWER : UPPER, after, before);
    }
    areas[i] = area_of(ring);
    rest.restore();
  }
  return areas;
}

}  // namespace dynhull
