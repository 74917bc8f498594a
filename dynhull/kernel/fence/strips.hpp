// The boundary of an area with its margin, in strips. The tests here round, and always to the safe side: they choose
// what is decided exactly, and decide nothing themselves.
#pragma once

#include "area.hpp"

namespace dynhull {

// All points at most `margin` from an edge; or, if the radius is not negative, between a circle around a and a larger
// one. While a subject stays off it, its state does not change.
struct Strip {
  Edge edge;
  double margin, radius;
};

inline bool edge_less(const Edge& e, const Edge& f) { return e.a == f.a ? e.b < f.b : e.a < f.a; }

inline Box around(const Strip& strip) {
  const double reach = std::max(strip.radius, 0.0) + strip.margin;
  Box box = Box::of(strip.edge);
  if (reach == 0) return box;
  const double wider = reach * (1 + STRIP_BOUND);
  box.least = {std::nextafter(box.least.x - wider, -INFINITE), std::nextafter(box.least.y - wider, -INFINITE)};
  box.greatest = {std::nextafter(box.greatest.x + wider, INFINITE), std::nextafter(box.greatest.y + wider, INFINITE)};
  return box;
}

// False only if no point of the box is in the strip.
inline bool may_touch(const Strip& strip, const Box& box) {
  if (!around(strip).meets(box)) return false;
  if (strip.radius >= 0) {
    const Point a = strip.edge.a;
    const Point center = box.center(), half = box.half();
    const double farthest = std::hypot(std::abs(center.x - a.x) + half.x, std::abs(center.y - a.y) + half.y);
    const double nearest =
        std::hypot(std::max(std::abs(center.x - a.x) - half.x, 0.0), std::max(std::abs(center.y - a.y) - half.y, 0.0));
    const double error = STRIP_BOUND * (farthest + strip.radius + strip.margin) + STRIP_SLACK;
    return !(farthest + error < strip.radius) && !(nearest - error > strip.radius + strip.margin);
  }
  return may_touch_line(strip.edge, strip.margin, box);
}

inline Strip strip_of(const Area& area, Edge edge) {
  return {edge, area.reach(edge), area.kind == Area::Kind::DISK ? area.radius : -1};
}

// The edges of an area in order; a disk has its center.
inline std::vector<Edge> sorted_edges(const Area& area) {
  std::vector<Edge> all;
  if (area.kind == Area::Kind::DISK) all.push_back({area.center, area.center});
  area.for_each_edge([&](Edge edge) { all.push_back(edge); });
  std::sort(all.begin(), all.end(), edge_less);
  return all;
}

}  // namespace dynhull
