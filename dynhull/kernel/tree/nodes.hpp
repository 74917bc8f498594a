// Leaves, inner nodes and their links, addressed by number in growing pools.
#pragma once

#include "../memory/pool.hpp"
#include "leaf.hpp"

namespace dynhull {

// A subtree: the number of a node, or of a leaf with the highest bit set; NONE if empty.
using Ref = std::uint32_t;
constexpr Ref LEAF_BIT = Ref{1} << 31;
inline bool is_leaf(Ref tree) { return tree >= LEAF_BIT; }
inline Ref leaf_ref(std::uint32_t leaf) { return leaf | LEAF_BIT; }
inline std::uint32_t leaf_number(Ref tree) { return tree & ~LEAF_BIT; }

// The fields that a descent reads; left < separator <= right. Two nodes fill a cache line.
struct Node {
  Ref child[2];
  Point separator;
  std::uint32_t parent;
  std::uint32_t height;
};
static_assert(sizeof(Node) == 32);

// The fields that a climb reads: for each side the bridge, the common tangent of the children's chains.
struct Bridges {
  Edge side[2];
};

class Nodes {
 public:
  Leaf& leaf(Ref tree) { return leaves_[leaf_number(tree)]; }
  const Leaf& leaf(Ref tree) const { return leaves_[leaf_number(tree)]; }
  Node& node(Ref tree) { return nodes_[tree]; }
  const Node& node(Ref tree) const { return nodes_[tree]; }
  Edge& bridge(Ref tree, Side side) { return bridges_[tree].side[side]; }
  const Edge& bridge(Ref tree, Side side) const { return bridges_[tree].side[side]; }

  Ref child(Ref tree, int rank) const { return node(tree).child[rank]; }
  Mask chain(Ref tree, Side side) const { return leaf(tree).chain[side]; }

  unsigned height(Ref tree) const { return is_leaf(tree) ? 0 : node(tree).height; }
  Ref parent(Ref tree) const { return is_leaf(tree) ? leaf(tree).parent : node(tree).parent; }
  void set_parent(Ref tree, Ref parent) { (is_leaf(tree) ? leaf(tree).parent : node(tree).parent) = parent; }

  // The leaf where p belongs.
  Ref descend(Ref tree, Point p) const {
    while (!is_leaf(tree)) tree = step(tree, p);
    return tree;
  }
  Ref step(Ref tree, Point p) const {
    const Node& node = this->node(tree);
    bool right = p.x > node.separator.x;
    if (p.x == node.separator.x) [[unlikely]]
      right = p.y >= node.separator.y;
    return node.child[right];
  }
  Ref first_leaf(Ref tree) const {
    while (!is_leaf(tree)) tree = node(tree).child[0];
    return tree;
  }
  Point first_point(Ref tree) const { return leaf(first_leaf(tree)).first(); }
  Point last_point(Ref tree) const {
    while (!is_leaf(tree)) tree = node(tree).child[1];
    return leaf(tree)[leaf(tree).size - 1];
  }

  // The index of a subtree among its parent's children.
  int rank(Ref parent, Ref tree) const { return node(parent).child[1] == tree; }

  void link(Ref parent, int rank, Ref tree) {
    node(parent).child[rank] = tree;
    set_parent(tree, parent);
  }
  // Puts a subtree, or NONE, in place of another below `parent`, or at the root.
  void replace(Ref parent, Ref old, Ref tree) {
    if (parent != NONE) {
      link(parent, rank(parent, old), tree);
    } else {
      root = tree;
      if (tree != NONE) set_parent(tree, NONE);
    }
  }

  // Makes room for `extra` more leaves and nodes; no other method throws.
  void reserve(std::size_t extra) {
    leaves_.reserve(extra);
    nodes_.reserve(extra);
    bridges_.reserve(extra);
  }
  // A new leaf or node is uninitialised, and has no parent until it is linked or put in a place.
  Ref take_leaf() { return leaf_ref(leaves_.take()); }
  Ref take_node() {
    bridges_.take();
    return nodes_.take();
  }
  void give_back(Ref tree) {
    if (is_leaf(tree)) {
      leaf(tree).size = 0;
      leaves_.give_back(leaf_number(tree));
    } else {
      nodes_.give_back(tree);
      bridges_.give_back(tree);
    }
  }

  // Room for `count` leaves and nodes, as Nodes of their own over the same memory: another thread may change subtrees
  // through them while this one changes others. Needs that much room; `take_back` ends it.
  Nodes lend(std::size_t count) {
    Nodes lent;
    lent.leaves_ = leaves_.lend(count);
    lent.nodes_ = nodes_.lend(count);
    lent.bridges_ = bridges_.lend(count);
    return lent;
  }
  void take_back(Nodes& lent) {
    leaves_.take_back(lent.leaves_);
    nodes_.take_back(lent.nodes_);
    bridges_.take_back(lent.bridges_);
  }

  // Greater than the number of every leaf and of every node.
  std::uint32_t leaf_end() const { return leaves_.end(); }
  std::uint32_t node_end() const { return nodes_.end(); }
  std::size_t leaf_count() const { return leaves_.used(); }
  std::size_t node_count() const { return nodes_.used(); }
  std::size_t used_bytes() const {
    return leaves_.used() * sizeof(Leaf) + nodes_.used() * (sizeof(Node) + sizeof(Bridges));
  }
  std::size_t reserved_bytes() const {
    return leaves_.reserved_bytes() + nodes_.reserved_bytes() + bridges_.reserved_bytes();
  }

  Ref root = NONE;

 private:
  Pool<Leaf> leaves_;
  Pool<Node> nodes_;
  Pool<Bridges> bridges_;
};

}  // namespace dynhull
