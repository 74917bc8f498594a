// What a large batch amounts to: read the tree, change nothing. What remains are points that are new, points that go,
// and points that only change their number.
#pragma once

#include "groups.hpp"

namespace dynhull {

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
  std::size_t inserts = 0;       // changes that insert
  std::size_t extra_leaves = 1;  // the changes need at most so many more; one where all goes before something comes

  Plan(const Nodes& nodes, const Copies& copies, Groups& groups) {
    changes.resize(groups.size());
    std::size_t kept = 0;
    for (std::size_t i = 0; i < groups.size(); ++i) {
      const std::size_t ahead = i + Groups::LOOKAHEAD;
      if (ahead < groups.size() && groups[ahead].leaf != NONE && groups.new_leaf(ahead))
        nodes.leaf(groups[ahead].leaf).fetch_x();
      const Group& group = groups[i];
      const Place place = group.leaf == NONE ? Place{NONE, 0, false} : find_in(nodes, group.leaf, group.p);
      const std::uint64_t before = count_of(nodes, copies, place);
      const std::uint64_t after = groups.settle(i, before);
      if (before != after && (before > 1 || after > 1)) recounts.push_back({group.p, after});
      changes[kept] = {group.p, group.leaf, before == 0};
      kept += (before == 0) != (after == 0);
      inserts += before == 0 && after > 0;
    }
    changes.resize(kept);
    count_leaves(nodes);
  }

 private:
  // After its first split, a leaf needs half a leaf's worth of inserts for each further one.
  void count_leaves(const Nodes& nodes) {
    for (std::size_t from = 0, to; from < changes.size(); from = to) {
      std::size_t added = 0;
      for (to = from; to < changes.size() && changes[to].leaf == changes[from].leaf; ++to) added += changes[to].insert;
      const std::size_t size = changes[from].leaf == NONE ? 0 : nodes.leaf(changes[from].leaf).size;
      if (added > 0 && size + added > LEAF) extra_leaves += 1 + added / (LEAF / 2);
    }
  }
};

}  // namespace dynhull
