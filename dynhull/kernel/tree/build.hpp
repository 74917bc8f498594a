// Bulk construction from sorted points.
#pragma once

#include "../threads.hpp"
#include "balance.hpp"

namespace dynhull {

inline std::size_t leaves_for(std::size_t points) { return points <= LEAF ? 1 : (points + FILL - 1) / FILL; }

// Builds a balanced tree over sorted distinct points. Takes all leaves and nodes first, so that several threads can
// fill them.
class Building {
 public:
  // `refs` has room for 2 leaves_for(count) entries, the leaves first; `nodes` has room for leaves_for(count) leaves.
  Building(Nodes& nodes, const Point* points, std::size_t count, Ref* refs)
      : nodes_(nodes), points_(points), count_(count), parts_(leaves_for(count)), leaves_(refs), inner_(refs + parts_) {
    for (std::size_t i = 0; i < parts_; ++i) refs[i] = nodes.take_leaf();
    for (std::size_t i = 1; i < parts_; ++i) refs[parts_ + i] = nodes.take_node();
  }

  // The whole tree, detached. O(n).
  Ref tree() const { return detached(subtree(0, parts_)); }

  // The same on several threads, one of which also calls `beside`.
  template <class Beside>
  Ref tree(Threads& threads, Beside beside) const {
    const auto levels = static_cast<unsigned>(std::bit_width(std::min<std::size_t>(4 * threads.count(), parts_)) - 1);
    const std::size_t subtrees = std::size_t{1} << levels;
    threads.run(1 + subtrees, [&](std::size_t task) {
      if (task == 0) return beside();
      std::size_t first = 0, last = parts_;
      for (unsigned level = levels; level-- > 0;) ((task - 1) >> level & 1 ? first : last) = middle(first, last);
      subtree(first, last);
    });
    return detached(top(0, parts_, levels));
  }

  // Marks a point as repeated in its leaf, once the leaf is built.
  void mark_repeated(std::size_t point) const {
    const std::size_t leaf = ((point + 1) * parts_ - 1) / count_;
    nodes_.leaf(leaves_[leaf]).repeated |= bit(static_cast<unsigned>(point - start(leaf)));
  }

 private:
  std::size_t start(std::size_t leaf) const { return count_ * leaf / parts_; }

  static std::size_t middle(std::size_t first, std::size_t last) { return first + (last - first) / 2; }

  // The tree over the leaves first..last.
  Ref subtree(std::size_t first, std::size_t last) const {
    if (last - first > 1) {
      const std::size_t cut = middle(first, last);
      return joined(cut, subtree(first, cut), subtree(cut, last));
    }
    const std::size_t from = start(first), to = start(last);
    nodes_.leaf(leaves_[first]).assign(points_ + from, static_cast<unsigned>(to - from));
    return leaves_[first];
  }
  // The same, once the subtrees `levels` below it are there.
  Ref top(std::size_t first, std::size_t last, unsigned levels) const {
    const std::size_t cut = middle(first, last);
    if (levels > 0) return joined(cut, top(first, cut, levels - 1), top(cut, last, levels - 1));
    return last - first > 1 ? inner_[cut] : leaves_[first];
  }

  Ref joined(std::size_t cut, Ref left, Ref right) const {
    const Ref v = inner_[cut];
    nodes_.link(v, 0, left);
    nodes_.link(v, 1, right);
    nodes_.node(v).separator = points_[start(cut)];
    refresh(nodes_, v);
    return v;
  }
  Ref detached(Ref tree) const {
    nodes_.set_parent(tree, NONE);
    return tree;
  }

  Nodes& nodes_;
  const Point* points_;
  std::size_t count_, parts_;
  const Ref *leaves_, *inner_;
};

}  // namespace dynhull
