// Multiplicities: the number of copies of each point that the tree holds more than once.
#pragma once

#include "../memory/hash.hpp"
#include "../memory/open_table.hpp"
#include "place.hpp"

namespace dynhull {

class Copies {
 public:
  std::size_t size() const { return table_.size(); }  // points
  std::size_t bytes() const { return table_.bytes(); }
  void fetch(Point p) const { table_.fetch(Hash::of(p)); }

  // The number of copies of a point that has an entry.
  std::uint64_t operator[](Point p) const { return table_[find(p)].copies; }

  // Makes room for `extra` more points. Only this function and the copy constructor throw.
  void reserve(std::size_t extra) { table_.reserve(extra); }

  // Changes a point's number from `before` to `after`; less than two have no entry. Needs room for an entry.
  void set(Point p, std::uint64_t before, std::uint64_t after) {
    if (before < 2 && after < 2) return;
    if (before < 2)
      table_.insert({p, after});
    else if (after < 2)
      table_.erase(find(p));
    else
      table_[find(p)].copies = after;
  }

  template <class Visit>
  void for_each(Visit visit) const {
    table_.for_each([&](const Entry& entry) { visit(entry.p); });
  }

 private:
  struct Entry {
    Point p;
    std::uint64_t copies;

    std::uint32_t tag() const { return Hash::of(p); }
    bool is_free() const { return copies == 0; }
    void make_free() { copies = 0; }
  };

  std::uint32_t find(Point p) const {
    return table_.first(Hash::of(p), [p](const Entry& entry) { return entry.p == p; });
  }

  OpenTable<Entry> table_;
};

}  // namespace dynhull
