// The keys of a batch, integers or packed strings, and how a slot stores them.
#pragma once

#include "../memory/hash.hpp"
#include "../memory/scratch.hpp"
#include "../tree/leaf.hpp"
#include "arena.hpp"

namespace dynhull {

// Integers, copied so that no other thread can change them between hashing and storing. A slot stores the key itself.
class IntegerKeys {
 public:
  IntegerKeys(const std::uint64_t* keys, std::size_t count) : count_(count), keys_(count) {
    std::copy_n(keys, count, keys_.data());
  }

  std::size_t size() const { return count_; }
  std::uint32_t tag(std::size_t row) const { return Hash::of(keys_[row]); }
  void fetch(const Arena&, std::uint64_t) const {}
  bool same(const Arena&, std::size_t row, std::uint64_t stored) const { return keys_[row] == stored; }
  std::size_t bytes(std::size_t) const { return 0; }
  std::uint64_t store(Arena&, std::size_t row) const { return keys_[row]; }
  std::string_view bytes_of(std::size_t row) const {
    return {reinterpret_cast<const char*>(keys_.data() + row), sizeof keys_[row]};
  }

 private:
  std::size_t count_;
  Scratch<std::uint64_t> keys_;
};

// Strings of 1 to 255 bytes, one after the other, which nobody changes. A slot stores where the arena has the key.
class StringKeys {
 public:
  StringKeys(const std::uint8_t* lengths, const char* data, std::size_t count)
      : lengths_(lengths), data_(data), count_(count), starts_(count) {
    std::uint64_t start = 0;
    for (std::size_t i = 0; i < count; start += lengths[i++]) starts_[i] = start;
  }

  std::size_t size() const { return count_; }
  std::uint32_t tag(std::size_t row) const { return Hash::of((*this)[row]); }
  void fetch(const Arena& arena, std::uint64_t stored) const { prefetch(arena.at(stored)); }
  bool same(const Arena& arena, std::size_t row, std::uint64_t stored) const {
    return Arena::length(stored) == lengths_[row] &&
           std::memcmp(arena.at(stored), data_ + starts_[row], lengths_[row]) == 0;
  }
  std::size_t bytes(std::size_t row) const { return lengths_[row]; }
  std::uint64_t store(Arena& arena, std::size_t row) const { return arena.add((*this)[row]); }

  std::string_view bytes_of(std::size_t row) const { return (*this)[row]; }
  std::string_view operator[](std::size_t row) const { return {data_ + starts_[row], lengths_[row]}; }

 private:
  const std::uint8_t* lengths_;
  const char* data_;
  std::size_t count_;
  Scratch<std::uint64_t> starts_;
};

}  // namespace dynhull
