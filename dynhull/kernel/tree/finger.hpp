// Finger search: remembers the ancestors above the current part of the tree, so that updates in sorted order do not
// climb the same nodes again.
#pragma once

#include "nodes.hpp"

namespace dynhull {

// For a single update, which has nothing to remember.
struct NoFinger {
  Ref over(Point) { return NONE; }
  bool clear(Side, double, double) { return false; }
  void forget() {}
  void earn() {}
};

class Finger {
 public:
  // Remembers ancestors of this height or more.
  Finger(const Nodes& nodes, unsigned height) : nodes_(nodes), height_(height) {}

  // The lowest remembered ancestor of p, or NONE; also NONE while recent calls did not pay. Successive p must not
  // decrease. O(1) amortized if updates are dense.
  Ref over(Point p) {
    if (credit_ == 0) return NONE;
    --credit_;
    while (steps_ > 0 && p >= path_[steps_ - 1].end) --steps_;
    if (steps_ == 0) path_[steps_++] = {NONE, nodes_.root, HIGHEST, {-INFINITE, -INFINITE}, {INFINITE, INFINITE}};
    for (; nodes_.height(here().tree) >= height_; ++steps_) path_[steps_] = below(here(), p);
    return here().parent;
  }

  // Whether no remembered bridge above the last p overlaps [left, right] in x.
  bool clear(Side side, double left, double right) {
    const bool is_clear = here().left[side] < left && right < here().right[side];
    if (is_clear) earn();
    return is_clear;
  }
  // Records that a climb was saved, or would have been; each one pays for a few more calls of over().
  void earn() { credit_ = std::min(credit_ + 4, 64u); }

  // To be called after links or bridges of the remembered ancestors have changed.
  void forget() { steps_ = 0; }

 private:
  static constexpr std::size_t MOST = 64;  // steps: more than the height of any tree that fits in memory

  // One step down: the subtree, where it ends, and for each side the interval of x that no bridge above overlaps.
  struct Step {
    Ref parent, tree;
    Point end;
    double left[2], right[2];
  };

  const Step& here() const { return path_[steps_ - 1]; }

  Step below(const Step& above, Point p) const {
    const Node& node = nodes_.node(above.tree);
    Step step = above;
    step.parent = above.tree;
    if (p < node.separator) {
      step.tree = node.child[0];
      step.end = node.separator;
      for (Side side : SIDES) step.right[side] = std::min(above.right[side], nodes_.bridge(above.tree, side).a.x);
    } else {
      step.tree = node.child[1];
      for (Side side : SIDES) step.left[side] = std::max(above.left[side], nodes_.bridge(above.tree, side).b.x);
    }
    return step;
  }

  const Nodes& nodes_;
  unsigned height_;
  unsigned credit_ = 0;
  std::size_t steps_ = 0;
  Step path_[MOST];
};

}  // namespace dynhull
