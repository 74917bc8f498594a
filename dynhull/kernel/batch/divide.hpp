// Large batches, by divide and conquer: split the batch along the tree, repair each touched leaf and bridge once on the
// way back.
//
// A few changes that share a small subtree are applied one by one, as if it were the whole tree; a leaf with many
// changes is merged with them, and its chains are computed once. Higher up only candidates matter: for each side,
// inserted points on the new chain and deleted points that were on the old one. Candidates may include points that
// joined and left a chain while changes ran one by one (deletes first, so that no point of the old or new chain is
// missed). Such a point is below an edge of the chain with a true candidate at one end, and the two pass the same
// nodes; so candidates reach the root exactly if the hull changed.
#pragma once

#include "../tree/build.hpp"
#include "../tree/update.hpp"
#include "plan.hpp"

namespace dynhull {

class DividedBatch {
 public:
  // Allocates all memory but that of leaves and nodes, so that apply() cannot fail.
  DividedBatch(Nodes& nodes, std::span<const Change> changes)
      : nodes_(nodes), changes_(changes.data()), count_(changes.size()), site_(count_ > FEW ? LEAF + count_ : 0) {
    for (Side side : SIDES) candidates_[side].resize(count_);
    if (count_ > FEW) {
      points_.resize(LEAF + count_);
      repeated_.resize(LEAF + count_);
    }
    small_.reserve(count_);
  }

  // Applies the changes from..to to the tree at nodes.root; calls `reached` with those that reach its top, and on which
  // side, as a bit. Needs room in `nodes` for the plan's extra leaves.
  template <class Reached>
  void apply(std::size_t from, std::size_t to, Reached reached) {
    const Found found = run(nodes_.root, from, to);
    nodes_.root = found.tree;
    if (found.tree != NONE) nodes_.set_parent(found.tree, NONE);
    for (Ref leaf : small_)
      if (nodes_.leaf(leaf).size > 0 && nodes_.leaf(leaf).size < LOW) merge(nodes_, leaf);
    small_.clear();
    for (Side side : SIDES)
      for (std::size_t i = 0; i < found.candidates[side]; ++i)
        reached(changes_[candidates_[side][from + i]], 1u << side);
  }

 private:
  // Up to this many changes in a subtree are applied one by one.
  static constexpr std::size_t FEW = LEAF * 3 / 8;
  static constexpr std::size_t LOOKAHEAD = 4;

  // A detached subtree after its changes, and the number of candidates of each side. A candidate is an index into
  // changes_; those of a subtree start at the index of its first change in candidates_.
  struct Found {
    Ref tree;
    std::size_t candidates[2] = {0, 0};
  };

  Found run(Ref tree, std::size_t from, std::size_t to) {
    if (to - from <= FEW) return one_by_one(tree, from, to);
    if (is_leaf(tree)) return merge_into_leaf(tree, from, to);
    const Node& node = nodes_.node(tree);
    const Point separator = node.separator;
    const Change* middle = std::partition_point(changes_ + from, changes_ + to,
                                                [&](const Change& change) { return change.p < separator; });
    const auto cut = static_cast<std::size_t>(middle - changes_);
    Found left{node.child[0]}, right{node.child[1]};
    if (from < cut) left = run(left.tree, from, cut);
    if (cut < to) right = run(right.tree, cut, to);
    return combine(tree, left, right, from, cut);
  }

  Found one_by_one(Ref tree, std::size_t from, std::size_t to) {
    Found found{tree};
    nodes_.set_parent(tree, NONE);
    nodes_.root = tree;
    for (const bool insert : {false, true}) {
      for (std::size_t i = from; i < to; ++i) {
        const Change& change = changes_[i];
        if (!insert && i + LOOKAHEAD < count_) nodes_.leaf(changes_[i + LOOKAHEAD].leaf).fetch();
        if (change.insert != insert) continue;
        const Place place = place_of(nodes_, change);
        const unsigned changed = insert ? insert_point(nodes_, place, change.p) : remove_point(nodes_, place, change.p);
        for (Side side : SIDES)
          if (changed & (1u << side)) propose(found, side, from, i);
      }
    }
    found.tree = nodes_.root;
    if (found.tree != NONE && is_leaf(found.tree)) note_small(found.tree);
    return found;
  }

  Found merge_into_leaf(Ref tree, std::size_t from, std::size_t to) {
    Found found{tree};
    const Leaf& leaf = nodes_.leaf(tree);
    std::size_t total = 0;
    unsigned entry = 0;
    const auto keep = [&](Point p, bool repeated) {
      points_[total] = p;
      repeated_[total++] = repeated;
    };
    for (std::size_t i = from; i < to; ++i) {
      const Change& change = changes_[i];
      for (; entry < leaf.size && leaf[entry] < change.p; ++entry) keep(leaf[entry], leaf.repeated & bit(entry));
      if (change.insert) {
        keep(change.p, false);
        continue;
      }
      for (Side side : SIDES)
        if (leaf.chain[side] & bit(entry)) propose(found, side, from, i);
      ++entry;
    }
    for (; entry < leaf.size; ++entry) keep(leaf[entry], leaf.repeated & bit(entry));

    nodes_.give_back(tree);
    if (total == 0) return found.tree = NONE, found;
    found.tree = Building(nodes_, points_.data(), total, site_).tree();
    std::size_t next = 0;
    for (std::size_t i = 0; i < leaves_for(total); ++i) {
      Leaf& part = nodes_.leaf(site_.leaves[i]);
      for (unsigned k = 0; k < part.size; ++k)
        if (repeated_[next++]) part.repeated |= bit(k);
    }
    for (std::size_t i = from; i < to; ++i)
      for (Side side : SIDES)
        if (changes_[i].insert && on_chain(nodes_, found.tree, side, changes_[i].p)) propose(found, side, from, i);
    if (is_leaf(found.tree)) note_small(found.tree);
    return found;
  }

  // Joins two subtrees again by their former parent, and keeps the candidates that matter higher up.
  Found combine(Ref v, Found left, Found right, std::size_t from, std::size_t cut) {
    const Bridges old = {{nodes_.bridge(v, UPPER), nodes_.bridge(v, LOWER)}};
    Found found{v};
    for (Side side : SIDES) {
      auto* all = candidates_[side].data();
      std::copy_n(all + cut, right.candidates[side], all + from + left.candidates[side]);
      found.candidates[side] = left.candidates[side] + right.candidates[side];
    }
    if (left.tree == NONE || right.tree == NONE) {
      nodes_.give_back(v);
      found.tree = left.tree == NONE ? right.tree : left.tree;
      for (Side side : SIDES)
        filter(
            found, side, from,
            [&](const Change& change, bool on_left) {
              return change.insert || reaches(old.side[side], change.p, on_left);
            },
            cut);
      return found;
    }
    const int difference = static_cast<int>(nodes_.height(left.tree)) - static_cast<int>(nodes_.height(right.tree));
    if (std::abs(difference) > 1) {
      found.tree = join(nodes_, left.tree, right.tree, v);
      for (Side side : SIDES)
        filter(
            found, side, from,
            [&](const Change& change, bool on_left) {
              return change.insert ? on_chain(nodes_, found.tree, side, change.p)
                                   : reaches(old.side[side], change.p, on_left);
            },
            cut);
      return found;
    }
    nodes_.link(v, 0, left.tree);
    nodes_.link(v, 1, right.tree);
    refresh_height(nodes_, v);
    for (Side side : SIDES) {
      if (found.candidates[side] == 0) continue;
      Edge& edge = nodes_.bridge(v, side);
      if (broken(edge, side, found, from, cut))
        edge = bridge_of(nodes_, left.tree, right.tree, side, nodes_.node(v).separator);
      filter(
          found, side, from,
          [&](const Change& change, bool on_left) {
            return reaches(change.insert ? edge : old.side[side], change.p, on_left);
          },
          cut);
    }
    return found;
  }

  // Whether a point on a child's chain is on the parent's chain.
  static bool reaches(const Edge& bridge, Point p, bool on_left) { return on_left ? p <= bridge.a : p >= bridge.b; }

  // Whether a bridge lost an end, or a new point is outside it, or on its line beyond an end.
  bool broken(const Edge& edge, Side side, const Found& found, std::size_t from, std::size_t cut) const {
    for (std::size_t i = 0; i < found.candidates[side]; ++i) {
      const std::size_t number = candidates_[side][from + i];
      const Change& change = changes_[number];
      if (!change.insert) {
        if (change.p == edge.a || change.p == edge.b) return true;
        continue;
      }
      const int turn = turned(side, orientation(edge.a, edge.b, change.p));
      const bool beyond = number < cut ? change.p < edge.a : change.p > edge.b;
      if (turn > 0 || (turn == 0 && beyond)) return true;
    }
    return false;
  }

  template <class Passes>
  void filter(Found& found, Side side, std::size_t from, Passes passes, std::size_t cut) {
    std::size_t kept = 0;
    for (std::size_t i = 0; i < found.candidates[side]; ++i) {
      const std::uint32_t number = candidates_[side][from + i];
      if (passes(changes_[number], number < cut)) candidates_[side][from + kept++] = number;
    }
    found.candidates[side] = kept;
  }

  void propose(Found& found, Side side, std::size_t from, std::size_t change) {
    candidates_[side][from + found.candidates[side]++] = static_cast<std::uint32_t>(change);
  }

  void note_small(Ref leaf) {
    if (nodes_.leaf(leaf).size < LOW) small_.push_back(leaf);
  }

  Nodes& nodes_;
  const Change* changes_;
  std::size_t count_;
  std::vector<std::uint32_t> candidates_[2];
  std::vector<Point> points_;  // of a merged leaf
  std::vector<std::uint8_t> repeated_;
  BuildingSite site_;
  std::vector<Ref> small_;  // leaves to merge with their neighbours in the end
};

}  // namespace dynhull
