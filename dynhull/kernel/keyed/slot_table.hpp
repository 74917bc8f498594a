// A hash table from tags to slot numbers.
//
// An entry holds a slot number and the 32-bit tag of what the slot is found by: its key, or its place. The caller
// compares the slot itself.
#pragma once

#include "../memory/open_table.hpp"

namespace dynhull {

class SlotTable {
  struct Entry {
    std::uint32_t slot, hash;

    std::uint32_t tag() const { return hash; }
    bool is_free() const { return slot == NONE; }
    void make_free() { slot = NONE; }
  };

  static auto has(std::uint32_t tag) {
    return [tag](const Entry& entry) { return entry.hash == tag; };
  }

 public:
  std::size_t size() const { return table_.size(); }
  std::size_t bytes() const { return table_.bytes(); }
  void fetch(std::uint32_t tag) const { table_.fetch(tag); }

  // The position of the first entry with this tag, or NONE; of the next one after `at`.
  std::uint32_t first(std::uint32_t tag) const { return table_.first(tag, has(tag)); }
  std::uint32_t next(std::uint32_t at, std::uint32_t tag) const { return table_.next(at, has(tag)); }

  // The position of the entry with this tag whose slot satisfies `wanted`, or NONE.
  template <class Wanted>
  std::uint32_t find(std::uint32_t tag, Wanted wanted) const {
    return table_.first(tag, [&](const Entry& entry) { return entry.hash == tag && wanted(entry.slot); });
  }

  std::uint32_t slot(std::uint32_t at) const { return table_[at].slot; }
  void set_slot(std::uint32_t at, std::uint32_t slot) { table_[at].slot = slot; }

  // Makes room for `extra` more entries. Only this function and the copy constructor throw.
  void reserve(std::size_t extra) { table_.reserve(extra); }
  void insert(std::uint32_t tag, std::uint32_t slot) { table_.insert({slot, tag}); }
  void erase(std::uint32_t at) { table_.erase(at); }
  void swap(SlotTable& other) noexcept { table_.swap(other.table_); }

 private:
  OpenTable<Entry> table_;
};

}  // namespace dynhull
