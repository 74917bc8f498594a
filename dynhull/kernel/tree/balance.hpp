// AVL balance: rotations, joins, splits and merges of leaves, with the bridges that they change.
#pragma once

#include "search.hpp"

namespace dynhull {

inline Edge bridge_of(const Nodes& nodes, Ref left, Ref right, Side side, Point separator) {
  return find_bridge(Cursor(nodes, left, side), Cursor(nodes, right, side), side, separator);
}

// Recomputes a node's height from its children.
inline void refresh_height(Nodes& nodes, Ref v) {
  Node& node = nodes.node(v);
  node.height = 1 + std::max(nodes.height(node.child[0]), nodes.height(node.child[1]));
}

// Recomputes a node's height and bridges from its children. O(log n).
inline void refresh(Nodes& nodes, Ref v) {
  const Node& node = nodes.node(v);
  for (Side side : SIDES) nodes.bridge(v, side) = bridge_of(nodes, node.child[0], node.child[1], side, node.separator);
  refresh_height(nodes, v);
}

inline int lean(const Nodes& nodes, Ref v) {
  const Node& node = nodes.node(v);
  return static_cast<int>(nodes.height(node.child[0])) - static_cast<int>(nodes.height(node.child[1]));
}

// Rotates child `up` of v above v and returns it. The caller links it to v's old parent.
//
// The chain of the whole subtree does not change. If its edge across v's separator does not end in the inner
// grandchild, the two nodes swap bridges; otherwise the new top keeps its bridge, and v gets a new one.
inline Ref rotate_once(Nodes& nodes, Ref v, int up) {
  const Ref top = nodes.node(v).child[up];
  const Ref inner = nodes.node(top).child[1 - up];
  nodes.link(v, up, inner);
  nodes.link(top, 1 - up, v);
  const Node& below = nodes.node(v);
  for (Side side : SIDES) {
    Edge& lower = nodes.bridge(v, side);
    Edge& upper = nodes.bridge(top, side);
    const bool ends_in_inner = up == 0 ? lower.a >= nodes.node(top).separator : lower.b < nodes.node(top).separator;
    if (!ends_in_inner) {
      upper = lower;
      lower = bridge_of(nodes, below.child[0], below.child[1], side, below.separator);
    }
  }
  refresh_height(nodes, v);
  refresh_height(nodes, top);
  return top;
}

// Restores the AVL condition at v, whose children differ in height by two. Returns the node that replaces v.
inline Ref rotate(Nodes& nodes, Ref v) {
  const Ref parent = nodes.node(v).parent;
  const int up = lean(nodes, v) > 0 ? 0 : 1;
  const Ref child = nodes.node(v).child[up];
  const int inward = up == 0 ? -lean(nodes, child) : lean(nodes, child);
  if (inward > 0) nodes.link(v, up, rotate_once(nodes, child, 1 - up));
  const Ref top = rotate_once(nodes, v, up);
  nodes.replace(parent, v, top);
  return top;
}

// Restores the AVL condition from v upwards; stops at the first height that does not change.
inline void rebalance(Nodes& nodes, Ref v) {
  while (v != NONE) {
    const unsigned height = nodes.node(v).height;
    if (std::abs(lean(nodes, v)) > 1)
      v = rotate(nodes, v);
    else
      refresh_height(nodes, v);
    if (nodes.node(v).height == height) return;
    v = nodes.node(v).parent;
  }
}

// Joins two detached subtrees of any heights by v, where all of the left < v's separator <= all of the right.
// O(difference of heights) bridges.
inline Ref join(Nodes& nodes, Ref left, Ref right, Ref v) {
  const int difference = static_cast<int>(nodes.height(left)) - static_cast<int>(nodes.height(right));
  if (std::abs(difference) <= 1) {
    nodes.link(v, 0, left);
    nodes.link(v, 1, right);
    refresh(nodes, v);
    nodes.node(v).parent = NONE;
    return v;
  }
  const int inner = difference > 0 ? 1 : 0;  // the child of the higher tree that the lower tree joins
  const Ref top = difference > 0 ? left : right;
  const Ref child = nodes.node(top).child[inner];
  nodes.link(top, inner, difference > 0 ? join(nodes, child, right, v) : join(nodes, left, child, v));
  refresh(nodes, top);
  nodes.node(top).parent = NONE;
  if (std::abs(lean(nodes, top)) <= 1) return top;
  const Ref root = nodes.root;
  const Ref result = rotate(nodes, top);  // sets nodes.root, as top has no parent
  nodes.root = root;
  return result;
}

// Splits a full leaf in two. The chain does not change, and its edge across the cut becomes the new node's bridge.
// Returns the new leaf, on the right.
inline Ref split(Nodes& nodes, Ref left) {
  const Ref right = nodes.take_leaf(), v = nodes.take_node();
  Leaf& low = nodes.leaf(left);
  Leaf& high = nodes.leaf(right);
  const unsigned half = low.size / 2;
  high.size = low.size - half;
  std::copy(low.x + half, low.x + low.size, high.x);
  std::copy(low.y + half, low.y + low.size, high.y);
  std::fill(low.x + half, low.x + LEAF, INFINITE);
  std::fill(high.x + high.size, high.x + LEAF, INFINITE);
  high.repeated = low.repeated >> half;
  low.repeated &= below(half);
  low.size = half;
  for (Side side : SIDES) {
    const Mask before = low.chain[side] & below(half), after = low.chain[side] >> half;
    const unsigned a = highest(before), b = lowest(after);
    nodes.bridge(v, side) = {low[a], high[b]};
    low.chain[side] = before | low.scan(side, a, half - 1);
    high.chain[side] = after | high.scan(side, 0, b);
  }
  const Ref parent = low.parent;
  nodes.node(v).separator = high.first();
  nodes.node(v).height = 1;
  nodes.replace(parent, left, v);
  nodes.link(v, 0, left);
  nodes.link(v, 1, right);
  rebalance(nodes, parent);
  return right;
}

// Removes an empty leaf; its sibling replaces their parent. Returns the node above, from which to rebalance.
inline Ref drop(Nodes& nodes, Ref tree) {
  const Ref parent = nodes.leaf(tree).parent;
  nodes.give_back(tree);
  if (parent == NONE) {
    nodes.root = NONE;
    return NONE;
  }
  const Ref above = nodes.node(parent).parent;
  nodes.replace(above, parent, nodes.node(parent).child[1 - nodes.rank(parent, tree)]);
  nodes.give_back(parent);
  return above;
}

// Moves a small leaf's points into the adjacent leaf below the same parent, if they fit.
inline void merge(Nodes& nodes, Ref small) {
  const Ref parent = nodes.leaf(small).parent;
  if (parent == NONE) return;
  const int rank = nodes.rank(parent, small);
  const Ref sibling = nodes.node(parent).child[1 - rank];
  const Ref neighbour = is_leaf(sibling) ? sibling : nodes.node(sibling).child[rank];
  const Leaf& low = nodes.leaf(rank == 0 ? small : neighbour);
  const Leaf& high = nodes.leaf(rank == 0 ? neighbour : small);
  if (low.size + high.size > FILL) return;
  Point points[LEAF];
  for (unsigned i = 0; i < low.size; ++i) points[i] = low[i];
  for (unsigned i = 0; i < high.size; ++i) points[low.size + i] = high[i];
  const Mask repeated = low.repeated | high.repeated << low.size;
  nodes.leaf(neighbour).assign(points, low.size + high.size);
  nodes.leaf(neighbour).repeated = repeated;
  const Ref above = nodes.node(parent).parent;
  nodes.replace(above, parent, sibling);
  nodes.give_back(small);
  nodes.give_back(parent);
  if (is_leaf(sibling)) {
    rebalance(nodes, above);
  } else {
    refresh(nodes, sibling);
    rebalance(nodes, above);
  }
}

}  // namespace dynhull
