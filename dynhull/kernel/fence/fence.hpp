// One fence: its area, now and when it was last decided, and the pieces of its boundary by number.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>

#include "strips.hpp"

namespace dynhull {

using Places = std::unordered_map<std::string, std::optional<Point>>;  // by key; none where the key is missing

struct Fence {
  std::int64_t number = 0;
  bool cross = false, own = false;  // own: around the subjects' own hull, without the subject
  bool decided_own = false;         // when it was last decided
  bool given = false;               // the keys inside were given, not decided
  std::int64_t count = 0;           // of subjects inside
  std::shared_ptr<const Area> area, decided;
  std::vector<Edge> edges;                // by number; some are free
  std::vector<std::uint32_t> free;        // the numbers of those
  std::vector<std::uint32_t> sorted;      // the numbers of the others, in order of the edges
  std::vector<std::uint32_t> outside;     // own: slots that are outside, and some that were
  std::shared_ptr<const Places> earlier;  // of a new fence: the places of the keys that had changed

  Strip strip(std::uint32_t edge) const { return strip_of(*area, edge); }
  Strip strip_of(const Area& of, std::uint32_t edge) const {
    return {edges[edge], of.margin, of.kind == Area::Kind::DISK ? of.radius : -1};
  }

  // The edges of an area in order; a disk has its center.
  static std::vector<Edge> sorted_edges(const Area& area) {
    std::vector<Edge> all;
    if (area.kind == Area::Kind::DISK) all.push_back({area.center, area.center});
    area.for_each_edge([&](Edge edge) { all.push_back(edge); });
    std::sort(all.begin(), all.end(), less);
    return all;
  }
  static bool less(const Edge& e, const Edge& f) { return e.a == f.a ? e.b < f.b : e.a < f.a; }

  std::uint32_t add(Edge edge) {
    if (free.empty()) {
      edges.push_back(edge);
      return static_cast<std::uint32_t>(edges.size() - 1);
    }
    const std::uint32_t id = free.back();
    free.pop_back();
    edges[id] = edge;
    return id;
  }

  std::size_t bytes() const {
    std::size_t bytes = sizeof *this + edges.capacity() * sizeof(Edge) + free.capacity() * 4 + sorted.capacity() * 4;
    for (const Polygon& polygon : area->polygons) bytes += polygon.bytes();
    return bytes + area->convex.capacity() * sizeof(Point) + outside.capacity() * 4;
  }
};

}  // namespace dynhull
