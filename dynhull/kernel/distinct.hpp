// The distinct among some points.
#pragma once

#include <algorithm>
#include <span>

#include "column_sort.hpp"

namespace dynhull {

struct Repeated {
  std::size_t number;
  std::uint64_t copies;
};

// Sorted, each once, and which of them are there more than once.
class Distinct {
 public:
  Distinct(const Point* points, std::size_t count)
      : count_(count), points_(count), repeated_(count / 2 + 1) {  // one is written before it is known whether to stay
    finite_ = ColumnSort(points, points_.data(), count, two_threads_for(count)).run();
    if (!finite_) return;
    Point* const end = points_.data() + count;
    size_ = static_cast<std::size_t>(std::adjacent_find(points_.data(), end) - points_.data());
    std::uint64_t copies = 0;
    for (const Point* next = points_.data() + size_; next < end; ++next) {  // no branches: copies are as good as random
      const bool last = next + 1 == end || !(next[1] == *next);
      ++copies;
      points_[size_] = *next;
      repeated_[repeated_size_] = {size_, copies};
      size_ += last;
      repeated_size_ += last & (copies > 1);
      copies = last ? 0 : copies;
    }
  }

  bool finite() const { return finite_; }  // false: a coordinate is not, and nothing else holds
  const Point* data() const { return points_.data(); }
  std::size_t size() const { return size_; }
  std::size_t count() const { return count_; }  // with copies
  std::span<const Repeated> repeated() const { return {repeated_.data(), repeated_size_}; }

 private:
  std::size_t count_;
  Buffer<Point> points_;
  Buffer<Repeated> repeated_;
  std::size_t size_ = 0, repeated_size_ = 0;
  bool finite_ = true;
};

}  // namespace dynhull
