// What a batch amounts to: read the tree, change nothing.
//
// A batch is a set. Equal points are taken together, and what remains are points that are new, points that go, and
// points that only change their number.
#pragma once

#include <unordered_map>
#include <vector>

#include "build.hpp"
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

// A point that the batch adds or removes, and the leaf where it belongs.
struct Change {
  Point p;
  Ref leaf;
  bool insert;
};

// A point that is there more than once before or after.
struct Recount {
  Point p;
  std::uint64_t copies;
};

class Plan {
 public:
  std::vector<Change> changes;  // in order
  std::vector<Recount> recounts;
  std::size_t inserts = 0;         // changes that insert
  std::size_t extra_leaves = 0;    // the changes need at most so many more
  std::int64_t rows_applied = 0;
  std::int64_t first_missing = -1;  // the first row that deletes what is not there
  std::int64_t growth = 0;          // points more than before, with multiplicity

  Plan(const Nodes& nodes, const Copies& copies, const std::int8_t* ops, const Point* points, std::size_t count) {
    std::vector<Row> rows(count), scratch(count);
    for (std::size_t i = 0; i < count; ++i) rows[i] = {points[i], static_cast<std::int64_t>(2 * i + (ops[i] < 0))};
    sort_by_point(rows.data(), scratch.data(), count);

    changes.reserve(count);
    std::vector<std::size_t> starts;  // of the rows of each change
    starts.reserve(count + 1);
    for (std::size_t i = 0; i < count; ++i) {
      if (i > 0 && rows[i].p == rows[i - 1].p) continue;
      changes.push_back({rows[i].p, NONE, false});
      starts.push_back(i);
    }
    starts.push_back(count);
    if (nodes.root != NONE) route(nodes, nodes.root, 0, changes.size());

    rows_applied = static_cast<std::int64_t>(count);
    std::size_t kept = 0;
    for (std::size_t i = 0; i < changes.size(); ++i) {
      if (i + LOOKAHEAD < changes.size()) fetch(nodes, i + LOOKAHEAD);
      const Change change = changes[i];
      const std::uint64_t before = count_of(nodes, copies, place(nodes, change));
      const std::uint64_t after = settle(rows.data() + starts[i], rows.data() + starts[i + 1], before);
      if (before != after && (before > 1 || after > 1)) recounts.push_back({change.p, after});
      growth += static_cast<std::int64_t>(after - before);
      if ((before == 0) == (after == 0)) continue;
      inserts += before == 0;
      changes[kept++] = {change.p, change.leaf, before == 0};
    }
    changes.resize(kept);
    count_leaves(nodes);
  }

 private:
  static constexpr std::size_t LOOKAHEAD = 6;

  // Find the leaf of each of the changes from..to, which belong to the subtree.
  void route(const Nodes& nodes, Ref tree, std::size_t from, std::size_t to) {
    while (to - from > 1 && !is_leaf(tree)) {
      const Node& node = nodes.node(tree);
      const auto middle = std::partition_point(changes.begin() + from, changes.begin() + to,
                                               [&](const Change& change) { return change.p < node.separator; });
      const auto cut = static_cast<std::size_t>(middle - changes.begin());
      if (cut < to && cut > from) route(nodes, node.child[0], from, cut);
      tree = node.child[cut < to];
      if (cut < to) from = std::max(from, cut);
    }
    for (std::size_t i = from; i < to; ++i) changes[i].leaf = nodes.descend(tree, changes[i].p);
  }

  void fetch(const Nodes& nodes, std::size_t i) const {
    const Ref leaf = changes[i].leaf;
    if (leaf != NONE && leaf != changes[i - 1].leaf) nodes.leaf(leaf).fetch();
  }

  static Place place(const Nodes& nodes, const Change& change) {
    if (change.leaf == NONE) return {NONE, 0, false};
    const Leaf& leaf = nodes.leaf(change.leaf);
    const unsigned i = leaf.find(change.p);
    return {change.leaf, i, leaf.holds(i, change.p)};
  }

  // How often a point is there after its rows, and note the deletes that find none left.
  std::uint64_t settle(const Row* first, const Row* last, std::uint64_t before) {
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
    return available;
  }

  // After its first split, a leaf needs half a leaf's worth of inserts for each further one.
  void count_leaves(const Nodes& nodes) {
    for (std::size_t from = 0, to; from < changes.size(); from = to) {
      std::size_t added = 0;
      for (to = from; to < changes.size() && changes[to].leaf == changes[from].leaf; ++to) added += changes[to].insert;
      const std::size_t size = changes[from].leaf == NONE ? 0 : nodes.leaf(changes[from].leaf).size;
      if (added > 0 && size + added > LEAF) extra_leaves += 1 + added / (LEAF / 2);
    }
    extra_leaves += 1;  // where everything goes before something comes
  }
};

}  // namespace dynhull
