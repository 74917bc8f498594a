// Temporary memory for a batch or a build.
#pragma once

#include <array>
#include <utility>

#include "pages.hpp"

namespace dynhull {

struct Block {
  void* data;
  std::size_t bytes;
};

// Blocks that a thread keeps for its next batch. The C library would return free memory of this size to the system,
// which hands it out again page by page, zeroed: a tenth of the cost of a large batch.
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
