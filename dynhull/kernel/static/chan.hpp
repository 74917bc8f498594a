// Chan's algorithm (1996): hulls of small groups, wrapped as one. The rounds are those of chan() in Python.
#pragma once

#include <memory>
#include <vector>

#include "../sort/by_point.hpp"
#include "chain.hpp"

namespace dynhull {

// The hull of a group, counter-clockwise from the least; `turning` is the index of the greatest.
struct Ring {
  const Point* points;
  std::size_t size, turning;

  std::size_t lower_size() const { return turning + 1; }
  std::size_t upper_size() const { return size - turning + (size > 1); }
  Point lower(std::size_t i) const { return points[i]; }
  Point upper(std::size_t i) const { return points[i == 0 ? 0 : size - i]; }
};

// The first index in first..last for which the monotone predicate `holds`; `last` if there is none before it.
template <class Holds>
std::size_t first_where(std::size_t first, std::size_t last, Holds holds) {
  while (first < last) {
    const std::size_t middle = first + (last - first) / 2;
    if (holds(middle))
      last = middle;
    else
      first = middle + 1;
  }
  return first;
}

// The same by exponential search from `first`, or from `last`: O(log distance). Most tangent points are near the start.
template <class Holds>
std::size_t first_where_from_first(std::size_t first, std::size_t last, Holds holds) {
  for (std::size_t step = 1; first < last; step *= 2) {
    const std::size_t probe = first + std::min(step, last - first) - 1;
    if (holds(probe)) {
      last = probe;
      break;
    }
    first = probe + 1;
  }
  return first_where(first, last, holds);
}
template <class Holds>
std::size_t first_where_from_last(std::size_t first, std::size_t last, Holds holds) {
  for (std::size_t step = 1; first < last; step *= 2) {
    const std::size_t probe = last - std::min(step, last - first);
    if (!holds(probe)) {
      first = probe + 1;
      break;
    }
    last = probe;
  }
  return first_where(first, last, holds);
}

// The point of the ring such that all of the ring is on or to the left of the ray from p to it; the farthest of
// several. p is a vertex of the hull of all rings; if the ring is p alone, returns p. O(log size).
inline Point tangent(Point p, const Ring& ring) {
  const auto rightward = [&](std::size_t first) {  // to the lower chain from index `first` on
    const std::size_t last = ring.lower_size() - 1;
    if (first > last) return ring.size > 1 ? ring.upper(ring.upper_size() - 2) : p;  // p is the greatest point
    return ring.lower(first_where_from_first(
        first, last, [&](std::size_t i) { return orientation(ring.lower(i), ring.lower(i + 1), p) > 0; }));
  };
  const std::size_t i = first_where(0, ring.lower_size(), [&](std::size_t k) { return p <= ring.lower(k); });
  if (i == 0 && p < ring.lower(0)) return rightward(0);
  if (i < ring.lower_size()) {
    if (p == ring.lower(i)) return rightward(i + 1);
    if (orientation(ring.lower(i - 1), ring.lower(i), p) < 0) return rightward(i);
  }
  const std::size_t j = first_where(0, ring.upper_size(), [&](std::size_t k) { return p <= ring.upper(k); });
  return ring.upper(first_where_from_last(
      0, j - 1, [&](std::size_t k) { return orientation(ring.upper(k), ring.upper(k + 1), p) >= 0; }));
}

class Chan {
 public:
  // The guess, the number of groups, the number of vertices found, and whether they closed the hull.
  struct Round {
    std::uint64_t guess, groups, steps;
    bool closed;
  };

  // O(n log h). The points are finite and have no negative zeros.
  Chan(const Point* points, std::size_t count) : points_(points, points + count), scratch_(count) {
    if (count == 0) return;
    const Point start = *std::min_element(points_.begin(), points_.end());
    rings_.reserve(count);
    for (const Point& p : points_) rings_.push_back({&p, 1, 0});
    std::uint64_t guess = 2, merged = 2;
    bool closed = false;
    while (!closed) {
      merge(merged);
      closed = wrap(start, guess);
      rounds.push_back({guess, rings_.size(), vertices.size(), closed});
      merged = guess;
      guess *= guess;
    }
  }

  std::vector<Point> vertices;
  std::vector<Round> rounds;

 private:
  // Replaces every `count` successive rings by their hull: the hull of a group is the hull of its subgroups' vertices.
  void merge(std::uint64_t count) {
    Point* free = points_.data();
    std::size_t groups = 0;
    for (std::size_t from = 0, to; from < rings_.size(); from = to) {
      to = from + static_cast<std::size_t>(std::min<std::uint64_t>(count, rings_.size() - from));
      Point* end = free;
      for (std::size_t i = from; i < to; ++i) end = std::copy_n(rings_[i].points, rings_[i].size, end);
      rings_[groups] = ring_of(free, end);
      free += rings_[groups++].size;
    }
    rings_.erase(rings_.begin() + static_cast<std::ptrdiff_t>(groups), rings_.end());
  }

  Ring ring_of(Point* first, Point* last) {
    sort_by_point(first, scratch_.data(), static_cast<std::size_t>(last - first));
    Chain upper(scratch_.data()), lower(first);
    for (const Point* p = last; p > first;) upper.push(*--p);
    for (const Point* p = first; p < last; ++p) lower.push(*p);
    const auto turning = static_cast<std::size_t>(lower.end() - first) - 1;
    Point* end = lower.end();
    if (turning > 0) end = std::copy(upper.begin() + 1, upper.end() - 1, end);
    return {first, static_cast<std::size_t>(end - first), turning};
  }

  // Gift wrapping from the least point. Returns whether the hull closes within `limit` vertices.
  bool wrap(Point start, std::size_t limit) {
    vertices = {start};
    while (true) {
      const Point p = vertices.back();
      Point best = p;
      for (const Ring& ring : rings_) {
        const Point q = tangent(p, ring);
        if (best == p) {
          best = q;
        } else if (!(q == p)) {
          const int side = orientation(p, best, q);
          if (side < 0 || (side == 0 && ((p < best && best < q) || (p > best && best > q)))) best = q;
        }
      }
      if (best == start || best == p) return true;
      if (vertices.size() == limit) return false;
      vertices.push_back(best);
    }
  }

  std::vector<Point> points_, scratch_;
  std::vector<Ring> rings_;
};

}  // namespace dynhull
