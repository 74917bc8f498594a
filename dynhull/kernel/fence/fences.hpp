// An index of fences over the entities of a hull: fences come, change and go. The reference in Python is
// dynhull/_fences.py.
//
// A new area visits the zones that its changed edges touch, and those between the old and the new boundary; their
// subjects are decided when crossings are taken.
#pragma once

#include <map>
#include <unordered_map>
#include <unordered_set>

#include "own_hull.hpp"

namespace dynhull {

// A subject that was removed: its place before, and the fences that it was inside of.
struct Departure {
  Point before;
  std::vector<std::int64_t> inside;
};
using Departures = std::unordered_map<std::string, Departure>;  // by key, as bytes
// A subject that may be new, and where it comes from.
struct Arrival {
  std::uint32_t slot;
  Departure* departure;
};

class Fences : public OwnHull {
 public:
  explicit Fences(const Slots& slots) : OwnHull(slots) {}

  std::size_t size() const { return numbers_.size(); }
  bool has(std::int64_t number) const { return numbers_.contains(number); }
  std::int64_t count(std::int64_t number) const { return fence(number).count; }
  // None around the subjects' own hull.
  std::shared_ptr<const Area> area(std::int64_t number) const {
    return fence(number).own ? nullptr : fence(number).area;
  }

  // Adds a fence, or replaces the area of one. `inside`: slots to be inside of a fence that is then new in any case.
  void set(const HullTree& tree, std::int64_t number, Area area, bool cross, bool own,
           const std::vector<std::uint32_t>* inside) {
    ready();
    const auto entry = numbers_.find(number);
    if (entry == numbers_.end()) return add_number(tree, number, std::move(area), cross, own, inside);
    const std::uint32_t handle = entry->second;
    Fence& fence = *fences_[handle];
    if (cross && !own) stray_changed();
    if (inside || fence.own != own) {
      entry->second = inside ? add(tree, number, std::move(area), cross, own, inside)
                             : add_other_kind(tree, handle, std::move(area), cross, own);
      remove(handle);
    } else if (own) {
      recent_.push_back(handle);
      auto empty = std::make_shared<const Area>(Area::of_hull({}, true, area.margin));
      if (fence.area->margin != area.margin) fence.area = std::move(empty);  // until it is decided
      owners_changed_ = true;
      fence.cross = cross;
    } else {
      if (!(*fence.area == area)) {
        recent_.push_back(handle);
        torn_ = true;
        replace(handle, std::make_shared<const Area>(std::move(area)));
        torn_ = false;
      }
      crossable_ += std::size_t{cross} - std::size_t{fence.cross};
      fence.cross = cross;
    }
    perhaps_divide_crowded();
  }

  // Removes a fence, and returns the keys of the subjects that were inside.
  Crossings drop(std::int64_t number) {
    ready();
    Crossings keys = inside(number);
    const auto entry = numbers_.find(number);
    remove(entry->second);
    numbers_.erase(entry);
    return keys;
  }

  // The keys inside, in order.
  Crossings inside(std::int64_t number) {
    ready();
    Crossings keys;
    const std::uint32_t handle = numbers_.at(number);
    for_each_inside(handle, [&](std::uint32_t slot) { append_key(keys, slot); });
    for (const Gone& gone : gone_)
      if (was_inside(handle, gone)) append_key(keys, gone);
    keys.sort(slots_->strings());
    return keys;
  }

  // Subjects that go over from one index to another

  // Those among some keys that were removed since crossings were last taken.
  Departures departures(const std::vector<std::string>& keys) {
    ready();
    Departures found;
    if (gone_.empty()) return found;
    const std::unordered_set<std::string_view> asked(keys.begin(), keys.end());
    for (const Gone& gone : gone_) {
      if (gone.cause != REMOVED || gone.done || gone.given || (gone.fresh && !gone.carried)) continue;
      std::string key = key_of(gone);
      if (!asked.contains(key)) continue;
      Departure departure{gone.before, {}};
      for (const std::uint32_t handle : members_.of(gone.inside))
        if (!fences_[handle]->own) departure.inside.push_back(fences_[handle]->number);
      found.insert_or_assign(std::move(key), std::move(departure));
    }
    return found;
  }

  // Lets subjects that are new, each by its slot with where it comes from, have come from there. Their departures keep
  // the fences of this index. Returns which of them are new, by row.
  std::vector<bool> arrive(std::span<const Arrival> arrivals) {
    ready();  // once for all: this looks at whatever has changed
    std::vector<bool> arrived(arrivals.size());
    for (std::size_t row = 0; row < arrivals.size(); ++row)
      arrived[row] = arrive(arrivals[row].slot, *arrivals[row].departure);
    return arrived;
  }

  // Forgets subjects that have gone over.
  void give(const Departures& departures) {
    for (Gone& gone : gone_) {
      if (gone.cause != REMOVED || gone.done || gone.given || (gone.fresh && !gone.carried)) continue;
      const auto departure = departures.find(key_of(gone));
      if (departure == departures.end()) continue;
      gone.given = true;
      for (const std::int64_t number : departure->second.inside) {
        const auto entry = numbers_.find(number);
        if (entry == numbers_.end() || !members_.has(gone.inside, entry->second)) continue;
        members_.remove(gone.inside, entry->second);
        --fences_[entry->second]->count;
      }
    }
  }

  // Whether there is nothing to decide.
  bool idle() const {
    return strayed_.empty() && gone_.empty() && waiting_.empty() && !torn_ && !everyone_ && taken_.rows.empty() &&
           (owners_.empty() || (changes_.empty() && !owners_changed_));
  }
  // About how many subjects are to be decided.
  std::size_t work() const { return strayed_.size() + gone_.size() + CROWD * (waiting_.size() + owners_.size()); }
  // After a look that found nothing to decide.
  void rest() { begin_again(); }

  // What has crossed since the last call, in order. `slots_at` returns the slot of the least key at each of some
  // vertices. If memory does not suffice, nothing is lost: the next call returns it.
  template <class SlotsAt>
  Crossings take(HullTree& tree, SlotsAt slots_at) {
    for (auto& found : found_) found.clear();
    prepare(only_strayed_matter());
    for (const std::uint32_t handle : recent_)
      if (fences_[handle] && *fences_[handle]->area == *fences_[handle]->decided)
        fences_[handle]->decided = fences_[handle]->area;
    if (everyone_) {
      settle_strayed([](std::uint32_t, const Zone&, std::size_t) {}, [](std::size_t) {});
      slots_->for_each([&](std::uint32_t slot) {
        if (subjects_[slot].zone == NONE) return;  // there are no zones
        decide(slot, zones_[subjects_[slot].zone], found_[0]);
        cross_found(found_[0]);
      });
    } else {
      settle_strayed([&](std::uint32_t slot, const Zone& zone, std::size_t part) { decide(slot, zone, found_[part]); },
                     [&](std::size_t part) { cross_found(found_[part]); });
    }
    divide_crowded();
    decide_waiting();
    for (const std::uint32_t handle : owners_) look_at_own(*fences_[handle], tree);
    if (carries_) report_carried();
    report_gone();
    list_fresh();
    for (const std::uint32_t handle : owners_) decide_own(handle, tree, slots_at);
    taken_.sort(slots_->strings());
    begin_again();
    carries_ = false;
    return std::exchange(taken_, {});
  }

  std::size_t bytes() const {
    std::size_t bytes = subjects_.bytes() + zones_.bytes() + members_.bytes() + changes_.capacity() * sizeof(Change) +
                        strayed_.capacity() * sizeof(std::uint32_t) + strays_.capacity() * sizeof(Stray) +
                        gone_.capacity() * sizeof(Gone) + gone_keys_.capacity();
    for (const auto& fence : fences_) bytes += fence ? fence->bytes() : 0;
    return bytes;
  }

  // Throws std::logic_error unless every subject is listed in the zone of its box, and every fence where it is.
  void check() const {
    const auto require = [](bool holds, const char* message) {
      if (!holds) throw std::logic_error(message);
    };
    if (!zoned_ || torn_) return;
    for (std::uint32_t zone = 0; zone < zones_.size(); ++zone) {
      for (std::uint32_t at = 0; at < zones_[zone].subjects.size(); ++at) {
        const std::uint32_t slot = zones_[zone].subjects[at];
        require(there(slot) && subjects_[slot].zone == zone && subjects_[slot].at == at, "a subject misfiled");
        const Point p = (*slots_)[slot].place;
        if (subjects_.box(slot).holds(p)) require(zones_.find(p) == zone, "a subject in another zone");
      }
      if (Zones::empty(zones_[zone].box)) continue;  // no point is in it
      for (const std::uint32_t handle : zones_[zone].covering) {
        require(fences_[handle] && !fences_[handle]->own, "a fence that is gone covers a zone");
        require(fences_[handle]->area->holds(zones_[zone].anchor()), "a fence that does not cover its zone");
      }
      for (const Piece& piece : zones_[zone].pieces)
        require(!piece.simple || piece.inside == (fences_[piece.fence]->area->where(zones_[zone].anchor()) > 0),
                "a piece whose anchor is elsewhere");
    }
  }

 private:
  const Fence& fence(std::int64_t number) const { return *fences_[numbers_.at(number)]; }

  bool arrive(std::uint32_t slot, Departure& departure) {
    Change* const change = there(slot) ? change_of(slot) : nullptr;
    if (change == nullptr || !change->fresh || change->carried) return false;
    std::erase_if(departure.inside, [&](std::int64_t number) {
      const auto entry = numbers_.find(number);
      return entry == numbers_.end() || fences_[entry->second]->own;
    });
    for (const std::int64_t number : departure.inside) {
      const std::uint32_t handle = numbers_.at(number);
      if (members_.has(subjects_[slot].inside, handle)) continue;
      members_.add(subjects_[slot].inside, handle);
      ++fences_[handle]->count;
    }
    change->before = departure.before;
    change->carried = true;
    carries_ = true;
    return true;
  }

  // If memory does not suffice, what is left of a new fence goes when the zones are made anew.

  void add_number(const HullTree& tree, std::int64_t number, Area area, bool cross, bool own,
                  const std::vector<std::uint32_t>* inside) {
    const auto entry = numbers_.emplace(number, NONE).first;
    try {
      entry->second = add(tree, number, std::move(area), cross, own, inside);
    } catch (...) {
      numbers_.erase(entry);
      throw;
    }
    perhaps_divide_crowded();
  }

  std::uint32_t add(const HullTree& tree, std::int64_t number, Area area, bool cross, bool own,
                    const std::vector<std::uint32_t>* inside) {
    auto fence = std::make_unique<Fence>();
    fence->number = number;
    fence->cross = cross;
    fence->own = fence->decided_own = own;
    fence->area = std::make_shared<const Area>(std::move(area));
    fence->decided = fence->area;
    fence->given = inside != nullptr;
    fence->earlier = places();
    grow(recent_, 1);
    grow(owners_, 1);
    torn_ = true;
    if (!zoned_ && !own) {
      zoned_ = true;
      const bool everyone = everyone_;  // no fence had a zone: nothing is to be decided again
      rebuild();
      everyone_ = everyone;
      torn_ = true;
    }
    const std::uint32_t handle = free_handle();
    fences_[handle] = std::move(fence);
    recent_.push_back(handle);
    if (own)
      owners_.push_back(handle);
    else
      crossable_ += cross;
    try {
      own ? add_own(tree, handle, inside) : add_pieces(handle, inside);
    } catch (...) {
      discard(handle);
      throw;
    }
    torn_ = false;
    return handle;
  }

  // Between a fence around the subjects' own hull and another one: who was inside, stays inside until decided.
  std::uint32_t add_other_kind(const HullTree& tree, std::uint32_t old, Area area, bool cross, bool own) {
    std::vector<std::uint32_t> inside;
    for_each_inside(old, [&](std::uint32_t slot) { inside.push_back(slot); });
    const std::uint32_t handle = add(tree, fences_[old]->number, std::move(area), cross, own, &inside);
    Fence& fence = *fences_[handle];
    fence.decided = fences_[old]->decided;
    fence.decided_own = fences_[old]->decided_own;
    fence.given = fences_[old]->given;
    fence.earlier = fences_[old]->earlier;
    try {
      for (Gone& gone : gone_) {
        const bool was = was_inside(old, gone);
        fence.count += was;
        if (was != own && (!own || was_there(fence, key_of(gone), gone.fresh && !gone.returned)))
          members_.add(gone.inside, handle);
      }
    } catch (...) {
      discard(handle);
      torn_ = true;
      throw;
    }
    return handle;
  }

  std::uint32_t free_handle() {
    for (; first_free_ < fences_.size(); ++first_free_)
      if (!fences_[first_free_]) return static_cast<std::uint32_t>(first_free_);
    fences_.emplace_back();
    return static_cast<std::uint32_t>(first_free_);
  }

  void add_pieces(std::uint32_t handle, const std::vector<std::uint32_t>* inside) {
    Fence& fence = *fences_[handle];
    const Area& area = *fence.area;
    const std::vector<Edge> edges = sorted_edges(area);
    std::vector<std::uint32_t> ids(edges.size());
    std::iota(ids.begin(), ids.end(), 0);
    std::vector<Edge> near;
    for (std::size_t i = 0; inside && i < inside->size(); ++i) {
      members_.add(subjects_[(*inside)[i]].inside, handle);
      ++fence.count;
    }
    zones_.descend(
        ids, [&](std::uint32_t id) { return dynhull::strip_of(area, edges[id]); },
        [&](Point p) { return area.holds(p); },
        [&](std::uint32_t number, std::span<const std::uint32_t> touching) {
          Zone& zone = zones_[number];
          near.clear();
          for (const std::uint32_t id : touching) near.push_back(edges[id]);
          if (touching.empty())
            zone.covering.push_back(handle);
          else
            append_pieces(zone, handle, area, near, inside_at(area, zone.anchor()));
          if (inside) wait_for(handle, number);
          if (is_crowded(zone)) crowded_.push_back(number);
          for (const std::uint32_t slot : zone.subjects) {
            const Point p = (*slots_)[slot].place;
            keep_off(slot, area, near);
            if (inside || !(touching.empty() || area.holds(p))) continue;
            members_.add(subjects_[slot].inside, handle);
            ++fence.count;
          }
        });
    if (inside)
      for (const std::uint32_t slot : *inside) wait_for(handle, subjects_[slot].zone);
  }
  // Makes the box of a subject smaller, so that it keeps off some edges of an area.
  void keep_off(std::uint32_t slot, const Area& area, std::span<const Edge> edges) {
    Clearance clearance(subjects_.box(slot), (*slots_)[slot].place);
    for (const Edge& edge : edges) clearance.keep_off(dynhull::strip_of(area, edge));
    subjects_.box(slot) = clearance.box();
  }
  // Replaces an area. Edges that stay need no visit, unless several polygons make one of them lie inside of another.
  void replace(std::uint32_t handle, std::shared_ptr<const Area> area) {
    Fence& fence = *fences_[handle];
    const std::shared_ptr<const Area> old = fence.area;
    const bool keeps = old->kind == area->kind && old->kind != Area::Kind::DISK && old->margin == area->margin &&
                       old->closed == area->closed && old->polygons.size() < 2 && area->polygons.size() < 2;
    const std::vector<Edge> before = sorted_edges(*old);
    const std::vector<Edge> after = sorted_edges(*area);
    std::vector<Edge> added = after, removed = before;
    if (keeps) {
      added.clear();
      removed.clear();
      std::set_difference(after.begin(), after.end(), before.begin(), before.end(), std::back_inserter(added),
                          edge_less);
      std::set_difference(before.begin(), before.end(), after.begin(), after.end(), std::back_inserter(removed),
                          edge_less);
    }
    std::vector<std::uint32_t> ids(added.size() + removed.size());  // those added, then those removed
    std::iota(ids.begin(), ids.end(), 0);
    const auto is_added = [&](std::uint32_t id) { return id < added.size(); };

    std::vector<Edge> near;
    zones_.descend(
        ids,
        [&](std::uint32_t id) {
          return is_added(id) ? dynhull::strip_of(*area, added[id])
                              : dynhull::strip_of(*old, removed[id - added.size()]);
        },
        [&](Point p) { return old->holds(p) != area->holds(p); },
        [&](std::uint32_t number, std::span<const std::uint32_t> touching) {
          Zone& zone = zones_[number];
          wait_for(handle, number);
          near.clear();
          for (const Piece& piece : zone.run_of(handle))
            if (!std::binary_search(removed.begin(), removed.end(), piece.edge, edge_less)) near.push_back(piece.edge);
          for (const std::uint32_t id : touching)
            if (is_added(id)) near.push_back(added[id]);
          std::erase_if(zone.pieces, [&](const Piece& piece) { return piece.fence == handle; });
          std::erase(zone.covering, handle);
          if (near.empty()) {
            if (area->holds(zone.anchor())) zone.covering.push_back(handle);
          } else {
            append_pieces(zone, handle, *area, near, inside_at(*area, zone.anchor()));
          }
          if (is_crowded(zone)) crowded_.push_back(number);
          near.clear();
          for (const std::uint32_t id : touching)
            if (is_added(id)) near.push_back(added[id]);
          for (const std::uint32_t slot : zone.subjects) keep_off(slot, *area, near);
        });
    fence.area = std::move(area);
  }
  // Removes a fence and its memberships. If memory does not suffice, these go when the zones are made anew.
  void remove(std::uint32_t handle) {
    try {
      forget(handle);
    } catch (const std::bad_alloc&) {
      torn_ = true;
    }
    discard(handle);
  }
  void forget(std::uint32_t handle) {
    const Fence& fence = *fences_[handle];
    if (fence.own) {
      for (const std::uint32_t slot : fence.outside) members_.remove(subjects_[slot].inside, handle);
      return;
    }
    for_each_zone(handle, [&](std::uint32_t number) {
      Zone& zone = zones_[number];
      std::erase(zone.covering, handle);
      std::erase(zone.pending, handle);
      std::erase_if(zone.pieces, [&](const Piece& piece) { return piece.fence == handle; });
      for (const std::uint32_t slot : zone.subjects) members_.remove(subjects_[slot].inside, handle);
    });
    for (const std::uint32_t number : strayed_) members_.remove(subjects_[changes_[number].slot].inside, handle);
    if (everyone_) slots_->for_each([&](std::uint32_t slot) { members_.remove(subjects_[slot].inside, handle); });
  }
  void discard(std::uint32_t handle) {
    const Fence& fence = *fences_[handle];
    for (Gone& gone : gone_) members_.remove(gone.inside, handle);
    if (!fence.own) crossable_ -= fence.cross;
    std::erase(owners_, handle);
    fences_[handle].reset();
    first_free_ = std::min(first_free_, std::size_t{handle});
  }

  std::map<std::int64_t, std::uint32_t> numbers_;
  std::size_t first_free_ = 0;
  bool carries_ = false;  // whether a subject has come from another index since crossings were last taken
};

}  // namespace dynhull
