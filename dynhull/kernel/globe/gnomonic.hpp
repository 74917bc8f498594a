// The gnomonic projection about a centre: see dynhull/_globe.py, whose operations these are, one by one, so that both
// have the same results to the last bit. There are no branches, so that compilers project several places at once.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <utility>

#include "../predicates/point.hpp"

// Where the system can choose between two versions of a function by the processor. Their results are the same. It
// chooses before the thread sanitizer has begun.
#if defined(__GNUC__) && defined(__x86_64__) && defined(__GLIBC__) && !defined(__SANITIZE_THREAD__)
#define DYNHULL_WIDE __attribute__((target_clones("avx2", "default")))
#else
#define DYNHULL_WIDE
#endif

namespace dynhull {

class Gnomonic {
 public:
  // A sum of two doubles, the second much smaller.
  struct Sum {
    double rounded, rest;
  };

  // The centre in degrees, and the sine and the cosine of its latitude.
  Gnomonic(double lon, double lat, Sum sine, Sum cosine) : lon_(lon), lat_(lat), sine_(sine), cosine_(cosine) {}

  std::pair<double, double> center() const { return {lon_, lat_}; }

  // Nothing if the place is too far from the centre.
  std::optional<Point> operator()(Point place) const {
    const Direction direction = seen(place);
    if (!direction.near()) return {};
    return direction.place();
  }

  // The same for many places; `near` says which of them have a projection.
  DYNHULL_WIDE void operator()(const Point* places, std::size_t count, Point* projections, bool* near) const {
    double x[TOGETHER], y[TOGETHER], z[TOGETHER];
    for (std::size_t from = 0; from < count; from += TOGETHER) {
      const std::size_t end = std::min(TOGETHER, count - from);
      for (std::size_t i = 0; i < end; ++i) x[i] = places[from + i].x, y[i] = places[from + i].y;
      for (std::size_t i = 0; i < end; ++i) {
        const Direction direction = seen({x[i], y[i]});
        const Point place = direction.place();
        x[i] = place.x, y[i] = place.y, z[i] = direction.z;
      }
      for (std::size_t i = 0; i < end; ++i) projections[from + i] = {x[i], y[i]}, near[from + i] = z[i] >= LEAST_COSINE;
    }
  }

 private:
  static constexpr std::size_t TOGETHER = 64;

  // East, north and up, as seen from the centre.
  struct Direction {
    double x, y, z;
    bool near() const { return z >= LEAST_COSINE; }
    Point place() const { return {x / z + 0.0, y / z + 0.0}; }
  };
  struct SinCos {
    Sum sine, cosine;
  };

  static constexpr double LEAST_COSINE = 0.08715574274765817 - 1e-15;  // of 85 degrees, less 6 nanometres
  static constexpr double RADIANS = 0.017453292519943295, RADIANS_REST = 2.9486522708701687e-19;
  static constexpr double SPLITTER = 134217729.0;           // 2^27 + 1
  static constexpr double TO_INTEGER = 6755399441055744.0;  // 2^52 + 2^51: nothing is left of a fraction beside it
  // FreeBSD, k_sin.c and k_cos.c.
  static constexpr double S1 = -1.66666666666666324348e-01, S2 = 8.33333333332248946124e-03,
                          S3 = -1.98412698298579493134e-04, S4 = 2.75573137070700676789e-06,
                          S5 = -2.50507602534068634195e-08, S6 = 1.58969099521155010221e-10;
  static constexpr double C1 = 4.16666666666666019037e-02, C2 = -1.38888888888741095749e-03,
                          C3 = 2.48015872894767294178e-05, C4 = -2.75573143513906633035e-07,
                          C5 = 2.08757232129817482790e-09, C6 = -1.13596475577881948265e-11;

  Direction seen(Point place) const {
    const Sum across = difference(wrapped(place.x), lon_), along = difference(place.y, lat_);
    const SinCos half = sin_cos(across.rounded / 2, across.rest / 2);
    const SinCos north = sin_cos(along.rounded, along.rest);
    const Sum cos_lat = sin_cos(place.y, 0).cosine;
    const Sum chord = product({2 * half.sine.rounded, 2 * half.sine.rest}, cos_lat);
    const Sum rise = product(chord, half.sine);
    const Sum fall = product(rise, cosine_);
    const double z = (north.cosine.rounded - fall.rounded) + (north.cosine.rest - fall.rest);
    const double x =
        chord.rounded * half.cosine.rounded + (chord.rounded * half.cosine.rest + chord.rest * half.cosine.rounded);
    const double y = (north.sine.rounded + sine_.rounded * rise.rounded) +
                     (north.sine.rest + (sine_.rounded * rise.rest + sine_.rest * rise.rounded));
    return {x, y, z};
  }

  static SinCos sin_cos(double degrees, double rest) {
    const double quarters = (degrees / 90 + TO_INTEGER) - TO_INTEGER, turns = std::abs(quarters);
    const Sum radians = in_radians(degrees - 90 * quarters, rest);
    const double x = radians.rounded, y = radians.rest;
    const double z = x * x, cube = z * x;
    const double sine_tail = S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)));
    const Sum sine = sum(x, -((z * (0.5 * y - cube * sine_tail) - y) - cube * S1));
    const double cosine_tail = z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))));
    const double half = 0.5 * z, first = 1 - half;
    const Sum cosine = sum(first, ((1 - first) - half) + (z * cosine_tail - x * y));
    const double turned = 1 - turns, across = quarters * (2 - turns);  // cosine and sine of the quarters: 0, 1 or -1
    return {{turned * sine.rounded + across * cosine.rounded, turned * sine.rest + across * cosine.rest},
            {turned * cosine.rounded - across * sine.rounded, turned * cosine.rest - across * sine.rest}};
  }

  static Sum in_radians(double degrees, double rest) {
    const Sum exact = product(degrees, RADIANS);
    return {exact.rounded, exact.rest + (degrees * RADIANS_REST + rest * RADIANS)};
  }

  // Exactly (Dekker).
  static Sum product(double a, double b) {
    const double rounded = a * b;
    const Sum c = split(a), d = split(b);
    return {rounded, ((c.rounded * d.rounded - rounded) + c.rounded * d.rest + c.rest * d.rounded) + c.rest * d.rest};
  }
  static Sum product(Sum a, Sum b) {
    const Sum exact = product(a.rounded, b.rounded);
    return {exact.rounded, exact.rest + (a.rounded * b.rest + a.rest * b.rounded)};
  }

  static Sum split(double value) {
    const double scaled = SPLITTER * value;
    const double high = scaled - (scaled - value);
    return {high, value - high};
  }

  // Exactly, where the first is greater (Dekker).
  static Sum sum(double a, double b) {
    const double rounded = a + b;
    return {rounded, (a - rounded) + b};
  }
  static Sum difference(double a, double b) {
    const double rounded = a - b, taken = a - rounded;
    return {rounded, (a - (rounded + taken)) + (taken - b)};
  }

  static double wrapped(double lon) { return (lon - (lon >= 180 ? 360.0 : 0.0)) + (lon < -180 ? 360.0 : 0.0); }

  double lon_, lat_;
  Sum sine_, cosine_;
};

}  // namespace dynhull
