// Finding the leaf and the entry of a point.
#pragma once

#include "nodes.hpp"

namespace dynhull {

// The place of a point, or the place where it belongs.
struct Place {
  Ref leaf;
  unsigned entry;
  bool there;
};

inline Place find_in(const Nodes& nodes, Ref tree, Point p) {
  const Leaf& leaf = nodes.leaf(tree);
  const unsigned i = leaf.find(p);
  return {tree, i, leaf.holds(i, p)};
}

inline Place find(const Nodes& nodes, Point p) {
  if (nodes.root == NONE) return {NONE, 0, false};
  const Ref tree = nodes.descend(nodes.root, p);
  nodes.leaf(tree).fetch();
  return find_in(nodes, tree, p);
}

// The same, faster if the leaf `guess` has points on both sides of p. The leaf may have been given back.
inline Place find_near(const Nodes& nodes, Ref guess, Point p) {
  const Leaf& leaf = nodes.leaf(guess);
  if (leaf.size > 0 && leaf.first() <= p && p <= leaf[leaf.size - 1]) return find_in(nodes, guess, p);
  return find(nodes, p);
}

}  // namespace dynhull
