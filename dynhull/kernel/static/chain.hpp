// Convex chains of sorted points.
#pragma once

#include <span>

#include "../predicates/signs.hpp"

namespace dynhull {

// A chain of strict left turns, built in memory of the caller: a hull's lower chain from left to right, or its upper
// chain from right to left.
class Chain {
 public:
  explicit Chain(Point* memory) : memory_(memory) {}

  void push(Point p) {
    if (size_ > 0 && memory_[size_ - 1] == p) return;
    while (size_ > 1 && orientation(memory_[size_ - 2], memory_[size_ - 1], p) <= 0) --size_;
    memory_[size_++] = p;
  }
  Point* begin() const { return memory_; }
  Point* end() const { return memory_ + size_; }

 private:
  Point* memory_;
  std::size_t size_ = 0;
};

}  // namespace dynhull
