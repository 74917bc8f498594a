// A quadtree over the plane. Its leaves are zones: a zone lists the fences whose area holds all of it, the pieces of
// boundary that touch it, and the subjects in it.
//
// A node divides its box at a point, so that boxes of any size and scale are divided where something is. The boxes at
// the rim are infinite.
#pragma once

#include <vector>

#include "../tree/leaf.hpp"
#include "strips.hpp"

namespace dynhull {

struct Zone {
  struct Piece {
    std::uint32_t fence, edge;
    Rim rim;
  };

  Box box;                                   // without its right and upper side
  std::vector<std::uint32_t> covering = {};  // fences
  std::vector<Piece> pieces = {};            // those of a fence one after the other
  std::vector<std::uint32_t> subjects = {};
  std::vector<std::uint32_t> pending = {};  // fences for which all subjects are to be decided again
  std::size_t most = 0;  // subjects or pieces beyond which it is worth dividing; 0 for the usual number

  bool holds(Point p) const {
    return (box.least.x <= p.x) & (p.x < box.greatest.x) & (box.least.y <= p.y) & (p.y < box.greatest.y);
  }
  bool covered_by(std::uint32_t fence) const {
    return std::find(covering.begin(), covering.end(), fence) != covering.end();
  }
};

class Zones {
 public:
  using Number = std::uint32_t;

  Zones() { zones_.push_back({.box = {LOWEST, HIGHEST}}); }

  Zone& operator[](Number zone) { return zones_[zone]; }
  const Zone& operator[](Number zone) const { return zones_[zone]; }
  std::size_t size() const { return zones_.size(); }

  Number find(Point p) const {
    std::uint32_t at = root_;
    while (!(at & ZONE)) {
      const Node& node = nodes_[at];
      at = node.child[quarter(node.split, p)];
    }
    return at & ~ZONE;
  }

  static unsigned quarter(Point split, Point p) {
    return static_cast<unsigned>(p.x >= split.x) | static_cast<unsigned>(p.y >= split.y) << 1;
  }

  // Replaces an emptied zone by four; the first has its number. Returns the numbers.
  std::array<Number, 4> divide(Number zone, Point split) {
    const std::uint32_t parent = parent_of(zone);
    const Box box = zones_[zone].box;
    nodes_.reserve(nodes_.size() + 1 + nodes_.size() / 4);
    if (zones_.capacity() < zones_.size() + 3) zones_.reserve(zones_.size() + 3 + zones_.size() / 4);
    const auto first = static_cast<Number>(zones_.size());
    const std::array<Number, 4> children = {zone, first, first + 1, first + 2};
    const auto node = static_cast<std::uint32_t>(nodes_.size());
    nodes_.push_back({split, {}});
    for (unsigned q = 0; q < 4; ++q) {
      if (q > 0) zones_.emplace_back();
      zones_[children[q]].box = quarter_of(box, split, q);
      nodes_[node].child[q] = children[q] | ZONE;
    }
    if (parent == NONE) {
      root_ = node;
    } else {
      for (std::uint32_t& child : nodes_[parent].child)
        if (child == (zone | ZONE)) child = node;
    }
    return children;
  }

  // Visits each zone that a strip may touch, with the numbers of those that do, and all zones of a box without one for
  // whose points `beyond` is true. `ids` has the numbers, and room for work behind them.
  template <class StripOf, class Beyond, class Visit>
  void descend(std::vector<std::uint32_t>& ids, StripOf strip_of, Beyond beyond, Visit visit) const {
    descend(root_, {LOWEST, HIGHEST}, ids, 0, ids.size(), strip_of, beyond, visit);
  }

  std::size_t bytes() const {
    std::size_t bytes = nodes_.capacity() * sizeof(Node) + zones_.capacity() * sizeof(Zone);
    for (const Zone& zone : zones_)
      bytes += (zone.covering.capacity() + zone.subjects.capacity() + zone.pending.capacity()) * sizeof(Number) +
               zone.pieces.capacity() * sizeof(Zone::Piece);
    return bytes;
  }

  // A finite point of a box that has one.
  static Point sample(const Box& box) {
    const auto of = [](double least, double greatest) {
      return least > -INFINITE ? least : greatest < INFINITE ? std::nextafter(greatest, -INFINITE) : 0;
    };
    return {of(box.least.x, box.greatest.x), of(box.least.y, box.greatest.y)};
  }

 private:
  static constexpr std::uint32_t ZONE = std::uint32_t{1} << 31;

  struct Node {
    Point split;
    std::uint32_t child[4];  // nodes, or zones with the bit ZONE
  };

  static Box quarter_of(Box box, Point split, unsigned q) {
    (q & 1 ? box.least.x : box.greatest.x) = split.x;
    (q & 2 ? box.least.y : box.greatest.y) = split.y;
    return box;
  }
  static bool empty(const Box& box) { return !(box.least.x < box.greatest.x && box.least.y < box.greatest.y); }

  std::uint32_t parent_of(Number zone) const {
    const Point p = sample(zones_[zone].box);
    std::uint32_t parent = NONE;
    for (std::uint32_t at = root_; !(at & ZONE); at = nodes_[at].child[quarter(nodes_[at].split, p)]) parent = at;
    return parent;
  }

  template <class StripOf, class Beyond, class Visit>
  void descend(std::uint32_t at, const Box& box, std::vector<std::uint32_t>& ids, std::size_t from, std::size_t to,
               StripOf& strip_of, Beyond& beyond, Visit& visit) const {
    if (empty(box)) return;
    const std::size_t start = ids.size();
    for (std::size_t i = from; i < to; ++i)
      if (may_touch(strip_of(ids[i]), box)) ids.push_back(ids[i]);
    const std::size_t end = ids.size();
    if (start == end) {
      if (beyond(sample(box))) visit_all(at, visit);
    } else if (at & ZONE) {
      visit(at & ~ZONE, std::span<const std::uint32_t>(ids).subspan(start));
    } else {
      for (unsigned q = 0; q < 4; ++q)
        descend(nodes_[at].child[q], quarter_of(box, nodes_[at].split, q), ids, start, end, strip_of, beyond, visit);
    }
    ids.resize(start);
  }

  template <class Visit>
  void visit_all(std::uint32_t at, Visit& visit) const {
    if (at & ZONE) return visit(at & ~ZONE, std::span<const std::uint32_t>());
    for (const std::uint32_t child : nodes_[at].child) visit_all(child, visit);
  }

  std::vector<Node> nodes_;
  std::vector<Zone> zones_;
  std::uint32_t root_ = ZONE;
};

}  // namespace dynhull
