// Single updates of the tree at nodes.root: repair the leaf, then climb while the hull changes.
#pragma once

#include "balance.hpp"
#include "finger.hpp"
#include "place.hpp"

namespace dynhull {

// One predictable branch, where || compiles to two unpredictable ones.
inline bool either(bool first, bool second) { return first + second != 0; }

// Climbs from a chain that has changed around p, and skips bridges that do not overlap the change in x: they stay.
template <class Over>
class Climb {
 public:
  Climb(const Nodes& nodes, Point p, Side side, Over& finger)
      : nodes_(nodes), side_(side), finger_(finger), known_(finger.over(p)) {}

  // The first node from v upwards whose bridge overlaps [left, right] in x, or NONE.
  Ref first_near(Ref v, double left, double right) {
    v = first_near(v, known_, left, right);
    if (v != known_) return v;
    if (v == NONE) {
      if (stood_) finger_.earn();
      return NONE;
    }
    if (finger_.clear(side_, left, right)) return NONE;
    known_ = NONE;
    return first_near(v, NONE, left, right);
  }

  // To be called if the bridge of the last node changes.
  void changes() {
    stood_ = false;
    if (known_ == NONE) finger_.forget();
  }

 private:
  Ref first_near(Ref v, Ref end, double left, double right) const {
    for (; v != end; v = nodes_.node(v).parent) {
      const Edge& edge = nodes_.bridge(v, side_);
      if (!either(right<edge.a.x, left> edge.b.x)) return v;
    }
    return end;
  }

  const Nodes& nodes_;
  Side side_;
  Over& finger_;
  Ref known_;  // the lowest node that the finger remembers; NONE once the climb has passed it
  bool stood_ = true;
};

// Repairs the bridges from v upwards after p joined the chain below, as long as p is on the chain. True if p reaches
// the root's chain.
//
// `neighbours` are p's neighbours on the chain, infinite at its ends. If one of them is between p and the bridge, the
// chain turns before the bridge, and p is inside the bridge's line.
template <class Over>
bool climb_added(Nodes& nodes, Ref v, Point p, Side side, Edge neighbours, Over& finger) {
  Climb climb(nodes, p, side, finger);
  const auto next = [&](Ref from) { return climb.first_near(from, neighbours.a.x, neighbours.b.x); };
  for (v = next(v); v != NONE; v = next(nodes.node(v).parent)) {
    Edge& edge = nodes.bridge(v, side);
    const Node& node = nodes.node(v);
    const bool on_left = p < node.separator;
    const bool beyond = on_left ? p < edge.a : p > edge.b;
    const int turn = turned(side, orientation(edge.a, edge.b, p));
    if (turn > 0 || (turn == 0 && beyond)) {
      climb.changes();
      if (on_left) {
        neighbours.b = tangent_to_right(Cursor(nodes, node.child[1], side), p, side);
        edge = {p, neighbours.b};
      } else {
        neighbours.a = tangent_to_left(Cursor(nodes, node.child[0], side), p, side);
        edge = {neighbours.a, p};
      }
    } else if (!beyond) {
      return false;
    }
  }
  return true;
}

// The new bridge of v, after `gone`, an end of the old one, left its child's chain, where `neighbours` were beside it.
// That chain has sunk below the old bridge only between the neighbours, so the bridge's new end is there too; its other
// end stays or moves towards the separator.
inline Edge bridge_after(const Nodes& nodes, Ref v, Side side, Point gone, Edge neighbours) {
  const Node& node = nodes.node(v);
  const Edge& old = nodes.bridge(v, side);
  const bool on_left = gone == old.a;
  const Edge left = on_left ? neighbours : Edge{old.a, HIGHEST};
  const Edge right = on_left ? Edge{LOWEST, old.b} : neighbours;
  return find_bridge(Cursor(nodes, node.child[0], side, left.a, left.b),
                     Cursor(nodes, node.child[1], side, right.a, right.b), side, node.separator);
}

// Repairs the bridges from v upwards after p left the chain below, as long as p was on the chain. True if p was on the
// root's chain.
//
// `neighbours` were p's neighbours on the chain, infinite at its ends.
template <class Over>
bool climb_removed(Nodes& nodes, Ref v, Point p, Side side, Edge neighbours, Over& finger) {
  Climb climb(nodes, p, side, finger);
  const auto next = [&](Ref from) { return climb.first_near(from, p.x, p.x); };
  for (v = next(v); v != NONE; v = next(nodes.node(v).parent)) {
    Edge& edge = nodes.bridge(v, side);
    if (p < edge.a || p > edge.b) continue;
    if (p != edge.a && p != edge.b) return false;
    climb.changes();
    const Edge old = edge;
    edge = bridge_after(nodes, v, side, p, neighbours);
    if (p == old.a)
      neighbours.b = old.b;
    else
      neighbours.a = old.a;
  }
  return true;
}

// Inserts a missing point. Returns the sides, as bits, on which the hull changed. Needs room for one more leaf and
// node. `finger` is that of a batch in sorted order.
template <class Over = NoFinger>
unsigned insert_point(Nodes& nodes, Place place, Point p, Over&& finger = Over()) {
  if (place.leaf == NONE) {
    nodes.replace(NONE, NONE, nodes.take_leaf());
    nodes.leaf(nodes.root).assign(&p, 1);
    return 0b11;
  }
  if (nodes.leaf(place.leaf).size == LEAF) {
    const Ref right = split(nodes, place.leaf);
    finger.forget();
    const unsigned half = nodes.leaf(place.leaf).size;
    if (place.entry > half) place = {right, place.entry - half, false};
  }
  Leaf& leaf = nodes.leaf(place.leaf);
  const unsigned on_leaf = leaf.add(place.entry, p);
  unsigned changed = 0;
  for (Side side : SIDES)
    if (on_leaf & (1u << side) && climb_added(nodes, leaf.parent, p, side, leaf.neighbours(side, place.entry), finger))
      changed |= 1u << side;
  return changed;
}

// Removes a present point. Returns the sides, as bits, on which the hull changed.
template <class Over = NoFinger>
unsigned remove_point(Nodes& nodes, Place place, Point p, Over&& finger = Over()) {
  Leaf& leaf = nodes.leaf(place.leaf);
  const Edge neighbours[] = {leaf.neighbours(UPPER, place.entry), leaf.neighbours(LOWER, place.entry)};
  const unsigned on_leaf = leaf.remove(place.entry);
  const bool empty = leaf.size == 0;
  if (empty) finger.forget();
  const Ref above = empty ? drop(nodes, place.leaf) : leaf.parent;
  unsigned changed = 0;
  for (Side side : SIDES)
    if (on_leaf & (1u << side) && climb_removed(nodes, above, p, side, neighbours[side], finger)) changed |= 1u << side;
  if (empty)
    rebalance(nodes, above);
  else if (leaf.size < LOW && leaf.size % MERGE_STEP == 1)
    merge(nodes, place.leaf);
  else
    return changed;
  finger.forget();
  return changed;
}

}  // namespace dynhull
