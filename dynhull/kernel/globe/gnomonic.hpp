// The gnomonic projection about a centre: see dynhull/_globe.py, whose operations these are, one by one, so that both
// have the same results to the last bit.
#pragma once

#include <cmath>
#include <optional>

#include "../predicates/point.hpp"

namespace dynhull {

class Gnomonic {
 public:
  // The centre in degrees, and the sine and the cosine of its latitude.
  Gnomonic(double lon, double lat, double sine, double cosine) : lon_(lon), lat_(lat), sine_(sine), cosine_(cosine) {}

  // Nothing if the place is too far from the centre.
  std::optional<Point> operator()(Point place) const {
    const Sum across = difference(wrapped(place.x), lon_), along = difference(place.y, lat_);
    const SinCos half = sin_cos(across.rounded / 2, across.rest / 2);
    const SinCos north = sin_cos(along.rounded, along.rest);
    const double chord = 2 * half.sine * sin_cos(place.y, 0).cosine;
    const double rise = chord * half.sine;
    const double z = north.cosine - cosine_ * rise;
    if (!(z >= LEAST_COSINE)) return {};
    return Point{chord * half.cosine / z + 0.0, (north.sine + sine_ * rise) / z + 0.0};
  }

 private:
  struct Sum {
    double rounded, rest;
  };
  struct SinCos {
    double sine, cosine;
  };

  static constexpr double LEAST_COSINE = 0.08715574274765817 - 1e-15;  // of 85 degrees, less 6 nanometres
  static constexpr double RADIANS = 0.017453292519943295, RADIANS_REST = 2.9486522708701687e-19;
  static constexpr double SPLITTER = 134217729.0;  // 2^27 + 1
  // FreeBSD, k_sin.c and k_cos.c.
  static constexpr double S1 = -1.66666666666666324348e-01, S2 = 8.33333333332248946124e-03,
                          S3 = -1.98412698298579493134e-04, S4 = 2.75573137070700676789e-06,
                          S5 = -2.50507602534068634195e-08, S6 = 1.58969099521155010221e-10;
  static constexpr double C1 = 4.16666666666666019037e-02, C2 = -1.38888888888741095749e-03,
                          C3 = 2.48015872894767294178e-05, C4 = -2.75573143513906633035e-07,
                          C5 = 2.08757232129817482790e-09, C6 = -1.13596475577881948265e-11;

  static SinCos sin_cos(double degrees, double rest) {
    const double quarters = std::rint(degrees / 90);
    const Sum radians = in_radians(degrees - 90 * quarters, rest);
    const double x = radians.rounded, y = radians.rest;
    const double z = x * x, cube = z * x;
    const double sine_tail = S2 + z * (S3 + z * (S4 + z * (S5 + z * S6)));
    const double sine = x - ((z * (0.5 * y - cube * sine_tail) - y) - cube * S1);
    const double cosine_tail = z * (C1 + z * (C2 + z * (C3 + z * (C4 + z * (C5 + z * C6)))));
    const double half = 0.5 * z, first = 1 - half;
    const double cosine = first + (((1 - first) - half) + (z * cosine_tail - x * y));
    const int quadrant = static_cast<int>(quarters) & 3;
    const bool odd = (quadrant & 1) != 0;
    return {(odd ? cosine : sine) * (quadrant >= 2 ? -1.0 : 1.0),
            (odd ? sine : cosine) * (quadrant == 1 || quadrant == 2 ? -1.0 : 1.0)};
  }

  static Sum in_radians(double degrees, double rest) {
    const double product = degrees * RADIANS;
    const Sum a = split(degrees), b = split(RADIANS);
    const double error =
        ((a.rounded * b.rounded - product) + a.rounded * b.rest + a.rest * b.rounded) + a.rest * b.rest;
    return {product, error + (degrees * RADIANS_REST + rest * RADIANS)};
  }

  static Sum split(double value) {
    const double scaled = SPLITTER * value;
    const double high = scaled - (scaled - value);
    return {high, value - high};
  }

  static Sum difference(double a, double b) {
    const double rounded = a - b, taken = a - rounded;
    return {rounded, (a - (rounded + taken)) + (taken - b)};
  }

  static double wrapped(double lon) { return (lon >= 180 ? lon - 360 : lon < -180 ? lon + 360 : lon) + 0.0; }

  double lon_, lat_, sine_, cosine_;
};

}  // namespace dynhull
