// Temporary memory for a batch or a build.
#pragma once

#include <array>
#include <atomic>
#include <utility>

#include "pages.hpp"

namespace dynhull {

struct Block {
  void* data;
  std::size_t bytes;
};

// One large block that the process keeps for its next build: to clear fresh pages is up to a quarter of what a build
// costs. Threads do not wait for each other here, nor does a child for a thread that it has not got: who finds another
// one here does without.
class LargeBlock {
 public:
  static Block take(std::size_t bytes) {
    if (allocation_fails()) throw std::bad_alloc();
    Block block = {};
    if (!busy_.test_and_set(std::memory_order_acquire)) {
      if (kept_.bytes >= bytes) block = std::exchange(kept_, {});
      busy_.clear(std::memory_order_release);
    }
    return block.bytes > 0 ? block : Block{memory::resize(nullptr, 0, bytes), bytes};
  }
  static void give_back(Block block) {
    if (block.bytes <= MOST && !busy_.test_and_set(std::memory_order_acquire)) {
      if (kept_.bytes < block.bytes) std::swap(kept_, block);
      busy_.clear(std::memory_order_release);
    }
    memory::release(block.data, block.bytes);
  }

 private:
  static constexpr std::size_t MOST = std::size_t{1} << 25;  // the C library keeps freed blocks of up to 32 MB, too

  static inline std::atomic_flag busy_;
  static inline Block kept_ = {};
};

// Blocks that a thread keeps for its next batch. The C library would return free memory of this size to the system,
// which hands it out again page by page, zeroed: a tenth of the cost of a large batch.
class BlockCache {
 public:
  static Block take(std::size_t bytes) {
    if (bytes >= memory::LARGE) return LargeBlock::take(bytes);
    if (!worth_keeping(bytes)) return {bytes > 0 ? memory::resize(nullptr, 0, bytes) : nullptr, bytes};
    return of_this_thread().smallest_with(bytes);
  }
  static void give_back(Block block) {
    if (block.bytes >= memory::LARGE) return LargeBlock::give_back(block);
    if (worth_keeping(block.bytes)) block = of_this_thread().replace_smallest(block);
    memory::release(block.data, block.bytes);
  }

  BlockCache(const BlockCache&) = delete;
  ~BlockCache() {
    for (const Block& block : blocks_) memory::release(block.data, block.bytes);
  }

 private:
  static bool worth_keeping(std::size_t bytes) { return memory::PAGE <= bytes && bytes < memory::LARGE; }

  BlockCache() = default;
  static BlockCache& of_this_thread() {
    static thread_local BlockCache spares;
    return spares;
  }

  // The smallest kept block of this size or more, or a new one.
  Block smallest_with(std::size_t bytes) {
    Block* best = nullptr;
    for (Block& block : blocks_)
      if (block.bytes >= bytes && (best == nullptr || block.bytes < best->bytes)) best = &block;
    if (best == nullptr) return {memory::resize(nullptr, 0, bytes), bytes};
    if (allocation_fails()) throw std::bad_alloc();
    return std::exchange(*best, {});
  }

  // Keeps the block if it is larger than the smallest one. Returns the block that is not kept.
  Block replace_smallest(Block block) {
    Block* smallest = &blocks_[0];
    for (Block& kept : blocks_)
      if (kept.bytes < smallest->bytes) smallest = &kept;
    if (smallest->bytes < block.bytes) std::swap(*smallest, block);
    return block;
  }

  std::array<Block, 8> blocks_ = {};  // about as many as a batch uses at a time
};

// A fixed number of plain records, uninitialised.
template <class Record>
class Scratch {
 public:
  explicit Scratch(std::size_t count) : block_(BlockCache::take(memory::whole_huge_pages(count * sizeof(Record)))) {}
  Scratch(Scratch&& other) noexcept : block_(std::exchange(other.block_, {})) {}
  ~Scratch() { BlockCache::give_back(block_); }

  Record* data() const { return static_cast<Record*>(block_.data); }
  std::size_t room() const { return block_.bytes / sizeof(Record); }
  Record& operator[](std::size_t i) const { return data()[i]; }

 private:
  Block block_;
};

}  // namespace dynhull
