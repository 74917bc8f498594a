// Where a batch is cut for several threads, and the subtrees between the cuts.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "../tree/balance.hpp"

namespace dynhull {

// Separators of the tree that cut the rows into at most `parts` parts of about the same size, as a sample of the rows
// tells; fewer where no separator does that, as in a batch within one leaf. In order. O(sample log n).
inline std::vector<Point> cuts_of(const Nodes& nodes, const Point* rows, std::size_t count, std::size_t parts) {
  constexpr std::size_t ONE_OF = 4, LARGEST_SAMPLE = 1024;
  constexpr double GOOD = 0.1, BAD = 0.6;  // how far a cut may be off, in parts
  std::vector<Point> sample(std::min(count / ONE_OF, LARGEST_SAMPLE)), cuts;
  for (std::size_t i = 0; i < sample.size(); ++i) sample[i] = rows[i * count / sample.size()];
  for (std::size_t part = 1; part < parts && nodes.root != NONE; ++part) {
    double least = BAD;
    Point cut = LOWEST;
    for (Ref tree = nodes.root;
         !is_leaf(tree) && least > GOOD;) {  // a high one: what is above it stays with one thread
      const Point separator = nodes.node(tree).separator;
      const auto before = std::count_if(sample.begin(), sample.end(), [&](Point p) { return p < separator; });
      const double off =
          static_cast<double>(before * parts) / static_cast<double>(sample.size()) - static_cast<double>(part);
      if (std::abs(off) < least) {
        least = std::abs(off);
        cut = separator;
      }
      tree = nodes.node(tree).child[off < 0];
    }
    if (least < BAD && (cuts.empty() || cuts.back() < cut)) cuts.push_back(cut);
  }
  return cuts;
}

// What of one side of a subtree is on the hull: the vertices from before.b to after.a. The edges before and after are
// the hull's; if no vertex of the subtree is on the hull, both are the edge over it.
struct Visible {
  Edge before = {LOWEST, LOWEST}, after = {HIGHEST, HIGHEST};

  // The same of the children's chains.
  Visible left(const Edge& bridge) const {
    if (before.b > bridge.a) return {before, before};
    return {before, after.a > bridge.a ? bridge : after};
  }
  Visible right(const Edge& bridge) const {
    if (after.a < bridge.b) return {after, after};
    return {before.b < bridge.b ? bridge : before, after};
  }

  // Whether the hull changes if a point joins or leaves the subtree's chain, and nothing else has changed it. No point
  // that leaves was outside of the edges.
  bool shows(Point p, Side side) const {
    if (before.b <= p && p <= after.a) return true;
    const Edge& over = p < before.b ? before : after;
    return turned(side, orientation(over.a, over.b, p)) > 0;
  }
};

// A tree cut into subtrees, none of which has a cut inside, and the nodes above them.
class CutTree {
 public:
  struct Subtree {
    Ref tree;
    std::size_t part;  // cuts before it
    Point end;         // all of its points are before this one
    Visible visible[2];
  };

  CutTree(const Nodes& nodes, const std::vector<Point>& cuts) {
    Subtree whole{nodes.root, 0, HIGHEST, {}};
    cut(nodes, whole, cuts, cuts.size());
  }

  std::vector<Subtree>& subtrees() { return subtrees_; }

  // The whole tree, put together from the subtrees, which may have changed or be empty.
  Ref joined(Nodes& nodes) {
    std::size_t subtree = 0, joint = 0;
    return joined(nodes, subtree, joint);
  }

 private:
  // The nodes above the subtrees, in preorder; NONE in place of a subtree.
  void cut(const Nodes& nodes, const Subtree& subtree, const std::vector<Point>& cuts, std::size_t end) {
    if (subtree.part == end) {
      subtrees_.push_back(subtree);
      above_.push_back(NONE);
      return;
    }
    const Node& node = nodes.node(subtree.tree);
    above_.push_back(subtree.tree);
    const auto first = cuts.begin(), last = first + static_cast<std::ptrdiff_t>(end);
    const auto left_end = static_cast<std::size_t>(std::lower_bound(first, last, node.separator) - first);
    const auto right_part = static_cast<std::size_t>(std::upper_bound(first, last, node.separator) - first);
    Subtree left{node.child[0], subtree.part, node.separator, {}};
    Subtree right{node.child[1], right_part, subtree.end, {}};
    for (Side side : SIDES) {
      left.visible[side] = subtree.visible[side].left(nodes.bridge(subtree.tree, side));
      right.visible[side] = subtree.visible[side].right(nodes.bridge(subtree.tree, side));
    }
    cut(nodes, left, cuts, left_end);
    cut(nodes, right, cuts, end);
  }

  Ref joined(Nodes& nodes, std::size_t& subtree, std::size_t& joint) {
    const Ref v = above_[joint++];
    if (v == NONE) return subtrees_[subtree++].tree;
    const Ref left = joined(nodes, subtree, joint), right = joined(nodes, subtree, joint);
    if (left != NONE && right != NONE) return join(nodes, left, right, v);
    nodes.give_back(v);
    return left == NONE ? right : left;
  }

  std::vector<Subtree> subtrees_;
  std::vector<Ref> above_;
};

}  // namespace dynhull
