// Boxes, and a tree of boxes around items that stay, such as the edges of a polygon: it finds those that are near a
// point or a line without a look at the others. What is tested here rounds, and always to the safe side.
#pragma once

#include <algorithm>
#include <vector>

#include "nearness.hpp"

namespace dynhull {

struct Box {
  Point least, greatest;

  static Box none() { return {HIGHEST, LOWEST}; }
  static Box of(Edge edge) {
    return {{std::min(edge.a.x, edge.b.x), std::min(edge.a.y, edge.b.y)},
            {std::max(edge.a.x, edge.b.x), std::max(edge.a.y, edge.b.y)}};
  }
  void add(Point p) {
    least = {std::min(least.x, p.x), std::min(least.y, p.y)};
    greatest = {std::max(greatest.x, p.x), std::max(greatest.y, p.y)};
  }
  void add(const Box& other) {
    add(other.least);
    add(other.greatest);
  }
  Point center() const { return {least.x / 2 + greatest.x / 2, least.y / 2 + greatest.y / 2}; }
  // From the centre to the farther side along each axis.
  Point half() const {
    const Point middle = center();
    return {std::max(greatest.x - middle.x, middle.x - least.x), std::max(greatest.y - middle.y, middle.y - least.y)};
  }
  bool holds(Point p) const { return (least.x <= p.x) & (p.x <= greatest.x) & (least.y <= p.y) & (p.y <= greatest.y); }
  bool meets(const Box& other) const {
    return (least.x <= other.greatest.x) & (other.least.x <= greatest.x) & (least.y <= other.greatest.y) &
           (other.least.y <= greatest.y);
  }
};

constexpr double STRIP_BOUND = 1e-14;  // relative, far above the rounding of a few operations
constexpr double STRIP_SLACK = 1e-280;

// False only if every point of a box is farther than `margin` from the line through an edge.
inline bool may_touch_line(Edge edge, double margin, const Box& box) {
  const Point center = box.center(), half = box.half();
  const double ux = edge.b.x - edge.a.x, uy = edge.b.y - edge.a.y;
  const double vx = center.x - edge.a.x, vy = center.y - edge.a.y;
  const double wide = margin > 0 ? margin * std::hypot(ux, uy) : 0;
  const double reach = std::abs(ux) * half.y + std::abs(uy) * half.x + wide;
  const double error = STRIP_BOUND * (std::abs(ux * vy) + std::abs(uy * vx) + reach) + STRIP_SLACK;
  return !(std::abs(ux * vy - uy * vx) - reach > error);
}

// At most the distance from a point to a box, but for the smallest doubles.
inline double least_distance(Point p, const Box& box) {
  const double x = std::max({box.least.x - p.x, p.x - box.greatest.x, 0.0});
  const double y = std::max({box.least.y - p.y, p.y - box.greatest.y, 0.0});
  return std::hypot(x, y) * (1 - NEARNESS_BOUND);
}

// Items are halved by the middles of their boxes, along the longer side of the box around them. A box is followed by
// those of its first half, then by those of the second one; leaves have a few items.
class BoxTree {
 public:
  BoxTree() = default;
  // `box_of` returns the box of an item; there is at least one. O(n log n).
  template <class BoxOf>
  BoxTree(std::vector<std::uint32_t> items, BoxOf box_of)
      : items_(std::move(items)), boxes_(2 * leaves_of(items_.size()) - 1) {
    lay({0, 0, items_.size()}, box_of);
  }

  bool empty() const { return items_.empty(); }
  std::size_t bytes() const { return items_.capacity() * sizeof(std::uint32_t) + boxes_.capacity() * sizeof(Box); }

  // Visits items until a visit returns true: those whose box meets something, as `meets` says of it and of boxes
  // around it, and perhaps others. Returns whether a visit did.
  template <class Meets, class Visit>
  bool any(Meets meets, Visit visit) const {
    return any({0, 0, items_.size()}, meets, visit);
  }

  // Visits items, and may leave out those that are farther than `most`, which a visit may lower. `least` says of a box
  // how near what is in it may be.
  template <class Least, class Visit>
  void visit_near(Least least, const double& most, Visit visit) const {
    visit_near({0, 0, items_.size()}, least(boxes_[0]), least, most, visit);
  }

 private:
  static constexpr std::size_t ITEMS_OF_A_LEAF = 16;

  static std::size_t leaves_of(std::size_t items) { return (items + ITEMS_OF_A_LEAF - 1) / ITEMS_OF_A_LEAF; }

  struct Part {
    std::size_t node, first, last;

    bool is_leaf() const { return last - first <= ITEMS_OF_A_LEAF; }
    Part first_half() const { return {node + 1, first, first + leaves_of(last - first) / 2 * ITEMS_OF_A_LEAF}; }
    Part second_half() const {
      const std::size_t leaves = leaves_of(last - first) / 2;
      return {node + 2 * leaves, first + leaves * ITEMS_OF_A_LEAF, last};
    }
  };

  template <class BoxOf>
  void lay(Part part, BoxOf& box_of) {
    Box box = Box::none();
    for (std::size_t i = part.first; i < part.last; ++i) box.add(box_of(items_[i]));
    boxes_[part.node] = box;
    if (part.is_leaf()) return;
    const bool wide = box.greatest.x - box.least.x > box.greatest.y - box.least.y;
    const auto middle = [&](std::uint32_t item) {
      const Point center = box_of(item).center();
      return wide ? center.x : center.y;
    };
    const auto begin = items_.begin();
    std::nth_element(begin + static_cast<std::ptrdiff_t>(part.first),
                     begin + static_cast<std::ptrdiff_t>(part.second_half().first),
                     begin + static_cast<std::ptrdiff_t>(part.last),
                     [&](std::uint32_t i, std::uint32_t j) { return middle(i) < middle(j); });
    lay(part.first_half(), box_of);
    lay(part.second_half(), box_of);
  }

  template <class Meets, class Visit>
  bool any(Part part, Meets& meets, Visit& visit) const {
    if (!meets(boxes_[part.node])) return false;
    if (!part.is_leaf()) return any(part.first_half(), meets, visit) || any(part.second_half(), meets, visit);
    return std::any_of(items_.begin() + static_cast<std::ptrdiff_t>(part.first),
                       items_.begin() + static_cast<std::ptrdiff_t>(part.last), visit);
  }

  template <class Least, class Visit>
  void visit_near(Part part, double nearest, Least& least, const double& most, Visit& visit) const {
    if (nearest > most) return;
    if (part.is_leaf()) {
      for (std::size_t i = part.first; i < part.last; ++i) visit(items_[i]);
      return;
    }
    Part near = part.first_half(), far = part.second_half();
    double to_near = least(boxes_[near.node]), to_far = least(boxes_[far.node]);
    if (to_far < to_near) {
      std::swap(near, far);
      std::swap(to_near, to_far);
    }
    visit_near(near, to_near, least, most, visit);
    visit_near(far, to_far, least, most, visit);
  }

  std::vector<std::uint32_t> items_;
  std::vector<Box> boxes_;
};

}  // namespace dynhull
