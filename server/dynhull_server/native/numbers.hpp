// A dictionary of integers without an object for each.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>

#include "../../../dynhull/kernel/memory/open_table.hpp"

namespace dynhull_server {

class Numbers {
 public:
  std::size_t size() const { return table_.size(); }

  // Where the value of a key is; null if it is not there.
  const std::int64_t* find(std::int64_t key) const {
    const std::uint32_t at = position(key);
    return at == dynhull::NONE ? nullptr : &table_[at].value;
  }
  void set(std::int64_t key, std::int64_t value) {
    if (key == FREE) throw std::invalid_argument("a number that no fence has");
    const std::uint32_t at = position(key);
    if (at != dynhull::NONE) {
      table_[at].value = value;
      return;
    }
    table_.reserve(1);
    table_.insert({key, value});
  }
  // Makes room for `extra` more keys: those of another table come in the order of this one, and would all begin where
  // it is small.
  void reserve(std::size_t extra) { table_.reserve(extra); }
  // Returns the value, if it was there.
  std::optional<std::int64_t> take(std::int64_t key) {
    const std::uint32_t at = position(key);
    if (at == dynhull::NONE) return {};
    const std::int64_t value = table_[at].value;
    table_.erase(at);
    return value;
  }
  template <class Visit>
  void for_each(Visit visit) const {
    table_.for_each([&](const Entry& entry) { visit(entry.key, entry.value); });
  }

 private:
  static constexpr std::int64_t FREE = std::numeric_limits<std::int64_t>::min();

  struct Entry {
    std::int64_t key, value;

    std::uint32_t tag() const { return tag_of(key); }
    bool is_free() const { return key == FREE; }
    void make_free() { key = FREE; }
  };

  static std::uint32_t tag_of(std::int64_t key) {
    return static_cast<std::uint32_t>(static_cast<std::uint64_t>(key) * 0x9e3779b97f4a7c15 >> 32);
  }
  std::uint32_t position(std::int64_t key) const {
    return table_.first(tag_of(key), [key](const Entry& entry) { return entry.key == key; });
  }

  dynhull::OpenTable<Entry> table_;
};

}  // namespace dynhull_server
