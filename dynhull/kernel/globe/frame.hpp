// Where points are: in the plane, or on the globe, where the gnomonic projection takes them to the plane.
#pragma once

#include "gnomonic.hpp"

namespace dynhull {

class Frame {
 public:
  Frame() = default;  // the plane
  static Frame globe(const std::optional<Gnomonic>& projection) {
    Frame frame;
    frame.globe_ = true;
    frame.projection_ = projection;
    return frame;
  }

  bool on_globe() const { return globe_; }
  const std::optional<Gnomonic>& projection() const { return projection_; }  // none until points choose its centre

  void set_projection(const std::optional<Gnomonic>& projection) { projection_ = projection; }

  // Whether a finite point can be in the frame at all.
  bool has(Point p) const { return !globe_ || ((std::abs(p.x) <= 360) & (std::abs(p.y) <= 90)); }

  // The place of a point in the plane; nothing if it has none.
  std::optional<Point> operator()(Point p) const {
    if (!globe_) return p;
    return projection_ ? (*projection_)(p) : std::nullopt;
  }

 private:
  bool globe_ = false;
  std::optional<Gnomonic> projection_;
};

}  // namespace dynhull
