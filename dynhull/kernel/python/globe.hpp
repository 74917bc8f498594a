// Hulls on the globe as Python objects.
#pragma once

#include <utility>

#include "window.hpp"

namespace dynhull {

using BoolArray = Output<bool>::Array;

inline std::pair<PointArray, BoolArray> gnomonic(const Rows& lonlat, const nb::object& parameters) {
  const Gnomonic project = gnomonic_of(parameters);
  const std::size_t count = lonlat.shape(0);
  const Output<double, 2> places(count);
  const Output<bool> near(count);
  {
    std::optional<nb::gil_scoped_release> release;
    if (count > FEW_ROWS) release.emplace();
    constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
    auto* const rows = reinterpret_cast<Point*>(places.data());
    project(points_of(lonlat), count, rows, near.data());
    for (std::size_t i = 0; i < count; ++i)
      if (!near.data()[i]) rows[i] = {NOWHERE, NOWHERE};
  }
  return {places.array(), near.array()};
}

inline Frame globe_of(const nb::object& center) {
  if (center.is_none()) return Frame::globe({});
  return Frame::globe(gnomonic_of(globe_module("parameters")(center)));
}

// A hull, entities or a window on the globe.
template <class Base>
class OnGlobe : public Base {
 public:
  template <class... Settings>
  explicit OnGlobe(const nb::object& center, Settings... settings) : Base(settings..., globe_of(center)) {}

  std::optional<std::pair<double, double>> center() { return Base::center(); }

  void recenter(const nb::object& center) {
    const Gnomonic projection = gnomonic_of(globe_module("parameters")(center));
    const bool done = [&] {
      const WriteLock lock(this->lock_);
      try {
        this->tree_.recenter(projection);
      } catch (const NotFinite&) {
        return false;
      }
      if constexpr (std::is_same_v<Base, KeyedHull>) this->forget_names();
      return true;
    }();
    if (done) return;
    globe_module("require_near")(this->points(), center);
    throw nb::value_error("another thread has changed the points");
  }

  OnGlobe* copy() {
    const ReadLock lock(this->lock_);
    return new OnGlobe(*this);
  }

 private:
  OnGlobe(const OnGlobe& other) = default;
};

}  // namespace dynhull
