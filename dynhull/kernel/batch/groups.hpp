// The rows of a batch as a multiset: sorted, and grouped by point.
#pragma once

#include "../memory/scratch.hpp"
#include "../sort/by_point.hpp"
#include "../tree/nodes.hpp"

namespace dynhull {

struct Group {
  Point p;
  Ref leaf = NONE;          // where p belongs, as found before the batch
  std::uint32_t first = 0;  // the group's first row; the next group's is its end
};

// The operations of a batch's rows, +1 to insert and -1 to delete: one for each row, or with step 0 one for all.
struct Ops {
  const std::int8_t* first;
  std::size_t step = 1;

  bool deletes(std::size_t row) const { return first[step * row] < 0; }
  bool all_insert() const { return step == 0 && *first > 0; }
};

struct NotFinite {};  // thrown if a coordinate is not finite

// Copies the rows of a batch, each to where `place` says, so that other threads may change them meanwhile.
template <class Place>
void copy_rows(Ops ops, const Point* points, std::size_t count, Place place) {
  if (count >= NONE) throw std::bad_alloc();
  Plain plain;
  for (std::size_t i = 0; i < count; ++i) {
    const Point p = plain(points[i]);
    *place(p) = {p, static_cast<std::int64_t>(2 * i + ops.deletes(i))};
  }
  if (!plain.finite()) throw NotFinite();
}

class Groups {
 public:
  std::int64_t rows_applied;
  std::int64_t first_missing = -1;  // the first row that deletes a missing point
  std::int64_t growth = 0;          // the change of the number of points, with multiplicity

  // Sorts the rows, which must outlive it, and finds the leaf of each group.
  Groups(const Nodes& nodes, Row* rows, std::size_t count)
      : rows_applied(static_cast<std::int64_t>(count)), rows_(rows), groups_(count + 1) {
    const Scratch<Row> scratch(count);
    sort_by_point(rows, scratch.data(), count);
    Group* next = groups_.data();
    for (std::size_t i = 0; i < count; ++i)
      if (i == 0 || !(rows[i].p == rows[i - 1].p)) *next++ = {rows[i].p, NONE, static_cast<std::uint32_t>(i)};
    next->first = static_cast<std::uint32_t>(count);
    size_ = static_cast<std::size_t>(next - groups_.data());
    if (nodes.root != NONE) descend(nodes, nodes.root, 0, size_);
  }

  std::size_t size() const { return size_; }
  const Group& operator[](std::size_t i) const { return groups_[i]; }

  bool new_leaf(std::size_t i) const { return i == 0 || groups_[i].leaf != groups_[i - 1].leaf; }

  // The number of copies of a group's point after its rows, given the number before. Records deletes that find none.
  std::uint64_t settle(std::size_t i, std::uint64_t before) {
    const Row* const first = rows_ + groups_[i].first;
    const Row* const last = rows_ + groups_[i + 1].first;
    std::uint64_t available = before;
    for (const Row* row = first; row < last; ++row) available += inserts(*row);
    const std::uint64_t deletes = before + static_cast<std::uint64_t>(last - first) - available;
    if (deletes > available) [[unlikely]]
      miss(first, deletes, available);
    const std::uint64_t after = available - std::min(deletes, available);
    growth += static_cast<std::int64_t>(after - before);
    return after;
  }

 private:
  static constexpr std::size_t TOGETHER = 32;  // interleaved descents

  static bool inserts(const Row& row) { return row.row % 2 == 0; }

  // Records the surplus deletes of a group: its first deletes find the available points, the others none.
  void miss(const Row* row, std::uint64_t deletes, std::uint64_t available) {
    rows_applied -= static_cast<std::int64_t>(deletes - available);
    for (std::uint64_t found = 0; found <= available; ++row) found += !inserts(*row);
    const std::int64_t number = row[-1].row / 2;
    if (first_missing < 0 || number < first_missing) first_missing = number;
  }

  // Finds the leaves of the groups from..to, at most TOGETHER, below `tree`: interleaved, so that cache misses overlap.
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

  // Finds the leaves of the groups from..to, which all belong to the subtree.
  void descend(const Nodes& nodes, Ref tree, std::size_t from, std::size_t to) {
    while (to - from > TOGETHER && !is_leaf(tree)) {
      const Point separator = nodes.node(tree).separator;
      const auto middle = std::partition_point(groups_.data() + from, groups_.data() + to,
                                               [&](const Group& group) { return group.p < separator; });
      const auto cut = static_cast<std::size_t>(middle - groups_.data());
      if (from < cut && cut < to) descend(nodes, nodes.node(tree).child[0], from, cut);
      tree = nodes.node(tree).child[cut < to];
      if (cut < to) from = cut;
    }
    for (; from < to; from += TOGETHER) descend_together(nodes, tree, from, std::min(from + TOGETHER, to));
  }

  const Row* rows_;
  Scratch<Group> groups_;
  std::size_t size_;
};

}  // namespace dynhull
