// An open-addressing table from tags to slot numbers.
//
// An entry holds a slot number and the 32-bit tag of what the slot is found by: its key, or its place. The caller
// compares the slot itself. An entry's home is its tag times the capacity, divided by 2^32, so any capacity will do,
// and growth reads the table alone. Linear probing; a removal moves later entries back, so that there are no
// tombstones.
#pragma once

#include <cstring>
#include <utility>

#include "../memory/pages.hpp"
#include "../tree/leaf.hpp"

namespace dynhull {

class SlotTable {
 public:
  SlotTable() = default;
  SlotTable(SlotTable&& other) noexcept { swap(other); }
  SlotTable(const SlotTable& other) {
    if (other.capacity_ == 0) return;
    allocate(other.capacity_);
    std::copy_n(other.entries_, capacity_, entries_);
    size_ = other.size_;
  }
  SlotTable& operator=(SlotTable&& other) noexcept {
    swap(other);
    return *this;
  }
  ~SlotTable() { memory::release(entries_, bytes_for(capacity_)); }

  std::size_t size() const { return size_; }
  std::size_t bytes() const { return bytes_for(capacity_); }

  void fetch(std::uint32_t tag) const {
    if (capacity_ > 0) prefetch(entries_ + home(tag));
  }

  // The position of the first entry with this tag, or NONE; of the next one after `at`.
  std::uint32_t first(std::uint32_t tag) const { return capacity_ > 0 ? from(home(tag), tag) : NONE; }
  std::uint32_t next(std::uint32_t at, std::uint32_t tag) const { return from(after(at), tag); }

  // The position of the entry with this tag whose slot satisfies `wanted`, or NONE.
  template <class Wanted>
  std::uint32_t find(std::uint32_t tag, Wanted wanted) const {
    std::uint32_t at = first(tag);
    while (at != NONE && !wanted(entries_[at].slot)) at = next(at, tag);
    return at;
  }

  std::uint32_t slot(std::uint32_t at) const { return entries_[at].slot; }
  void set_slot(std::uint32_t at, std::uint32_t slot) { entries_[at].slot = slot; }

  // Makes room for `extra` more entries. Only this function and the copy constructor throw.
  void reserve(std::size_t extra) {
    const std::size_t needed = size_ + extra;
    if (needed <= most(capacity_)) return;
    const std::size_t capacity = std::max(needed + needed / 3 + SPARE, std::size_t{capacity_} + capacity_ / 4);
    if (capacity >= NONE) throw std::bad_alloc();
    SlotTable larger;
    larger.allocate(static_cast<std::uint32_t>(capacity));
    for (std::uint32_t at = 0; at < capacity_; ++at)
      if (entries_[at].slot != NONE) larger.insert(entries_[at].tag, entries_[at].slot);
    swap(larger);
  }

  void insert(std::uint32_t tag, std::uint32_t slot) {
    std::uint32_t at = home(tag);
    while (entries_[at].slot != NONE) at = after(at);
    entries_[at] = {slot, tag};
    ++size_;
  }

  void erase(std::uint32_t hole) {
    for (std::uint32_t at = after(hole); entries_[at].slot != NONE; at = after(at)) {
      if (distance(home(entries_[at].tag), at) < distance(hole, at)) continue;  // its home is past the hole
      entries_[hole] = entries_[at];
      hole = at;
    }
    entries_[hole].slot = NONE;
    --size_;
  }

  void swap(SlotTable& other) noexcept {
    std::swap(entries_, other.entries_);
    std::swap(capacity_, other.capacity_);
    std::swap(size_, other.size_);
  }

 private:
  struct Entry {
    std::uint32_t slot, tag;
  };
  static constexpr std::size_t SPARE = 8;

  // Three quarters: one entry at least is free, which ends every search.
  static std::size_t most(std::uint32_t capacity) { return std::size_t{capacity} - (capacity + 3) / 4; }
  static std::size_t bytes_for(std::uint32_t capacity) { return memory::whole_pages(capacity * sizeof(Entry)); }

  void allocate(std::uint32_t capacity) {
    entries_ = static_cast<Entry*>(memory::resize(nullptr, 0, bytes_for(capacity)));
    capacity_ = capacity;
    for (std::uint32_t at = 0; at < capacity; ++at) entries_[at].slot = NONE;
  }

  std::uint32_t home(std::uint32_t tag) const {
    return static_cast<std::uint32_t>(std::uint64_t{tag} * capacity_ >> 32);
  }
  std::uint32_t after(std::uint32_t at) const { return at + 1 < capacity_ ? at + 1 : 0; }
  std::uint32_t distance(std::uint32_t from, std::uint32_t to) const {
    return to >= from ? to - from : to + capacity_ - from;
  }
  std::uint32_t from(std::uint32_t at, std::uint32_t tag) const {
    while (entries_[at].tag != tag || entries_[at].slot == NONE) {
      if (entries_[at].slot == NONE) return NONE;
      at = after(at);
    }
    return at;
  }

  Entry* entries_ = nullptr;
  std::uint32_t capacity_ = 0;
  std::size_t size_ = 0;
};

}  // namespace dynhull
