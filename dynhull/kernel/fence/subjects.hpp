// What an index of fences knows of each subject, by slot number, and lists of the fences that a subject is inside of.
#pragma once

#include <utility>
#include <vector>

#include "../memory/pages.hpp"
#include "strips.hpp"

namespace dynhull {

// Two fences in place, or the number of a longer list.
struct Members {
  static constexpr std::uint32_t NOBODY = ~std::uint32_t{0}, MANY = NOBODY - 1;

  std::uint32_t first = NOBODY, second = NOBODY;  // if the second is MANY, the first is the number of a list
  bool empty() const { return first == NOBODY && second == NOBODY; }
};

// The longer lists. Only `add` throws.
class MemberLists {
 public:
  std::span<const std::uint32_t> of(const Members& members) const {
    if (members.second == Members::MANY) return lists_[members.first];
    return {&members.first, std::size_t{members.first != Members::NOBODY} + (members.second != Members::NOBODY)};
  }
  bool has(const Members& members, std::uint32_t fence) const {
    const auto all = of(members);
    return std::find(all.begin(), all.end(), fence) != all.end();
  }
  void add(Members& members, std::uint32_t fence) {
    if (members.second == Members::MANY)
      lists_[members.first].push_back(fence);
    else if (members.first == Members::NOBODY)
      members.first = fence;
    else if (members.second == Members::NOBODY)
      members.second = fence;
    else
      lengthen(members, fence);
  }
  void remove(Members& members, std::uint32_t fence) {
    if (members.second == Members::MANY) {
      std::erase(lists_[members.first], fence);
      if (lists_[members.first].size() <= 2) shorten(members);
    } else if (members.second == fence) {
      members.second = Members::NOBODY;
    } else if (members.first == fence) {
      members.first = std::exchange(members.second, Members::NOBODY);
    }
  }
  void clear(Members& members) {
    if (members.second == Members::MANY) lists_[members.first].clear(), shorten(members);
    members = {};
  }
  std::size_t bytes() const {
    std::size_t bytes = lists_.capacity() * sizeof lists_[0];
    for (const auto& list : lists_) bytes += list.capacity() * sizeof(std::uint32_t);
    return bytes;
  }

 private:
  void lengthen(Members& members, std::uint32_t fence) {
    if (free_.empty()) {
      if (free_.capacity() <= lists_.size()) free_.reserve(2 * lists_.size() + 1);
      lists_.emplace_back();
      free_.push_back(static_cast<std::uint32_t>(lists_.size() - 1));
    }
    lists_[free_.back()] = {members.first, members.second, fence};
    members = {free_.back(), Members::MANY};
    free_.pop_back();
  }
  void shorten(Members& members) {
    std::vector<std::uint32_t>& list = lists_[members.first];
    free_.push_back(members.first);  // has room for all
    members = {list.empty() ? Members::NOBODY : list[0], list.size() < 2 ? Members::NOBODY : list[1]};
    list.clear();
  }

  std::vector<std::vector<std::uint32_t>> lists_;
  std::vector<std::uint32_t> free_;
};

struct Subject {
  SafeBox box;
  std::uint32_t zone, at;  // the zone that lists it, and where; NONE if none does
  std::uint32_t changed;   // its number in the list of changes, plus a base
  Members inside;
};

// Subjects by slot number. Grows without a copy where the system supports that.
class Subjects {
 public:
  Subjects() = default;
  Subjects(const Subjects&) = delete;
  ~Subjects() { memory::release(data_, bytes()); }

  Subject& operator[](std::uint32_t slot) { return data_[slot]; }
  const Subject& operator[](std::uint32_t slot) const { return data_[slot]; }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return memory::whole_pages(capacity_ * sizeof(Subject)); }

  // Makes room for slots below `end`, which are subjects of nothing yet.
  void reserve(std::size_t end, const Subject& fresh) {
    if (end <= size_) return;
    if (end > capacity_) {
      const std::size_t capacity = std::max(end, capacity_ + capacity_ / 8);
      const std::size_t larger = memory::whole_pages(capacity * sizeof(Subject));
      data_ = static_cast<Subject*>(memory::resize(data_, bytes(), larger));
      capacity_ = larger / sizeof(Subject);
    }
    for (; size_ < end; ++size_) data_[size_] = fresh;
  }

 private:
  Subject* data_ = nullptr;
  std::size_t capacity_ = 0, size_ = 0;
};

}  // namespace dynhull
