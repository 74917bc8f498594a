// Sorting many points with one or two threads: in columns of x, each small enough to be sorted in the cache.
#pragma once

#include "../memory/scratch.hpp"
#include "../threads.hpp"
#include "by_point.hpp"

namespace dynhull {

// Copies points in order, without negative zeros. The result is in order even if another thread changes the points
// meanwhile.
class ColumnSort {
 public:
  ColumnSort(const Point* from, Point* to, std::size_t count, bool threads)
      : to_(to),
        half_(count / 2),
        width_(static_cast<unsigned>(std::min(count / A_COLUMN + 1, MOST))),
        threads_(threads),
        parts_{{from, half_}, {from + half_, count - half_}} {
    choose_columns();
    place();
    if (finite()) sort();
  }

  bool finite() const { return parts_[0].finite && parts_[1].finite; }        // if false, nothing else holds
  bool repeated() const { return parts_[0].repeated || parts_[1].repeated; }  // whether some points are equal

 private:
  static constexpr std::size_t MOST = 256, A_COLUMN = 2048;

  // The share of one thread: half of the points as given, then the columns with about half of them.
  struct Part {
    const Point* points;
    std::size_t count;
    Range range = {};
    Scratch<std::uint16_t> columns{count};    // of each point
    std::array<std::size_t, MOST> next = {};  // counts of each column, then the place of its next point
    bool finite = true, repeated = false;
  };

  template <class Work>
  void for_each_part(Work work) {
    both(threads_, [&] { work(parts_[0]); }, [&] { work(parts_[1]); });
  }

  void choose_columns() {
    for_each_part([](Part& part) { part.range = Range::of<&Point::x>(part.points, part.count); });
    const Columns columns(std::min(parts_[0].range.least, parts_[1].range.least),
                          std::max(parts_[0].range.greatest, parts_[1].range.greatest), width_);
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
    const auto middle = std::lower_bound(starts_.begin(), starts_.begin() + width_, half_) - starts_.begin();
    const auto cut = static_cast<unsigned>(middle);
    both(threads_, [&] { parts_[0].repeated = sort(0, cut); }, [&] { parts_[1].repeated = sort(cut, width_); });
    if (in_order()) return;
    Point* const end = to_ + starts_[width_];
    std::sort(to_, end);
    parts_[0].repeated = std::adjacent_find(to_, end) != end;
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
      repeated = repeated || std::adjacent_find(begin, end) != end;
    }
    return repeated;
  }

  Point* to_;
  std::size_t half_;
  unsigned width_;
  bool threads_;
  Part parts_[2];
  std::array<std::size_t, MOST + 1> starts_;
};

}  // namespace dynhull
