// Columns of equal width.
#pragma once

#include <cmath>

#include "../predicates/point.hpp"

namespace dynhull {

// Which of `count` columns of equal width a coordinate lies in. Never falls where the coordinate grows, because no
// rounding turns an order round. All are in column 0 where the width is no usable number: one coordinate only, or
// farther apart than any double.
class Columns {
 public:
  Columns() = default;
  Columns(double least, double greatest, unsigned count) : least_(least), last_(static_cast<double>(count - 1)) {
    const double scale = last_ / (greatest - least);
    if (scale > 0 && std::isfinite(scale)) scale_ = scale;
  }

  bool usable() const { return scale_ > 0; }

  // Any double will do, NaN as well.
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
