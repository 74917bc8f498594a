// The net effect of a batch: points to add, points to remove, and points whose number of copies changes. Reads the tree
// and changes nothing.
#pragma once

#include <span>
#include <vector>

#include "../tree/copies.hpp"
#include "groups.hpp"

namespace dynhull {

// A point that the batch adds or removes, and its place before the batch.
struct Change {
  Point p;
  Ref leaf;
  std::uint8_t entry, size;  // the entry's index, and the size of the leaf
  bool insert;
};

// The change's present place. If changes are applied in order, the earlier ones have moved it, but no point after it.
inline Place place_of(const Nodes& nodes, const Change& change) {
  const Leaf& leaf = nodes.leaf(change.leaf);
  const unsigned entry = leaf.size - (change.size - change.entry);
  if (leaf.has_place(entry, change.p)) return {change.leaf, entry, !change.insert};
  return find_near(nodes, change.leaf, change.p);
}

// A point with more than one copy before or after the batch, whose number of copies changes.
struct Recount {
  Point p;
  Place place;  // before the batch
  std::uint64_t before, after;
};

class Plan {
 public:
  std::int64_t rows_applied;
  std::int64_t first_missing;  // the first row that deletes a missing point, or -1
  std::int64_t growth;         // the change of the number of points, with multiplicity
  std::size_t inserts = 0;     // changes that insert
  std::size_t leaves = 0;      // leaves with a change
  // The changes need at most this many new leaves: one if everything is removed before something is inserted, one for
  // each leaf that overflows, and one for every half leaf of inserts, the least that splits a leaf from a split again.
  // A leaf from a merge may split too, but the merge has given a leaf back.
  std::size_t extra_leaves = 1;
  std::vector<Recount> recounts;

  // Of these rows, which it sorts.
  Plan(const Nodes& nodes, const Copies& copies, Row* rows, std::size_t count)
      : Plan(nodes, copies, Groups(nodes, rows, count)) {}
  Plan(const Nodes& nodes, const Copies& copies, Groups&& groups)
      : changes_(groups.size()), changes_end_(changes_.data()) {
    for (std::size_t from = 0; from < groups.size(); from += BLOCK)
      read(nodes, copies, groups, from, std::min(from + BLOCK, groups.size()));
    extra_leaves += inserts / (LEAF / 2);
    rows_applied = groups.rows_applied;
    first_missing = groups.first_missing;
    growth = groups.growth;
  }

  std::span<const Change> changes() const { return {changes_.data(), changes_end_}; }
  std::int64_t distinct_growth() const { return static_cast<std::int64_t>(2 * inserts - changes().size()); }

  void forget_changes() {
    const Scratch<Change> gone(std::move(changes_));
    changes_end_ = changes_.data();
  }

  // Whether enough changes share a leaf that divide and conquer is faster: measured, see docs/performance.md.
  bool crowded() const { return changes().size() >= LEAF / 2 * leaves; }

 private:
  static constexpr std::size_t BLOCK = 16;
  static constexpr std::size_t LOOKAHEAD = 12;  // groups whose leaf is being prefetched

  // Reads a block of groups. First does all searches in x, which are branch-free, so that they overlap.
  void read(const Nodes& nodes, const Copies& copies, Groups& groups, std::size_t from, std::size_t to) {
    const bool empty = nodes.root == NONE;
    unsigned entries[BLOCK] = {};
    for (std::size_t i = from; i < to && !empty; ++i) {
      const std::size_t ahead = i + LOOKAHEAD;
      if (ahead < groups.size() && groups.new_leaf(ahead)) nodes.leaf(groups[ahead].leaf).fetch_x();
      const Leaf& leaf = nodes.leaf(groups[i].leaf);
      entries[i - from] = leaf.find_x(groups[i].p.x);
      prefetch(&leaf.y[entries[i - from]]);
    }
    // Numbers of copies are fetched first. A pass of its own: most hulls have none.
    if (copies.size() > 0 && !empty) {
      for (std::size_t i = from; i < to; ++i) {
        const Leaf& leaf = nodes.leaf(groups[i].leaf);
        const unsigned entry = leaf.find_y(entries[i - from], groups[i].p);
        if (leaf.repeated >> entry & 1) copies.fetch(groups[i].p);
      }
    }
    for (std::size_t i = from; i < to; ++i) {
      const Group& group = groups[i];
      Place place = {NONE, 0, false};
      unsigned size = 0;
      bool repeated = false;
      if (!empty) {
        const Leaf& leaf = nodes.leaf(group.leaf);
        const unsigned entry = leaf.find_y(entries[i - from], group.p);
        place = {group.leaf, entry, leaf.holds(entry, group.p)};
        repeated = place.there & (leaf.repeated >> entry & 1);
        size = leaf.size;
      }
      const std::uint64_t before = repeated ? copies[group.p] : place.there;
      const std::uint64_t after = groups.settle(i, before);
      if (before != after && (before > 1 || after > 1)) recounts.push_back({group.p, place, before, after});
      if ((before == 0) != (after == 0))
        note({group.p, group.leaf, static_cast<std::uint8_t>(place.entry), static_cast<std::uint8_t>(size),
              before == 0});
    }
  }

  void note(const Change& change) {
    const bool first = changes_end_ == changes_.data() || changes_end_[-1].leaf != change.leaf;
    leaves += first;
    inserts += change.insert;
    added_ = added_ * !first + change.insert;
    extra_leaves += change.insert & (change.size + added_ == LEAF + 1);
    *changes_end_++ = change;
  }

  Scratch<Change> changes_;
  Change* changes_end_;
  std::size_t added_ = 0;  // inserts into the leaf of the last change
};

}  // namespace dynhull
