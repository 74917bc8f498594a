// One build of the kernel for versions.py, which loads two of them into one process.
#include <cstddef>
#include <cstdint>

#include "hull_tree.hpp"

using dynhull::HullTree;
using dynhull::Point;

extern "C" {

HullTree* make(const Point* points, std::size_t count) {
#ifdef WITH_TEAM
  dynhull::Team::set_limit(1);
#endif
  return new HullTree(points, count);
}

void drop(HullTree* tree) { delete tree; }

std::uint64_t apply(HullTree* tree, const std::int8_t* ops, const Point* points, std::size_t count) {
  tree->apply({ops}, points, count, false);
  return tree->changes;
}

std::uint64_t insert(HullTree* tree, const Point* points, std::size_t count) {
  for (std::size_t i = 0; i < count; ++i) tree->insert(points[i]);
  return tree->changes;
}
}
