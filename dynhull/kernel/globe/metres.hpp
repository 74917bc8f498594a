// Metres on WGS84 from a place to an edge, in the plane of a projection: see dynhull/_metres.py, whose operations these
// are, one by one, so that both decide alike. Bounds save most of them: those round to the safe side.
#pragma once

#include "../fence/boxes.hpp"

namespace dynhull {

class Metres {
 public:
  static constexpr double MOST = 250100;  // metres, more than any distance that is not infinite

  // The sine and the cosine of the latitude of the centre.
  Metres(double sine, double cosine) : sine_(sine), cosine_(cosine) {}

  // The distance from p to an edge; infinite beyond 250 km.
  double to_edge(Point p, Edge edge) const {
    const Vector seen = direction(p), a = direction(edge.a), here = surface(seen);
    const double dx = edge.b.x - edge.a.x, dy = edge.b.y - edge.a.y;
    const Vector way = {0.0 - dy * sine_, dx, dy * cosine_};
    double share = nearest_share(seen, a, way);
    for (int step = 0; step < STEPS; ++step) share = nearer(here, a, way, share);
    return arc(seen, here, a.towards(way, share));
  }

  // At most the distance from p to what is in a box, in metres: that to the great circles along its sides.
  static double least(Point p, const Box& box) {
    const double x = beyond(p.x, box.least.x, box.greatest.x), y = beyond(p.y, box.least.y, box.greatest.y);
    return LEAST_RADIUS * std::max(x, y) / std::sqrt(1 + (p.x * p.x + p.y * p.y)) * (1 - SLACK) - SLACK_METRES;
  }

  // At least the distance in the plane between an edge and a point that is within some metres of it, and in reach.
  static double reach(Edge edge, double metres) {
    const double angle = (metres + SLACK_METRES) / LEAST_RADIUS * (1 + SLACK), turned = angle * (1 + angle);
    const double end = std::sqrt(std::max(edge.a.x * edge.a.x + edge.a.y * edge.a.y,  //
                                          edge.b.x * edge.b.x + edge.b.y * edge.b.y));
    const double farthest = std::min(farther(end, turned), farther(END_OF_REACH, turned));
    return angle * (1 + farthest * farthest) * (1 + SLACK);
  }

 private:
  static constexpr int STEPS = 2;
  static constexpr double EQUATOR = 6378137.0, FLAT = 0.9933056200098587, FARTHEST = 0.0392;
  static constexpr double ARC[] = {0.16666666666666666, 0.075, 0.044642857142857144, 0.030381944444444444,
                                   0.022372159090909092};
  // The least radius of curvature; the tangent of 85.01 degrees; and far more than what rounds, relative and absolute.
  static constexpr double LEAST_RADIUS = 6335439.0, END_OF_REACH = 11.453, SLACK = 1e-9, SLACK_METRES = 1e-5;

  struct Vector {
    double x, y, z;

    double dot(const Vector& b) const { return (x * b.x + y * b.y) + z * b.z; }
    Vector towards(const Vector& way, double share) const {
      return {x + share * way.x, y + share * way.y, z + share * way.z};
    }
  };

  Vector direction(Point p) const { return {cosine_ - p.y * sine_, p.x, sine_ + p.y * cosine_}; }

  static Vector surface(const Vector& direction) {
    const auto [x, y, z] = direction;
    const double up = FLAT * z, root = std::sqrt((x * x + y * y) + z * up);
    return {x / root, y / root, up / root};
  }

  static double within(double share) { return share > 0 ? (share < 1 ? share : 1.0) : 0.0; }

  static double nearest_share(const Vector& p, const Vector& a, const Vector& way) {
    const double ahead = p.dot(a), along = p.dot(way);
    const double first = a.dot(a), second = a.dot(way), third = way.dot(way);
    const double divisor = ahead * third - along * second;
    return divisor > 0 ? within((along * first - ahead * second) / divisor) : 0.0;
  }

  static double nearer(const Vector& here, const Vector& a, const Vector& way, double share) {
    const auto [x, y, z] = a.towards(way, share);
    const double up = FLAT * z, rise = FLAT * way.z;
    const double square = (x * x + y * y) + z * up, root = std::sqrt(square);
    const double turn = ((x * way.x + y * way.y) + z * rise) / square;
    const Vector speed = {(way.x - x * turn) / root, (way.y - y * turn) / root, (rise - up * turn) / root};
    const Vector apart = {here.x - x / root, here.y - y / root, here.z - up / root};
    const double divisor = speed.dot(speed);
    return divisor > 0 ? within(share + apart.dot(speed) / divisor) : share;
  }

  static double arc(const Vector& p, const Vector& here, const Vector& nearest) {
    const Vector there = surface(nearest);
    const Vector apart = {there.x - here.x, there.y - here.y, there.z - here.z};
    const double square = apart.dot(apart);
    if (!(square > 0)) return 0;
    const double own = std::sqrt(p.dot(p)), other = std::sqrt(nearest.dot(nearest));
    const Vector middle = {p.x / own + nearest.x / other, p.y / own + nearest.y / other, p.z / own + nearest.z / other};
    const double bent = 0.8 * curvature(middle, apart) + 0.1 * (curvature(p, apart) + curvature(nearest, apart));
    const double chord = std::sqrt(square), half = bent * chord / 2, z = half * half;
    const double series = 1 + z * (ARC[0] + z * (ARC[1] + z * (ARC[2] + z * (ARC[3] + z * ARC[4]))));
    return chord <= FARTHEST ? EQUATOR * chord * series : INFINITE;
  }

  static double curvature(const Vector& normal, const Vector& apart) {
    const auto [x, y, z] = normal;
    const double square = normal.dot(normal), steep = apart.dot(normal) / square;
    const double east = apart.x - steep * x, north = apart.y - steep * y, up = apart.z - steep * z;
    const double level = east * east + north * north;
    return std::sqrt(((x * x + y * y) + z * (FLAT * z)) / square) * ((level + up * up / FLAT) / (level + up * up));
  }

  // How far a coordinate is beyond an interval, as the sine of the angle to the great circle of its end, times the
  // length of the point's direction.
  static double beyond(double at, double least, double greatest) {
    const double end = at < least ? least : greatest;
    return at < least || at > greatest ? std::abs(at - end) / std::sqrt(1 + end * end) : 0;
  }

  // The tangent of an angle and another one, given as tangents; infinite beyond a quarter.
  static double farther(double tangent, double turned) {
    return tangent * turned < 1 ? (tangent + turned) / (1 - tangent * turned) : INFINITE;
  }

  double sine_, cosine_;
};

// The distance in metres from p to the nearest of some edges; infinite if there is none within 250 km. See
// `distance_to_nearest`.
template <class ForEach>
double metres_to_nearest(const Metres& metres, Point p, ForEach for_each) {
  double most = Metres::MOST;
  for_each(most, [&](Edge edge) {
    if (Metres::least(p, Box::of(edge)) <= most) most = std::min(most, metres.to_edge(p, edge));
  });
  return most < Metres::MOST ? most : INFINITE;
}

}  // namespace dynhull
