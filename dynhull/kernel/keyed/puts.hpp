// What a batch of puts brings, what it counts, and what it asks of the tree.
#pragma once

#include "../globe/framed_tree.hpp"
#include "slots.hpp"

namespace dynhull {

// The numbers of rows of each kind.
struct Counts {
  std::int64_t fresh = 0, moved = 0, unmoved = 0, stale = 0, skipped = 0;
};

// The places and times of a batch, checked and copied. Throws NotFinite.
class Puts {
 public:
  Puts(const Frame& frame, const Point* points, const double* times, bool or_none, std::size_t count)
      : places_(count), times_(times != nullptr ? count : 0), timed_(times != nullptr) {
    Plain plain;
    bool placed = true;
    for (std::size_t i = 0; i < count; ++i) {
      places_[i] = plain(points[i]);
      placed &= frame.has(places_[i]);
    }
    double strange = 0;
    for (std::size_t i = 0; timed_ && i < count; ++i) {
      const double time = times[i] + 0.0;  // turns -0.0 into 0.0
      times_[i] = std::isnan(time) ? NO_TIME : time;
      strange += or_none && std::isnan(time) ? 0 : time - time;
    }
    if (!plain.finite() || !placed || strange != 0) throw NotFinite();
  }

  Point& place(std::size_t row) { return places_[row]; }
  double time(std::size_t row) const { return timed_ ? times_[row] : NO_TIME; }

 private:
  Scratch<Point> places_;
  Scratch<double> times_;
  bool timed_;
};

// Rows for a batch of the tree.
class Changes {
 public:
  explicit Changes(std::size_t most) : ops_(most), places_(most) {}
  void set(std::size_t row, std::int8_t op, Point place) const {
    ops_[row] = op;
    places_[row] = place;
  }
  Point place(std::size_t row) const { return places_[row]; }
  void apply(FramedTree& tree, std::size_t count, bool all_insert) const {
    if (count > 0) tree.apply({ops_.data(), all_insert ? 0u : 1u}, places_.data(), count, false);
  }

 private:
  Scratch<std::int8_t> ops_;
  Scratch<Point> places_;
};

}  // namespace dynhull
