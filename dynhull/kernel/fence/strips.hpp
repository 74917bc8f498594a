// The boundary of an area with its margin, in pieces, and boxes that certainly keep off it. Only these tests round, and
// always to the safe side: they choose what is decided exactly, and decide nothing themselves.
#pragma once

#include "area.hpp"

namespace dynhull {

// All points at most `margin` from an edge; or, if the radius is not negative, between a circle around a and a larger
// one. While a subject stays off it, its state does not change.
struct Strip {
  Edge edge;
  double margin, radius;
};

constexpr double STRIP_BOUND = 1e-14;  // relative, far above the rounding of a few operations
constexpr double STRIP_SLACK = 1e-280;

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
  const Point a = strip.edge.a;
  const Point center = {box.least.x / 2 + box.greatest.x / 2, box.least.y / 2 + box.greatest.y / 2};
  const double half_x = std::max(box.greatest.x - center.x, center.x - box.least.x);
  const double half_y = std::max(box.greatest.y - center.y, center.y - box.least.y);
  if (strip.radius >= 0) {
    const double farthest = std::hypot(std::abs(center.x - a.x) + half_x, std::abs(center.y - a.y) + half_y);
    const double nearest =
        std::hypot(std::max(std::abs(center.x - a.x) - half_x, 0.0), std::max(std::abs(center.y - a.y) - half_y, 0.0));
    const double error = STRIP_BOUND * (farthest + strip.radius + strip.margin) + STRIP_SLACK;
    return !(farthest + error < strip.radius) && !(nearest - error > strip.radius + strip.margin);
  }
  const double ux = strip.edge.b.x - a.x, uy = strip.edge.b.y - a.y;
  const double vx = center.x - a.x, vy = center.y - a.y;
  const double margin = strip.margin > 0 ? strip.margin * std::hypot(ux, uy) : 0;
  const double reach = std::abs(ux) * half_y + std::abs(uy) * half_x + margin;
  const double error = STRIP_BOUND * (std::abs(ux * vy) + std::abs(uy * vx) + reach) + STRIP_SLACK;
  return !(std::abs(ux * vy - uy * vx) - reach > error);
}

// A box with a strip strictly inside, rounded to floats.
struct Rim {
  float least_x, greatest_x, least_y, greatest_y;

  bool meets(const Box& box) const {
    return (least_x < box.greatest.x) & (box.least.x < greatest_x) & (least_y < box.greatest.y) &
           (box.least.y < greatest_y);
  }
};

constexpr float INFINITE_FLOAT = std::numeric_limits<float>::infinity();

inline float float_above(double value) {
  const float near = static_cast<float>(value);
  return near <= value ? std::nextafter(near, INFINITE_FLOAT) : near;
}
inline float float_below(double value) {
  const float near = static_cast<float>(value);
  return near >= value && value < INFINITE ? std::nextafter(near, -INFINITE_FLOAT) : near;
}

inline Rim rim_of(const Strip& strip) {
  const Box box = around(strip);
  return {float_below(box.least.x), float_above(box.greatest.x), float_below(box.least.y), float_above(box.greatest.y)};
}

// Rounded to floats, inwards. Empty unless it holds the subject's place.
struct SafeBox {
  float least_x, greatest_x, least_y, greatest_y;

  static SafeBox everywhere() {
    constexpr float INF = std::numeric_limits<float>::infinity();
    return {-INF, INF, -INF, INF};
  }
  bool holds(Point p) const { return (p.x >= least_x) & (p.x <= greatest_x) & (p.y >= least_y) & (p.y <= greatest_y); }

  // Stays where least <= p < greatest.
  void stay_in(const Box& box) {
    least_x = std::max(least_x, at_least(box.least.x));
    least_y = std::max(least_y, at_least(box.least.y));
    greatest_x = std::min(greatest_x, float_below(box.greatest.x));
    greatest_y = std::min(greatest_y, float_below(box.greatest.y));
  }

  // Cuts off what is in the rim of a strip. False if p is in it.
  bool keep_off(const Rim& rim, Point p) {
    if ((rim.least_x >= greatest_x) | (rim.greatest_x <= least_x) | (rim.least_y >= greatest_y) |
        (rim.greatest_y <= least_y))
      return true;
    const double beside_x = std::max(rim.least_x - p.x, p.x - rim.greatest_x);
    const double beside_y = std::max(rim.least_y - p.y, p.y - rim.greatest_y);
    if (std::max(beside_x, beside_y) < 0) return false;
    if (beside_x >= beside_y)
      p.x <= rim.least_x ? greatest_x = rim.least_x : least_x = rim.greatest_x;
    else
      p.y <= rim.least_y ? greatest_y = rim.least_y : least_y = rim.greatest_y;
    return true;
  }

  // Cuts off what is in the strip, so that p stays inside unless it is close to it.
  void keep_off(const Strip& strip, Point p) {
    const Box box = around(strip);
    if (box.least.x > greatest_x || box.greatest.x < least_x || box.least.y > greatest_y || box.greatest.y < least_y)
      return;
    const double beside_x = std::max(box.least.x - p.x, p.x - box.greatest.x);
    const double beside_y = std::max(box.least.y - p.y, p.y - box.greatest.y);
    const double beside = std::max(beside_x, beside_y), clear = clearance(strip, p);
    if (beside <= clear) {
      if (!(clear > 0)) {
        *this = {1, 0, 1, 0};
        return;
      }
      least_x = std::max(least_x, at_least(p.x - clear));
      greatest_x = std::min(greatest_x, at_most(p.x + clear));
      least_y = std::max(least_y, at_least(p.y - clear));
      greatest_y = std::min(greatest_y, at_most(p.y + clear));
    } else if (beside_x >= beside_y) {
      if (p.x < box.least.x)
        greatest_x = std::min(greatest_x, float_below(box.least.x));
      else
        least_x = std::max(least_x, float_above(box.greatest.x));
    } else {
      if (p.y < box.least.y)
        greatest_y = std::min(greatest_y, float_below(box.least.y));
      else
        least_y = std::max(least_y, float_above(box.greatest.y));
    }
  }

 private:
  static float at_least(double value) {
    const float near = static_cast<float>(value);
    return near < value ? std::nextafter(near, INFINITE_FLOAT) : near;
  }
  static float at_most(double value) {
    const float near = static_cast<float>(value);
    return near > value ? std::nextafter(near, -INFINITE_FLOAT) : near;
  }
  // Half the side of a square around p that is off the strip: a quarter of the distance, as a square reaches farther in
  // its corners and as coordinates are rounded. 0 if there is none for sure.
  static double clearance(const Strip& strip, Point p) {
    const Point a = strip.edge.a;
    double distance = 0, size = 0;
    if (strip.radius >= 0) {
      const double from_center = std::hypot(p.x - a.x, p.y - a.y);
      distance = from_center < strip.radius ? strip.radius - from_center : from_center - strip.radius - strip.margin;
      size = from_center + strip.radius + strip.margin;
    } else {
      const double ux = strip.edge.b.x - a.x, uy = strip.edge.b.y - a.y;
      const double left = ux * (p.y - a.y), right = uy * (p.x - a.x), length = std::sqrt(ux * ux + uy * uy);
      if (!(length > SMALLEST_LENGTH)) return 0;
      distance = std::abs(left - right) / length - strip.margin;
      size = (std::abs(left) + std::abs(right) + STRIP_SLACK) / length + strip.margin;
    }
    const double clear = (distance - STRIP_BOUND * size) / 4;
    return clear > 0 && clear < INFINITE ? clear : 0;
  }
  static constexpr double SMALLEST_LENGTH = 1e-140;  // its square does not underflow
};

}  // namespace dynhull
