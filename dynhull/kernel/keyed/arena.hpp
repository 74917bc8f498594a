// The bytes of string keys, one after the other. Those of removed keys are garbage until the arena is compacted.
#pragma once

#include <cstring>
#include <string_view>
#include <utility>

#include "../memory/pages.hpp"

namespace dynhull {

// Where a string is in the arena: its place in the upper 56 bits, its length in the lowest 8.
using Interned = std::uint64_t;

// Only `reserve`, `compacted` and the copy constructor throw.
class Arena {
 public:
  Arena() = default;
  Arena(Arena&& other) noexcept { swap(other); }
  Arena(const Arena& other) : Arena() {
    if (other.used_ == 0) return;
    grow(other.used_);
    std::memcpy(data_, other.data_, other.used_);
    used_ = other.used_;
    garbage_ = other.garbage_;
  }
  Arena& operator=(Arena&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Arena() { memory::release(data_, capacity_); }

  const char* at(Interned string) const { return data_ + (string >> LENGTH_BITS); }
  static std::size_t length(Interned string) { return string & LONGEST; }
  std::string_view operator[](Interned string) const { return {at(string), length(string)}; }

  // Makes room for as many bytes more.
  void reserve(std::size_t extra) {
    if (used_ + extra > capacity_) grow(std::max(used_ + extra, capacity_ + capacity_ / 8));
  }
  // Whether it would have to grow, and half of it is garbage.
  bool worth_compacting(std::size_t extra) const { return used_ + extra > capacity_ && garbage_ > used_ / 2; }
  // An arena with room for the living strings and as many bytes more, for the caller to fill.
  Arena compacted(std::size_t extra) const {
    Arena fresh;
    fresh.grow(used_ - garbage_ + std::max(extra, used_ / 8));
    return fresh;
  }

  Interned add(std::string_view string) {
    std::memcpy(data_ + used_, string.data(), string.size());
    const Interned interned = std::uint64_t{used_} << LENGTH_BITS | string.size();
    used_ += string.size();
    return interned;
  }
  void remove(Interned string) { garbage_ += length(string); }

  std::size_t living() const { return used_ - garbage_; }
  std::size_t bytes() const { return capacity_; }

  void swap(Arena& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
    std::swap(used_, other.used_);
    std::swap(garbage_, other.garbage_);
  }

 private:
  static constexpr unsigned LENGTH_BITS = 8;
  static constexpr std::uint64_t LONGEST = (1 << LENGTH_BITS) - 1;

  void grow(std::size_t bytes) {
    const std::size_t capacity = memory::whole_pages(bytes);
    data_ = static_cast<char*>(memory::resize(data_, capacity_, capacity));
    capacity_ = capacity;
  }

  char* data_ = nullptr;
  std::size_t capacity_ = 0, used_ = 0, garbage_ = 0;
};

}  // namespace dynhull
