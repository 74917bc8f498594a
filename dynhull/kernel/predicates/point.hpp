// Points and their order.
#pragma once

#include <cstdint>
#include <limits>

namespace dynhull {

struct Point {
  double x, y;
};

inline bool operator==(Point p, Point q) { return (p.x == q.x) & (p.y == q.y); }  // & on purpose: no branch

// The lexicographic order. The branch is foreseen, as few points of an input share their x.
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

// Makes points what trees hold: no zero is negative, so that equal points are the same; and sees whether all are
// finite.
class Plain {
 public:
  Point operator()(Point p) {
    const Point plain = {p.x + 0.0, p.y + 0.0};
    strange_.x += plain.x - plain.x;  // 0, or NaN where it is not finite
    strange_.y += plain.y - plain.y;
    return plain;
  }
  bool finite() const { return strange_ == Point{0, 0}; }

 private:
  Point strange_ = {0, 0};
};

// Both sides share all code: turned(side, orientation(a, b, p)) > 0 says that p lies outside the edge from a to b.
enum Side : int { UPPER = 0, LOWER = 1 };
constexpr Side SIDES[] = {UPPER, LOWER};
inline int turned(Side side, int sign) { return side == UPPER ? sign : -sign; }

}  // namespace dynhull
