// Sorting many points, by two threads or one: in columns of x, each of which fits the processor's cache while it is
// sorted.
#pragma once

#include "sort.hpp"
#include "store.hpp"
#include "threads.hpp"

namespace dynhull {

// From one place into another, in which negative zeros become positive. It stays in its bounds even where the points
// change meanwhile.
class ColumnSort {
 public:
  ColumnSort(const Point* from, Point* to, std::size_t count, bool threads)
      : to_(to),
        half_(count / 2),
        width_(static_cast<unsigned>(std::min(count / A_COLUMN + 1, MOST))),
        threads_(threads),
        parts_{{from, half_}, {from + half_, count - half_}} {}

  // False where a coordinate is not finite: then they are not sorted.
  bool run() {
    choose_columns();
    place();
    if (!parts_[0].finite || !parts_[1].finite) return false;
    const auto middle = std::lower_bound(starts_.begin(), starts_.begin() + width_, half_) - starts_.begin();
    const auto cut = static_cast<unsigned>(middle);
    both(threads_, [&] { sort(0, cut); }, [&] { sort(cut, width_); });
    return true;
  }

 private:
  static constexpr std::size_t MOST = 256, A_COLUMN = 2048;

  // Of the points as they come in, for one thread.
  struct Part {
    const Point* points;
    std::size_t count;
    Range range = {};
    Buffer<std::uint16_t> columns{count};     // of each point
    std::array<std::size_t, MOST> next = {};  // how many points each column has, then where its next one goes
    bool finite = true;
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
      for (std::size_t i = 0; i < part.count; ++i) {
        const Point p = {part.points[i].x + 0.0, part.points[i].y + 0.0};
        part.finite &= (p.x - p.x == 0) & (p.y - p.y == 0);
        to_[part.next[part.columns[i]]++] = p;
      }
    });
  }

  // Sort each of the columns first..last.
  void sort(unsigned first, unsigned last) const {
    const auto size = [&](unsigned column) { return starts_[column + 1] - starts_[column]; };
    std::size_t most = 0;
    for (unsigned column = first; column < last; ++column) most = std::max(most, size(column));
    const Buffer<Point> scratch(most);
    for (unsigned column = first; column < last; ++column)
      sort_by_point(to_ + starts_[column], scratch.data(), size(column));
  }

  Point* to_;
  std::size_t half_;
  unsigned width_;
  bool threads_;
  Part parts_[2];
  std::array<std::size_t, MOST + 1> starts_;
};

}  // namespace dynhull
