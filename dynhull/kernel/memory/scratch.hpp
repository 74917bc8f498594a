// Memory that a batch or a build needs for a moment.
#pragma once

#include <array>
#include <utility>

#include "pages.hpp"

namespace dynhull {

struct Block {
  void* data;
  std::size_t bytes;
};

// Blocks that a thread has had a use for, for its next batch: the C library gives free memory of some size back to the
// system, which hands it out again page by page, zeroed. That was a tenth of the cost of a large batch.
class BlockCache {
 public:
  static Block take(std::size_t bytes) {
    if (!worth_keeping(bytes)) return {bytes > 0 ? memory::resize(nullptr, 0, bytes) : nullptr, bytes};
    return of_this_thread().smallest_with(bytes);
  }
  static void give_back(Block block) {
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

  // A block, or a new one.
  Block smallest_with(std::size_t bytes) {
    Block* best = nullptr;
    for (Block& block : blocks_)
      if (block.bytes >= bytes && (best == nullptr || block.bytes < best->bytes)) best = &block;
    if (best == nullptr) return {memory::resize(nullptr, 0, bytes), bytes};
    if (allocation_fails()) throw std::bad_alloc();
    return std::exchange(*best, {});
  }

  // Keeps the block instead of the smallest one, where it is larger. Returns what is left over.
  Block replace_smallest(Block block) {
    Block* smallest = &blocks_[0];
    for (Block& kept : blocks_)
      if (kept.bytes < smallest->bytes) smallest = &kept;
    if (smallest->bytes < block.bytes) std::swap(*smallest, block);
    return block;
  }

  std::array<Block, 4> blocks_ = {};  // a batch needs so many at once
};

// A fixed number of plain records, not initialised.
template <class Record>
class Scratch {
 public:
  explicit Scratch(std::size_t count) : block_(BlockCache::take(memory::whole_pages(count * sizeof(Record)))) {}
  Scratch(const Scratch&) = delete;
  ~Scratch() { BlockCache::give_back(block_); }

  Record* data() const { return static_cast<Record*>(block_.data); }
  Record& operator[](std::size_t i) const { return data()[i]; }

 private:
  Block block_;
};

}  // namespace dynhull
