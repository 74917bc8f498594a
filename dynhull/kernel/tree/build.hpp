// Bulk construction from sorted points.
#pragma once

#include "../memory/scratch.hpp"
#include "../threads.hpp"
#include "balance.hpp"

namespace dynhull {

inline std::size_t leaves_for(std::size_t points) { return points <= LEAF ? 1 : (points + FILL - 1) / FILL; }

// The memory that a build needs besides the tree's: enough for every build of up to `points` points.
struct BuildingSite {
  explicit BuildingSite(std::size_t points)
      : leaves(leaves_for(points)),
        inner(leaves_for(points)),
        seams{Scratch<Seam>(leaves_for(points)), Scratch<Seam>(leaves_for(points))} {}

  // Of a leaf and one side: which of its entries are on the chain of the largest subtree built so far, and the nearest
  // leaves before and after it there that have some.
  struct Seam {
    Mask chain;
    std::uint32_t before, after;
  };

  Scratch<Ref> leaves, inner;
  Scratch<Seam> seams[2];
};

// Builds a balanced tree over sorted distinct points. Takes all leaves and nodes first, so that several threads can
// fill them.
class Building {
 public:
  // `nodes` has room for leaves_for(count) leaves. Their numbers are in `site` afterwards.
  Building(Nodes& nodes, const Point* points, std::size_t count, BuildingSite& site)
      : nodes_(nodes), points_(points), count_(count), parts_(leaves_for(count)), site_(site) {
    for (std::size_t i = 0; i < parts_; ++i) site.leaves[i] = nodes.take_leaf();
    for (std::size_t i = 1; i < parts_; ++i) site.inner[i] = nodes.take_node();
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
    nodes_.leaf(site_.leaves[leaf]).repeated |= bit(static_cast<unsigned>(point - start(leaf)));
  }

 private:
  std::size_t start(std::size_t leaf) const { return count_ * leaf / parts_; }

  static std::size_t middle(std::size_t first, std::size_t last) { return first + (last - first) / 2; }

  // The tree over the leaves first..last. Some leaves at a time are filled before they are joined: between joins, which
  // look here and there, the processor does not foresee which points and which leaf come next.
  Ref subtree(std::size_t first, std::size_t last) const {
    constexpr std::size_t FILLED_AT_ONCE = 128;
    if (last - first > FILLED_AT_ONCE) {
      const std::size_t cut = middle(first, last);
      return joined(cut, subtree(first, cut), subtree(cut, last));
    }
    for (std::size_t leaf = first; leaf < last; ++leaf) fill(leaf);
    return filled(first, last);
  }
  // The same over leaves that have their points.
  Ref filled(std::size_t first, std::size_t last) const {
    if (last - first == 1) return site_.leaves[first];
    const std::size_t cut = middle(first, last);
    return joined(cut, filled(first, cut), filled(cut, last));
  }
  void fill(std::size_t number) const {
    const std::size_t from = start(number), to = start(number + 1);
    Leaf& leaf = nodes_.leaf(site_.leaves[number]);
    leaf.assign(points_ + from, static_cast<unsigned>(to - from));
    for (Side side : SIDES) site_.seams[side][number] = {leaf.chain[side], NONE, NONE};
  }
  // The same, once the subtrees `levels` below it are there.
  Ref top(std::size_t first, std::size_t last, unsigned levels) const {
    const std::size_t cut = middle(first, last);
    if (levels > 0) return joined(cut, top(first, cut, levels - 1), top(cut, last, levels - 1));
    return last - first > 1 ? site_.inner[cut] : site_.leaves[first];
  }

  Ref joined(std::size_t cut, Ref left, Ref right) const {
    const Ref v = site_.inner[cut];
    nodes_.link(v, 0, left);
    nodes_.link(v, 1, right);
    nodes_.node(v).separator = points_[start(cut)];
    for (Side side : SIDES) nodes_.bridge(v, side) = sewn(cut, side);
    refresh_height(nodes_, v);
    return v;
  }

  // A vertex of a chain, and what is beyond it on the chain of its leaf.
  struct Vertex {
    std::uint32_t leaf;
    unsigned entry;
    Mask rest;
    Point p;
  };
  Vertex vertex(std::uint32_t leaf, unsigned entry, Mask rest) const {
    return {leaf, entry, rest, nodes_.leaf(site_.leaves[leaf])[entry]};
  }
  // The next vertex to the left, or to the right; without one, its leaf is NONE.
  Vertex before(const Vertex& v, const BuildingSite::Seam* seams) const {
    const std::uint32_t leaf = v.rest ? v.leaf : seams[v.leaf].before;
    if (leaf == NONE) return {NONE, 0, 0, {}};
    const Mask rest = v.rest ? v.rest : seams[leaf].chain;
    const unsigned entry = highest(rest);
    return vertex(leaf, entry, rest & ~bit(entry));
  }
  Vertex after(const Vertex& v, const BuildingSite::Seam* seams) const {
    const std::uint32_t leaf = v.rest ? v.leaf : seams[v.leaf].after;
    if (leaf == NONE) return {NONE, 0, 0, {}};
    const Mask rest = v.rest ? v.rest : seams[leaf].chain;
    return vertex(leaf, lowest(rest), rest & (rest - 1));
  }

  // Joins the chains on both sides of a cut, and returns the edge that does. Starts from the points beside the cut and
  // moves outwards: what it passes is on no larger chain, so that a build passes each vertex once.
  Edge sewn(std::size_t cut, Side side) const {
    const auto right_leaf = static_cast<std::uint32_t>(cut), left_leaf = right_leaf - 1;
    BuildingSite::Seam* const seams = site_.seams[side].data();
    const unsigned last = nodes_.leaf(site_.leaves[left_leaf]).size - 1;
    Vertex a = vertex(left_leaf, last, seams[left_leaf].chain & below(last));
    Vertex b = vertex(right_leaf, 0, seams[right_leaf].chain & ~bit(0));
    Vertex beside_a = before(a, seams), beside_b = after(b, seams);
    while (true) {
      if (beside_a.leaf != NONE && turned(side, orientation(beside_a.p, a.p, b.p)) >= 0) {
        a = beside_a;
        beside_a = before(a, seams);
      } else if (beside_b.leaf != NONE && turned(side, orientation(a.p, b.p, beside_b.p)) >= 0) {
        b = beside_b;
        beside_b = after(b, seams);
      } else {
        break;
      }
    }
    BuildingSite::Seam &left = seams[a.leaf], &right = seams[b.leaf];
    left.chain &= below(a.entry + 1);
    left.after = b.leaf;
    right.chain &= ~below(b.entry);
    right.before = a.leaf;
    return {a.p, b.p};
  }

  Ref detached(Ref tree) const {
    nodes_.set_parent(tree, NONE);
    return tree;
  }

  Nodes& nodes_;
  const Point* points_;
  std::size_t count_, parts_;
  BuildingSite& site_;
};

}  // namespace dynhull
