// A growing array of plain records whose memory moves without being copied where the system can do that.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>
#include <type_traits>
#include <utility>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace dynhull {

#ifdef DYNHULL_FAIL_ALLOCATIONS
bool allocation_fails();  // the fuzzer's
#else
constexpr bool allocation_fails() { return false; }
#endif

namespace memory {

constexpr std::size_t PAGE = 4096;

inline std::size_t whole_pages(std::size_t bytes) { return bytes > PAGE ? (bytes + PAGE - 1) / PAGE * PAGE : bytes; }

#ifdef __linux__
constexpr std::size_t HUGE_PAGE = std::size_t{1} << 21;

// Below this, the C library's heap; above, whole pages of our own, aligned so that huge pages fit.
inline bool mapped(std::size_t bytes) { return bytes >= 2 * HUGE_PAGE; }

inline void* map_aligned(std::size_t bytes) {
  const std::size_t span = bytes + HUGE_PAGE;
  void* region = mmap(nullptr, span, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS | MAP_NORESERVE, -1, 0);
  if (region == MAP_FAILED) throw std::bad_alloc();
  char* start = static_cast<char*>(region);
  const std::size_t before = (HUGE_PAGE - reinterpret_cast<std::uintptr_t>(start) % HUGE_PAGE) % HUGE_PAGE;
  if (before > 0) munmap(start, before);
  munmap(start + before + bytes, span - before - bytes);
  madvise(start + before, bytes, MADV_HUGEPAGE);
  return start + before;
}
#endif

// Both sizes are multiples of a page where they are mapped.
inline void* resize(void* old, std::size_t old_bytes, std::size_t bytes) {
  if (allocation_fails()) throw std::bad_alloc();
#ifdef __linux__
  if (mapped(bytes)) {
    if (mapped(old_bytes) && mremap(old, old_bytes, bytes, 0) != MAP_FAILED) return old;
    void* fresh = map_aligned(bytes);
    if (mapped(old_bytes)) {
      if (mremap(old, old_bytes, bytes, MREMAP_MAYMOVE | MREMAP_FIXED, fresh) == MAP_FAILED) {
        munmap(fresh, bytes);
        throw std::bad_alloc();
      }
    } else {
      std::copy_n(static_cast<const char*>(old), old_bytes, static_cast<char*>(fresh));
      std::free(old);
    }
    return fresh;
  }
#endif
  void* fresh = std::realloc(old, bytes);
  if (fresh == nullptr) throw std::bad_alloc();
  return fresh;
}

inline void release(void* data, [[maybe_unused]] std::size_t bytes) {
#ifdef __linux__
  if (mapped(bytes)) {
    munmap(data, bytes);
    return;
  }
#endif
  std::free(data);
}

}  // namespace memory

// A fixed number of plain records, not initialised.
template <class Record>
class Buffer {
 public:
  explicit Buffer(std::size_t count)
      : bytes_(memory::whole_pages(count * sizeof(Record))),
        data_(static_cast<Record*>(bytes_ > 0 ? memory::resize(nullptr, 0, bytes_) : nullptr)) {}
  Buffer(const Buffer&) = delete;
  ~Buffer() { memory::release(data_, bytes_); }

  Record* data() const { return data_; }
  Record& operator[](std::size_t i) const { return data_[i]; }

 private:
  std::size_t bytes_;
  Record* data_;
};

// Slots are handed out by number, freed ones first; `reserve` may throw, nothing else does.
template <class Record>
class Store {
  static_assert(std::is_trivially_copyable_v<Record> && sizeof(Record) >= sizeof(std::uint32_t));

 public:
  Store() = default;
  Store(Store&& other) noexcept { swap(other); }
  Store(const Store& other) : used_(other.used_), freed_(other.freed_), free_(other.free_) {
    if (used_ == 0) return;
    data_ = static_cast<Record*>(memory::resize(nullptr, 0, whole_pages(used_)));
    capacity_ = used_;
    std::copy_n(other.data_, used_, data_);
  }
  Store& operator=(Store&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Store() { memory::release(data_, bytes()); }

  Record& operator[](std::uint32_t i) { return data_[i]; }
  const Record& operator[](std::uint32_t i) const { return data_[i]; }

  // Room for `extra` more records: take() will not throw that many times. Grows by an eighth at least.
  void reserve(std::size_t extra) {
    const std::size_t needed = used_ + extra;
    if (needed <= capacity_ + freed_) return;
    std::size_t capacity = std::max<std::size_t>({needed - freed_, std::size_t{capacity_} + capacity_ / 8, 2});
    if (capacity >= NOWHERE / 2) throw std::bad_alloc();
    capacity = memory::whole_pages(capacity * sizeof(Record)) / sizeof(Record);
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
    free_ = i;
    ++freed_;
  }

  std::size_t used() const { return used_ - freed_; }
  std::size_t reserved_bytes() const { return bytes(); }

  void swap(Store& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(capacity_, other.capacity_);
    std::swap(used_, other.used_);
    std::swap(freed_, other.freed_);
    std::swap(free_, other.free_);
  }

 private:
  static constexpr std::uint32_t NOWHERE = ~std::uint32_t{0};

  static std::size_t whole_pages(std::size_t capacity) { return memory::whole_pages(capacity * sizeof(Record)); }
  std::size_t bytes() const { return whole_pages(capacity_); }
  std::uint32_t& link(std::uint32_t i) { return reinterpret_cast<std::uint32_t&>(data_[i]); }

  Record* data_ = nullptr;
  std::uint32_t capacity_ = 0, used_ = 0, freed_ = 0, free_ = NOWHERE;
};

}  // namespace dynhull
