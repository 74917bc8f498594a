// Exact queries, one point, direction or line at a time. O(log n) each.
#pragma once

#include <optional>

#include "../tree/search.hpp"
#include "constructions.hpp"

namespace dynhull {

// +1 inside, 0 on the boundary, -1 outside. Outside, also the side and the edge beyond which the point is, unless it
// precedes or follows all points of the hull.
struct Location {
  int where;
  Side side = UPPER;
  std::optional<Edge> edge = std::nullopt;
};

// The edge of a chain above or below p, whose ends p is strictly between in lexicographic order. If p is a vertex, p
// twice; if p precedes or follows all points, none.
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

// The farthest vertex in a direction, the lexicographically smaller of two.
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

// The left and the right tangent point seen from p, if p is strictly outside.
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

// The part of a side nearest to p, which is outside and sees the side: an edge if the nearest point is between its
// ends, otherwise a vertex, twice. The distance first falls and then rises along the visible edges, and the hidden
// edges are beyond them.
template <class Trees>
Edge nearest(Cursor<Trees> cursor, Side side, Point p) {
  while (!cursor.single) {
    const Point a = cursor.a, b = cursor.b;
    if (turned(side, orientation(a, b, p)) <= 0)
      p > a ? cursor.go_right() : cursor.go_left();
    else if (dot_sign(b, p, a, b) >= 0)
      cursor.go_right();
    else if (dot_sign(a, p, a, b) <= 0)
      cursor.go_left();
    else
      return {a, b};
  }
  return {cursor.a, cursor.a};
}

inline double distance(Point p, Edge edge) {
  return edge.a == edge.b ? distance(p, edge.a) : distance_to_line(p, edge.a, edge.b);
}

// The part of the hull nearest to p: an edge, a vertex, twice, or p itself, twice, if it is not outside. None without
// points.
inline std::optional<Edge> nearest_part(const Nodes& nodes, Point p) {
  if (nodes.root == NONE) return std::nullopt;
  const Location at = locate(nodes, p);
  if (at.where >= 0) return Edge{p, p};
  const Edge one = nearest(Cursor(nodes, nodes.root, at.side), at.side, p);
  if (at.edge || !(one.a == one.b)) return one;
  // p precedes or follows all points and may see both sides; at least one of the vertices is their common end.
  const Edge other = nearest(Cursor(nodes, nodes.root, LOWER), LOWER, p);
  if (!(other.a == other.b)) return other;
  const Point vertex = p < one.a ? std::max(one.a, other.a) : std::min(one.a, other.a);
  return Edge{vertex, vertex};
}

// The distance from p to the hull, rounded once: 0 inside, infinite without points.
inline double distance(const Nodes& nodes, Point p) {
  const std::optional<Edge> part = nearest_part(nodes, p);
  if (!part) return INFINITE;
  return part->a == p ? 0 : distance(p, *part);
}

// The vertex of a side farthest from the line through p and q (p < q) on that side of the line; or an edge.
template <class Trees>
Edge farthest(Cursor<Trees> cursor, Side side, Point p, Point q) {
  while (!cursor.single) {
    const int turn = turned(side, cross_sign(p, q, cursor.a, cursor.b));
    if (turn == 0) return {cursor.a, cursor.b};
    turn > 0 ? cursor.go_right() : cursor.go_left();
  }
  return {cursor.a, cursor.a};
}

// The intersection of the line through p and q with a part of a chain that starts on the line's side `sign` and ends on
// the other.
template <class Trees>
Point crossing_point(Cursor<Trees> cursor, Point p, Point q, int sign) {
  while (true) {
    const Point a = cursor.a, b = cursor.b;
    const int at_b = sign * orientation(p, q, b);
    if (at_b == 0) return b;
    if (at_b > 0) {
      cursor.go_right();
    } else {
      const int at_a = sign * orientation(p, q, a);
      if (at_a == 0) return a;
      if (at_a > 0) return intersection(p, q, a, b);
      cursor.go_left();
    }
  }
}

// Where the line through p and q (p < q) enters and leaves the hull, each coordinate rounded once. A line that touches
// a vertex has it twice; a line along an edge has the edge's ends.
inline std::optional<Edge> chord(const Nodes& nodes, Point p, Point q) {
  const Ref root = nodes.root;
  if (root == NONE) return std::nullopt;
  Point vertex[2];
  for (Side side : {LOWER, UPPER}) {
    const Edge edge = farthest(Cursor(nodes, root, side), side, p, q);
    const int turn = turned(side, orientation(p, q, edge.a));
    if (turn < 0) return std::nullopt;
    if (turn == 0) return edge;
    vertex[side] = edge.a;
  }
  const Point first = nodes.first_point(root), last = nodes.last_point(root);
  const int at_first = orientation(p, q, first), at_last = orientation(p, q, last);
  Edge ends = {first, last};
  if (at_first != 0) {
    const Side side = at_first > 0 ? LOWER : UPPER;
    ends.a = crossing_point(Cursor(nodes, root, side, LOWEST, vertex[side]), p, q, at_first);
  }
  if (at_last != 0) {
    const Side side = at_last > 0 ? LOWER : UPPER;
    ends.b = crossing_point(Cursor(nodes, root, side, vertex[side], HIGHEST), p, q, -at_last);
  }
  return ends;
}

// The same, in the order from p to q.
inline std::optional<Edge> intersect_line(const Nodes& nodes, Point p, Point q) {
  if (p < q) return chord(nodes, p, q);
  const std::optional<Edge> ends = chord(nodes, q, p);
  return ends ? std::optional(Edge{ends->b, ends->a}) : std::nullopt;
}

}  // namespace dynhull
