// A box around a subject that certainly keeps off all boundaries: while the subject stays in it, nothing is to be
// decided.
#pragma once

#include "strips.hpp"

namespace dynhull {

constexpr float INFINITE_FLOAT = std::numeric_limits<float>::infinity();

// The next float beyond, so that what is rounded on the way to `value` is made good.
inline float float_above(double value) {
  const float near = static_cast<float>(value);
  return near <= value ? std::nextafter(near, INFINITE_FLOAT) : near;
}
inline float float_below(double value) {
  const float near = static_cast<float>(value);
  return near >= value ? std::nextafter(near, -INFINITE_FLOAT) : near;
}

// Rounded to floats, inwards. Empty unless it holds the subject's place: otherwise a boundary may be in between.
struct SafeBox {
  float least_x, greatest_x, least_y, greatest_y;

  static SafeBox nowhere() { return {1, 0, 1, 0}; }
  static SafeBox everywhere() { return {-INFINITE_FLOAT, INFINITE_FLOAT, -INFINITE_FLOAT, INFINITE_FLOAT}; }
  bool holds(Point p) const { return (p.x >= least_x) & (p.x <= greatest_x) & (p.y >= least_y) & (p.y <= greatest_y); }

  // Stays where least <= p < greatest.
  void stay_in(const Box& box, Point p) {
    if (box.least.x > least_x) least_x = at_least(box.least.x);
    if (box.least.y > least_y) least_y = at_least(box.least.y);
    if (box.greatest.x <= greatest_x && box.greatest.x < INFINITE) greatest_x = float_below(box.greatest.x);
    if (box.greatest.y <= greatest_y && box.greatest.y < INFINITE) greatest_y = float_below(box.greatest.y);
    if (!holds(p)) *this = nowhere();
  }

  // Cuts off what is in the strip, so that p stays inside unless it is close to it: beside the strip at one side, or
  // obliquely at a corner, where that leaves more room around p.
  void keep_off(const Strip& strip, Point p) {
    const Box box = around(strip);
    if ((box.least.x > greatest_x) | (box.greatest.x < least_x) | (box.least.y > greatest_y) |
        (box.greatest.y < least_y))
      return;
    const double beside_x = std::max(box.least.x - p.x, p.x - box.greatest.x);
    const double beside_y = std::max(box.least.y - p.y, p.y - box.greatest.y);
    const double beside = std::max(beside_x, beside_y);
    const bool cut = strip.radius >= 0 ? keep_off_circle(strip, p, beside) : keep_off_line(strip, p, beside);
    if (!cut && beside > 0) keep_beside(box, p, beside_x >= beside_y);
    if (!(cut || beside > 0) || !holds(p)) *this = nowhere();
  }

 private:
  static float at_least(double value) {
    const float near = static_cast<float>(value);
    return near < value ? std::nextafter(near, INFINITE_FLOAT) : near;
  }

  void keep_beside(const Box& box, Point p, bool along_x) {
    if (along_x && p.x < box.least.x)
      greatest_x = std::min(greatest_x, float_below(box.least.x));
    else if (along_x)
      least_x = std::max(least_x, float_above(box.greatest.x));
    else if (p.y < box.least.y)
      greatest_y = std::min(greatest_y, float_below(box.least.y));
    else
      least_y = std::max(least_y, float_above(box.greatest.y));
  }

  bool keep_off_line(const Strip& strip, Point p, double beside) {
    const Point a = strip.edge.a;
    const double ux = strip.edge.b.x - a.x, uy = strip.edge.b.y - a.y;
    const double left = ux * (p.y - a.y), right = uy * (p.x - a.x);
    const double size = std::abs(left) + std::abs(right);
    double reach = std::abs(left - right) - STRIP_BOUND * size - STRIP_SLACK;
    if (strip.margin > 0) reach -= strip.margin * std::hypot(ux, uy) * (1 + STRIP_BOUND);
    return left > right ? cut_corner(p, uy, -ux, reach, beside) : cut_corner(p, -uy, ux, reach, beside);
  }

  bool keep_off_circle(const Strip& strip, Point p, double beside) {
    const double dx = strip.edge.a.x - p.x, dy = strip.edge.a.y - p.y, from_center = std::hypot(dx, dy);
    const double error = STRIP_BOUND * (from_center + strip.radius + strip.margin) + STRIP_SLACK;
    if (from_center > strip.radius)
      return cut_corner(p, dx / from_center, dy / from_center, from_center - strip.radius - strip.margin - error,
                        beside);
    const double room = strip.radius - from_center - error;
    return cut_corner(p, 1, 1, room, beside) && cut_corner(p, 1, -1, room, beside) &&
           cut_corner(p, -1, 1, room, beside) && cut_corner(p, -1, -1, room, beside);
  }

  // Keeps p + v where direction * v < reach, by two sides, unless beside a strip there is more room. False if that is
  // so or p is too close.
  bool cut_corner(Point p, double direction_x, double direction_y, double reach, double beside) {
    const double x = std::abs(direction_x), y = std::abs(direction_y);
    reach *= 1 - STRIP_BOUND;
    if (!(reach > 0 && reach < INFINITE)) return false;
    const double room_x = direction_x > 0 ? greatest_x - p.x : p.x - least_x;
    const double room_y = direction_y > 0 ? greatest_y - p.y : p.y - least_y;
    if (x * room_x + y * room_y < reach) return true;
    const double half = reach / (x + y);
    double least = half, cut_x = half, cut_y = half;
    if (room_x < half)
      least = cut_y = (reach - x * room_x) / y;
    else if (room_y < half)
      least = cut_x = (reach - y * room_y) / x;
    if (beside >= least) return false;
    if (x > 0) {
      if (direction_x > 0)
        greatest_x = std::min(greatest_x, float_below(p.x + cut_x));
      else
        least_x = std::max(least_x, float_above(p.x - cut_x));
    }
    if (y > 0) {
      if (direction_y > 0)
        greatest_y = std::min(greatest_y, float_below(p.y + cut_y));
      else
        least_y = std::max(least_y, float_above(p.y - cut_y));
    }
    return true;
  }
};

}  // namespace dynhull
