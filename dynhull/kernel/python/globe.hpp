// What hulls on the globe need of the kernel, for Python: projections, and the numbers that were given. The GIL, held
// throughout, makes each call one step.
#pragma once

#include <utility>

#include "../globe/given.hpp"
#include "../globe/gnomonic.hpp"
#include "arrays.hpp"

namespace dynhull {

using BoolArray = Output<bool>::Array;

inline std::pair<PointArray, BoolArray> gnomonic(const Rows& lonlat, double lon, double lat, double sine,
                                                 double cosine) {
  const std::size_t count = lonlat.shape(0);
  const Output<double, 2> places(count);
  const Output<bool> near(count);
  const Gnomonic project(lon, lat, sine, cosine);
  constexpr double NOWHERE = std::numeric_limits<double>::quiet_NaN();
  auto* const rows = reinterpret_cast<Point*>(places.data());
  for (std::size_t i = 0; i < count; ++i) {
    const std::optional<Point> place = project(points_of(lonlat)[i]);
    near.data()[i] = place.has_value();
    rows[i] = place.value_or(Point{NOWHERE, NOWHERE});
  }
  return {places.array(), near.array()};
}

class GivenPairs {
 public:
  std::size_t distinct() const { return given_.distinct(); }
  void clear() { given_.clear(); }
  std::size_t memory() const { return given_.bytes(); }

  std::pair<BoolArray, PointArray> apply(const OpRows& ops, const Rows& pairs, const Rows& places,
                                         bool ignore_missing) {
    const std::size_t count = pairs.shape(0);
    if (places.shape(0) != count || ops.shape(0) != count)
      throw nb::value_error("ops, pairs and places must have the same length");
    const Output<bool> kept(count);
    Given::Outcome outcome =
        given_.apply(ops.data(), points_of(pairs), points_of(places), count, ignore_missing, kept.data());
    if (outcome.first_missing >= 0 && !ignore_missing) {
      const Point pair = points_of(pairs)[outcome.first_missing];
      PyErr_SetObject(PyExc_KeyError, nb::make_tuple(pair.x, pair.y, outcome.first_missing).ptr());
      throw nb::python_error();
    }
    return {kept.array(), array_of(std::move(outcome.renamed))};
  }

  CountArray counts(const Rows& pairs, const Rows& places) const {
    const std::size_t count = pairs.shape(0);
    if (places.shape(0) != count) throw nb::value_error("pairs and places must have the same length");
    const Output<std::int64_t> output(count);
    for (std::size_t i = 0; i < count; ++i)
      output.data()[i] = static_cast<std::int64_t>(given_.count(points_of(pairs)[i], points_of(places)[i]));
    return output.array();
  }

  PointArray at(const Rows& places) const {
    std::vector<Point> pairs;
    for (std::size_t i = 0; i < places.shape(0); ++i) {
      const std::optional<Point> pair = given_.least(points_of(places)[i]);
      if (!pair) throw nb::key_error("no point was given for a place");
      pairs.push_back(*pair);
    }
    return array_of(std::move(pairs));
  }

  PointArray points() const {
    std::vector<Point> pairs;
    given_.for_each([&](const Given::Item& item) { pairs.insert(pairs.end(), item.copies, item.pair); });
    std::sort(pairs.begin(), pairs.end());
    return array_of(std::move(pairs));
  }

  GivenPairs* copy() const { return new GivenPairs(*this); }

 private:
  Given given_;
};

}  // namespace dynhull
