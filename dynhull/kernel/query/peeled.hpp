// The tree without some of its points: a view that leaves the tree as it is, so that others may read it meanwhile.
#pragma once

#include <algorithm>
#include <span>
#include <vector>

#include "../tree/search.hpp"

namespace dynhull {

// Has what a Cursor asks of Nodes. Points are only taken away, so nothing is rebalanced: the view holds those bridges,
// chains and children that differ, and one child of a node stands for the node if the other is empty.
class Peeled {
 public:
  explicit Peeled(const Nodes& nodes)
      : nodes_(nodes), root_(nodes.root), node_at_(nodes.node_end(), NONE), leaf_at_(nodes.leaf_end(), NONE) {}

  Ref root() const { return root_; }
  const Leaf& leaf(Ref tree) const { return nodes_.leaf(tree); }
  Ref child(Ref tree, int rank) const {
    const std::uint32_t at = node_at_[tree];
    return at == NONE ? nodes_.child(tree, rank) : branches_[at].child[rank];
  }
  const Edge& bridge(Ref tree, Side side) const {
    const std::uint32_t at = node_at_[tree];
    return at == NONE ? nodes_.bridge(tree, side) : branches_[at].bridge[side];
  }
  Mask chain(Ref tree, Side side) const {
    const std::uint32_t at = leaf_at_[leaf_number(tree)];
    return at == NONE ? nodes_.chain(tree, side) : rests_[at].chain[side];
  }

  // The chain of what is left, between two of its vertices, left to right. O(log n) a vertex.
  void collect(Side side, Point lowest, Point highest, std::vector<Point>& points) const {
    dynhull::collect(*this, root_, side, lowest, highest, points);
  }

  // Takes points away that are all there, in order, each once, with all their copies. O(log² n) each.
  void take(std::span<const Point> points) {
    if (!points.empty()) root_ = take(root_, points);
  }

  // Puts all points back.
  void restore() {
    for (const Branch& branch : branches_) node_at_[branch.tree] = NONE;
    for (const Rest& rest : rests_) leaf_at_[leaf_number(rest.tree)] = NONE;
    branches_.clear();
    rests_.clear();
    root_ = nodes_.root;
  }

 private:
  // Of a node with fewer points.
  struct Branch {
    Ref tree;
    Ref child[2];
    Edge bridge[2];
  };
  // Of a leaf with fewer points, as masks.
  struct Rest {
    Ref tree;
    Mask points;
    Mask chain[2];
  };

  // What is left of a subtree: itself, a part of it, or NONE.
  Ref take(Ref tree, std::span<const Point> points) {
    if (is_leaf(tree)) return rest_of(tree, points).points ? tree : NONE;
    const auto middle = std::lower_bound(points.begin(), points.end(), nodes_.node(tree).separator);
    const auto left_count = static_cast<std::size_t>(middle - points.begin());
    Ref left = child(tree, 0), right = child(tree, 1);
    if (left_count > 0) left = take(left, points.first(left_count));
    if (left_count < points.size()) right = take(right, points.subspan(left_count));
    if (left == NONE) return right;
    if (right == NONE) return left;
    Branch& branch = branch_of(tree);
    branch.child[0] = left;
    branch.child[1] = right;
    for (Side side : SIDES) {
      Edge& edge = branch.bridge[side];
      // A bridge whose ends stay is above all that stays.
      if (std::binary_search(points.begin(), points.end(), edge.a) ||
          std::binary_search(points.begin(), points.end(), edge.b))
        edge = find_bridge(Cursor(*this, left, side), Cursor(*this, right, side), side, nodes_.node(tree).separator);
    }
    return tree;
  }

  Branch& branch_of(Ref tree) {
    if (node_at_[tree] == NONE) {
      const Node& node = nodes_.node(tree);
      branches_.push_back(
          {tree, {node.child[0], node.child[1]}, {nodes_.bridge(tree, UPPER), nodes_.bridge(tree, LOWER)}});
      node_at_[tree] = static_cast<std::uint32_t>(branches_.size() - 1);
    }
    return branches_[node_at_[tree]];
  }

  const Rest& rest_of(Ref tree, std::span<const Point> points) {
    const Leaf& leaf = nodes_.leaf(tree);
    std::uint32_t& at = leaf_at_[leaf_number(tree)];
    if (at == NONE) {
      rests_.push_back({tree, below(leaf.size), {leaf.chain[UPPER], leaf.chain[LOWER]}});
      at = static_cast<std::uint32_t>(rests_.size() - 1);
    }
    Rest& rest = rests_[at];
    Mask gone = 0;
    for (Point p : points) gone |= bit(leaf.find(p));
    rest.points &= ~gone;
    if (rest.points)
      for (Side side : SIDES) rest.chain[side] = closed(leaf, side, rest.chain[side], gone, rest.points);
    return rest;
  }

  // A leaf's chain, closed where points are gone: between two vertices that stay, or an end and a vertex.
  static Mask closed(const Leaf& leaf, Side side, Mask chain, Mask gone, Mask points) {
    gone &= chain;
    chain &= ~gone;
    while (gone) {
      const unsigned first = lowest(gone);
      const Mask before = chain & below(first), after = chain & ~below(first);
      const unsigned from = before ? highest(before) : lowest(points);
      const unsigned to = after ? lowest(after) : highest(points);
      chain |= leaf.scan(side, from, points & below(to) & ~below(from + 1), to);
      gone &= after ? ~below(to) : 0;
    }
    return chain;
  }

  const Nodes& nodes_;
  Ref root_;
  std::vector<std::uint32_t> node_at_, leaf_at_;  // where a node or leaf is below, or NONE
  std::vector<Branch> branches_;
  std::vector<Rest> rests_;
};

}  // namespace dynhull
