// What lies over one part of a tree after the other, for updates in order: they share most of what they would climb.
#pragma once

#include "nodes.hpp"

namespace dynhull {

// Of a single update.
struct NoFinger {
  Ref over(Point) { return NONE; }
  bool clear(Side, double, double) { return false; }
  void forget() {}
  void earn() {}
};

class Finger {
 public:
  // The nodes of this height or more.
  Finger(const Nodes& nodes, unsigned height) : nodes_(nodes), height_(height) {}

  // The lowest of them over p, or NONE: also where to ask did not pay of late. No p may lie before an earlier one. O(1)
  // amortized where updates are dense.
  Ref over(Point p) {
    if (credit_ == 0) return NONE;
    --credit_;
    while (steps_ > 0 && p >= path_[steps_ - 1].end) --steps_;
    if (steps_ == 0) path_[steps_++] = {NONE, nodes_.root, HIGHEST, {-INFINITE, -INFINITE}, {INFINITE, INFINITE}};
    for (; nodes_.height(here().tree) >= height_; ++steps_) path_[steps_] = below(here(), p);
    return here().parent;
  }

  // Whether none of their bridges over the last p shares some x with the part from `left` to `right` of the chain.
  bool clear(Side side, double left, double right) {
    const bool is_clear = here().left[side] < left && right < here().right[side];
    if (is_clear) earn();
    return is_clear;
  }
  // A climb has been spared, or would have been. It pays for a few questions.
  void earn() { credit_ = std::min(credit_ + 4, 64u); }

  // Their links or bridges have changed.
  void forget() { steps_ = 0; }

 private:
  static constexpr std::size_t MOST = 64;  // steps: the height of any tree that fits into memory is less

  // From one of the nodes down to a subtree: where that ends, and for each side the x between which no bridge lies.
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
