// Queries on a tree, one point or direction at a time. O(log n) each, exact.
#pragma once

#include <optional>

#include "tree.hpp"

namespace dynhull {

// Where a point is: +1 inside, 0 on the boundary, -1 outside; then also the side and the edge that it lies beyond,
// unless it lies before or after all points.
struct Location {
  int where;
  Side side = UPPER;
  std::optional<Edge> edge = std::nullopt;
};

// The edge of a chain below or above p: strictly between its ends in the order. Otherwise p itself twice where it is a
// vertex, and nothing where it lies before or after all.
inline std::optional<Edge> edge_at(const Nodes& nodes, Side side, Point p) {
  Ref tree = nodes.root;
  while (!is_leaf(tree)) {
    const Edge& edge = nodes.bridge(tree, side);
    if (p > edge.a && p < edge.b) return edge;
    tree = nodes.node(tree).child[p > edge.a];
  }
  const Leaf& leaf = nodes.leaf(tree);
  const unsigned i = leaf.find(p);
  const Mask before = leaf.chain[side] & below(i), after = leaf.chain[side] & ~below(i);
  if (after && leaf[lowest(after)] == p) return Edge{p, p};
  if (!before || !after) return std::nullopt;
  return Edge{leaf[highest(before)], leaf[lowest(after)]};
}

inline Location locate(const Nodes& nodes, Point p) {
  if (nodes.root == NONE) return {-1};
  int inside = 1;
  for (Side side : SIDES) {
    const std::optional<Edge> edge = edge_at(nodes, side, p);
    if (!edge) return {-1};
    if (edge->a == p || edge->b == p) return {0};
    const int turn = turned(side, orientation(edge->a, edge->b, p));
    if (turn > 0) return {-1, side, edge};
    inside = std::min(inside, -turn);
  }
  return {inside};
}

// The vertex farthest in a direction; of two the lexicographically smaller.
inline Point support(const Nodes& nodes, Point direction) {
  const bool up = direction.y > 0 || (direction.y == 0 && direction.x < 0);
  Cursor cursor(nodes, nodes.root, up ? UPPER : LOWER);
  while (!cursor.single) {
    if (direction_sign(direction, cursor.a, cursor.b) > 0)
      cursor.go_right();
    else
      cursor.go_left();
  }
  return cursor.a;
}

// The left and the right tangent point seen from p, unless p is not strictly outside.
inline std::optional<Edge> tangents(const Nodes& nodes, Point p) {
  const Location at = locate(nodes, p);
  const Ref root = nodes.root;
  if (root == NONE || at.where >= 0) return std::nullopt;
  if (at.edge) {
    const Point before = tangent_to_left(Cursor(nodes, root, at.side, LOWEST, at.edge->a), p, at.side);
    const Point after = tangent_to_right(Cursor(nodes, root, at.side, at.edge->b, HIGHEST), p, at.side);
    return at.side == UPPER ? Edge{after, before} : Edge{before, after};
  }
  if (p < nodes.first_point(root))
    return Edge{tangent_to_right(Cursor(nodes, root, UPPER), p, UPPER),
                tangent_to_right(Cursor(nodes, root, LOWER), p, LOWER)};
  return Edge{tangent_to_left(Cursor(nodes, root, LOWER), p, LOWER),
              tangent_to_left(Cursor(nodes, root, UPPER), p, UPPER)};
}

}  // namespace dynhull
