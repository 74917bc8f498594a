// Sorting many points on several threads: in columns of x, each small enough to be sorted in the cache.
#pragma once

#include <deque>

#include "../memory/scratch.hpp"
#include "../threads.hpp"
#include "by_point.hpp"

namespace dynhull {

// Copies points in order, without negative zeros. The result is in order even if another thread changes the points
// meanwhile.
class ColumnSort {
 public:
  ColumnSort(const Point* from, Point* to, std::size_t count, Threads& threads)
      : to_(to), width_(static_cast<unsigned>(std::min(count / A_COLUMN + 1, MOST))), threads_(threads) {
    const std::size_t parts = threads.count();
    for (std::size_t i = 0; i < parts; ++i)
      parts_.emplace_back(from + count * i / parts, count * (i + 1) / parts - count * i / parts);
    choose_columns();
    place();
    if (finite()) sort();
  }

  // If false, nothing else holds.
  bool finite() const {
    return std::all_of(parts_.begin(), parts_.end(), [](const Part& part) { return part.finite; });
  }
  bool repeated() const { return repeated_; }  // whether some points are equal

 private:
  static constexpr std::size_t MOST = 256, A_COLUMN = 2048;

  // The share of one thread: some of the points as given.
  struct Part {
    Part(const Point* points, std::size_t count) : points(points), count(count) {}

    const Point* points;
    std::size_t count;
    Range range = {};
    Scratch<std::uint16_t> columns{count};    // of each point
    std::array<std::size_t, MOST> next = {};  // counts of each column, then the place of its next point
    bool finite = true;
  };

  template <class Work>
  void for_each_part(Work work) {
    threads_.run(parts_.size(), [&](std::size_t i) { work(parts_[i]); });
  }

  void choose_columns() {
    for_each_part([](Part& part) { part.range = Range::of<&Point::x>(part.points, part.count); });
    Range range;
    for (const Part& part : parts_) {
      range.add(part.range.least);
      range.add(part.range.greatest);
    }
    const Columns columns(range.least, range.greatest, width_);
    for_each_part([&](Part& part) {
      for (std::size_t i = 0; i < part.count; ++i) {
        const unsigned column = columns(part.points[i].x);
        part.columns[i] = static_cast<std::uint16_t>(column);
        ++part.next[column];
      }
    });
    std::size_t total = 0;
    for (unsigned column = 0; column < width_; ++column) {
      starts_[column] = total;
      for (Part& part : parts_) total += std::exchange(part.next[column], total);
    }
    starts_[width_] = total;
  }

  void place() {
    for_each_part([&](Part& part) {
      Plain plain;
      for (std::size_t i = 0; i < part.count; ++i) to_[part.next[part.columns[i]]++] = plain(part.points[i]);
      part.finite = plain.finite();
    });
  }

  void sort() {
    const std::size_t shares = parts_.size() > 1 ? 4 * parts_.size() : 1;
    const auto first_of = [&](std::size_t share) {
      const auto from = std::lower_bound(starts_.begin(), starts_.begin() + width_, starts_[width_] * share / shares);
      return share < shares ? static_cast<unsigned>(from - starts_.begin()) : width_;
    };
    threads_.run(shares, [&](std::size_t i) {
      if (sort(first_of(i), first_of(i + 1))) repeated_ = true;
    });
    if (in_order()) return;
    Point* const end = to_ + starts_[width_];
    std::sort(to_, end);
    repeated_ = std::adjacent_find(to_, end) != end;
  }

  // Whether the columns are in order. They are not if another thread changed a point between the two reads.
  bool in_order() const {
    for (unsigned column = 1; column < width_; ++column) {
      const std::size_t start = starts_[column];
      if (0 < start && start < starts_[width_] && to_[start] < to_[start - 1]) return false;
    }
    return true;
  }

  // Sorts each of the columns first..last. Returns whether some points are equal; equal points share a column.
  bool sort(unsigned first, unsigned last) const {
    const auto size = [&](unsigned column) { return starts_[column + 1] - starts_[column]; };
    std::size_t most = 0;
    for (unsigned column = first; column < last; ++column) most = std::max(most, size(column));
    const Scratch<Point> scratch(most);
    bool repeated = false;
    for (unsigned column = first; column < last; ++column) {
      Point *const begin = to_ + starts_[column], *const end = begin + size(column);
      sort_by_point(begin, scratch.data(), size(column));
      repeated = repeated || repeats(begin, size(column));
    }
    return repeated;
  }

  // Whether neighbours are equal. Without an early end, which would keep the loop from being vectorised.
  static bool repeats(const Point* points, std::size_t count) {
    bool repeated = false;
    for (std::size_t i = 1; i < count; ++i) repeated |= points[i] == points[i - 1];
    return repeated;
  }

  Point* to_;
  unsigned width_;
  Threads& threads_;
  std::deque<Part> parts_;
  std::atomic<bool> repeated_ = false;
  std::array<std::size_t, MOST + 1> starts_;
};

}  // namespace dynhull
