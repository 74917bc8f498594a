// Items in order of time, filed without a search: 1,024 buckets, and a heap for the open one.
//
// The buckets divide a span of time evenly. Items of the open bucket, and older ones, wait in the heap; items after the
// span wait in one list. When all buckets are empty, they are laid over that list's times anew. So an item is filed
// twice and passes the heap once, which holds about a thousandth of the items: O(1) an item if the times are spread
// evenly, O(log n) if they are not.
#pragma once

#include <array>
#include <vector>

#include "../memory/pool.hpp"
#include "../sort/columns.hpp"

namespace dynhull {

// `Order` knows the items. Its type `Entry` has what the order depends on: the time, as `time`, and what else decides
// between equal times. Functions:
//
//     time(item)     its present time; NaN if the item has left, and the wheel drops it
//     entry(item)    its present entry
//     item(entry)    the inverse
//     current(entry) whether the item still has this entry
//     before(a, b)   the order of two entries of equal times
//
// Times may grow meanwhile: an item that proves younger when its turn comes is filed again. An item whose time shrinks
// must be pushed again; from then on it may come twice. Only `reserve`, `front`, `take_until` and the copy constructor
// throw; all but `take_until` leave every item in its place.
template <class Item, class Order>
class Wheel {
 public:
  using Entry = typename Order::Entry;

  explicit Wheel(Order order = {}) : order_(order) { buckets_.fill(NOWHERE); }

  std::size_t size() const { return size_; }

  // Makes room for `extra` more items.
  void reserve(std::size_t extra) {
    const bool no_span = end_ == -INFINITE;  // the items will be in the list
    const std::size_t heap = no_span ? 0 : heap_.size() + popped_ + extra;
    if (heap > heap_.capacity()) heap_.reserve(std::max(heap, heap_.capacity() + heap_.capacity() / 2));
    reserve_chunks(extra);
  }

  void push(const Item& item) {
    ++size_;
    file(item);
  }

  // The entry of the first item, valid until the next call; nullptr if there is none.
  const Entry* front() {
    for (;;) {
      if (heap_.empty()) {
        if (size_ == 0) return nullptr;
        open_next();
        continue;
      }
      if (order_.current(heap_.front())) return &heap_.front();
      reserve_chunks(1);
      file_first_again();
    }
  }

  // Removes the item that `front` has returned. Its room stays, so that it can be pushed again, until `settle`.
  void pop_front() {
    remove_first();
    --size_;
    ++popped_;
  }
  void settle() { popped_ = 0; }

  // Removes and visits all items with times of at most `until`, in no order. An item of a bucket that ends before
  // `until` does not pass the heap. If this throws, items are lost.
  template <class Visit>
  void take_until(double until, Visit visit) {
    for (;;) {
      while (!heap_.empty() && heap_.front().time <= until) {
        if (!order_.current(heap_.front())) {
          reserve_chunks(1);
          file_first_again();
          continue;
        }
        visit(order_.item(heap_.front()));
        remove_first();
        --size_;
      }
      if (!heap_.empty() || size_ == 0) return;
      const int next = next_bucket(), last = until < end_ ? static_cast<int>(columns_(until)) : BUCKETS;
      if (next == BUCKETS ? later_least_ > until : next > last) return;
      if (next == BUCKETS || next == last)
        open_next();
      else
        take_bucket(next, until, visit);
    }
  }

  // Visits all items, in no order.
  template <class Visit>
  void for_each(Visit visit) const {
    for (const Entry& entry : heap_) visit(order_.item(entry));
    for_each_of(later_, visit);
    for (Number bucket : buckets_) for_each_of(bucket, visit);
  }

  std::size_t bytes() const { return sizeof *this + heap_.capacity() * sizeof(Entry) + chunks_.reserved_bytes(); }

 private:
  using Number = std::uint32_t;
  static constexpr Number NOWHERE = ~Number{0};
  static constexpr int BUCKETS = 1024;
  static constexpr std::size_t CHUNK_BYTES = 240;
  static constexpr Number CHUNK = (CHUNK_BYTES - 2 * sizeof(Number)) / sizeof(Item);

  // Some items of a list, and the next chunk of it.
  struct Chunk {
    Item items[CHUNK];
    Number size, next;
  };

  void reserve_chunks(std::size_t items) { chunks_.reserve(items / CHUNK + std::min<std::size_t>(items, BUCKETS + 1)); }

  void file(const Item& item) {
    const double time = order_.time(item);
    if (std::isnan(time)) {
      --size_;
      return;
    }
    if (time > end_) {
      later_least_ = std::min(later_least_, time);
      later_greatest_ = std::max(later_greatest_, time);
      ++later_size_;
      append(later_, item);
      return;
    }
    const int bucket = static_cast<int>(columns_(time));
    if (bucket > open_ && time >= start_) return append(buckets_[bucket], item);
    heap_.push_back(order_.entry(item));
    std::push_heap(heap_.begin(), heap_.end(), after());
  }

  void append(Number& list, const Item& item) {
    if (list == NOWHERE || chunks_[list].size == CHUNK) {
      const Number chunk = chunks_.take();
      chunks_[chunk].size = 0;
      chunks_[chunk].next = std::exchange(list, chunk);
    }
    Chunk& chunk = chunks_[list];
    chunk.items[chunk.size++] = item;
  }

  // The next bucket that has items; BUCKETS if none has.
  int next_bucket() const {
    int next = open_ + 1;
    while (next < BUCKETS && buckets_[next] == NOWHERE) ++next;
    return next;
  }

  void open_next() {
    const int next = next_bucket();
    if (next == BUCKETS) return lay_buckets();
    std::size_t count = 0;
    for_each_of(buckets_[next], [&](const Item&) { ++count; });
    reserve(count);
    open_ = next;
    file_again(std::exchange(buckets_[next], NOWHERE));
  }

  // Lays the buckets over the times of the list.
  void lay_buckets() {
    reserve_chunks(later_size_);
    columns_ = Columns(later_least_, later_greatest_, BUCKETS);
    start_ = later_least_;
    end_ = later_greatest_;
    open_ = -1;
    later_least_ = INFINITE;
    later_greatest_ = -INFINITE;
    later_size_ = 0;
    file_again(std::exchange(later_, NOWHERE));
  }

  void file_again(Number list) {
    while (list != NOWHERE) {
      for (Number i = 0; i < chunks_[list].size; ++i) {
        const Item item = chunks_[list].items[i];
        file(item);
      }
      chunks_.give_back(std::exchange(list, chunks_[list].next));
    }
  }

  // Opens a bucket whose items were filed under times of at most `until`.
  template <class Visit>
  void take_bucket(int bucket, double until, Visit& visit) {
    std::size_t count = 0;
    for_each_of(buckets_[bucket], [&](const Item&) { ++count; });
    reserve_chunks(count);
    open_ = bucket;
    for (Number list = std::exchange(buckets_[bucket], NOWHERE); list != NOWHERE;) {
      for (Number i = 0; i < chunks_[list].size; ++i) {
        const Item item = chunks_[list].items[i];
        if (order_.time(item) <= until) {
          visit(item);
          --size_;
        } else {
          file(item);
        }
      }
      chunks_.give_back(std::exchange(list, chunks_[list].next));
    }
  }

  template <class Visit>
  void for_each_of(Number list, Visit&& visit) const {
    for (; list != NOWHERE; list = chunks_[list].next)
      for (Number i = 0; i < chunks_[list].size; ++i) visit(chunks_[list].items[i]);
  }

  void remove_first() {
    std::pop_heap(heap_.begin(), heap_.end(), after());
    heap_.pop_back();
  }
  void file_first_again() {
    const Item item = order_.item(heap_.front());
    remove_first();
    file(item);
  }

  auto after() const {
    return [this](const Entry& a, const Entry& b) { return a.time == b.time ? order_.before(b, a) : a.time > b.time; };
  }

  Order order_;
  std::size_t size_ = 0, popped_ = 0;
  std::vector<Entry> heap_;
  Pool<Chunk> chunks_;
  std::array<Number, BUCKETS> buckets_;
  Columns columns_;
  int open_ = BUCKETS - 1;                      // buckets up to this one are empty; their items wait in the heap
  double start_ = -INFINITE, end_ = -INFINITE;  // of the span
  Number later_ = NOWHERE;                      // the list of items after the span
  std::size_t later_size_ = 0;
  double later_least_ = INFINITE, later_greatest_ = -INFINITE;
};

}  // namespace dynhull
