// Allocation of plain memory, in whole pages where it is large.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <new>

#ifdef __linux__
#include <sys/mman.h>
#endif

namespace dynhull {

#ifdef DYNHULL_FAIL_ALLOCATIONS
bool allocation_fails();  // defined by the fuzzer
#else
constexpr bool allocation_fails() { return false; }
#endif

namespace memory {

constexpr std::size_t PAGE = 4096;

// Blocks of this size or more are mapped from the system where it can move them (mremap), and unmapped when released.
constexpr std::size_t LARGE = std::size_t{1} << 22;

inline std::size_t whole_pages(std::size_t bytes) { return bytes > PAGE ? (bytes + PAGE - 1) / PAGE * PAGE : bytes; }

#ifdef __linux__
constexpr std::size_t HUGE_PAGE = std::size_t{1} << 21;

// Smaller blocks come from the C library's heap. Larger ones are mapped, and aligned for huge pages.
inline bool mapped(std::size_t bytes) { return bytes >= LARGE; }

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

// The size of a block that is soon released: without a rest that the system would hand out in small pages.
inline std::size_t whole_huge_pages(std::size_t bytes) {
  return mapped(bytes) ? (bytes + HUGE_PAGE - 1) / HUGE_PAGE * HUGE_PAGE : whole_pages(bytes);
}
#else
inline std::size_t whole_huge_pages(std::size_t bytes) { return whole_pages(bytes); }
#endif

// The size of a block that stays: in huge pages only where that takes a sixteenth more at most.
inline std::size_t mostly_huge_pages(std::size_t bytes) {
  const std::size_t whole = whole_huge_pages(bytes);
  return whole - bytes <= bytes / 16 ? whole : whole_pages(bytes);
}

// Sizes of mapped blocks are multiples of a page.
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

}  // namespace dynhull
