// The rows of a batch as a set: sorted, equal points together.
#pragma once

#include <unordered_map>
#include <vector>

#include "sort.hpp"
#include "update.hpp"

namespace dynhull {

struct PointHash {
  std::size_t operator()(Point p) const {
    const auto x = std::bit_cast<std::uint64_t>(p.x), y = std::bit_cast<std::uint64_t>(p.y);
    const std::uint64_t mixed = (x ^ std::rotl(y, 32)) * 0x9e3779b97f4a7c15;
    return static_cast<std::size_t>(mixed ^ (mixed >> 29));
  }
};

// How often, for the points that are there more than once.
using Copies = std::unordered_map<Point, std::uint64_t, PointHash>;

inline std::uint64_t count_of(const Nodes& nodes, const Copies& copies, const Place& place) {
  if (!place.there) return 0;
  const Leaf& leaf = nodes.leaf(place.leaf);
  return leaf.repeated & bit(place.entry) ? copies.find(leaf[place.entry])->second : 1;
}

struct Group {
  Point p;
  Ref leaf = NONE;          // where p belongs, or belonged
  std::uint32_t first = 0;  // of its rows; the next group's is the end
};

class Groups {
 public:
  static constexpr std::size_t LOOKAHEAD = 8;  // groups whose leaf is on its way from memory

  std::int64_t rows_applied;
  std::int64_t first_missing = -1;  // the first row that deletes what is not there
  std::int64_t growth = 0;          // points more than before, with multiplicity
  std::size_t inserts = 0;          // rows that insert

  Groups(const std::int8_t* ops, const Point* points, std::size_t count)
      : rows_applied(static_cast<std::int64_t>(count)), rows_(count) {
    if (count >= NONE) throw std::bad_alloc();
    std::vector<Row> scratch(count);
    for (std::size_t i = 0; i < count; ++i) {
      rows_[i] = {points[i], static_cast<std::int64_t>(2 * i + (ops[i] < 0))};
      inserts += ops[i] > 0;
    }
    sort_by_point(rows_.data(), scratch.data(), count);
    groups_.resize(count + 1);
    Group* next = groups_.data();
    for (std::size_t i = 0; i < count; ++i)
      if (i == 0 || !(rows_[i].p == rows_[i - 1].p)) *next++ = {rows_[i].p, NONE, static_cast<std::uint32_t>(i)};
    next->first = static_cast<std::uint32_t>(count);
    size_ = static_cast<std::size_t>(next - groups_.data());
  }

  std::size_t size() const { return size_; }
  std::size_t rows() const { return rows_.size(); }
  const Group& operator[](std::size_t i) const { return groups_[i]; }

  // Find the leaf of each group.
  void descend(const Nodes& nodes) {
    if (nodes.root != NONE) descend(nodes, nodes.root, 0, size_);
  }

  bool new_leaf(std::size_t i) const { return i == 0 || groups_[i].leaf != groups_[i - 1].leaf; }

  std::size_t touched_leaves() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i < size_; ++i) count += new_leaf(i);
    return count;
  }

  // How many rows of a group insert.
  std::size_t inserts_of(std::size_t i) const {
    std::size_t count = 0;
    for (std::uint32_t row = groups_[i].first; row < groups_[i + 1].first; ++row) count += rows_[row].row % 2 == 0;
    return count;
  }

  // How often a group's point is there after its rows; notes the deletes that find none left.
  std::uint64_t settle(std::size_t i, std::uint64_t before) {
    const Row* const first = rows_.data() + groups_[i].first;
    const Row* const last = rows_.data() + groups_[i + 1].first;
    std::uint64_t available = before;
    for (const Row* row = first; row < last; ++row) available += row->row % 2 == 0;
    for (const Row* row = first; row < last; ++row) {
      if (row->row % 2 == 0) continue;
      if (available > 0) {
        --available;
        continue;
      }
      --rows_applied;
      const std::int64_t number = row->row / 2;
      if (first_missing < 0 || number < first_missing) first_missing = number;
    }
    growth += static_cast<std::int64_t>(available - before);
    return available;
  }

 private:
  static constexpr std::size_t TOGETHER = 12;  // descents side by side

  // Find the leaves of the groups from..to, at most TOGETHER, below `tree`: side by side, so that cache misses overlap.
  void descend_together(const Nodes& nodes, Ref tree, std::size_t from, std::size_t to) {
    Ref at[TOGETHER];
    std::fill_n(at, to - from, tree);
    for (bool moved = !is_leaf(tree); moved;) {
      moved = false;
      for (std::size_t i = from; i < to; ++i) {
        if (is_leaf(at[i - from])) continue;
        at[i - from] = nodes.step(at[i - from], groups_[i].p);
        moved = true;
      }
    }
    for (std::size_t i = from; i < to; ++i) groups_[i].leaf = at[i - from];
  }

  // Find the leaf of each of the groups from..to, which belong to the subtree.
  void descend(const Nodes& nodes, Ref tree, std::size_t from, std::size_t to) {
    while (to - from > TOGETHER && !is_leaf(tree)) {
      const Point separator = nodes.node(tree).separator;
      const auto middle = std::partition_point(groups_.begin() + from, groups_.begin() + to,
                                               [&](const Group& group) { return group.p < separator; });
      const auto cut = static_cast<std::size_t>(middle - groups_.begin());
      if (from < cut && cut < to) descend(nodes, nodes.node(tree).child[0], from, cut);
      tree = nodes.node(tree).child[cut < to];
      if (cut < to) from = cut;
    }
    for (; from < to; from += TOGETHER) descend_together(nodes, tree, from, std::min(from + TOGETHER, to));
  }

  std::vector<Row> rows_;
  std::vector<Group> groups_;
  std::size_t size_;
};

}  // namespace dynhull
