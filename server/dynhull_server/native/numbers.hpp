// A dictionary of integers without an object for each: open addressing with linear probing.
#pragma once

#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace dynhull_server {

class Numbers {
 public:
  Numbers() = default;
  // With room for that many.
  explicit Numbers(std::size_t count) {
    if (count > 0) allocate(std::bit_ceil(count + count / 2 + 1));
  }

  std::size_t size() const { return size_; }

  // Where the value of a key is; null if it is not there.
  const std::int64_t* find(std::int64_t key) const {
    if (size_ == 0) return nullptr;
    const Entry& entry = entries_[place_of(key)];
    return entry.key == key && key != FREE ? &entry.value : nullptr;
  }
  void set(std::int64_t key, std::int64_t value) {
    if (key == FREE) throw std::invalid_argument("a number that no fence has");
    if (4 * (size_ + 1) > 3 * entries_.size()) grow();
    Entry& entry = entries_[place_of(key)];
    size_ += entry.key == FREE;
    entry = {key, value};
  }
  // Returns the value, if it was there.
  std::optional<std::int64_t> take(std::int64_t key) {
    const std::int64_t* const found = find(key);
    if (!found) return {};
    const std::int64_t value = *found;
    std::size_t hole = place_of(key);
    // Those behind it move up, unless their home is behind the hole.
    for (std::size_t at = next(hole); entries_[at].key != FREE; at = next(at))
      if (((at - home(entries_[at].key)) & mask()) >= ((at - hole) & mask()))
        entries_[std::exchange(hole, at)] = entries_[at];
    entries_[hole] = Entry();
    --size_;
    return value;
  }
  template <class Visit>
  void for_each(Visit visit) const {
    for (const Entry& entry : entries_)
      if (entry.key != FREE) visit(entry.key, entry.value);
  }

 private:
  static constexpr std::int64_t FREE = std::numeric_limits<std::int64_t>::min();

  struct Entry {
    std::int64_t key = FREE, value = 0;
  };

  std::size_t mask() const { return entries_.size() - 1; }
  std::size_t next(std::size_t at) const { return (at + 1) & mask(); }
  std::size_t home(std::int64_t key) const {
    return static_cast<std::size_t>(static_cast<std::uint64_t>(key) * 0x9e3779b97f4a7c15 >> shift_);
  }
  // Of a key, or the free place for it.
  std::size_t place_of(std::int64_t key) const {
    std::size_t at = home(key);
    while (entries_[at].key != key && entries_[at].key != FREE) at = next(at);
    return at;
  }
  void allocate(std::size_t room) {
    entries_.assign(room, Entry());
    shift_ = 64 - std::countr_zero(room);
  }
  void grow() {
    Numbers larger(std::max<std::size_t>(entries_.size(), 4));
    for_each([&](std::int64_t key, std::int64_t value) { larger.set(key, value); });
    std::swap(*this, larger);
  }

  std::vector<Entry> entries_;  // a power of two; a quarter of them is free
  std::size_t size_ = 0;
  int shift_ = 0;
};

}  // namespace dynhull_server
