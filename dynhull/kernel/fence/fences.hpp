// An index of fences over the entities of a hull: fences come, change and go. The reference in Python is
// dynhull/_fences.py.
//
// A new area visits the zones that its changed edges touch, and those between the old and the new boundary; their
// subjects are decided when crossings are taken. Its parts: where all are (zoning), what the entities have reported
// (reports), who has crossed because of that (decisions), and the fences around the subjects' own hull (own hulls).
#pragma once

#include <map>
#include <unordered_map>
#include <unordered_set>

#include "own_hulls.hpp"

namespace dynhull {

// A subject that was removed: its place before, and the fences that it was inside of.
struct Departure {
  Point before;
  std::vector<std::int64_t> inside;
};
using Departures = std::unordered_map<std::string, Departure, HashOfKey>;  // by key, as bytes
// A subject that may be new, and where it comes from.
struct Arrival {
  std::uint32_t slot;
  Departure* departure;
};

class Fences {
 public:
  explicit Fences(const Slots& slots, std::shared_ptr<const Metres> metres = {})
      : zoning_(slots, std::move(metres)),
        reports_(zoning_),
        decisions_(zoning_, reports_),
        own_hulls_(zoning_, reports_, decisions_) {}
  Fences(const Fences&) = delete;

  // What the entities report to.
  Reports& reports() { return reports_; }

  std::size_t size() const { return numbers_.size(); }
  bool has(std::int64_t number) const { return numbers_.contains(number); }
  std::int64_t count(std::int64_t number) const { return fence(number).count; }
  std::shared_ptr<const Area> area(std::int64_t number) const { return fence(number).area; }
  bool is_own(std::int64_t number) const { return fence(number).own; }

  // Adds a fence, or replaces the area of one. `inside`: slots to be inside of a fence that is then new in any case.
  void set(const HullTree& tree, std::int64_t number, Area area, bool cross, bool own,
           const std::vector<std::uint32_t>* inside) {
    reports_.ready();
    area.metres = zoning_.metres;
    const auto entry = numbers_.find(number);
    if (entry == numbers_.end()) return add_number(tree, number, std::move(area), cross, own, inside);
    const std::uint32_t handle = entry->second;
    Fence& fence = *zoning_.fences[handle];
    if (cross && !own) reports_.stray_changed();
    if (inside || fence.own != own) {
      entry->second = inside ? add(tree, number, std::move(area), cross, own, inside)
                             : add_other_kind(tree, handle, std::move(area), cross, own);
      remove(handle);
    } else if (own) {
      reports_.recent.push_back(handle);
      auto empty = std::make_shared<const Area>(Area::of_hull({}, true, area.margin));
      if (fence.area->margin != area.margin) fence.area = std::move(empty);  // until it is decided
      reports_.owners_changed = true;
      fence.cross = cross;
    } else {
      if (!(*fence.area == area)) {
        reports_.recent.push_back(handle);
        zoning_.torn = true;
        replace(handle, std::make_shared<const Area>(std::move(area)));
        zoning_.torn = false;
      }
      decisions_.crossable += std::size_t{cross} - std::size_t{fence.cross};
      fence.cross = cross;
    }
    zoning_.perhaps_divide_crowded();
  }

  // Removes a fence, and returns the keys of the subjects that were inside.
  Crossings drop(std::int64_t number) {
    reports_.ready();
    Crossings keys = inside(number);
    const auto entry = numbers_.find(number);
    remove(entry->second);
    numbers_.erase(entry);
    return keys;
  }

  // The keys inside, in order.
  Crossings inside(std::int64_t number) {
    reports_.ready();
    Crossings keys;
    const std::uint32_t handle = numbers_.at(number);
    reports_.for_each_inside(handle, [&](std::uint32_t slot) { reports_.append_key(keys, slot); });
    for (const Reports::Gone& gone : reports_.absent)
      if (reports_.was_inside(handle, gone)) reports_.append_key(keys, gone);
    keys.sort(zoning_.slots->strings());
    return keys;
  }

  // Subjects that go over from one index to another

  // Those among some keys that were removed since crossings were last taken.
  Departures departures(const std::vector<std::string>& keys) {
    reports_.ready();
    Departures found;
    if (reports_.absent.empty()) return found;
    const std::unordered_set<std::string_view, HashOfKey> asked(keys.begin(), keys.end());
    for (const Reports::Gone& gone : reports_.absent) {
      if (gone.cause != REMOVED || gone.done || gone.given || (gone.fresh && !gone.carried)) continue;
      std::string key = reports_.key_of(gone);
      if (!asked.contains(key)) continue;
      Departure departure{gone.before, {}};
      for (const std::uint32_t handle : zoning_.members.of(gone.inside))
        if (!zoning_.fences[handle]->own) departure.inside.push_back(zoning_.fences[handle]->number);
      found.insert_or_assign(std::move(key), std::move(departure));
    }
    return found;
  }

  // Lets subjects that are new, each by its slot with where it comes from, have come from there. Their departures keep
  // the fences of this index. Returns which of them are new, by row.
  std::vector<bool> arrive(std::span<const Arrival> arrivals) {
    reports_.ready();  // once for all: this looks at whatever has changed
    std::vector<bool> arrived(arrivals.size());
    for (std::size_t row = 0; row < arrivals.size(); ++row)
      arrived[row] = arrive(arrivals[row].slot, *arrivals[row].departure);
    return arrived;
  }

  // Forgets subjects that have gone over.
  void give(const Departures& departures) {
    for (Reports::Gone& gone : reports_.absent) {
      if (gone.cause != REMOVED || gone.done || gone.given || (gone.fresh && !gone.carried)) continue;
      const auto departure = departures.find(reports_.key_of(gone));
      if (departure == departures.end()) continue;
      gone.given = true;
      for (const std::int64_t number : departure->second.inside) {
        const auto entry = numbers_.find(number);
        if (entry == numbers_.end() || !zoning_.members.has(gone.inside, entry->second)) continue;
        zoning_.members.remove(gone.inside, entry->second);
        --zoning_.fences[entry->second]->count;
      }
    }
  }

  // Whether there is nothing to decide.
  bool idle() const {
    return reports_.strayed.empty() && reports_.absent.empty() && zoning_.waiting.empty() && !zoning_.torn &&
           !zoning_.everyone && decisions_.taken.rows.empty() &&
           (reports_.owners.empty() || (reports_.changes.empty() && !reports_.owners_changed));
  }
  // About how many subjects are to be decided.
  std::size_t work() const {
    return reports_.strayed.size() + reports_.absent.size() +
           Zoning::CROWD * (zoning_.waiting.size() + reports_.owners.size());
  }
  // Whether a batch that moves subjects may be looked at while it takes place, as it alone decides what they cross.
  bool at_rest() const {
    return zoning_.zoned && reports_.at_rest() && decisions_.crossable == 0 && decisions_.taken.rows.empty();
  }
  // Finds what `take` would, of the one batch that has been reported. If memory does not suffice, `take` finds it.
  void look_ahead() {
    try {
      for (auto& found : decisions_.found) found.clear();
      reports_.prepare(true);
      settle_strayed([](std::size_t) {});
      zoning_.divide_crowded();
      decisions_.write_found();
      reports_.ahead = true;
    } catch (const std::bad_alloc&) {
    }
  }
  // Forgets that batch, which has not taken place after all. Zones may list subjects where they have not come to.
  void forget_ahead() {
    zoning_.torn |= !reports_.changes.empty();
    reports_.begin_again();
  }
  // After a look that found nothing to decide.
  void rest() { reports_.begin_again(); }

  // What has crossed since the last call, in order. `slots_at` returns the slot of the least key at each of some
  // vertices. If memory does not suffice, nothing is lost: the next call returns it.
  template <class SlotsAt>
  Crossings take(HullTree& tree, SlotsAt slots_at) {
    if (std::exchange(reports_.ahead, false)) {
      decisions_.cross_ahead();
      reports_.begin_again();
      return std::exchange(decisions_.taken, {});
    }
    for (auto& found : decisions_.found) found.clear();
    reports_.prepare(reports_.only_strayed_matter());
    for (const std::uint32_t handle : reports_.recent)
      if (zoning_.fences[handle] && *zoning_.fences[handle]->area == *zoning_.fences[handle]->decided)
        zoning_.fences[handle]->decided = zoning_.fences[handle]->area;
    if (zoning_.everyone) {
      reports_.settle_strayed([](const Zoning::Stray&, const Zone&, std::size_t) {}, [](std::size_t) {});
      zoning_.slots->for_each([&](std::uint32_t slot) {
        if (zoning_.subjects[slot].zone == NONE) return;  // there are no zones
        decisions_.decide(slot, zoning_.zones[zoning_.subjects[slot].zone], SafeBox::nowhere(), decisions_.found[0]);
        decisions_.cross_found(decisions_.found[0]);
      });
    } else {
      settle_strayed([&](std::size_t part) { decisions_.cross_found(decisions_.found[part]); });
    }
    zoning_.divide_crowded();
    decisions_.decide_waiting();
    for (const std::uint32_t handle : reports_.owners) own_hulls_.look_at_own(*zoning_.fences[handle], tree);
    if (carries_) decisions_.report_carried();
    decisions_.report_gone();
    own_hulls_.list_fresh();
    for (const std::uint32_t handle : reports_.owners) own_hulls_.decide_own(handle, tree, slots_at);
    decisions_.taken.sort(zoning_.slots->strings());
    reports_.begin_again();
    carries_ = false;
    return std::exchange(decisions_.taken, {});
  }

  std::size_t bytes() const {
    std::size_t bytes = zoning_.subjects.bytes() + zoning_.zones.bytes() + zoning_.members.bytes() + reports_.bytes();
    for (const auto& fence : zoning_.fences) bytes += fence ? fence->bytes() : 0;
    return bytes;
  }

  // Throws std::logic_error unless every subject is listed in the zone of its box, and every fence where it is.
  void check() const {
    const auto require = [](bool holds, const char* message) {
      if (!holds) throw std::logic_error(message);
    };
    if (!zoning_.zoned || zoning_.torn) return;
    for (std::uint32_t zone = 0; zone < zoning_.zones.size(); ++zone) {
      for (std::uint32_t at = 0; at < zoning_.zones[zone].subjects.size(); ++at) {
        const std::uint32_t slot = zoning_.zones[zone].subjects[at];
        require(zoning_.there(slot) && zoning_.subjects[slot].zone == zone && zoning_.subjects[slot].at == at,
                "a subject misfiled");
        const Point p = (*zoning_.slots)[slot].place;
        if (zoning_.subjects.box(slot).holds(p)) require(zoning_.zones.find(p) == zone, "a subject in another zone");
      }
      if (Zones::empty(zoning_.zones[zone].box)) continue;  // no point is in it
      for (const std::uint32_t handle : zoning_.zones[zone].covering) {
        require(zoning_.fences[handle] && !zoning_.fences[handle]->own, "a fence that is gone covers a zone");
        require(zoning_.fences[handle]->area->holds(zoning_.zones[zone].anchor()),
                "a fence that does not cover its zone");
      }
      for (const Piece& piece : zoning_.zones[zone].pieces)
        require(!piece.simple ||
                    piece.inside == (zoning_.fences[piece.fence]->area->where(zoning_.zones[zone].anchor()) > 0),
                "a piece whose anchor is elsewhere");
    }
  }

 private:
  const Fence& fence(std::int64_t number) const { return *zoning_.fences[numbers_.at(number)]; }

  // Lists those that have strayed, and decides what they cross. Calls `then` with each part of what is found.
  template <class Then>
  void settle_strayed(Then then) {
    reports_.settle_strayed(
        [&](const Zoning::Stray& stray, const Zone& zone, std::size_t part) {
          decisions_.decide(stray.slot, zone, stray.box, decisions_.found[part]);
        },
        then);
  }

  bool arrive(std::uint32_t slot, Departure& departure) {
    Reports::Change* const change = zoning_.there(slot) ? reports_.change_of(slot) : nullptr;
    if (change == nullptr || !change->fresh || change->carried) return false;
    std::erase_if(departure.inside, [&](std::int64_t number) {
      const auto entry = numbers_.find(number);
      return entry == numbers_.end() || zoning_.fences[entry->second]->own;
    });
    for (const std::int64_t number : departure.inside) {
      const std::uint32_t handle = numbers_.at(number);
      if (zoning_.members.has(zoning_.subjects[slot].inside, handle)) continue;
      zoning_.members.add(zoning_.subjects[slot].inside, handle);
      ++zoning_.fences[handle]->count;
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
    zoning_.perhaps_divide_crowded();
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
    fence->earlier = reports_.places();
    Zoning::grow(reports_.recent, 1);
    Zoning::grow(reports_.owners, 1);
    zoning_.torn = true;
    if (!zoning_.zoned && !own) {
      zoning_.zoned = true;
      const bool everyone = zoning_.everyone;  // no fence had a zone: nothing is to be decided again
      reports_.rebuild();
      zoning_.everyone = everyone;
      zoning_.torn = true;
    }
    const std::uint32_t handle = free_handle();
    zoning_.fences[handle] = std::move(fence);
    reports_.recent.push_back(handle);
    if (own)
      reports_.owners.push_back(handle);
    else
      decisions_.crossable += cross;
    try {
      own ? own_hulls_.add_own(tree, handle, inside) : add_pieces(handle, inside);
    } catch (...) {
      discard(handle);
      throw;
    }
    zoning_.torn = false;
    return handle;
  }

  // Between a fence around the subjects' own hull and another one: who was inside, stays inside until decided.
  std::uint32_t add_other_kind(const HullTree& tree, std::uint32_t old, Area area, bool cross, bool own) {
    std::vector<std::uint32_t> inside;
    reports_.for_each_inside(old, [&](std::uint32_t slot) { inside.push_back(slot); });
    const std::uint32_t handle = add(tree, zoning_.fences[old]->number, std::move(area), cross, own, &inside);
    Fence& fence = *zoning_.fences[handle];
    fence.decided = zoning_.fences[old]->decided;
    fence.decided_own = zoning_.fences[old]->decided_own;
    fence.given = zoning_.fences[old]->given;
    fence.earlier = zoning_.fences[old]->earlier;
    try {
      for (Reports::Gone& gone : reports_.absent) {
        const bool was = reports_.was_inside(old, gone);
        fence.count += was;
        if (was != own && (!own || reports_.was_there(fence, reports_.key_of(gone), gone.fresh && !gone.returned)))
          zoning_.members.add(gone.inside, handle);
      }
    } catch (...) {
      discard(handle);
      zoning_.torn = true;
      throw;
    }
    return handle;
  }

  std::uint32_t free_handle() {
    for (; first_free_ < zoning_.fences.size(); ++first_free_)
      if (!zoning_.fences[first_free_]) return static_cast<std::uint32_t>(first_free_);
    zoning_.fences.emplace_back();
    return static_cast<std::uint32_t>(first_free_);
  }

  void add_pieces(std::uint32_t handle, const std::vector<std::uint32_t>* inside) {
    Fence& fence = *zoning_.fences[handle];
    const Area& area = *fence.area;
    const std::vector<Edge> edges = sorted_edges(area);
    std::vector<std::uint32_t> ids(edges.size());
    std::iota(ids.begin(), ids.end(), 0);
    std::vector<Edge> near;
    for (std::size_t i = 0; inside && i < inside->size(); ++i) {
      zoning_.members.add(zoning_.subjects[(*inside)[i]].inside, handle);
      ++fence.count;
    }
    zoning_.zones.descend(
        ids, [&](std::uint32_t id) { return dynhull::strip_of(area, edges[id]); },
        [&](Point p) { return area.holds(p); },
        [&](std::uint32_t number, std::span<const std::uint32_t> touching) {
          Zone& zone = zoning_.zones[number];
          near.clear();
          for (const std::uint32_t id : touching) near.push_back(edges[id]);
          if (touching.empty())
            zone.covering.push_back(handle);
          else
            zoning_.append_pieces(zone, handle, area, near, zoning_.inside_at(area, zone.anchor()));
          if (inside) zoning_.wait_for(handle, number);
          if (zoning_.is_crowded(zone)) zoning_.crowded.push_back(number);
          for (const std::uint32_t slot : zone.subjects) {
            const Point p = (*zoning_.slots)[slot].place;
            keep_off(slot, area, near);
            if (inside || !(touching.empty() || area.holds(p))) continue;
            zoning_.members.add(zoning_.subjects[slot].inside, handle);
            ++fence.count;
          }
        });
    if (inside)
      for (const std::uint32_t slot : *inside) zoning_.wait_for(handle, zoning_.subjects[slot].zone);
  }
  // Makes the box of a subject smaller, so that it keeps off some edges of an area.
  void keep_off(std::uint32_t slot, const Area& area, std::span<const Edge> edges) {
    Clearance clearance(zoning_.subjects.box(slot), (*zoning_.slots)[slot].place);
    for (const Edge& edge : edges) clearance.keep_off(dynhull::strip_of(area, edge));
    zoning_.subjects.box(slot) = clearance.box();
  }
  // Replaces an area. Edges that stay need no visit, unless several polygons make one of them lie inside of another.
  void replace(std::uint32_t handle, std::shared_ptr<const Area> area) {
    Fence& fence = *zoning_.fences[handle];
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
    zoning_.zones.descend(
        ids,
        [&](std::uint32_t id) {
          return is_added(id) ? dynhull::strip_of(*area, added[id])
                              : dynhull::strip_of(*old, removed[id - added.size()]);
        },
        [&](Point p) { return old->holds(p) != area->holds(p); },
        [&](std::uint32_t number, std::span<const std::uint32_t> touching) {
          Zone& zone = zoning_.zones[number];
          zoning_.wait_for(handle, number);
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
            zoning_.append_pieces(zone, handle, *area, near, zoning_.inside_at(*area, zone.anchor()));
          }
          if (zoning_.is_crowded(zone)) zoning_.crowded.push_back(number);
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
      zoning_.torn = true;
    }
    discard(handle);
  }
  void forget(std::uint32_t handle) {
    const Fence& fence = *zoning_.fences[handle];
    if (fence.own) {
      for (const std::uint32_t slot : fence.outside) zoning_.members.remove(zoning_.subjects[slot].inside, handle);
      return;
    }
    zoning_.for_each_zone(handle, [&](std::uint32_t number) {
      Zone& zone = zoning_.zones[number];
      std::erase(zone.covering, handle);
      std::erase(zone.pending, handle);
      std::erase_if(zone.pieces, [&](const Piece& piece) { return piece.fence == handle; });
      for (const std::uint32_t slot : zone.subjects) zoning_.members.remove(zoning_.subjects[slot].inside, handle);
    });
    for (const std::uint32_t number : reports_.strayed)
      zoning_.members.remove(zoning_.subjects[reports_.changes[number].slot].inside, handle);
    if (zoning_.everyone)
      zoning_.slots->for_each(
          [&](std::uint32_t slot) { zoning_.members.remove(zoning_.subjects[slot].inside, handle); });
  }
  void discard(std::uint32_t handle) {
    const Fence& fence = *zoning_.fences[handle];
    for (Reports::Gone& gone : reports_.absent) zoning_.members.remove(gone.inside, handle);
    if (!fence.own) decisions_.crossable -= fence.cross;
    std::erase(reports_.owners, handle);
    zoning_.fences[handle].reset();
    first_free_ = std::min(first_free_, std::size_t{handle});
  }

  Zoning zoning_;        // where subjects and boundaries are
  Reports reports_;      // what has changed since crossings were last taken
  Decisions decisions_;  // who has crossed
  OwnHulls own_hulls_;   // the fences around the subjects' own hull
  std::map<std::int64_t, std::uint32_t> numbers_;
  std::size_t first_free_ = 0;
  bool carries_ = false;  // whether a subject has come from another index since crossings were last taken
};

}  // namespace dynhull
