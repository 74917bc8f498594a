// The hull of points given at once: throw away what is surely inside, sort the rest, one pass a side.
//
// Akl and Toussaint, "A fast convex hull algorithm" (1978), with many more than their few extreme points: the hull of a
// sample, and below it a row of boxes. The corners of each box were located exactly, so what lies in a box is no
// vertex.
#pragma once

#include "build.hpp"

namespace dynhull {

struct BarePoint {
  Point p;
};

// The vertices of one side of sorted distinct points, left to right.
inline std::vector<Point> half_chain(const std::vector<BarePoint>& points, Side side) {
  std::vector<Point> chain;
  for (const auto& [p] : points) {
    while (chain.size() > 1 && turned(side, orientation(chain[chain.size() - 2], chain.back(), p)) >= 0)
      chain.pop_back();
    chain.push_back(p);
  }
  return chain;
}

inline void sort_distinct(std::vector<BarePoint>& points) {
  std::vector<BarePoint> scratch(points.size());
  sort_by_point(points.data(), scratch.data(), points.size());
  points.erase(std::unique(points.begin(), points.end(), [](auto& a, auto& b) { return a.p == b.p; }), points.end());
}

// Boxes inside the hull of a sample.
class Inside {
 public:
  Inside(const Point* points, std::size_t count) {
    std::vector<BarePoint> sample(SAMPLE);
    for (std::size_t i = 0; i < SAMPLE; ++i) sample[i] = {points[i * (count / SAMPLE)]};
    sort_distinct(sample);
    for (Side side : SIDES) chain_[side] = half_chain(sample, side);
    boxes_.assign(BOXES + 1, Box{INFINITE, -INFINITE});
    least_ = sample.front().p.x;
    const double span = sample.back().p.x - least_;
    scale_ = static_cast<double>(BOXES) / span;
    if (!(scale_ > 0 && scale_ < INFINITE)) {
      scale_ = 0;
      return;
    }
    for (std::size_t k = 0; k < BOXES; ++k) {
      const double left = least_ + span * ((static_cast<double>(k) - MARGIN) / BOXES);
      const double right = least_ + span * ((static_cast<double>(k + 1) + MARGIN) / BOXES);
      // The place of a box grows with x, so that all of its points are between these two.
      if (left < least_ || key(left) >= k || key(right) <= k) continue;
      const Box box = {std::max(height(LOWER, left), height(LOWER, right)),
                       std::min(height(UPPER, left), height(UPPER, right))};
      const double slack = MARGIN * (box.high - box.low);
      const Box safe = {box.low + slack, box.high - slack};
      if (safe.low < safe.high && holds({left, safe.low}) && holds({right, safe.low}) && holds({left, safe.high}) &&
          holds({right, safe.high}))
        boxes_[k] = safe;
    }
  }

  bool covers(Point p) const {
    const Box& box = boxes_[key(p.x)];
    return (p.y > box.low) & (p.y < box.high);
  }

 private:
  static constexpr std::size_t SAMPLE = 4096, BOXES = 1024;
  static constexpr double MARGIN = 1e-6;  // for success only: what counts is that the corners are inside

  struct Box {
    double low, high;
  };

  // Outside of the sample's width, the last box, which is empty; in a sample without width all boxes are.
  std::size_t key(double x) const {
    const double place = (x - least_) * scale_;
    return place >= 0 && place < static_cast<double>(BOXES) ? static_cast<std::size_t>(place) : BOXES;
  }

  const Point* after(Side side, double x) const {
    const auto& chain = chain_[side];
    return &*std::lower_bound(chain.begin() + 1, chain.end() - 1, x, [](Point p, double x) { return p.x < x; });
  }

  double height(Side side, double x) const {
    const Point *b = after(side, x), *a = b - 1;
    return a->y + (b->y - a->y) * ((x - a->x) / (b->x - a->x));
  }

  // Whether a point is inside the sample's hull or on its boundary, exactly.
  bool holds(Point p) const {
    for (Side side : SIDES) {
      const Point *b = after(side, p.x), *a = b - 1;
      if (!(a->x <= p.x && p.x <= b->x) || turned(side, orientation(*a, *b, p)) > 0) return false;
    }
    return true;
  }

  std::vector<Point> chain_[2];
  std::vector<Box> boxes_;
  double least_ = 0, scale_ = 0;
};

constexpr std::size_t FILTER_FROM = 16384;  // points, above which a sample pays

// Strict vertices, counter-clockwise from the lexicographically smallest. O(n) for most inputs, O(n log n) for all.
inline std::vector<Point> static_hull(const Point* points, std::size_t count) {
  std::vector<BarePoint> rest;
  std::size_t next = 0;
  if (count >= FILTER_FROM) {
    const Inside inside(points, count);
    const std::size_t probe = FILTER_FROM;
    rest.resize(count);
    std::size_t kept = 0;
    const auto filter = [&](std::size_t end) {
      for (; next < end; ++next) {
        rest[kept].p = points[next];
        kept += !inside.covers(points[next]);
      }
    };
    filter(probe);
    if (kept < probe * 7 / 10) filter(count);
    rest.resize(kept);
  }
  for (; next < count; ++next) rest.push_back({points[next]});
  if (rest.empty()) return {};
  sort_distinct(rest);
  std::vector<Point> hull = half_chain(rest, LOWER);
  const std::vector<Point> upper = half_chain(rest, UPPER);
  if (upper.size() > 2) hull.insert(hull.end(), upper.rbegin() + 1, upper.rend() - 1);
  return hull;
}

}  // namespace dynhull
