// From a place to its key, for the places where vertices may be.
//
// Only vertices are asked for. Boxes inside the hull, shrunk by a twentieth, separate the entities that are no vertices
// for some time; a table has those outside of them, which are few. Updates keep the table. When a vertex turns up
// inside the boxes, or far more entities are outside than at first, they are laid anew, in one pass over all entities.
#pragma once

#include <set>

#include "../globe/framed_tree.hpp"
#include "../static/inner_boxes.hpp"
#include "slot_table.hpp"
#include "slots.hpp"

namespace dynhull {

class Names {
 public:
  Names(const FramedTree& tree, const Slots& slots)
      : frame_(tree.frame()), boxes_(boxes_in(tree.plane())), several_(Order{&slots}) {
    slots.for_each([&](std::uint32_t slot) { add(slots, slot, slots[slot].place); });
    laid_ = outside_;
  }

  // Whether the names of all these places that are vertices are known.
  bool current(const FramedTree& tree, std::span<const Point> places) const {
    if (outside_ > 2 * laid_ + FEW) return false;
    return std::none_of(places.begin(), places.end(),
                        [&](Point place) { return inside(place) && tree.is_vertex(*frame_(place)); });
  }

  // The slot of the least key at each place, or NONE. A place inside the boxes costs a scan of all entities.
  std::vector<std::uint32_t> least_at(const Slots& slots, std::span<const Point> places) const {
    std::vector<std::uint32_t> least(places.size(), NONE);
    bool complete = true;
    for (std::size_t i = 0; i < places.size(); ++i) {
      if (inside(places[i]))
        complete = false;
      else
        least[i] = at(slots, places[i]);
    }
    if (!complete) scan(slots, places, least);
    return least;
  }

  // An entity has come to its present place. All slots have theirs.
  void add(const Slots& slots, std::uint32_t slot, Point place) {
    if (inside(place)) return;
    ++outside_;
    const std::uint32_t entry = find(slots, place);
    if (entry == NONE) {
      table_.reserve(1);
      table_.insert(Hash::of(place), slot);
      return;
    }
    const std::uint32_t least = table_.slot(entry);
    several_.insert({place, least});
    several_.insert({place, slot});
    if (slots.less(slot, least)) table_.set_slot(entry, slot);
  }

  // An entity has left a place. To be called for all entities that did before `add`, while they have their keys.
  void remove(std::uint32_t slot, Point place) {
    if (inside(place)) return;
    --outside_;
    if (!several_.empty()) several_.erase({place, slot});
    const std::uint32_t entry = table_.find(Hash::of(place), [slot](std::uint32_t other) { return other == slot; });
    if (entry == NONE) return;
    const auto next = several_.lower_bound({place, NONE});
    if (next != several_.end() && next->place == place)
      table_.set_slot(entry, next->slot);
    else
      table_.erase(entry);
  }

  // Throws std::logic_error unless each place outside of the boxes has its least key.
  void check(const Slots& slots) const {
    std::size_t outside = 0;
    slots.for_each([&](std::uint32_t slot) {
      const Point place = slots[slot].place;
      if (inside(place)) return;
      ++outside;
      const std::uint32_t least = at(slots, place);
      if (least == NONE || slots.less(slot, least)) throw std::logic_error("a place without its least key");
    });
    if (outside != outside_) throw std::logic_error("a name of an entity that left");
  }

  std::size_t bytes() const { return sizeof *this + table_.bytes() + several_.size() * (sizeof(Member) + NODE); }

 private:
  static constexpr double SHRINK = 0.95;
  static constexpr std::size_t FEW = 1024;
  static constexpr std::size_t NODE = 40;  // bytes of a node of std::set, the member aside

  struct Member {
    Point place;
    std::uint32_t slot;  // NONE is before all others
  };
  struct Order {
    const Slots* slots;
    bool operator()(const Member& a, const Member& b) const {
      if (!(a.place == b.place)) return a.place < b.place;
      if (a.slot == NONE || b.slot == NONE) return a.slot == NONE && b.slot != NONE;
      return slots->less(a.slot, b.slot);
    }
  };

  bool inside(Point place) const {
    const std::optional<Point> in_plane = frame_(place);
    return in_plane && boxes_.holds(*in_plane);
  }

  std::uint32_t at(const Slots& slots, Point place) const {
    const std::uint32_t entry = find(slots, place);
    return entry == NONE ? NONE : table_.slot(entry);
  }

  // Finds the least key at each place without the table of names.
  static void scan(const Slots& slots, std::span<const Point> places, std::vector<std::uint32_t>& least) {
    SlotTable rows;  // of different places
    rows.reserve(places.size());
    const auto row_of = [&](Point place) {
      const std::uint32_t entry = rows.find(Hash::of(place), [&](std::uint32_t row) { return places[row] == place; });
      return entry == NONE ? NONE : rows.slot(entry);
    };
    for (std::uint32_t row = 0; row < places.size(); ++row)
      if (row_of(places[row]) == NONE) rows.insert(Hash::of(places[row]), row);
    slots.for_each([&](std::uint32_t slot) {
      const std::uint32_t row = row_of(slots[slot].place);
      if (row != NONE && (least[row] == NONE || slots.less(slot, least[row]))) least[row] = slot;
    });
    for (std::uint32_t row = 0; row < places.size(); ++row) least[row] = least[row_of(places[row])];
  }

  std::uint32_t find(const Slots& slots, Point place) const {
    return table_.find(Hash::of(place), [&](std::uint32_t slot) { return slots[slot].place == place; });
  }

  // No boxes at all if rounding put a vertex into one.
  static InnerBoxes boxes_in(const HullTree& tree) {
    const std::vector<Point> lower = tree.chain(LOWER), upper = tree.chain(UPPER);
    const InnerBoxes none({}, {});
    if (lower.empty()) return none;
    const Point center = {lower.front().x / 2 + lower.back().x / 2, lower.front().y / 2 + lower.back().y / 2};
    const auto shrunk = [center](std::vector<Point> chain) {
      for (Point& p : chain) p = {center.x + SHRINK * (p.x - center.x), center.y + SHRINK * (p.y - center.y)};
      return chain;
    };
    const std::vector<Point> inner_lower = shrunk(lower), inner_upper = shrunk(upper);
    for (const auto* chain : {&inner_lower, &inner_upper})
      for (Point p : *chain)
        if (!std::isfinite(p.x) || !std::isfinite(p.y)) return none;
    const InnerBoxes boxes(inner_lower, inner_upper);
    for (const auto* chain : {&lower, &upper})
      for (Point p : *chain)
        if (boxes.holds(p)) return none;
    return boxes;
  }

  Frame frame_;
  InnerBoxes boxes_;
  SlotTable table_;                  // one entry for each place, with its least key
  std::set<Member, Order> several_;  // all entities of the places that several have shared
  std::size_t outside_ = 0, laid_ = 0;
};

}  // namespace dynhull
