// Who has crossed: by the zone of each subject, exactly, for the fences that cover or touch the zone and those that it
// was inside of.
#pragma once

#include "reports.hpp"

namespace dynhull {

class Decisions {
 public:
  Decisions(Zoning& zoning, Reports& reports) : zoning_(zoning), reports_(reports) {}

  // What is found of a subject: that it enters or leaves a fence, or, after all that, that it may have passed through
  // others.
  struct Found {
    std::uint32_t fence, slot;
    int change;
    std::optional<double> distance;
  };
  using FoundList = std::vector<Found>;

  // Where a subject was that has changed or is gone; around the own hull, one from another index was nowhere.
  template <class Changed>
  static Point place_before(const Fence& fence, const Changed& changed) {
    return changed.fresh && (!changed.carried || fence.own) ? Reports::NOWHERE : changed.before;
  }

  // Finds the fences that a subject in this zone, with this box, enters or leaves. Changes nothing else than its own
  // `decided`.
  void decide(std::uint32_t slot, const Zone& zone, const SafeBox& box, FoundList& found) {
    const Point p = (*zoning_.slots)[slot].place;
    Reports::Change* const change = reports_.change_of(slot);
    // The state before is that of areas which are still there, and the way from there is within the zone.
    const bool known = !zoning_.everyone && reports_.recent.empty() && change && !change->fresh && !change->carried &&
                       !change->decided && zone.holds(change->before);
    if (change) change->decided = true;
    if (!known) decide_covering(slot, zone, found);
    const bool stays = known && box.holds(change->before);  // no boundary is between
    for (std::size_t i = 0; i < zone.pieces.size() && !stays;) {
      const std::span<const Piece> run = zone.run(i);
      i += run.size();
      const bool from_before = known && !run[0].wide;
      if (from_before && !any_meets(run, Box::of({change->before, p}))) continue;
      const std::uint32_t handle = run[0].fence;
      const bool was = zoning_.members.has(zoning_.subjects[slot].inside, handle);
      const bool now =
          from_before ? holds(run, change->before, was, p, was) : holds(run, zone.anchor(), run[0].inside, p, was);
      if (now == was) continue;
      const bool elsewhere = now || run[0].disk || zoning_.metres;
      find(found, handle, slot, now ? +1 : -1, elsewhere ? std::nullopt : zone.distance(run, p));
    }
    if (change && crossable > 0) found.push_back({NONE, slot, 0, {}});
  }

  // Reports what was found, when all of these subjects are listed.
  void cross_found(FoundList& found) {
    former_.clear();
    for (std::size_t i = 0; i < found.size(); ++i) {
      const Found& each = found[i];
      if (each.fence != NONE) {
        if (each.change < 0) former_.push_back(each.fence);
        cross(each.fence, each.slot, each.change, each.distance);
        continue;
      }
      decide_ways(*reports_.change_of(each.slot), (*zoning_.slots)[each.slot].place);
      former_.clear();
    }
    found.clear();
  }

  // Where a subject was before, or when the fence was set; nothing if it was not there.
  std::optional<Point> start(const Fence& fence, std::uint32_t slot) const {
    if (fence.earlier)
      if (const auto entry = fence.earlier->find(reports_.key_of(slot)); entry != fence.earlier->end())
        return entry->second;
    const Reports::Change* const change = reports_.change_of(slot);
    if (change == nullptr) return (*zoning_.slots)[slot].place;
    return change->fresh && (!change->carried || fence.own) ? std::nullopt : std::optional(change->before);
  }

  void decide_waiting() {
    for (; !zoning_.waiting.empty(); zoning_.waiting.pop_back()) {
      const std::uint32_t number = zoning_.waiting.back();
      const Zone& zone = zoning_.zones[number];
      for (const std::uint32_t handle : zone.pending) {
        const bool covers = zone.covered_by(handle);
        const std::span<const Piece> run = zone.run_of(handle);
        for (std::size_t at = 0; at < zone.subjects.size(); ++at) {
          if (at + Zoning::LOOKAHEAD < zone.subjects.size()) {
            prefetch(&(*zoning_.slots)[zone.subjects[at + Zoning::LOOKAHEAD]]);
            prefetch(&zoning_.subjects[zone.subjects[at + Zoning::LOOKAHEAD]]);
          }
          const std::uint32_t slot = zone.subjects[at];
          const bool was = zoning_.members.has(zoning_.subjects[slot].inside, handle);
          const bool now =
              covers || (!run.empty() && holds(run, zone.anchor(), run[0].inside, (*zoning_.slots)[slot].place, was));
          if (now != was) cross(handle, slot, now ? +1 : -1);
        }
      }
      zoning_.zones[number].pending.clear();
    }
  }

  // Reports a crossing and notes the new state.
  void cross(std::uint32_t handle, std::uint32_t slot, int change, std::optional<double> distance = {}) {
    const Found found = {handle, slot, change, distance};
    reports_.append_key(taken, slot, row_of(found));
    try {
      note(found);
    } catch (...) {
      taken.rows.pop_back();
      throw;
    }
  }

  // Makes the rows of all that was found, in order, and reports them later.
  void write_found() {
    ahead_ = {};
    for (std::size_t i = 0; i < found[0].size(); ++i) {
      Crossing row = row_of(found[0][i]);
      row.found = static_cast<std::uint32_t>(i);
      reports_.append_key(ahead_, found[0][i].slot, row);
    }
    ahead_.sort(zoning_.slots->strings());
  }
  void cross_ahead() {
    taken = std::exchange(ahead_, {});
    for (std::size_t i = 0; i < taken.rows.size(); ++i) {
      if (i + Zoning::LOOKAHEAD < taken.rows.size()) {
        const Found& later = found[0][taken.rows[i + Zoning::LOOKAHEAD].found];
        prefetch(zoning_.fences[later.fence].get());
        prefetch(&zoning_.subjects[later.slot]);
      }
      try {
        note(found[0][taken.rows[i].found]);
      } catch (...) {
        taken.rows.resize(i);  // the next call finds the others
        throw;
      }
    }
  }

  // Reports who was inside as a subject of another index, and is inside.
  void report_carried() {
    for (std::size_t i = 0; i < reports_.changes.size(); ++i) {
      const Reports::Change& change = reports_.changes[i];
      if (!change.carried || !reports_.current(i)) continue;
      for (const std::uint32_t handle : zoning_.members.of(zoning_.subjects[change.slot].inside)) {
        const Fence& fence = *zoning_.fences[handle];
        if (fence.own || (fence.earlier && fence.earlier->contains(reports_.key_of(change.slot)))) continue;
        Crossing row{};
        row.fence = fence.number;
        row.now = (*zoning_.slots)[change.slot].place;
        row.before = change.before;
        row.distance = fence.area->distance(row.now);
        row.change = 2;
        row.cause = static_cast<std::uint8_t>(MOVED | (changed(fence) ? AREA : 0));
        reports_.append_key(taken, change.slot, row);
      }
    }
  }

  void report_gone() {
    for (Reports::Gone& gone : reports_.absent) {
      if (gone.done) continue;
      for (const std::uint32_t handle : reports_.owners)
        if (reports_.was_inside(handle, gone)) {
          zoning_.members.add(gone.inside, handle);
          try {
            leave(handle, gone);
          } catch (...) {
            zoning_.members.remove(gone.inside, handle);
            throw;
          }
        }
      former_.assign(zoning_.members.of(gone.inside).begin(), zoning_.members.of(gone.inside).end());
      for (const std::uint32_t handle : former_) {
        if (zoning_.fences[handle]->own) continue;
        leave(handle, gone);
        zoning_.members.remove(gone.inside, handle);
      }
      gone.done = true;
    }
  }

  std::size_t crossable = 0;  // fences that report who passes through, other than those around the own hull
  Crossings taken;
  FoundList found[Reports::MOST_PARTS];

 private:
  static bool changed(const Fence& fence) {
    return fence.given || fence.area != fence.decided || fence.own != fence.decided_own;
  }

  Crossing row_of(const Found& each) const {
    const Fence& fence = *zoning_.fences[each.fence];
    const Reports::Change* const moved = reports_.change_of(each.slot);
    Crossing row{};
    row.fence = fence.number;
    row.now = (*zoning_.slots)[each.slot].place;
    row.before = moved ? place_before(fence, *moved) : row.now;
    row.change = static_cast<std::int8_t>(each.change);
    if (moved && moved->carried && !fence.own)
      row.cause = MOVED;
    else if (moved && moved->fresh)
      row.cause = APPEARED;
    else if (!(row.before == row.now))
      row.cause = MOVED;
    else
      row.cause = 0;
    if (changed(fence) || row.cause == 0) row.cause |= AREA;
    row.distance = each.distance ? *each.distance : each.change > 0 ? 0 : fence.area->distance_to_boundary(row.now);
    return row;
  }

  // Notes the new state.
  void note(const Found& each) {
    Fence& fence = *zoning_.fences[each.fence];
    Members& inside = zoning_.subjects[each.slot].inside;
    if (each.change != 0 && (each.change > 0) != fence.own)
      zoning_.members.add(inside, each.fence);
    else if (each.change != 0)
      zoning_.members.remove(inside, each.fence);
    fence.count += each.change;
  }

  void find(FoundList& found, std::uint32_t handle, std::uint32_t slot, int change,
            std::optional<double> distance = {}) const {
    prefetch(zoning_.fences[handle].get());
    found.push_back({handle, slot, change, distance});
  }

  // Decides for the fences that cover a zone, and for those that are not near it.
  void decide_covering(std::uint32_t slot, const Zone& zone, FoundList& found) const {
    const auto is_near = [&](std::uint32_t handle) { return zone.covered_by(handle) || !zone.run_of(handle).empty(); };
    for (const std::uint32_t handle : zoning_.members.of(zoning_.subjects[slot].inside))
      if (!is_near(handle) && !zoning_.fences[handle]->own) find(found, handle, slot, -1);
    for (const std::uint32_t handle : zone.covering)
      if (!zoning_.members.has(zoning_.subjects[slot].inside, handle)) find(found, handle, slot, +1);
  }

  // Decides for the fence of these pieces of a zone, by the way to p from another point of the zone, where it is known
  // whether that is inside.
  bool holds(std::span<const Piece> run, Point from, bool inside, Point p, bool was) const {
    const std::optional<bool> after = run[0].simple ? inside_after(run, from, inside, p) : std::nullopt;
    if (after && (*after || !run[0].wide || !was)) return *after;
    const Area& area = *zoning_.fences[run[0].fence]->area;
    const int where = after ? -1 : area.where(p);
    if (where >= (area.closed ? 0 : 1)) return true;
    if (!was || area.margin == 0) return false;
    if (where == 0) return true;
    if (area.kind == Area::Kind::DISK) return compare_distance(p, area.center, area.radius, area.margin) <= 0;
    return std::any_of(run.begin(), run.end(), [&](const Piece& piece) { return area.is_near(p, piece.edge); });
  }

  // Reports the fences that a subject has passed through: it was outside, is outside, and the way meets the area.
  void decide_ways(const Reports::Change& change, Point now) {
    ways_.clear();
    const std::uint32_t slot = change.slot;
    const auto collect = [&](Point from) {
      std::vector<std::uint32_t> ids(1, 0);
      const Strip way = {{from, now}, 0, -1};
      zoning_.zones.descend(
          ids, [&](std::uint32_t) { return way; }, [](Point) { return false; },
          [&](std::uint32_t number, std::span<const std::uint32_t>) {
            for (const std::uint32_t handle : zoning_.zones[number].covering) ways_.push_back(handle);
            for (const Piece& piece : zoning_.zones[number].pieces) ways_.push_back(piece.fence);
          });
    };
    if ((!change.fresh || change.carried) && !(change.before == now)) collect(change.before);
    for (const std::uint32_t handle : reports_.recent) {  // a place at the time when a fence was set
      const Fence* const fence = zoning_.fences[handle].get();
      if (fence == nullptr || !fence->cross || !fence->earlier) continue;
      const std::optional<Point> from = start(*fence, slot);
      if (from && !(*from == now) && !(*from == change.before)) collect(*from);
    }
    std::sort(ways_.begin(), ways_.end());
    ways_.erase(std::unique(ways_.begin(), ways_.end()), ways_.end());
    for (const std::uint32_t handle : ways_) {
      const Fence& fence = *zoning_.fences[handle];
      if (!fence.cross || zoning_.members.has(zoning_.subjects[slot].inside, handle) || just_left(handle)) continue;
      const std::optional<Point> from = start(fence, slot);
      if (from && !(*from == now) && fence.area->meets(*from, now)) cross(handle, slot, 0);
    }
  }

  bool just_left(std::uint32_t handle) const {
    return std::find(former_.begin(), former_.end(), handle) != former_.end();
  }

  void leave(std::uint32_t handle, const Reports::Gone& gone) {
    Fence& fence = *zoning_.fences[handle];
    Crossing row{};
    row.fence = fence.number;
    row.now = Reports::NOWHERE;
    row.before = place_before(fence, gone);
    row.distance = NO_TIME;
    row.change = -1;
    row.cause = static_cast<std::uint8_t>(gone.cause | (changed(fence) ? AREA : 0));
    reports_.append_key(taken, gone, row);
    --fence.count;
  }

  Zoning& zoning_;
  Reports& reports_;
  std::vector<std::uint32_t> former_, ways_;  // fences of one subject, while they change
  Crossings ahead_;                           // what was found, until it is taken
};

}  // namespace dynhull
