// Verification: every invariant of a tree against its definition, without the searches' code.
#pragma once

#include <stdexcept>
#include <string>

#include "hull_tree.hpp"

namespace dynhull {

class Check {
 public:
  // Throws std::logic_error if an invariant is broken. O(n log n) orientations.
  explicit Check(const HullTree& tree) : nodes_(tree.nodes()) {
    std::size_t repeats = 0;
    std::size_t repeated = 0;
    tree.for_each([&](Point p, std::uint64_t copies) {
      require(points_.empty() || points_.back() < p, "points out of order");
      points_.push_back(p);
      repeats += copies - 1;
      repeated += copies > 1;
    });
    require(points_.size() == tree.distinct(), "distinct points miscounted");
    require(repeated == tree.copies().size(), "a count without its point, or below two");
    require(tree.size() == tree.distinct() + repeats, "size is wrong");
    if (nodes_.root == NONE) return;
    require(nodes_.parent(nodes_.root) == NONE, "a root with a parent");
    require(subtree(nodes_.root) == points_.size(), "points outside of the tree");
    require(leaves_ == nodes_.leaf_count() && leaves_ == nodes_.node_count() + 1, "a lost leaf or node");
  }

 private:
  static void require(bool holds, const char* message) {
    if (!holds) throw std::logic_error(message);
  }

  // Checks a subtree whose points begin at next_. Returns their end.
  std::size_t subtree(Ref tree) {
    if (is_leaf(tree)) return leaf(nodes_.leaf(tree));
    const Node& node = nodes_.node(tree);
    for (Ref child : node.child) require(nodes_.parent(child) == tree, "a child with another parent");
    const std::size_t from = next_, middle = subtree(node.child[0]), to = subtree(node.child[1]);
    require(points_[middle - 1] < node.separator && node.separator <= points_[middle], "separator out of place");
    const unsigned left = nodes_.height(node.child[0]), right = nodes_.height(node.child[1]);
    require(node.height == 1 + std::max(left, right), "height is wrong");
    require(left <= right + 1 && right <= left + 1, "out of balance");
    for (Side side : SIDES) {
      const Edge& edge = nodes_.bridge(tree, side);
      require(std::binary_search(points_.begin() + from, points_.begin() + middle, edge.a),
              "a bridge starts outside the left subtree");
      require(std::binary_search(points_.begin() + middle, points_.begin() + to, edge.b),
              "a bridge ends outside the right subtree");
      supports(edge, side, from, to);
    }
    return to;
  }

  std::size_t leaf(const Leaf& leaf) {
    ++leaves_;
    const std::size_t from = next_;
    require(0 < leaf.size && leaf.size <= LEAF, "a leaf of a wrong size");
    for (unsigned i = 0; i < leaf.size; ++i) require(leaf[i] == points_[next_++], "a point out of place");
    for (unsigned i = leaf.size; i < LEAF; ++i) require(leaf.x[i] == INFINITE, "a leaf without its end");
    for (Side side : SIDES) {
      const Mask mask = leaf.chain[side];
      require(mask & 1 && highest(mask) == leaf.size - 1, "a chain without its ends");
      for (Mask rest = mask & (mask - 1), before = 0; rest; rest &= rest - 1) {
        const unsigned i = lowest(rest);
        supports({leaf[static_cast<unsigned>(before)], leaf[i]}, side, from, next_);
        before = i;
      }
    }
    return next_;
  }

  // Requires that no point of from..to is outside the edge, or on its line beyond its ends.
  void supports(const Edge& edge, Side side, std::size_t from, std::size_t to) const {
    for (std::size_t i = from; i < to; ++i) {
      const Point p = points_[i];
      const int turn = turned(side, orientation(edge.a, edge.b, p));
      require(turn < 0 || (turn == 0 && edge.a <= p && p <= edge.b), "a point outside of an edge");
    }
  }

  const Nodes& nodes_;
  std::vector<Point> points_;
  std::size_t next_ = 0;
  std::size_t leaves_ = 0;
};

}  // namespace dynhull
