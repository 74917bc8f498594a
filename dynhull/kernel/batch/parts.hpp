// Large batches on several threads: each has a range of the tree, which it reads and changes on its own.
//
// The tree is cut at nodes so high that few are above them. First each thread sorts and plans the rows of its range,
// and only reads. Then one thread checks the whole batch and makes room; nothing fails after that. Then each thread
// changes the subtrees of its range, one by one, as if each were a tree of its own, with slots of its own for new
// leaves and nodes; so there are neither locks nor shared counters, and the tree does not depend on who is faster. In
// the end the subtrees are joined by the nodes above them.
//
// A change that reaches a subtree's top reaches the hull if its point is on the part of the subtree that the old hull
// shows, or if it is new and outside of the old hull's edge beside it. The batch changes the hull exactly if there is
// such a change: while there is none, the shown parts stand and no point is outside of the old hull.
#pragma once

#include <memory>

#include "../threads.hpp"
#include "cuts.hpp"
#include "divide.hpp"
#include "in_order.hpp"

namespace dynhull {

class BatchInParts {
 public:
  // Plans the batch. Changes nothing but `nodes.root`, later. If `together` is not given, each part decides.
  BatchInParts(Threads& threads, const std::vector<Point>& cuts, Nodes& nodes, const Copies& copies, Ops ops,
               const Point* points, std::size_t count, std::optional<bool> together)
      : threads_(threads), nodes_(nodes), tree_(nodes, cuts), parts_(cuts.size() + 1) {
    std::vector<Scratch<Row>> rows;
    std::vector<Row*> ends;
    for (std::size_t i = 0; i < parts_.size(); ++i) ends.push_back(rows.emplace_back(count).data());
    copy_rows(ops, points, count, [&](Point p) {
      std::size_t part = 0;
      for (Point cut : cuts) part += p >= cut;
      return ends[part]++;
    });
    threads_.run(parts_.size(), [&](std::size_t i) {
      Part& part = parts_[i];
      part.plan =
          std::make_unique<Plan>(nodes, copies, rows[i].data(), static_cast<std::size_t>(ends[i] - rows[i].data()));
      if (together.value_or(part.plan->crowded()))
        part.divided = std::make_unique<DividedBatch>(i == 0 ? nodes : part.nodes, part.plan->changes());
    });
    for (Part& part : parts_) plans_.push_back(part.plan.get());
  }

  const std::vector<Plan*>& plans() const { return plans_; }

  // True if the hull changed. Needs room in `nodes` for the extra leaves of all plans.
  bool apply() {
    std::size_t changes = 1;
    for (const Plan* plan : plans_) changes += plan->changes().size();
    const std::size_t leaves_a_change = nodes_.leaf_count() / changes;
    for (std::size_t i = 1; i < parts_.size(); ++i) parts_[i].nodes = nodes_.lend(plans_[i]->extra_leaves);
    threads_.run(parts_.size(), [&](std::size_t i) { apply(i, leaves_a_change); });
    bool changed = parts_[0].changed;
    for (std::size_t i = 1; i < parts_.size(); ++i) {
      nodes_.take_back(parts_[i].nodes);
      changed |= parts_[i].changed;
    }
    const Ref root = tree_.joined(nodes_);
    nodes_.replace(NONE, NONE, root);
    return changed;
  }

 private:
  struct Part {
    std::unique_ptr<Plan> plan;
    std::unique_ptr<DividedBatch> divided;
    Nodes nodes;  // lent; the first part uses the tree's own
    bool changed = false;
  };

  void apply(std::size_t number, std::size_t leaves_a_change) {
    Part& part = parts_[number];
    Nodes& nodes = number == 0 ? nodes_ : part.nodes;
    const std::span<const Change> changes = part.plan->changes();
    std::size_t from = 0;
    for (CutTree::Subtree& subtree : tree_.subtrees()) {
      if (subtree.part != number) continue;
      const auto reached = [&](const Change& change, unsigned sides) {
        for (Side side : SIDES)
          if (sides & (1u << side) && !part.changed) part.changed = subtree.visible[side].shows(change.p, side);
      };
      const auto end = std::partition_point(changes.begin() + static_cast<std::ptrdiff_t>(from), changes.end(),
                                            [&](const Change& change) { return change.p < subtree.end; });
      const auto to = static_cast<std::size_t>(end - changes.begin());
      if (from == to) continue;
      nodes.root = subtree.tree;
      nodes.set_parent(subtree.tree, NONE);
      if (part.divided)
        part.divided->apply(from, to, reached);
      else
        apply_in_order(nodes, changes.subspan(from, to - from), leaves_a_change, reached);
      subtree.tree = nodes.root;
      from = to;
    }
    part.plan->forget_changes();  // its memory goes back to the thread that took it
  }

  Threads& threads_;
  Nodes& nodes_;
  CutTree tree_;
  std::vector<Part> parts_;
  std::vector<Plan*> plans_;
};

}  // namespace dynhull
