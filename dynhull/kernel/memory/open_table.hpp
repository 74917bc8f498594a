// A hash table with open addressing, for plain entries.
//
// The caller compares what it looks for with the entries. An entry's home is its tag, a hash of 32 bits, times the
// capacity, divided by 2^32, so any capacity will do, and growth reads the table alone. Linear probing; a removal moves
// later entries back, so that there are no tombstones.
#pragma once

#include <type_traits>
#include <utility>

#include "../tree/leaf.hpp"
#include "pages.hpp"

namespace dynhull {

// `Entry` has `tag()`, `is_free()` and `make_free()`.
template <class Entry>
class OpenTable {
  static_assert(std::is_trivially_copyable_v<Entry>);

 public:
  OpenTable() = default;
  OpenTable(OpenTable&& other) noexcept { swap(other); }
  OpenTable(const OpenTable& other) {
    if (other.capacity_ == 0) return;
    allocate(other.capacity_);
    std::copy_n(other.entries_, capacity_, entries_);
    size_ = other.size_;
  }
  OpenTable& operator=(OpenTable&& other) noexcept {
    swap(other);
    return *this;
  }
  ~OpenTable() { memory::release(entries_, bytes_for(capacity_)); }

  std::size_t size() const { return size_; }
  std::size_t bytes() const { return bytes_for(capacity_); }

  void fetch(std::uint32_t tag) const {
    if (capacity_ > 0) prefetch(entries_ + home(tag));
  }

  // The position of the first entry with this home or a later one that satisfies `wanted`, or NONE; of the next one
  // after `at`.
  template <class Wanted>
  std::uint32_t first(std::uint32_t tag, Wanted wanted) const {
    return capacity_ > 0 ? from(home(tag), wanted) : NONE;
  }
  template <class Wanted>
  std::uint32_t next(std::uint32_t at, Wanted wanted) const {
    return from(after(at), wanted);
  }

  Entry& operator[](std::uint32_t at) { return entries_[at]; }
  const Entry& operator[](std::uint32_t at) const { return entries_[at]; }

  template <class Visit>
  void for_each(Visit visit) const {
    for (std::uint32_t at = 0; at < capacity_; ++at)
      if (!entries_[at].is_free()) visit(entries_[at]);
  }

  // Makes room for `extra` more entries. Only this function and the copy constructor throw.
  void reserve(std::size_t extra) {
    const std::size_t needed = size_ + extra;
    if (needed <= most(capacity_)) return;
    const std::size_t capacity = std::max(needed + needed / 3 + SPARE, std::size_t{capacity_} + capacity_ / 4);
    if (capacity >= NONE) throw std::bad_alloc();
    OpenTable larger;
    larger.allocate(static_cast<std::uint32_t>(capacity));
    for_each([&](const Entry& entry) { larger.insert(entry); });
    swap(larger);
  }

  void insert(const Entry& entry) {
    std::uint32_t at = home(entry.tag());
    while (!entries_[at].is_free()) at = after(at);
    entries_[at] = entry;
    ++size_;
  }

  void erase(std::uint32_t hole) {
    for (std::uint32_t at = after(hole); !entries_[at].is_free(); at = after(at)) {
      if (distance(home(entries_[at].tag()), at) < distance(hole, at)) continue;  // its home is past the hole
      entries_[hole] = entries_[at];
      hole = at;
    }
    entries_[hole].make_free();
    --size_;
  }

  void swap(OpenTable& other) noexcept {
    std::swap(entries_, other.entries_);
    std::swap(capacity_, other.capacity_);
    std::swap(size_, other.size_);
  }

 private:
  static constexpr std::size_t SPARE = 8;

  // Three quarters: one entry at least is free, which ends every search.
  static std::size_t most(std::uint32_t capacity) { return std::size_t{capacity} - (capacity + 3) / 4; }
  static std::size_t bytes_for(std::uint32_t capacity) { return memory::whole_pages(capacity * sizeof(Entry)); }

  void allocate(std::uint32_t capacity) {
    entries_ = static_cast<Entry*>(memory::resize(nullptr, 0, bytes_for(capacity)));
    capacity_ = capacity;
    for (std::uint32_t at = 0; at < capacity; ++at) entries_[at].make_free();
  }

  std::uint32_t home(std::uint32_t tag) const {
    return static_cast<std::uint32_t>(std::uint64_t{tag} * capacity_ >> 32);
  }
  std::uint32_t after(std::uint32_t at) const { return at + 1 < capacity_ ? at + 1 : 0; }
  std::uint32_t distance(std::uint32_t from, std::uint32_t to) const {
    return to >= from ? to - from : to + capacity_ - from;
  }
  template <class Wanted>
  std::uint32_t from(std::uint32_t at, Wanted wanted) const {
    for (; !entries_[at].is_free(); at = after(at))
      if (wanted(entries_[at])) return at;
    return NONE;
  }

  Entry* entries_ = nullptr;
  std::uint32_t capacity_ = 0;
  std::size_t size_ = 0;
};

}  // namespace dynhull
