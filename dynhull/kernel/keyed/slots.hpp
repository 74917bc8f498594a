// Entities by slot number: a place, a key and a time each.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "../memory/hash.hpp"
#include "../memory/pool.hpp"
#include "arena.hpp"

namespace dynhull {

constexpr double NO_TIME = std::numeric_limits<double>::quiet_NaN();

struct Slot {
  Point place;        // y is NaN in a slot that is free
  std::uint64_t key;  // the integer, or where the arena has the string
  double time;        // NO_TIME without one
};
static_assert(sizeof(Slot) == 32);

// Only `reserve` and the copy constructor throw.
class Slots {
 public:
  explicit Slots(bool strings) : strings_(strings) {}

  bool strings() const { return strings_; }
  std::size_t size() const { return pool_.used(); }
  Slot& operator[](std::uint32_t slot) { return pool_[slot]; }
  const Slot& operator[](std::uint32_t slot) const { return pool_[slot]; }
  const Arena& arena() const { return arena_; }

  bool free(std::uint32_t slot) const { return std::isnan(pool_[slot].place.y); }
  std::uint32_t end() const { return pool_.end(); }  // greater than every slot

  // Makes room for `extra` more entities, whose strings have `bytes` in all. Returns whether strings have moved.
  bool reserve(std::size_t extra, std::size_t bytes) {
    pool_.reserve(extra);
    const bool compacts = arena_.worth_compacting(bytes);
    if (compacts) {
      Arena fresh = arena_.compacted(bytes);
      for_each([&](std::uint32_t slot) { pool_[slot].key = fresh.add(arena_[pool_[slot].key]); });
      arena_.swap(fresh);
    }
    arena_.reserve(bytes);
    return compacts;
  }

  // A new entity with the key of a batch's row.
  template <class Keys>
  std::uint32_t take(const Keys& keys, std::size_t row) {
    const std::uint32_t slot = pool_.take();
    pool_[slot] = {{0, 0}, keys.store(arena_, row), NO_TIME};
    return slot;
  }
  void give_back(std::uint32_t slot) {
    if (strings_) arena_.remove(pool_[slot].key);
    pool_[slot].place.y = NO_TIME;
    pool_.give_back(slot);
  }

  std::uint32_t tag(std::uint32_t slot) const {
    return strings_ ? Hash::of(arena_[pool_[slot].key]) : Hash::of(pool_[slot].key);
  }

  // The order of keys, by number or bytewise.
  bool less(std::uint32_t a, std::uint32_t b) const { return key_less(pool_[a].key, pool_[b].key); }
  bool key_less(std::uint64_t a, std::uint64_t b) const { return strings_ ? arena_[a] < arena_[b] : a < b; }

  template <class Visit>
  void for_each(Visit visit) const {
    for (std::uint32_t slot = 0; slot < pool_.end(); ++slot)
      if (!free(slot)) visit(slot);
  }

  // All slots in the order of their keys.
  std::vector<std::uint32_t> in_order() const {
    struct Ranked {
      std::uint64_t rank;  // the integer, or the first bytes of the string
      std::uint32_t slot;
    };
    std::vector<Ranked> ranked;
    ranked.reserve(size());
    for_each([&](std::uint32_t slot) { ranked.push_back({rank(slot), slot}); });
    std::sort(ranked.begin(), ranked.end(), [this](const Ranked& a, const Ranked& b) {
      return a.rank != b.rank ? a.rank < b.rank : strings_ && less(a.slot, b.slot);
    });
    std::vector<std::uint32_t> order(ranked.size());
    std::transform(ranked.begin(), ranked.end(), order.begin(), [](const Ranked& each) { return each.slot; });
    return order;
  }

  std::size_t bytes() const { return pool_.reserved_bytes() + arena_.bytes(); }

 private:
  std::uint64_t rank(std::uint32_t slot) const {
    if (!strings_) return pool_[slot].key;
    std::uint64_t rank = 0;
    const std::string_view key = arena_[pool_[slot].key].substr(0, sizeof rank);
    for (std::size_t i = 0; i < sizeof rank; ++i)
      rank = rank << 8 | (i < key.size() ? static_cast<unsigned char>(key[i]) : 0u);
    return rank;
  }

  bool strings_;
  Pool<Slot> pool_;
  Arena arena_;
};

}  // namespace dynhull
