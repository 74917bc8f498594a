// Small batches: one change after the other, in sorted order.
#pragma once

#include "../tree/update.hpp"
#include "plan.hpp"

namespace dynhull {

// Applies the changes to the tree at nodes.root; calls `reached` with those that reach its top, and on which sides, as
// bits. Needs room in `nodes` for the plan's extra leaves. The tree has about `leaves_a_change` leaves for each change.
template <class Reached>
void apply_in_order(Nodes& nodes, std::span<const Change> changes, std::size_t leaves_a_change, Reached reached) {
  constexpr std::size_t LOOKAHEAD = 8;  // changes whose leaf is being prefetched
  constexpr unsigned SHARED = 4;  // the height of subtrees that several changes share, if changes were spread evenly
  Finger finger(nodes, SHARED + static_cast<unsigned>(std::bit_width(leaves_a_change)));
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const std::size_t ahead = i + LOOKAHEAD;
    if (ahead < changes.size() && changes[ahead].leaf != changes[ahead - 1].leaf)
      nodes.leaf(changes[ahead].leaf).fetch();
    const Change& change = changes[i];
    const Place place = place_of(nodes, change);
    const unsigned sides =
        change.insert ? insert_point(nodes, place, change.p, finger) : remove_point(nodes, place, change.p, finger);
    if (sides != 0) reached(change, sides);
  }
}

}  // namespace dynhull
