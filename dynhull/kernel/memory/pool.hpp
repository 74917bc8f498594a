// A growing array of plain records. Its memory moves without a copy where the system supports that.
#pragma once

#include <type_traits>
#include <utility>

#include "pages.hpp"

namespace dynhull {

// Hands out slots by number, freed ones first. Only `reserve` and the copy constructor throw.
template <class Record>
class Pool {
  static_assert(std::is_trivially_copyable_v<Record> && sizeof(Record) >= sizeof(std::uint32_t));

 public:
  Pool() = default;
  Pool(Pool&& other) noexcept { swap(other); }
  Pool(const Pool& other) : used_(other.used_), freed_(other.freed_), free_(other.free_), last_(other.last_) {
    if (used_ == 0) return;
    data_ = static_cast<Record*>(memory::resize(nullptr, 0, whole_pages(used_)));
    capacity_ = used_;
    std::copy_n(other.data_, used_, data_);
  }
  Pool& operator=(Pool&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Pool() { memory::release(data_, bytes()); }

  Record& operator[](std::uint32_t i) { return data_[i]; }
  const Record& operator[](std::uint32_t i) const { return data_[i]; }

  // Makes room for `extra` more records, so that as many calls of take() succeed. The first room is what is
  // needed: many trees never grow. Later it grows by at least an eighth, and a small pool to half as much again as
  // needed, because moving memory costs more than untouched memory.
  void reserve(std::size_t extra) {
    const std::size_t needed = used_ + extra;
    if (needed <= capacity_ + freed_) return;
    std::size_t capacity = std::max<std::size_t>({needed - freed_, std::size_t{capacity_} + capacity_ / 8, 2});
    if (capacity_ > 0 && capacity < SMALL) capacity += capacity / 2;
    if (capacity >= NOWHERE / 2) throw std::bad_alloc();
    capacity = whole_pages(capacity) / sizeof(Record);
    data_ = static_cast<Record*>(memory::resize(data_, bytes(), whole_pages(capacity)));
    capacity_ = static_cast<std::uint32_t>(capacity);
  }

  std::uint32_t take() {
    if (freed_ == 0) return used_++;
    --freed_;
    const std::uint32_t i = free_;
    free_ = link(i);
    return i;
  }

  void give_back(std::uint32_t i) {
    link(i) = free_;
    if (freed_++ == 0) last_ = i;
    free_ = i;
  }

  // `count` free slots, as a pool of its own over the same records: another thread takes and gives back its own slots,
  // while this one does too. Needs room for them. `take_back` ends that.
  Pool lend(std::size_t count) {
    Pool lent;
    lent.data_ = data_;
    if (count > 0 && freed_ > 0) {
      lent.free_ = lent.last_ = free_;
      lent.freed_ = static_cast<std::uint32_t>(std::min<std::size_t>(count, freed_));
      for (std::uint32_t i = 1; i < lent.freed_; ++i) lent.last_ = link(lent.last_);
      free_ = link(lent.last_);
      freed_ -= lent.freed_;
    }
    lent.used_ = used_;
    used_ += static_cast<std::uint32_t>(count - lent.freed_);
    lent.capacity_ = used_;
    return lent;
  }
  void take_back(Pool& lent) {
    if (used_ == lent.capacity_)
      used_ = lent.used_;
    else
      while (lent.used_ < lent.capacity_) lent.give_back(lent.used_++);
    if (lent.freed_ > 0) {
      if (freed_ == 0)
        last_ = lent.last_;
      else
        link(lent.last_) = free_;
      free_ = lent.free_;
      freed_ += lent.freed_;
    }
    lent.data_ = nullptr;
    lent.capacity_ = 0;
  }

  std::size_t used() const { return used_ - freed_; }
  std::uint32_t end() const { return used_; }  // greater than the number of every slot in use
  std::size_t reserved_bytes() const { return bytes(); }

  void swap(Pool& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
    std::swap(used_, other.used_);
    std::swap(freed_, other.freed_);
    std::swap(free_, other.free_);
    std::swap(last_, other.last_);
  }

 private:
  static constexpr std::uint32_t NOWHERE = ~std::uint32_t{0};
  static constexpr std::size_t SMALL = (std::size_t{1} << 20) / sizeof(Record);

  static std::size_t whole_pages(std::size_t capacity) { return memory::mostly_huge_pages(capacity * sizeof(Record)); }
  std::size_t bytes() const { return whole_pages(capacity_); }
  std::uint32_t& link(std::uint32_t i) { return reinterpret_cast<std::uint32_t&>(data_[i]); }

  Record* data_ = nullptr;
  std::uint32_t capacity_ = 0, used_ = 0, freed_ = 0;
  std::uint32_t free_ = NOWHERE, last_ = NOWHERE;  // the first and the last of the freed slots
};

}  // namespace dynhull
