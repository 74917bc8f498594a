// A monotone map from coordinates to columns of equal width.
#pragma once

#include <cmath>

#include "../predicates/point.hpp"

namespace dynhull {

// Maps a coordinate to one of `count` columns. Monotone, because rounding is. If the width is not a positive finite
// number (all coordinates are equal, or their difference overflows), every coordinate is in column 0.
class Columns {
 public:
  Columns() = default;
  Columns(double least, double greatest, unsigned count) : least_(least), last_(static_cast<double>(count - 1)) {
    const double scale = last_ / (greatest - least);
    if (scale > 0 && std::isfinite(scale)) scale_ = scale;
  }

  bool usable() const { return scale_ > 0; }

  // Accepts any double, including NaN.
  unsigned operator()(double x) const {
    double column = (x - least_) * scale_;
    column = column > 0 ? column : 0;
    column = column < last_ ? column : last_;
    return static_cast<unsigned>(static_cast<int>(column));
  }

 private:
  double least_ = 0, last_ = 0, scale_ = 0;
};

}  // namespace dynhull
