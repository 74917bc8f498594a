// The times that are too old: an exact comparison with a difference of doubles.
#pragma once

#include <cmath>

#include "../predicates/point.hpp"

namespace dynhull {

// The greatest double that is at most now - max_age, exactly; -inf if there is none. Knuth's error-free sum: the
// difference is `rounded` plus `error`.
inline double horizon(double now, double max_age) {
  const double rounded = now - max_age;
  if (rounded == -INFINITE) return rounded;
  const double taken = now - rounded;
  const double error = (now - (rounded + taken)) - (max_age - taken);
  return error < 0 ? std::nextafter(rounded, -INFINITE) : rounded;
}

}  // namespace dynhull
