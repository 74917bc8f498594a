// A box around a subject that certainly keeps off all boundaries: while the subject stays in it, nothing is to be
// decided.
#pragma once

#include <bit>

#include "strips.hpp"

namespace dynhull {

constexpr float INFINITE_FLOAT = std::numeric_limits<float>::infinity();

// The next float beyond one that is not infinite, if `moves`. Without a branch, which nothing could predict.
inline float next_above(float value, bool moves = true) {
  const auto bits = std::bit_cast<std::int32_t>(value + 0.0f);  // of zeros, the positive one
  return std::bit_cast<float>(bits + (bits < 0 ? -std::int32_t{moves} : std::int32_t{moves}));
}

// The next float beyond, so that what is rounded on the way to `value` is made good.
inline float float_above(double value) {
  const float near = static_cast<float>(value);
  return next_above(near, (near <= value) & (near < INFINITE_FLOAT));
}
inline float float_below(double value) { return -float_above(-value); }

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

 private:
  static float at_least(double value) {
    const float near = static_cast<float>(value);
    return next_above(near, near < value);
  }
};

// The room around a place towards each side, while the box of a subject is made smaller. Distances are rounded, and so
// little too short that what is added up to a side and rounded to a float is good.
class Clearance {
 public:
  Clearance(const SafeBox& box, Point p)
      : box_(box),
        p_(p),
        right_(box.greatest_x - p.x),
        left_(p.x - box.least_x),
        up_(box.greatest_y - p.y),
        down_(p.y - box.least_y),
        is_close_(!box.holds(p)) {}

  // Cuts off what is in the strip, so that p stays inside unless it is close to it: beside the strip at one side, or
  // obliquely at a corner, where that leaves more room around p.
  void keep_off(const Strip& strip) {
    if (strip.radius < 0) return keep_off(strip.edge, around(strip), strip.margin);
    const Beside beside(around(strip), p_);
    if (is_out(beside)) return;
    settle(beside, cut_circle(strip, beside.most()));
  }
  // The same for an edge with a margin, given the box around that.
  void keep_off(const Edge& edge, const Box& box, double margin = 0) {
    const Beside beside(box, p_);
    if (is_out(beside)) return;
    settle(beside, cut_line(edge, margin, beside.most()));
  }

  SafeBox box() const {
    if (is_close_) return SafeBox::nowhere();
    const float right = float_below(p_.x + right_), left = float_above(p_.x - left_);
    const float up = float_below(p_.y + up_), down = float_above(p_.y - down_);
    const SafeBox box = {
        left_ < p_.x - box_.least_x ? left : box_.least_x, right_ < box_.greatest_x - p_.x ? right : box_.greatest_x,
        down_ < p_.y - box_.least_y ? down : box_.least_y, up_ < box_.greatest_y - p_.y ? up : box_.greatest_y};
    return box.holds(p_) ? box : SafeBox::nowhere();
  }

 private:
  // How far a box is beyond p to each side; negative where it is not.
  struct Beside {
    double right, left, up, down;

    Beside(const Box& box, Point p)
        : right(box.least.x - p.x), left(p.x - box.greatest.x), up(box.least.y - p.y), down(p.y - box.greatest.y) {}
    double along_x() const { return std::max(right, left); }
    double along_y() const { return std::max(up, down); }
    double most() const { return std::max(along_x(), along_y()); }
  };

  bool is_out(const Beside& beside) const {
    return (beside.right > right_) | (beside.left > left_) | (beside.up > up_) | (beside.down > down_);
  }

  // Keeps beside the strip if nothing better was found.
  void settle(const Beside& beside, bool cut) {
    if (cut) return;
    const double most = beside.most();
    is_close_ |= !(most > 0 && most < INFINITE);
    double& side = beside.along_x() >= beside.along_y() ? (beside.right > beside.left ? right_ : left_)
                                                        : (beside.up > beside.down ? up_ : down_);
    side = std::min(side, most * (1 - STRIP_BOUND));
  }

  bool cut_line(const Edge& edge, double margin, double beside) {
    const double ux = edge.b.x - edge.a.x, uy = edge.b.y - edge.a.y;
    const double left = ux * (p_.y - edge.a.y), right = uy * (p_.x - edge.a.x);
    double reach = std::abs(left - right) - STRIP_BOUND * (std::abs(left) + std::abs(right)) - STRIP_SLACK;
    if (margin > 0) reach -= margin * std::hypot(ux, uy) * (1 + STRIP_BOUND);
    const double sign = left > right ? 1 : -1;
    return cut_corner(sign * uy, -sign * ux, reach, beside);
  }

  bool cut_circle(const Strip& strip, double beside) {
    const double dx = strip.edge.a.x - p_.x, dy = strip.edge.a.y - p_.y, from_center = std::hypot(dx, dy);
    const double error = STRIP_BOUND * (from_center + strip.radius + strip.margin) + STRIP_SLACK;
    if (from_center > strip.radius)
      return cut_corner(dx / from_center, dy / from_center, from_center - strip.radius - strip.margin - error, beside);
    const double room = strip.radius - from_center - error;
    return cut_corner(1, 1, room, beside) && cut_corner(1, -1, room, beside) && cut_corner(-1, 1, room, beside) &&
           cut_corner(-1, -1, room, beside);
  }

  // Keeps p + v where direction * v < reach, by two sides, unless beside a strip there is more room. False if that is
  // so or p is too close.
  bool cut_corner(double direction_x, double direction_y, double reach, double beside) {
    const double x = std::abs(direction_x), y = std::abs(direction_y);
    reach *= 1 - STRIP_BOUND;
    if (!(reach > 0 && reach < INFINITE)) return false;
    double& side_x = direction_x > 0 ? right_ : left_;
    double& side_y = direction_y > 0 ? up_ : down_;
    const double room_x = side_x, room_y = side_y;
    if (x * room_x + y * room_y < reach) return true;
    const double half = reach / (x + y);
    double least = half, cut_x = half, cut_y = half;
    if (room_x < half)
      least = cut_y = (reach - x * room_x) / y;
    else if (room_y < half)
      least = cut_x = (reach - y * room_y) / x;
    if (beside >= least) return false;
    if (x > 0) side_x = std::min(room_x, cut_x);
    if (y > 0) side_y = std::min(room_y, cut_y);
    return true;
  }

  SafeBox box_;
  Point p_;
  double right_, left_, up_, down_;
  bool is_close_;
};

}  // namespace dynhull
