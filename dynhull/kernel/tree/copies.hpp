// Multiplicities: the number of copies of each point that the tree holds more than once.
#pragma once

#include <unordered_map>

#include "place.hpp"

namespace dynhull {

struct PointHash {
  std::size_t operator()(Point p) const {
    const auto x = std::bit_cast<std::uint64_t>(p.x), y = std::bit_cast<std::uint64_t>(p.y);
    const std::uint64_t mixed = (x ^ std::rotl(y, 32)) * 0x9e3779b97f4a7c15;
    return static_cast<std::size_t>(mixed ^ (mixed >> 29));
  }
};

using Copies = std::unordered_map<Point, std::uint64_t, PointHash>;

// The number of copies of the point at a place, or nullptr if it is not repeated.
inline std::uint64_t* copies_at(const Nodes& nodes, Copies& copies, const Place& place) {
  const Leaf& leaf = nodes.leaf(place.leaf);
  const bool repeated = place.there & (leaf.repeated >> place.entry & 1);
  return repeated ? &copies.find(leaf[place.entry])->second : nullptr;
}

}  // namespace dynhull
