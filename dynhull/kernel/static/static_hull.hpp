// The hull of a fixed set of points: discard, sort, chain.
//
// Boxes inside the hull of a sample discard most points (in the manner of Akl and Toussaint 1978). The others go into
// columns of x, separately above and below the line through the extreme points; each column is sorted and chained
// (Andrew 1979) with exact orientations. Two threads share each pass over the points, and then build one chain each.
#pragma once

#include <optional>
#include <utility>
#include <vector>

#include "../memory/scratch.hpp"
#include "../sort/by_point.hpp"
#include "../threads.hpp"
#include "inner_boxes.hpp"

namespace dynhull {

// The hull of points in two parts. Stays within its memory even if another thread changes the points meanwhile.
class StaticHull {
 public:
  using Part = std::span<const Point>;

  // Uses two of the threads, if there are two.
  StaticHull(Part first, Part second, Threads& threads) : threads_(threads), parts_{first, second} {
    find_ends();
    if (!finite_ || size() == 0) return;
    place();
    Point *lower_end, *upper_end;
    both([&] { lower_end = chain(0, least_, greatest_); }, [&] { upper_end = chain(width_, greatest_, least_); });
    // Both chains include both ends.
    Point* const memory = memory_->data();
    if (lower_end > memory + 1) lower_end = std::copy(memory + starts_[width_], upper_end - 1, lower_end);
    vertices_ = {memory, lower_end};
  }

  bool finite() const { return finite_; }  // if false, there is no hull

  // Counter-clockwise from the least, at the start of the memory.
  std::span<const Point> vertices() const { return vertices_; }
  std::optional<Scratch<Point>>& memory() { return memory_; }

 private:
  std::size_t size() const { return parts_[0].size() + parts_[1].size(); }

  template <class First, class Second>
  void both(First first, Second second) {
    threads_.run(2, [&](std::size_t task) { task == 0 ? first() : second(); });
  }

  void find_ends() {
    Point least[2] = {}, greatest[2] = {};
    bool finite[2] = {true, true};
    const auto find = [&](int part) {
      if (parts_[part].empty()) return;
      Point low = parts_[part].front(), high = low;
      Plain plain;
      for (Point given : parts_[part]) {
        const Point p = plain(given);
        if ((p.x <= low.x) | (p.x >= high.x)) [[unlikely]] {
          low = std::min(low, p);
          high = std::max(high, p);
        }
      }
      least[part] = low;
      greatest[part] = high;
      finite[part] = plain.finite();
    };
    both([&] { find(0); }, [&] { find(1); });
    finite_ = finite[0] && finite[1];
    const int some = parts_[0].empty() ? 1 : 0, other = parts_[1].empty() ? 0 : 1;
    least_ = positive_zeros(std::min(least[some], least[other]));
    greatest_ = positive_zeros(std::max(greatest[some], greatest[other]));
  }

  // Puts the points into columns: those below the line through the ends from left to right, then those above it from
  // right to left. Points on the line are no vertices.
  void place() {
    constexpr std::size_t MOST_COLUMNS = 512, A_COLUMN = 1024;
    width_ = static_cast<unsigned>(std::min(std::bit_ceil(size() / A_COLUMN + 1), MOST_COLUMNS));
    const Columns columns(least_.x, greatest_.x, width_);
    const unsigned none = 2 * width_;
    const Scratch<std::uint16_t> keys[2] = {Scratch<std::uint16_t>(parts_[0].size()),
                                            Scratch<std::uint16_t>(parts_[1].size())};
    std::vector<std::size_t> next[2];  // counts of each column, then the place of its next point
    const auto count = [&](int part) {
      next[part].assign(none + 1, 0);
      std::uint16_t* key = keys[part].data();
      for (Point p : parts_[part]) {
        const int side = orientation(least_, greatest_, p);
        const unsigned mirror = (none - 1) * static_cast<unsigned>(side > 0);
        const unsigned column = side == 0 ? none : columns(p.x) ^ mirror;  // branch-free: sides are unpredictable
        ++next[part][column];
        *key++ = static_cast<std::uint16_t>(column);
      }
    };
    both([&] { count(0); }, [&] { count(1); });

    starts_.resize(none + 1);
    std::size_t total = 0;
    for (unsigned column = 0; column <= none; ++column) {
      if (column % width_ == 0) total += column == 0 ? 1 : 2;  // room for the ends, which are in both chains
      starts_[column] = total;
      for (auto& part : next) total += std::exchange(part[column], total);
    }
    Point* const memory = memory_.emplace(starts_[none] - 1).data();
    const auto put = [&](int part) {
      const std::uint16_t* key = keys[part].data();
      std::size_t* const place = next[part].data();
      for (Point p : parts_[part]) {
        const unsigned column = *key++;
        if (column != none) memory[place[column]++] = positive_zeros(p);
      }
    };
    both([&] { put(0); }, [&] { put(1); });
  }

  // Sorts and chains the columns of one side, from its first column. The chain overwrites points already read, from the
  // slot before them. Returns the chain's end.
  Point* chain(unsigned first, Point from, Point to) {
    const auto end = [&](unsigned column) { return starts_[column + 1] - (column + 1 == first + width_ ? 2 : 0); };
    std::size_t most = 0;
    for (unsigned column = first; column < first + width_; ++column)
      most = std::max(most, end(column) - starts_[column]);
    const Scratch<Point> scratch(most);
    Point* const memory = memory_->data();
    Chain chain(&memory[starts_[first] - 1]);
    chain.push(from);
    for (unsigned column = first; column < first + width_; ++column) {
      const std::span<Point> points(&memory[starts_[column]], &memory[end(column)]);
      sort_by_point(points.data(), scratch.data(), points.size());
      if (first > 0) std::reverse(points.begin(), points.end());
      for (Point p : points) chain.push(p);
    }
    chain.push(to);
    return chain.end();
  }

  static Point positive_zeros(Point p) { return {p.x + 0.0, p.y + 0.0}; }

  Threads& threads_;
  bool finite_ = true;
  Part parts_[2];
  Point least_, greatest_;
  unsigned width_ = 0;
  std::vector<std::size_t> starts_;
  std::optional<Scratch<Point>> memory_;
  std::span<const Point> vertices_;
};

// Whether to discard points by a sample's hull first, and whether to use two threads; by default the input decides.
struct StaticOptions {
  std::optional<bool> discard, threads;
};

// Boxes that discard points; none if they would discard too few to pay, unless `always`.
inline std::optional<InnerBoxes> inner_boxes_of(const Point* points, std::size_t count, bool always) {
  constexpr std::size_t FEW = 2048, LARGEST_SAMPLE = 4096, ONE_OF = 32;
  if (count < FEW && !always) return {};
  std::vector<Point> sample(std::min(LARGEST_SAMPLE, always ? count : count / ONE_OF));
  const std::size_t stride = count / std::max<std::size_t>(sample.size(), 1);
  for (std::size_t i = 0; i < sample.size(); ++i)
    sample[i] = points[i * stride + i * 2654435761u % stride];  // scattered, against patterns in the input
  Threads alone(1);
  const StaticHull hull(sample, {}, alone);
  if (!hull.finite()) return {};
  if (2 * hull.vertices().size() > sample.size() && !always) return {};
  const InnerBoxes inner_boxes(hull.vertices());
  const std::size_t kept = inner_boxes.discard(sample, sample.data());
  if (sample.size() - kept < sample.size() / 8 && !always) return {};
  return inner_boxes;
}

// Moves what no box holds to `kept`, which has room for all, and returns it. In shares: a thread that comes late takes
// fewer of them.
inline StaticHull::Part discard(const InnerBoxes& inner_boxes, StaticHull::Part points, Point* kept, Threads& threads) {
  constexpr std::size_t MOST = 16;
  const std::size_t shares = threads.count() > 1 ? MOST : 1, count = points.size();
  std::array<std::size_t, MOST> left;
  const auto start = [&](std::size_t share) { return count * share / shares; };
  threads.run(shares, [&](std::size_t i) {
    left[i] = inner_boxes.discard(points.subspan(start(i), start(i + 1) - start(i)), kept + start(i));
  });
  Point* end = kept;
  for (std::size_t i = 0; i < shares; ++i) end = std::copy_n(kept + start(i), left[i], end);
  return {kept, end};
}

// O(n log n), and O(n) if few points are near the hull.
inline StaticHull static_hull(const Point* points, std::size_t count, StaticOptions options = {}) {
  constexpr std::size_t DISCARDED_FOR_ONE_PLACED = 16;  // at the same cost
  const auto threads_to_place = [&](std::size_t placed) {
    return options.threads.value_or(threads_for(placed) > 1) ? 2u : 1u;
  };
  const auto in_parts = [](StaticHull::Part all, Threads& threads) {
    return StaticHull(all.first(all.size() / 2), all.subspan(all.size() / 2), threads);
  };
  const StaticHull::Part all(points, count);
  // Before they are needed: to wake a thread takes as long as the hull of a sample.
  std::optional<Threads> threads(std::in_place, threads_to_place(count / DISCARDED_FOR_ONE_PLACED));
  const bool may_discard = options.discard.value_or(true);
  const auto inner_boxes = may_discard ? inner_boxes_of(points, count, options.discard.has_value()) : std::nullopt;
  if (!inner_boxes) {
    if (threads->count() < 2) threads.emplace(threads_to_place(count));
    return in_parts(all, *threads);
  }
  const Scratch<Point> kept(count);
  const StaticHull::Part left = discard(*inner_boxes, all, kept.data(), *threads);
  if (threads_to_place(left.size()) < 2) threads.emplace(1);
  return in_parts(left, *threads);
}

}  // namespace dynhull
