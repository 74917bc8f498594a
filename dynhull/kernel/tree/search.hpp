// Searches along chains: the cursor, tangents from a point, the bridge of two subtrees.
#pragma once

#include <vector>

#include "nodes.hpp"

namespace dynhull {

// A binary search along the chain of a subtree, or along the part between two of its vertices. At every step (a, b) is
// an edge of the chain, and the caller chooses the side of it that holds the vertex; when one vertex is left, it is a.
// `Trees` holds the subtree: Nodes, or a view of them.
template <class Trees>
class Cursor {
 public:
  Point a, b;
  bool single = false;

  Cursor(const Trees& trees, Ref tree, Side side, Point lowest = LOWEST, Point highest = HIGHEST)
      : trees_(trees), side_(side), tree_(tree), lowest_(lowest), highest_(highest) {
    descend();
  }

  void go_left() {  // the sought vertex is a, or left of it
    if (is_leaf(tree_)) {
      chain_ &= before_;
      halve();
    } else {
      highest_ = a;
      tree_ = trees_.child(tree_, 0);
      descend();
    }
  }
  void go_right() {  // the sought vertex is b, or right of it
    if (is_leaf(tree_)) {
      chain_ &= ~before_;
      halve();
    } else {
      lowest_ = b;
      tree_ = trees_.child(tree_, 1);
      descend();
    }
  }

 private:
  // Skips the edges that are not between the two ends: at inner nodes, bridges below the chain.
  void descend() {
    if (lowest_ == highest_) return settle(lowest_);
    while (!is_leaf(tree_)) {
      const Edge& edge = trees_.bridge(tree_, side_);
      if (edge.b > highest_) {
        tree_ = trees_.child(tree_, 0);
      } else if (edge.a < lowest_) {
        tree_ = trees_.child(tree_, 1);
      } else {
        a = edge.a;
        b = edge.b;
        return;
      }
    }
    trees_.leaf(tree_).fetch();
    chain_ = trees_.chain(tree_, side_);
    halve();
  }
  // Halves the rest of a leaf's chain by entries rather than by vertices, which needs no list of vertices.
  void halve() {
    const Leaf& leaf = trees_.leaf(tree_);
    while (several(chain_)) {
      before_ = chain_ & below((lowest(chain_) + highest(chain_)) / 2 + 1);
      a = leaf[highest(before_)];
      b = leaf[lowest(chain_ & ~before_)];
      if (b > highest_)
        chain_ &= before_;
      else if (a < lowest_)
        chain_ &= ~before_;
      else
        return;
    }
    settle(leaf[lowest(chain_)]);
  }
  void settle(Point vertex) {
    a = b = vertex;
    single = true;
  }

  const Trees& trees_;
  Side side_;
  Ref tree_;
  Point lowest_, highest_;
  Mask chain_, before_;  // of a leaf: the rest of its chain, and the part up to a
};

// The tangent point of the chain seen from p, which is right of the chain and outside it; the farther of two.
template <class Trees>
Point tangent_to_left(Cursor<Trees> cursor, Point p, Side side) {
  while (!cursor.single) {
    if (turned(side, orientation(cursor.a, cursor.b, p)) >= 0)
      cursor.go_left();
    else
      cursor.go_right();
  }
  return cursor.a;
}

// The tangent point of the chain seen from p, which is left of the chain and outside it; the farther of two.
template <class Trees>
Point tangent_to_right(Cursor<Trees> cursor, Point p, Side side) {
  while (!cursor.single) {
    if (turned(side, orientation(cursor.a, cursor.b, p)) >= 0)
      cursor.go_right();
    else
      cursor.go_left();
  }
  return cursor.a;
}

// The edge that joins two chains, all of the left one < separator <= all of the right one. O(log n) orientations.
//
// With (a, b) an edge of the left chain, the bridge starts at a or before exactly when some point of the right chain
// is outside or on the line through a and b; likewise on the right. If both edges have each other's ends inside,
// their lines cross between the chains, and the side of the separator on which they do decides.
template <class Trees>
Edge find_bridge(Cursor<Trees> left, Cursor<Trees> right, Side side, Point separator) {
  while (true) {
    const Point a = left.a, b = left.b, c = right.a, d = right.b;
    if (left.single && right.single) return {a, c};
    const bool start_before = !left.single && (turned(side, orientation(a, b, c)) >= 0 ||
                                               (!right.single && turned(side, orientation(a, b, d)) >= 0));
    const bool end_after = !right.single && (turned(side, orientation(c, d, a)) >= 0 ||
                                             (!left.single && turned(side, orientation(c, d, b)) >= 0));
    if (start_before || end_after) {
      if (start_before) left.go_left();
      if (end_after) right.go_right();
    } else if (right.single) {
      left.go_right();
    } else if (left.single) {
      right.go_left();
    } else if (turned(side, crossing(a, b, c, d, separator)) >= 0) {
      left.go_right();
    } else {
      right.go_left();
    }
  }
}

// Whether p, a point of the subtree, is on its chain. O(log n).
inline bool on_chain(const Nodes& nodes, Ref tree, Side side, Point p) {
  while (!is_leaf(tree)) {
    const Edge& edge = nodes.bridge(tree, side);
    if (p == edge.a || p == edge.b) return true;
    if (p > edge.a && p < edge.b) return false;
    tree = nodes.node(tree).child[p > edge.a];
  }
  const Leaf& leaf = nodes.leaf(tree);
  const unsigned i = leaf.find(p);
  return leaf.holds(i, p) && (leaf.chain[side] & bit(i));
}

// Appends the vertices of a subtree's chain between two of them, left to right. O(log n) a vertex.
template <class Trees>
void collect(const Trees& trees, Ref tree, Side side, Point lowest, Point highest, std::vector<Point>& points) {
  if (tree == NONE) return;
  if (lowest == highest) return points.push_back(lowest);
  if (!is_leaf(tree)) {
    const Edge& edge = trees.bridge(tree, side);
    if (edge.a >= lowest) collect(trees, trees.child(tree, 0), side, lowest, std::min(edge.a, highest), points);
    if (edge.b <= highest) collect(trees, trees.child(tree, 1), side, std::max(edge.b, lowest), highest, points);
    return;
  }
  const Leaf& leaf = trees.leaf(tree);
  for (Mask mask = trees.chain(tree, side); mask; mask &= mask - 1) {
    const Point p = leaf[dynhull::lowest(mask)];
    if (p >= lowest && p <= highest) points.push_back(p);
  }
}

}  // namespace dynhull
