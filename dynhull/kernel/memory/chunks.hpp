// A growing array whose items stay where they are: growth copies nothing, so that no single step takes long.
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

namespace dynhull {

template <class Item>
class Chunks {
 public:
  Item& operator[](std::size_t i) { return chunks_[i / SIZE][i % SIZE]; }
  const Item& operator[](std::size_t i) const { return chunks_[i / SIZE][i % SIZE]; }
  std::size_t size() const { return size_; }
  std::size_t bytes() const {
    return chunks_.size() * SIZE * sizeof(Item) + chunks_.capacity() * sizeof(std::unique_ptr<Item[]>);
  }

  // Makes room for that many items. Only this throws.
  void reserve(std::size_t count) {
    while (chunks_.size() * SIZE < count) chunks_.push_back(std::make_unique<Item[]>(SIZE));
  }
  // Adds an item for which there is room.
  void push_back(Item item) { (*this)[size_++] = std::move(item); }

 private:
  static constexpr std::size_t SIZE = 16;  // few: a small array takes a whole chunk

  std::vector<std::unique_ptr<Item[]>> chunks_;
  std::size_t size_ = 0;
};

}  // namespace dynhull
