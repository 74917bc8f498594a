// A few vertices of a hull that show its shape.
#pragma once

#include <algorithm>
#include <cmath>
#include <queue>
#include <vector>

#include "../hull_tree.hpp"
#include "queries.hpp"

namespace dynhull {

// Vertices of a sketch, counter-clockwise from the least, and for each of its edges beyond which the hull has others
// the edge's ends and the farthest of them.
struct Sketch {
  struct Beyond {
    Edge edge;
    Point farthest;
  };
  std::vector<Point> vertices;
  std::vector<Beyond> beyond;
};

// Begins with the extreme vertices along the axes, and adds the vertex farthest from its edge until there are `most`
// (at least 4), after the adaptive sampling of Hershberger and Suri (2008). Between two extreme vertices a chain turns
// by a right angle at most, so a vertex beyond an edge is nearest to a point between the edge's ends. O(k log n).
inline Sketch sketch_of(const HullTree& tree, std::size_t most) {
  const Nodes& nodes = tree.nodes();
  Sketch sketch;
  if (nodes.root == NONE) return sketch;
  const Point first = nodes.first_point(nodes.root), last = nodes.last_point(nodes.root);
  std::vector<Point> chain[2];
  for (Side side : SIDES) {
    const Point middle = support(nodes, {0, side == UPPER ? 1.0 : -1.0});
    chain[side] = {first};
    if (first < middle && middle < last) chain[side].push_back(middle);
    if (first < last) chain[side].push_back(last);
  }

  // Heights only say which vertex to add next. The scale keeps products from overflowing.
  double largest = 0;
  for (Point p : {first, last, chain[UPPER][chain[UPPER].size() / 2], chain[LOWER][chain[LOWER].size() / 2]})
    largest = std::max({largest, std::abs(p.x), std::abs(p.y)});
  int scale;
  std::frexp(largest, &scale);
  const auto scaled = [&](Point p) { return Point{std::ldexp(p.x, -scale), std::ldexp(p.y, -scale)}; };
  const auto height = [&](Edge edge, Point apex) {
    const Point a = scaled(edge.a), b = scaled(edge.b), p = scaled(apex);
    const double dx = b.x - a.x, dy = b.y - a.y;
    const double length = std::sqrt(dx * dx + dy * dy);
    return length > 0 ? std::abs(difference_of_products(dx, p.y - a.y, dy, p.x - a.x)) / length : 0;
  };

  struct Candidate {
    double height;
    std::size_t number;  // earlier ones first among equals
    Side side;
    Sketch::Beyond beyond;
    bool operator<(const Candidate& other) const {
      return height < other.height || (height == other.height && number > other.number);
    }
  };
  std::priority_queue<Candidate> candidates;
  std::size_t number = 0;
  const auto consider = [&](Side side, Point a, Point b) {
    const Point apex = farthest(Cursor(nodes, nodes.root, side, a, b), side, a, b).a;
    if (apex != a && apex != b) candidates.push({height({a, b}, apex), number++, side, {{a, b}, apex}});
  };
  for (Side side : SIDES)
    for (std::size_t i = 1; i < chain[side].size(); ++i) consider(side, chain[side][i - 1], chain[side][i]);
  for (std::size_t size = chain[UPPER].size() + chain[LOWER].size() - 2; size < most && !candidates.empty(); ++size) {
    const Candidate next = candidates.top();
    candidates.pop();
    chain[next.side].push_back(next.beyond.farthest);
    consider(next.side, next.beyond.edge.a, next.beyond.farthest);
    consider(next.side, next.beyond.farthest, next.beyond.edge.b);
  }
  for (; !candidates.empty(); candidates.pop()) sketch.beyond.push_back(candidates.top().beyond);
  for (Side side : SIDES) std::sort(chain[side].begin(), chain[side].end());
  sketch.vertices = ring_of(std::move(chain[LOWER]), chain[UPPER]);
  return sketch;
}

}  // namespace dynhull
