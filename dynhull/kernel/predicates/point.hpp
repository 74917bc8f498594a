// Points in lexicographic order, edges, and the two sides of a hull.
#pragma once

#include <cstdint>
#include <limits>

namespace dynhull {

struct Point {
  double x, y;
};

inline bool operator==(Point p, Point q) { return (p.x == q.x) & (p.y == q.y); }  // & rather than &&: no branch

// The branch is predictable: few points of an input share their x.
inline bool operator<(Point p, Point q) {
  if (p.x == q.x) [[unlikely]]
    return p.y < q.y;
  return p.x < q.x;
}
inline bool operator>(Point p, Point q) { return q < p; }
inline bool operator<=(Point p, Point q) {
  if (p.x == q.x) [[unlikely]]
    return p.y <= q.y;
  return p.x < q.x;
}
inline bool operator>=(Point p, Point q) { return q <= p; }

constexpr double INFINITE = std::numeric_limits<double>::infinity();
constexpr Point LOWEST = {-INFINITE, -INFINITE}, HIGHEST = {INFINITE, INFINITE};

struct Edge {
  Point a, b;
};

// Turns points into the form that trees store, without negative zeros, so that equal points have equal bits. Records
// whether all of them were finite.
class Plain {
 public:
  Point operator()(Point p) {
    const Point plain = {p.x + 0.0, p.y + 0.0};
    strange_.x += plain.x - plain.x;  // 0, or NaN if not finite
    strange_.y += plain.y - plain.y;
    return plain;
  }
  bool finite() const { return strange_ == Point{0, 0}; }

 private:
  Point strange_ = {0, 0};
};

// Both sides share all code: p is outside the edge from a to b if turned(side, orientation(a, b, p)) > 0.
enum Side : int { UPPER = 0, LOWER = 1 };
constexpr Side SIDES[] = {UPPER, LOWER};
inline int turned(Side side, int sign) { return side == UPPER ? sign : -sign; }

}  // namespace dynhull
