// Strict chains from points in order.
#pragma once

#include <span>

#include "predicates.hpp"

namespace dynhull {

// The strict chains of a hull, from left to right.
struct Chains {
  std::span<const Point> lower, upper;
};

// A chain that is pushed from left to right, into memory that the caller has.
class Chain {
 public:
  Chain(Side side, Point* memory) : side_(side), memory_(memory) {}

  void push(Point p) {
    if (size_ > 0 && memory_[size_ - 1] == p) return;
    while (size_ > 1 && turned(side_, orientation(memory_[size_ - 2], memory_[size_ - 1], p)) >= 0) --size_;
    memory_[size_++] = p;
  }
  std::span<const Point> points() const { return {memory_, size_}; }

 private:
  Side side_;
  Point* memory_;
  std::size_t size_ = 0;
};

}  // namespace dynhull
