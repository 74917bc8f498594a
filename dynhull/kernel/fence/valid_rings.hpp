// Whether rings of corners are those of a polygon with holes.
#pragma once

#include <algorithm>
#include <numeric>
#include <set>
#include <span>
#include <vector>

#include "../predicates/signs.hpp"
#include "boxes.hpp"

namespace dynhull {

// A line sweeps over the corners of all rings in their order (Shamos and Hoey 1976). Edges that get neighbours on it
// are compared; and what is between neighbours, the outside, the inside or a hole, must be the same for both. As long
// as nothing is wrong, the order of the edges on the line does not change.
class RingSweep {
 public:
  RingSweep(std::span<const Point> corners, std::span<const std::size_t> sizes) : corners_(corners) {
    for (const std::size_t size : sizes) {
      const std::size_t first = after_.size();
      for (std::size_t i = 0; i < size; ++i) {
        after_.push_back(first + (i + 1 == size ? 0 : i + 1));
        before_.push_back(first + (i == 0 ? size - 1 : i - 1));
        ring_.push_back(turnings_.size());
      }
      turnings_.push_back(0);
    }
  }

  // Of each ring, the first of which is the exterior: +1 if its inside is on its left, -1 if on its right. Empty unless
  // each is simple, the others are holes inside of the first one, and no two of these overlap; rings may touch at
  // corners. A corner that repeats the one before it makes a ring not simple. O(k log k) for k corners.
  std::vector<int> turnings() {
    if (!sweep()) turnings_.clear();
    return std::move(turnings_);
  }

 private:
  struct Below {
    using is_transparent = void;
    const RingSweep* sweep;

    bool operator()(std::size_t i, std::size_t j) const {
      const auto [a, b] = sweep->ends(i);
      const auto [c, d] = sweep->ends(j);
      const auto side = [](Point from, Point to, Point p, Point q) {
        const int turn = orientation(from, to, p);
        return turn != 0 ? turn : orientation(from, to, q);
      };
      return a < c ? side(a, b, c, d) > 0 : side(c, d, a, b) < 0;
    }
    bool operator()(std::size_t i, Point p) const { return sweep->side(i, p) > 0; }
  };
  using Line = std::set<std::size_t, Below>;  // the edges on the line, upwards, by the numbers of their first corners

  // The ends of an edge, in order.
  std::pair<Point, Point> ends(std::size_t edge) const { return std::minmax(corners_[edge], corners_[after_[edge]]); }
  // +1 if p is above an edge, on its left.
  int side(std::size_t edge, Point p) const {
    const auto [a, b] = ends(edge);
    return orientation(a, b, p);
  }

  bool sweep() {
    for (std::size_t i = 0; i < corners_.size(); ++i) {  // neighbours overlap only if they are collinear and turn back
      const Point a = corners_[before_[i]], b = corners_[i], c = corners_[after_[i]];
      if (a == b || (orientation(a, b, c) == 0 && (a < b) != (b < c))) return false;
    }
    std::vector<std::size_t> order(corners_.size());
    std::iota(order.begin(), order.end(), 0);
    std::sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) {
      return corners_[i] == corners_[j] ? ring_[i] < ring_[j] : corners_[i] < corners_[j];
    });
    for (const std::size_t corner : order)
      if (int& turning = turnings_[ring_[corner]]; turning == 0)
        turning = orientation(corners_[before_[corner]], corners_[corner], corners_[after_[corner]]);
    if (std::find(turnings_.begin(), turnings_.end(), 0) != turnings_.end()) return false;
    at_.assign(corners_.size(), line_.end());
    for (std::size_t first = 0, last = 0; first < order.size(); first = last) {
      while (last < order.size() && corners_[order[last]] == corners_[order[first]]) ++last;
      if (!pass(std::span(order).subspan(first, last - first))) return false;
    }
    return true;
  }

  // Passes over the corners at one point, of different rings unless one of these is not simple.
  bool pass(std::span<const std::size_t> corners) {
    const Point p = corners_[corners[0]];
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const std::size_t corner = corners[k];
      if (k > 0 && ring_[corners[k - 1]] == ring_[corner]) return false;
      if (corners_[before_[corner]] < p) line_.erase(at_[before_[corner]]);
      if (corners_[after_[corner]] < p) line_.erase(at_[corner]);
    }
    const auto above = line_.lower_bound(p);
    const auto next = above != line_.end() && side(*above, p) == 0 ? std::next(above) : above;
    if (next != above) {  // these corners are on an edge
      if (next != line_.end() && side(*next, p) == 0) return false;
      for (const std::size_t corner : corners)
        if (ring_[corner] == ring_[*above]) return false;
    }
    for (const std::size_t corner : corners) {
      if (p < corners_[before_[corner]] && !insert(before_[corner])) return false;
      if (p < corners_[after_[corner]] && !insert(corner)) return false;
    }
    for (const std::size_t corner : corners) {
      for (const std::size_t edge : {before_[corner], corner})
        if (p < ends(edge).second && !(agree(at_[edge]) && agree(std::next(at_[edge])))) return false;
    }
    return agree(above) && agree(next);
  }
  bool insert(std::size_t edge) {
    const auto [place, is_new] = line_.insert(edge);
    at_[edge] = place;
    return is_new;
  }
  // Whether an edge on the line, or the upper end of that, and the edge before it agree about what is between them.
  bool agree(Line::const_iterator place) const {
    const bool first = place == line_.begin(), none = place == line_.end();
    const std::size_t below = first ? OUTSIDE : part_beside(*std::prev(place), true);
    return below == (none ? OUTSIDE : part_beside(*place, false)) &&
           (first || none || !clash(*std::prev(place), *place));
  }

  // What is above or below an edge.
  static constexpr std::size_t OUTSIDE = 0, INSIDE = 1;  // greater ones are holes
  std::size_t part_beside(std::size_t edge, bool above) const {
    const std::size_t ring = ring_[edge];
    const bool inside_above = (corners_[edge] < corners_[after_[edge]]) == (turnings_[ring] > 0);
    return above == inside_above ? ring + 1 : ring == 0 ? OUTSIDE : INSIDE;
  }

  // Whether two edges meet, other than neighbours of a ring do, and rings at a corner.
  bool clash(std::size_t i, std::size_t j) const {
    if (after_[i] == j || after_[j] == i) return false;
    const Point a = corners_[i], b = corners_[after_[i]], c = corners_[j], d = corners_[after_[j]];
    if (!Box::of({a, b}).meets(Box::of({c, d}))) return false;
    const int at_c = orientation(a, b, c), at_d = orientation(a, b, d);
    const int at_a = orientation(c, d, a), at_b = orientation(c, d, b);
    if (at_c * at_d > 0 || at_a * at_b > 0) return false;
    if (ring_[i] == ring_[j] || (at_c * at_d < 0 && at_a * at_b < 0)) return true;
    const auto [low, high] = ends(i);
    const auto [least, greatest] = ends(j);
    return at_c == 0 && at_d == 0 && std::max(low, least) < std::min(high, greatest);
  }

  std::span<const Point> corners_;
  std::vector<std::size_t> after_, before_, ring_;  // of each corner
  std::vector<int> turnings_;                       // of each ring
  Line line_{Below{this}};
  std::vector<Line::iterator> at_;  // of edges on the line
};

}  // namespace dynhull
