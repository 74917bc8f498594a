// Bulk construction from sorted points.
#pragma once

#include "../threads.hpp"
#include "balance.hpp"

namespace dynhull {

inline std::size_t leaves_for(std::size_t points) { return points <= LEAF ? 1 : (points + FILL - 1) / FILL; }

// Builds a balanced tree over sorted distinct points. Takes all leaves and nodes first, so that two threads can fill
// them.
class Building {
 public:
  // `refs` has room for 2 leaves_for(count) entries, the leaves first; `nodes` has room for leaves_for(count) leaves.
  Building(Nodes& nodes, const Point* points, std::size_t count, Ref* refs)
      : nodes_(nodes), points_(points), count_(count), parts_(leaves_for(count)), leaves_(refs), inner_(refs + parts_) {
    for (std::size_t i = 0; i < parts_; ++i) refs[i] = nodes.take_leaf();
    for (std::size_t i = 1; i < parts_; ++i) refs[parts_ + i] = nodes.take_node();
  }

  // The whole tree, detached. O(n).
  Ref tree(bool threads = false) const {
    const Ref whole = subtree(0, parts_, threads);
    nodes_.set_parent(whole, NONE);
    return whole;
  }

  // Marks a point as repeated in its leaf, once the leaf is built.
  void mark_repeated(std::size_t point) const {
    const std::size_t leaf = ((point + 1) * parts_ - 1) / count_;
    nodes_.leaf(leaves_[leaf]).repeated |= bit(static_cast<unsigned>(point - start(leaf)));
  }

 private:
  std::size_t start(std::size_t leaf) const { return count_ * leaf / parts_; }

  // The tree over the leaves first..last.
  Ref subtree(std::size_t first, std::size_t last, bool threads) const {
    if (last - first == 1) {
      const std::size_t from = start(first), to = start(last);
      nodes_.leaf(leaves_[first]).assign(points_ + from, static_cast<unsigned>(to - from));
      return leaves_[first];
    }
    const std::size_t middle = first + (last - first) / 2;
    const Ref v = inner_[middle];
    both(
        threads, [&] { nodes_.link(v, 0, subtree(first, middle, false)); },
        [&] { nodes_.link(v, 1, subtree(middle, last, false)); });
    nodes_.node(v).separator = points_[start(middle)];
    refresh(nodes_, v);
    return v;
  }

  Nodes& nodes_;
  const Point* points_;
  std::size_t count_, parts_;
  const Ref *leaves_, *inner_;
};

}  // namespace dynhull
