// A queue of plain records in one block of memory.
#pragma once

#include <type_traits>

#include "../memory/pages.hpp"

namespace dynhull {

// Only `reserve` and the copy constructor throw.
template <class Record>
class Queue {
  static_assert(std::is_trivially_copyable_v<Record>);

 public:
  Queue() = default;
  Queue(Queue&& other) noexcept { swap(other); }
  Queue(const Queue& other) {
    reserve(other.size_);
    for (std::size_t i = 0; i < other.size_; ++i) data_[i] = other[i];
    size_ = other.size_;
  }
  Queue& operator=(Queue other) noexcept {
    swap(other);
    return *this;
  }
  ~Queue() { memory::release(data_, bytes(capacity_)); }

  std::size_t size() const { return size_; }
  bool empty() const { return size_ == 0; }
  Record& operator[](std::size_t i) { return data_[slot(i)]; }
  const Record& operator[](std::size_t i) const { return data_[slot(i)]; }
  const Record& back() const { return (*this)[size_ - 1]; }

  // Makes room for `extra` more records. Grows by at least half.
  void reserve(std::size_t extra) {
    if (size_ + extra <= capacity_) return;
    const std::size_t capacity = bytes(std::max(size_ + extra, capacity_ + capacity_ / 2)) / sizeof(Record);
    data_ = static_cast<Record*>(memory::resize(data_, bytes(capacity_), bytes(capacity)));
    if (head_ + size_ > capacity_) {  // the records at the block's end stay at its end
      const std::size_t moved = capacity - capacity_;
      std::copy_backward(data_ + head_, data_ + capacity_, data_ + capacity);
      head_ += moved;
    }
    capacity_ = capacity;
  }

  // Adds records that were written behind the last one, where `reserve` has made room.
  void extend(std::size_t extra) { size_ += extra; }
  void shrink(std::size_t size) { size_ = size; }
  void pop_front(std::size_t count) {
    head_ = slot(count);
    size_ -= count;
  }
  void clear() { head_ = size_ = 0; }

 private:
  static std::size_t bytes(std::size_t capacity) { return memory::whole_pages(capacity * sizeof(Record)); }
  std::size_t slot(std::size_t i) const {
    const std::size_t slot = head_ + i;
    return slot < capacity_ ? slot : slot - capacity_;
  }

  void swap(Queue& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
    std::swap(head_, other.head_);
    std::swap(size_, other.size_);
  }

  Record* data_ = nullptr;
  std::size_t capacity_ = 0, head_ = 0, size_ = 0;
};

}  // namespace dynhull
