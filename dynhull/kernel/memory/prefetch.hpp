// Asking for memory before it is read.
#pragma once

namespace dynhull {

constexpr unsigned LINE = 64;  // bytes of a cache line

inline void prefetch(const void* address) {
#if defined(__GNUC__)
  __builtin_prefetch(address);
#else
  (void)address;
#endif
}

}  // namespace dynhull
