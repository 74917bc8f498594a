// Small batches: one change after the other, in sorted order.
#pragma once

#include "../tree/update.hpp"
#include "plan.hpp"

namespace dynhull {

// True if the hull changed. Needs room in `nodes` for the plan's extra leaves.
inline bool apply_in_order(Nodes& nodes, std::span<const Change> changes) {
  constexpr std::size_t LOOKAHEAD = 8;  // changes whose leaf is being prefetched
  constexpr unsigned SHARED = 4;  // the height of subtrees that several changes share, if changes were spread evenly
  Finger finger(nodes, SHARED + static_cast<unsigned>(std::bit_width(nodes.leaf_count() / (changes.size() + 1))));
  bool changed = false;
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const std::size_t ahead = i + LOOKAHEAD;
    if (ahead < changes.size() && changes[ahead].leaf != changes[ahead - 1].leaf)
      nodes.leaf(changes[ahead].leaf).fetch();
    const Change& change = changes[i];
    const Place place = place_of(nodes, change);
    changed |= (change.insert ? insert_point(nodes, place, change.p, finger)
                              : remove_point(nodes, place, change.p, finger)) != 0;
  }
  return changed;
}

}  // namespace dynhull
