// The area of a fence: polygons with holes, a convex polygon, a segment or a point, or a disk. Where a point is and
// whether a segment meets the area, exactly. The reference in Python is dynhull/_areas.py.
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <memory>
#include <numeric>
#include <span>
#include <vector>

#include "../globe/metres.hpp"

namespace dynhull {

// Rings of one polygon, each closed by its first corner, with the inside on the left.
class Polygon {
 public:
  Polygon() = default;
  explicit Polygon(std::span<const std::vector<Point>> rings) {
    for (const std::vector<Point>& ring : rings) {
      starts_.push_back(static_cast<std::uint32_t>(corners_.size()));
      corners_.insert(corners_.end(), ring.begin(), ring.end());
      corners_.push_back(ring.front());
    }
    starts_.push_back(static_cast<std::uint32_t>(corners_.size()));
    for (Point p : corners_) box_.add(p);
    if (few()) return;
    lay_slabs();
    std::vector<std::uint32_t> edges;
    edges.reserve(corners_.size() - rings.size());
    any_edge([](const Box&) { return true; },
             [&](std::uint32_t i) {
               edges.push_back(i);
               return false;
             });
    tree_ = BoxTree(std::move(edges), [&](std::uint32_t i) { return Box::of(edge(i)); });
  }

  const Box& box() const { return box_; }
  std::size_t corners() const { return corners_.size(); }
  std::size_t bytes() const {
    return sizeof *this + corners_.capacity() * sizeof(Point) +
           (starts_.capacity() + slabs_.capacity() + in_slabs_.capacity()) * sizeof(std::uint32_t) + tree_.bytes();
  }
  bool operator==(const Polygon& other) const { return corners_ == other.corners_ && starts_ == other.starts_; }

  // Visits the edges.
  template <class Visit>
  void for_each_edge(Visit visit) const {
    for (std::size_t ring = 0; ring + 1 < starts_.size(); ++ring)
      for (std::uint32_t i = starts_[ring]; i + 1 < starts_[ring + 1]; ++i) visit(edge(i));
  }
  // Visits edges until a visit returns true; may leave out those whose box does not meet something: see `BoxTree`.
  template <class Meets, class Visit>
  bool any_edge_meeting(Meets meets, Visit visit) const {
    return any_edge(meets, [&](std::uint32_t i) { return visit(edge(i)); });
  }
  // Visits edges, and may leave out those that are farther than `most`: see `BoxTree`.
  template <class Least, class Visit>
  void visit_near(Least least, const double& most, Visit visit) const {
    if (few()) return for_each_edge(visit);
    tree_.visit_near(least, most, [&](std::uint32_t i) { visit(edge(i)); });
  }

  // +1 inside, 0 on a ring, -1 outside: by the number of edges to the right of p.
  int where(Point p) const {
    if (!box_.holds(p)) return -1;
    bool inside = false;
    if (slabs_.empty()) {
      for (std::size_t ring = 0; ring + 1 < starts_.size(); ++ring)
        for (std::uint32_t i = starts_[ring]; i + 1 < starts_[ring + 1]; ++i)
          if (!passes(corners_[i], corners_[i + 1], p, inside)) return 0;
    } else {
      const auto turned = [&](Point q) { return upright_ ? Point{q.y, q.x} : q; };
      const std::size_t slab = slab_of(along(p));
      for (std::uint32_t k = slabs_[slab]; k < slabs_[slab + 1]; ++k)
        if (!passes(turned(corners_[in_slabs_[k]]), turned(corners_[in_slabs_[k] + 1]), turned(p), inside)) return 0;
    }
    return inside ? 1 : -1;
  }

  // Whether a part of the segment from p to q is inside, where neither p nor q is.
  bool lets_in(Point p, Point q) const {
    const Box way = Box::of({p, q});
    if (!way.meets(box_)) return false;
    const auto enters = [&](Point at) {  // whether the segment is inside just before or after a point of a ring
      return (!(at == q) && points_inside(at, q)) || (!(at == p) && points_inside(at, p));
    };
    const auto meets = [&](const Box& box) { return way.meets(box) && may_touch_line({p, q}, 0, box); };
    return any_edge_meeting(meets, [&](Edge edge) {
      if (!way.meets(Box::of(edge))) return false;
      const int at_a = orientation(p, q, edge.a), at_b = orientation(p, q, edge.b);
      const int at_p = orientation(edge.a, edge.b, p), at_q = orientation(edge.a, edge.b, q);
      if (at_a * at_b > 0 || at_p * at_q > 0) return false;
      if (at_a * at_b < 0 && at_p * at_q < 0) return !touched_where_crossed(p, q, edge);
      return (at_a == 0 && way.holds(edge.a) && enters(edge.a)) || (at_p == 0 && Box::of(edge).holds(p) && enters(p)) ||
             (at_q == 0 && Box::of(edge).holds(q) && enters(q));
    });
  }

 private:
  static constexpr std::size_t FEW_CORNERS = 24, CORNERS_OF_A_SLAB = 4, ENTRIES_OF_A_CORNER = 8;
  bool few() const { return corners_.size() <= FEW_CORNERS; }  // asked of what is read anyway, not of the tree

  // Flips `inside` if the edge crosses the ray from p to the right. False if p is on the edge.
  static bool passes(Point a, Point b, Point p, bool& inside) {
    const bool above_a = a.y > p.y, above_b = b.y > p.y;
    if (above_a == above_b && !(a.y == p.y || b.y == p.y)) return true;
    if (a.x < p.x && b.x < p.x) return true;
    const int turn = orientation(a, b, p);
    if (turn == 0 && Box::of({a, b}).holds(p)) return false;
    inside ^= above_a != above_b && (turn > 0) == (b.y > a.y);
    return true;
  }

  // Slabs along the axis along which fewer edges are long, and so few that the lists of edges stay short.
  void lay_slabs() {
    const auto cut = [&](bool upright, std::size_t slabs) {
      upright_ = upright;
      count_ = slabs;
      scale_ = static_cast<double>(slabs) / (along(box_.greatest) - along(box_.least));
      if (!(scale_ > 0 && scale_ < INFINITE)) return std::numeric_limits<std::size_t>::max();
      std::size_t entries = 0;
      for_each_slabs([&](std::size_t first, std::size_t last, std::uint32_t) { entries += last - first + 1; });
      return entries;
    };
    std::size_t slabs = corners_.size() / CORNERS_OF_A_SLAB;
    const bool upright = cut(true, slabs) < cut(false, slabs);
    while (slabs > 1 && cut(upright, slabs) > ENTRIES_OF_A_CORNER * corners_.size()) slabs /= 2;
    const std::size_t entries = cut(upright, slabs);
    if (entries == std::numeric_limits<std::size_t>::max()) return;
    std::vector<std::uint32_t> ends(slabs + 1, 0);
    for_each_slabs([&](std::size_t first, std::size_t last, std::uint32_t) {
      for (std::size_t slab = first; slab <= last; ++slab) ++ends[slab + 1];
    });
    for (std::size_t slab = 0; slab < slabs; ++slab) ends[slab + 1] += ends[slab];
    slabs_ = ends;
    in_slabs_.resize(entries);
    for_each_slabs([&](std::size_t first, std::size_t last, std::uint32_t i) {
      for (std::size_t slab = first; slab <= last; ++slab) in_slabs_[ends[slab]++] = i;
    });
  }
  // Visits the first and the last slab of each edge, and the number of the edge.
  template <class Visit>
  void for_each_slabs(Visit visit) const {
    for (std::size_t ring = 0; ring + 1 < starts_.size(); ++ring)
      for (std::uint32_t i = starts_[ring]; i + 1 < starts_[ring + 1]; ++i) {
        const double at = along(corners_[i]), next = along(corners_[i + 1]);
        visit(slab_of(std::min(at, next)), slab_of(std::max(at, next)), i);
      }
  }
  double along(Point p) const { return upright_ ? p.x : p.y; }
  // Rounding is monotone: an edge is in the slabs of all heights between its ends.
  std::size_t slab_of(double coordinate) const {
    const auto slab = static_cast<std::size_t>((coordinate - along(box_.least)) * scale_);
    return std::min(slab, count_ - 1);
  }

  // Whether the way from a point of rings to another one starts inside: on the inner side of every ring there.
  bool points_inside(Point at, Point to) const {
    const auto misses = [&](std::uint32_t i) {
      const Point a = corners_[i], b = corners_[i + 1];
      if (b == at) return !opens_to(a, b, corner_after(i + 1), to);
      return !(a == at) && Box::of({a, b}).holds(at) && orientation(a, b, at) == 0 && orientation(a, b, to) <= 0;
    };
    return !any_edge([&](const Box& box) { return box.holds(at); }, misses);
  }
  // The corner that follows one that is not the first of its ring.
  Point corner_after(std::uint32_t i) const {
    const auto next = std::upper_bound(starts_.begin(), starts_.end(), i);
    return i + 1 == *next ? corners_[next[-1] + 1] : corners_[i + 1];
  }
  // Whether a point is in the open angle on the left of the corner b between a and c.
  static bool opens_to(Point a, Point b, Point c, Point to) {
    const bool left_before = orientation(a, b, to) > 0, left_after = orientation(b, c, to) > 0;
    if (orientation(a, b, c) > 0) return left_before && left_after;
    return left_before || left_after;
  }

  // Whether a corner is on both segments, which cross: the inside need not be beside the edge there.
  bool touched_where_crossed(Point p, Point q, Edge edge) const {
    const Box box = Box::of(edge);
    return any_edge_meeting([&](const Box& other) { return box.meets(other); },
                            [&](Edge other) {
                              return box.holds(other.a) && orientation(edge.a, edge.b, other.a) == 0 &&
                                     orientation(p, q, other.a) == 0;
                            });
  }

  Edge edge(std::uint32_t i) const { return {corners_[i], corners_[i + 1]}; }
  // As `any_edge_meeting`, by the number of the first corner.
  template <class Meets, class Visit>
  bool any_edge(Meets meets, Visit visit) const {
    if (!few() && !tree_.empty()) return tree_.any(meets, visit);
    for (std::size_t ring = 0; ring + 1 < starts_.size(); ++ring)
      for (std::uint32_t i = starts_[ring]; i + 1 < starts_[ring + 1]; ++i)
        if (visit(i)) return true;
    return false;
  }

  std::vector<Point> corners_;
  std::vector<std::uint32_t> starts_;  // of rings, and the end
  Box box_ = Box::none();
  bool upright_ = false;  // of the slabs
  std::size_t count_ = 0;
  double scale_ = 0;
  std::vector<std::uint32_t> slabs_, in_slabs_;  // the first of each slab in the list of edges, and the list
  BoxTree tree_;  // of the edges, by the numbers of their first corners, if these are not few
};

// Counter-clockwise from the least vertex, three or more.
inline int where_in_convex(std::span<const Point> vertices, std::size_t greatest, Point p) {
  const Point first = vertices[0], last = vertices[greatest];
  if (p < first || p > last) return -1;
  if (p == first || p == last) return 0;
  const auto after =
      std::upper_bound(vertices.begin(), vertices.begin() + static_cast<std::ptrdiff_t>(greatest) + 1, p);
  const int above_lower = orientation(after[-1], after[0], p);
  if (above_lower < 0) return -1;
  const auto beyond = std::upper_bound(vertices.begin() + static_cast<std::ptrdiff_t>(greatest), vertices.end(), p,
                                       [](Point q, Point vertex) { return !(q < vertex); });
  const Point next = beyond == vertices.end() ? first : *beyond;
  return std::min(above_lower, orientation(beyond[-1], next, p));
}

struct Area {
  enum class Kind { POLYGONS, SEGMENT, DISK };

  Kind kind = Kind::POLYGONS;
  bool closed = true;
  double margin = 0;
  std::vector<Polygon> polygons = {};  // joined by "or"; none: the empty area
  std::vector<Point> convex = {};      // the vertices, if there is one polygon and it is a hull
  std::size_t greatest = 0;            // the number of the greatest of them
  Edge segment = {};
  Point center = {};
  double radius = 0;
  std::shared_ptr<const Metres> metres = {};  // in which distances are; none: units of the plane
  BoxTree tree = {};  // of the polygons, if they are not few; last, because areas of one are read without it

  static Area of_polygons(std::vector<Polygon> polygons, bool closed, double margin) {
    Area area{.closed = closed, .margin = margin};
    area.polygons = std::move(polygons);
    if (area.polygons.size() > FEW_POLYGONS) {
      std::vector<std::uint32_t> numbers(area.polygons.size());
      std::iota(numbers.begin(), numbers.end(), 0);
      area.tree = BoxTree(std::move(numbers), [&](std::uint32_t i) { return area.polygons[i].box(); });
    }
    return area;
  }
  static Area of_disk(Point center, double radius, bool closed, double margin) {
    Area area{.closed = closed, .margin = margin};
    if (!closed && radius == 0) return area;
    area.kind = Kind::DISK;
    area.center = center;
    area.radius = radius;
    return area;
  }
  static Area of_hull(std::vector<Point> vertices, bool closed, double margin) {
    Area area{.closed = closed, .margin = margin};
    if (vertices.size() > 2) {
      area.polygons.emplace_back(std::span(&vertices, 1));
      area.greatest = static_cast<std::size_t>(std::max_element(vertices.begin(), vertices.end()) - vertices.begin());
      area.convex = std::move(vertices);
    } else if (!vertices.empty() && closed) {
      area.kind = Kind::SEGMENT;
      area.segment = {vertices.front(), vertices.back()};
    }
    return area;
  }

  // Whether both are described in the same way.
  bool operator==(const Area& other) const {
    return kind == other.kind && closed == other.closed && margin == other.margin && polygons == other.polygons &&
           segment.a == other.segment.a && segment.b == other.segment.b && center == other.center &&
           radius == other.radius;
  }

  // +1 inside, 0 on the boundary, -1 outside.
  int where(Point p) const {
    if (kind == Kind::DISK) return -compare_distance(p, center, radius, 0);
    if (kind == Kind::SEGMENT) return Box::of(segment).holds(p) && orientation(segment.a, segment.b, p) == 0 ? 0 : -1;
    if (!convex.empty()) return where_in_convex(convex, greatest, p);
    int where = -1;
    any_polygon([&](const Box& box) { return box.holds(p); },
                [&](const Polygon& polygon) {
                  where = std::max(where, polygon.where(p));
                  return where > 0;
                });
    return where;
  }
  bool holds(Point p) const { return where(p) >= (closed ? 0 : 1); }

  template <class Visit>
  void for_each_edge(Visit visit) const {
    if (kind == Kind::SEGMENT) visit(segment);
    for (const Polygon& polygon : polygons) polygon.for_each_edge(visit);
  }

  std::size_t corners() const {
    std::size_t corners = 0;
    for (const Polygon& polygon : polygons) corners += polygon.corners();
    return corners;
  }
  std::size_t bytes() const {
    std::size_t bytes = sizeof *this + convex.capacity() * sizeof(Point) + tree.bytes();
    for (const Polygon& polygon : polygons) bytes += polygon.bytes();
    return bytes;
  }

  // The distance from p, rounded once: 0 inside and on the boundary, infinite if the area is empty.
  double distance(Point p) const { return where(p) >= 0 ? 0 : distance_to_boundary(p); }
  // The same for a p that is not inside.
  double distance_to_boundary(Point p) const {
    if (kind == Kind::DISK) return where(p) >= 0 ? 0 : distance_to_circle(p, center, radius);
    const auto by = [&](auto least) {
      return [this, least](const double& most, auto visit) {
        if (kind == Kind::SEGMENT) visit(segment);
        visit_near(least, most, [&](const Polygon& polygon) { polygon.visit_near(least, most, visit); });
      };
    };
    if (metres) return metres_to_nearest(*metres, p, by([p](const Box& box) { return Metres::least(p, box); }));
    return distance_to_nearest(p, by([p](const Box& box) { return least_distance(p, box); }));
  }
  // Whether the distance from p to an edge is at most the margin.
  bool is_near(Point p, Edge edge) const { return is_near(p, edge, margin); }
  // Whether it is at most r + s; of metres, at most the rounded sum.
  bool is_near(Point p, Edge edge, double r, double s = 0) const {
    if (!metres) return compare_distance(p, nearest_part(p, edge), r, s) <= 0;
    return Metres::least(p, Box::of(edge)) <= r + s && metres->to_edge(p, edge) <= r + s;
  }
  // At least how far from an edge, in the plane, points are that are near it.
  double reach(Edge edge) const { return metres && margin > 0 ? Metres::reach(edge, margin) : margin; }

  // Whether p is farther than `error` from the boundary: inside of one of the polygons by more than it, or outside by
  // more than the margin and it. True without an error.
  bool is_clear(Point p, double error) const {
    if (error == 0) return true;
    const int at = where(p);
    if (at == 0) return false;
    if (kind == Kind::DISK) {
      if (at < 0) return compare_distance(p, center, radius, margin, error) > 0;
      return error < radius && compare_distance(p, center, radius, -error) < 0;
    }
    if (kind == Kind::SEGMENT) return !is_near(p, segment, margin, error);
    const double more = at > 0 ? 0 : margin;  // rounding is monotone: what is beyond the rounded sum is beyond the sum
    const auto near = [&](const Box& box) {
      if (metres) return Metres::least(p, box) <= more + error;
      return std::max({box.least.x - p.x, p.x - box.greatest.x, box.least.y - p.y, p.y - box.greatest.y}) <=
             error + more;
    };
    const auto is_near_ring = [&](const Polygon& polygon) {
      return polygon.any_edge_meeting(near,
                                      [&](Edge edge) { return near(Box::of(edge)) && is_near(p, edge, more, error); });
    };
    if (at < 0) return !any_polygon(near, is_near_ring);
    return any_polygon([&](const Box& box) { return box.holds(p); },
                       [&](const Polygon& polygon) { return polygon.where(p) > 0 && !is_near_ring(polygon); });
  }

  // Whether the segment from p to q, which differ, has a point of the area.
  bool meets(Point p, Point q) const {
    if (kind == Kind::DISK) {
      const int more = compare_distance(center, nearest_part(center, {p, q}), radius);
      return closed ? more <= 0 : more < 0;
    }
    if (holds(p) || holds(q)) return true;
    if (kind == Kind::SEGMENT) return segments_meet({p, q}, segment);
    const Box way = Box::of({p, q});
    const auto near = [&](const Box& box) { return way.meets(box) && may_touch_line({p, q}, 0, box); };
    return any_polygon(near, [&](const Polygon& polygon) {
      if (!closed) return polygon.lets_in(p, q);
      return polygon.any_edge_meeting(near, [&](Edge edge) { return segments_meet({p, q}, edge); });
    });
  }

 private:
  static constexpr std::size_t FEW_POLYGONS = 16;
  bool few() const { return polygons.size() <= FEW_POLYGONS; }

  // See `BoxTree`.
  template <class Meets, class Visit>
  bool any_polygon(Meets meets, Visit visit) const {
    if (few()) return std::any_of(polygons.begin(), polygons.end(), visit);
    return tree.any(meets, [&](std::uint32_t i) { return visit(polygons[i]); });
  }
  template <class Least, class Visit>
  void visit_near(Least least, const double& most, Visit visit) const {
    if (few())
      for (const Polygon& polygon : polygons) visit(polygon);
    else
      tree.visit_near(least, most, [&](std::uint32_t i) { visit(polygons[i]); });
  }

  static bool segments_meet(Edge s, Edge t) {
    if (!Box::of(s).meets(Box::of(t))) return false;
    if (t.a == t.b) return orientation(s.a, s.b, t.a) == 0;
    return orientation(s.a, s.b, t.a) * orientation(s.a, s.b, t.b) <= 0 &&
           orientation(t.a, t.b, s.a) * orientation(t.a, t.b, s.b) <= 0;
  }
};

}  // namespace dynhull
