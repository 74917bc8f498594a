// What an index of fences knows of each subject, by slot number, and lists of the fences that a subject is inside of.
#pragma once

#include <utility>
#include <vector>

#include "../memory/pages.hpp"
#include "safe_box.hpp"

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
  std::uint32_t zone = NONE, at = 0;  // the zone that lists it, and where; NONE if none does
  std::uint32_t changed = 0;          // its number in the list of changes, plus a base
  Members inside;
};

// Items by slot number. Grows without a copy where the system supports that.
template <class Item>
class SlotArray {
 public:
  SlotArray() = default;
  SlotArray(const SlotArray&) = delete;
  ~SlotArray() { memory::release(data_, bytes()); }

  Item& operator[](std::size_t slot) { return data_[slot]; }
  const Item& operator[](std::size_t slot) const { return data_[slot]; }
  std::size_t bytes() const { return memory::whole_pages(capacity_ * sizeof(Item)); }

  void reserve(std::size_t end) {
    if (end <= capacity_) return;
    const std::size_t larger = memory::whole_pages(std::max(end, capacity_ + capacity_ / 8) * sizeof(Item));
    data_ = static_cast<Item*>(memory::resize(data_, bytes(), larger));
    capacity_ = larger / sizeof(Item);
  }

 private:
  Item* data_ = nullptr;
  std::size_t capacity_ = 0;
};

// Subjects by slot number. The boxes are apart, as most moves look at nothing else.
class Subjects {
 public:
  Subject& operator[](std::uint32_t slot) { return subjects_[slot]; }
  const Subject& operator[](std::uint32_t slot) const { return subjects_[slot]; }
  SafeBox& box(std::uint32_t slot) { return boxes_[slot]; }
  const SafeBox& box(std::uint32_t slot) const { return boxes_[slot]; }
  std::size_t size() const { return size_; }
  std::size_t bytes() const { return boxes_.bytes() + subjects_.bytes(); }

  // Makes room for slots below `end`, which are subjects of nothing yet. Only this throws.
  void reserve(std::size_t end) {
    if (end <= size_) return;
    boxes_.reserve(end);
    subjects_.reserve(end);
    for (; size_ < end; ++size_) begin(static_cast<std::uint32_t>(size_));
  }
  void begin(std::uint32_t slot) {
    boxes_[slot] = SafeBox::everywhere();
    subjects_[slot] = Subject{};
  }

 private:
  SlotArray<SafeBox> boxes_;
  SlotArray<Subject> subjects_;
  std::size_t size_ = 0;
};

}  // namespace dynhull
