// A quadtree over the plane. Its leaves are zones: a zone lists the fences whose area holds all of it, the pieces of
// boundary that touch it, and the subjects in it.
//
// A node divides its box at a point, so that boxes of any size and scale are divided where something is. The boxes at
// the rim are infinite.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "../memory/chunks.hpp"
#include "../tree/leaf.hpp"
#include "strips.hpp"

namespace dynhull {

// An edge of a fence in a zone.
struct Piece {
  Edge edge;
  std::uint32_t fence;
  bool simple;  // the area is one polygon
  bool wide;    // more than the edge is near the boundary: the area has a margin, or is a disk
  bool disk;    // instead of an edge
  bool inside;  // simple: whether the zone's anchor is
};

// Whether the box of one of some edges meets another box.
inline bool any_meets(std::span<const Piece> pieces, const Box& box) {
  return std::any_of(pieces.begin(), pieces.end(), [&](const Piece& piece) { return Box::of(piece.edge).meets(box); });
}

// Whether the end of a way in a zone is inside of a polygon, by the edges that the way crosses, if its start is. None
// where the way is not clear of the ends of an edge, or starts or ends on one. Exact.
inline std::optional<bool> inside_after(std::span<const Piece> pieces, Point from, bool inside, Point to) {
  const Box way = Box::of({from, to});
  for (const Piece& piece : pieces) {
    const Edge edge = piece.edge;
    if (!Box::of(edge).meets(way)) continue;
    const int at_from = orientation(edge.a, edge.b, from), at_to = orientation(edge.a, edge.b, to);
    if (at_from * at_to > 0) continue;
    const int at_a = orientation(from, to, edge.a), at_b = orientation(from, to, edge.b);
    if (at_a * at_b > 0) continue;
    if (at_from == 0 || at_to == 0 || at_a == 0 || at_b == 0) return std::nullopt;
    inside = !inside;
  }
  return inside;
}

// A finite point of a box, in the middle if it has one: ways from there are short. If it has none, of its closure.
inline Point anchor_of(const Box& box) {
  const auto of = [](double least, double greatest) {
    const double middle = least / 2 + greatest / 2;
    if (std::isfinite(middle) && least <= middle && middle < greatest) return middle;
    return least > -INFINITE ? least : greatest < INFINITE ? std::nextafter(greatest, -INFINITE) : 0;
  };
  return {of(box.least.x, box.greatest.x), of(box.least.y, box.greatest.y)};
}

struct alignas(LINE) Zone {
  Box box = Box::none();           // without its right and upper side
  std::vector<Piece> pieces = {};  // those of a fence one after the other
  std::size_t most = 0;            // subjects or pieces beyond which it is worth dividing; 0 for the usual number
  std::vector<std::uint32_t> covering = {};  // fences
  std::vector<std::uint32_t> subjects = {};
  std::vector<std::uint32_t> pending = {};  // fences for which all subjects are to be decided again

  bool holds(Point p) const {
    return (box.least.x <= p.x) & (p.x < box.greatest.x) & (box.least.y <= p.y) & (p.y < box.greatest.y);
  }
  void fetch() const {
    for (std::size_t i = 0; i < sizeof(Zone); i += LINE) prefetch(reinterpret_cast<const char*>(this) + i);
  }
  void fetch_pieces() const {
    const std::size_t bytes = std::min(pieces.size() * sizeof(Piece), std::size_t{12 * LINE});
    for (std::size_t i = 0; i < bytes; i += LINE) prefetch(reinterpret_cast<const char*>(pieces.data()) + i);
  }
  void fetch_subjects() const { prefetch(&subjects); }
  Point anchor() const { return anchor_of(box); }
  // The distance from a point of the zone to the nearest of some pieces, if all others are farther. Rounded once.
  std::optional<double> distance(std::span<const Piece> run, Point p) const {
    const double nearest = distance_to_nearest(p, [&](const double&, auto visit) {
      for (const Piece& piece : run) visit(piece.edge);
    });
    const double to_border =
        std::min({p.x - box.least.x, box.greatest.x - p.x, p.y - box.least.y, box.greatest.y - p.y});
    return nearest < to_border * (1 - NEARNESS_BOUND) ? std::optional(nearest) : std::nullopt;
  }
  // The pieces of the fence of piece `first`.
  std::span<const Piece> run(std::size_t first) const {
    std::size_t end = first + 1;
    while (end < pieces.size() && pieces[end].fence == pieces[first].fence) ++end;
    return std::span(pieces).subspan(first, end - first);
  }
  // Those of a fence; empty if there are none.
  std::span<const Piece> run_of(std::uint32_t fence) const {
    for (std::size_t first = 0; first < pieces.size(); ++first)
      if (pieces[first].fence == fence) return run(first);
    return {};
  }
  bool covered_by(std::uint32_t fence) const {
    return std::find(covering.begin(), covering.end(), fence) != covering.end();
  }
};

class Zones {
 public:
  using Number = std::uint32_t;

  Zones() {
    zones_.reserve(1);
    zones_.push_back({.box = {LOWEST, HIGHEST}});
  }

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

  // An infinite coordinate of the split leaves the first half whole and the second one empty.
  static Box quarter_of(Box box, Point split, unsigned q) {
    q& 1 ? box.least.x = split.x : box.greatest.x = std::min(split.x, box.greatest.x);
    q& 2 ? box.least.y = split.y : box.greatest.y = std::min(split.y, box.greatest.y);
    return box;
  }

  static bool empty(const Box& box) { return !(box.least.x < box.greatest.x && box.least.y < box.greatest.y); }

  // Replaces an emptied zone by four; the first has its number. Returns the numbers.
  std::array<Number, 4> divide(Number zone, Point split) {
    const std::uint32_t parent = parent_of(zone);
    const Box box = zones_[zone].box;
    nodes_.reserve(nodes_.size() + 1 + nodes_.size() / 4);
    zones_.reserve(zones_.size() + 3);
    const auto first = static_cast<Number>(zones_.size());
    const std::array<Number, 4> children = {zone, first, first + 1, first + 2};
    const auto node = static_cast<std::uint32_t>(nodes_.size());
    nodes_.push_back({split, {}});
    for (unsigned q = 0; q < 4; ++q) {
      if (q > 0) zones_.push_back({});
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
    std::size_t bytes = nodes_.capacity() * sizeof(Node) + zones_.bytes();
    for (std::size_t i = 0; i < zones_.size(); ++i) {
      const Zone& zone = zones_[i];
      bytes += (zone.covering.capacity() + zone.subjects.capacity() + zone.pending.capacity()) * sizeof(Number) +
               zone.pieces.capacity() * sizeof(Piece);
    }
    return bytes;
  }

 private:
  static constexpr std::uint32_t ZONE = std::uint32_t{1} << 31;

  struct Node {
    Point split;
    std::uint32_t child[4];  // nodes, or zones with the bit ZONE
  };

  std::uint32_t parent_of(Number zone) const {
    const Point p = zones_[zone].anchor();
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
      if (beyond(anchor_of(box))) visit_all(at, visit);
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
  Chunks<Zone> zones_;
  std::uint32_t root_ = ZONE;
};

}  // namespace dynhull
