// Allocations that fail on purpose: every kind that the kernel makes. For a program of one source file.
#pragma once

#include <atomic>
#include <cstdlib>
#include <new>

#include "../../dynhull/kernel/memory/pages.hpp"

namespace {

std::atomic<long> allocations_left = -1;  // until one fails, of any thread; negative: none does
bool fails() { return allocations_left >= 0 && allocations_left-- == 0; }

}  // namespace

bool dynhull::allocation_fails() { return fails(); }

void* operator new(std::size_t size) {
  void* memory = fails() ? nullptr : std::malloc(size);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto to = static_cast<std::size_t>(alignment);
  void* memory = fails() ? nullptr : std::aligned_alloc(to, (size + to - 1) / to * to);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}
void* operator new(std::size_t size, const std::nothrow_t&) noexcept { return fails() ? nullptr : std::malloc(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::align_val_t) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept { std::free(memory); }
