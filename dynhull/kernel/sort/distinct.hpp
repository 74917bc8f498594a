// The distinct points among many, with multiplicities.
#pragma once

#include <span>

#include "column_sort.hpp"

namespace dynhull {

struct Repeated {
  std::size_t number;
  std::uint64_t copies;
};

// The sorted distinct points, and the number of copies of the repeated ones.
class Distinct {
 public:
  Distinct(const Point* points, std::size_t count) : Distinct(points, count, Threads(threads_for(count))) {}
  Distinct(const Point* points, std::size_t count, Threads&& threads)
      : count_(count), size_(count), points_(count), repeated_(count / 2 + 1) {
    const ColumnSort sort(points, points_.data(), count, threads);
    finite_ = sort.finite();
    if (sort.repeated()) count_copies();
  }

  bool finite() const { return finite_; }  // if false, nothing else holds
  const Point* data() const { return points_.data(); }
  std::size_t size() const { return size_; }
  std::size_t count() const { return count_; }  // with copies
  std::span<const Repeated> repeated() const { return {repeated_.data(), repeated_size_}; }

 private:
  // Branch-free, because repetitions are unpredictable: the next entry overwrites those that do not stay.
  void count_copies() {
    const Point* const end = points_.data() + count_;
    std::uint64_t copies = 0;
    size_ = 0;
    for (const Point* next = points_.data(); next < end; ++next) {
      const bool last = next + 1 == end || !(next[1] == *next);
      ++copies;
      points_[size_] = *next;
      repeated_[repeated_size_] = {size_, copies};
      size_ += last;
      repeated_size_ += last & (copies > 1);
      copies = last ? 0 : copies;
    }
  }

  std::size_t count_, size_;
  Scratch<Point> points_;
  Scratch<Repeated> repeated_;
  std::size_t repeated_size_ = 0;
  bool finite_;
};

}  // namespace dynhull
