// Subjects and the boundaries of fences, filed in zones.
//
// Each subject has a box in which no boundary is, so that most moves cost four comparisons. A zone with too many
// subjects or pieces of boundary is divided.
#pragma once

#include <memory>
#include <numeric>

#include "../keyed/slots.hpp"
#include "fence.hpp"
#include "subjects.hpp"
#include "zones.hpp"

namespace dynhull {

class Zoning {
 protected:
  static constexpr std::size_t CROWD = 96, MANY_PIECES = 32;  // beyond which a zone is divided
  static constexpr std::size_t LOOKAHEAD = 16;                // subjects that are being prefetched

  explicit Zoning(const Slots& slots) : slots_(&slots) { subjects_.reserve(slots_->end()); }

  template <class Item>
  static void grow(std::vector<Item>& items, std::size_t extra) {
    if (items.capacity() < items.size() + extra) items.reserve(std::max(items.size() + extra, 2 * items.size()));
  }

  // Whether a slot has a subject now: since it was noted, all may have left.
  bool there(std::uint32_t slot) const { return slot < slots_->end() && !slots_->free(slot); }

  void unlist(Subject& subject) {
    if (subject.zone == NONE) return;
    std::vector<std::uint32_t>& subjects = zones_[subject.zone].subjects;
    subjects_[subjects.back()].at = subject.at;
    subjects[subject.at] = subjects.back();
    subjects.pop_back();
    subject.zone = NONE;
  }
  void list(std::uint32_t slot, std::uint32_t zone) {
    std::vector<std::uint32_t>& subjects = zones_[zone].subjects;
    subjects.push_back(slot);
    subjects_[slot].zone = zone;
    subjects_[slot].at = static_cast<std::uint32_t>(subjects.size() - 1);
    if (is_crowded(zones_[zone])) crowded_.push_back(zone);
  }

  // A subject that has left its box, with the zone and the box that it gets.
  struct Stray {
    std::uint32_t slot;
    std::uint32_t zone = NONE;
    SafeBox box = SafeBox::nowhere();
  };
  void find_zones(std::span<Stray> strays) const {
    for (const Stray& stray : strays) {
      prefetch(&(*slots_)[stray.slot]);
      if (const std::uint32_t zone = subjects_[stray.slot].zone; zone != NONE) prefetch(&zones_[zone]);
    }
    for (Stray& stray : strays) {
      const Point p = (*slots_)[stray.slot].place;
      const std::uint32_t old = stray.zone = subjects_[stray.slot].zone;
      if (old != NONE && zones_[old].holds(p)) continue;
      stray.zone = zones_.find(p);
      if (old != NONE) zones_[old].fetch_subjects();
      zones_[stray.zone].fetch();
    }
    for (const Stray& stray : strays) zones_[stray.zone].fetch_pieces();
  }
  void relist(const Stray& stray) {
    Subject& subject = subjects_[stray.slot];
    if (stray.zone != subject.zone) {
      grow(zones_[stray.zone].subjects, 1);
      unlist(subject);
      list(stray.slot, stray.zone);
    }
    subjects_.box(stray.slot) = stray.box;
  }
  // The box of a subject at p.
  SafeBox box_in(const Zone& zone, Point p) const {
    SafeBox box = SafeBox::everywhere();
    box.stay_in(zone.box, p);
    Clearance clearance(box, p);
    for (const Piece& piece : zone.pieces)
      piece.wide ? clearance.keep_off(strip_of(piece)) : clearance.keep_off(piece.edge, Box::of(piece.edge));
    return clearance.box();
  }

  // Makes the zones from the fences and the places.
  void make_zones() {
    Zone& all = zones_[0];
    for (std::uint32_t handle = 0; handle < fences_.size(); ++handle)
      if (fences_[handle] && !fences_[handle]->own) {
        const std::vector<Edge> edges = sorted_edges(*fences_[handle]->area);
        append_pieces(all, handle, *fences_[handle]->area, edges, inside_at(*fences_[handle]->area, all.anchor()));
      }
    all.subjects.reserve(slots_->size());
    slots_->for_each([&](std::uint32_t slot) {
      Subject& subject = subjects_[slot];
      subject.zone = 0;
      subject.at = static_cast<std::uint32_t>(all.subjects.size());
      all.subjects.push_back(slot);
    });
    crowded_.assign(1, 0);
    divide_crowded();
    for (std::uint32_t zone = 0; zone < zones_.size(); ++zone)
      for (const std::uint32_t slot : zones_[zone].subjects)
        subjects_.box(slot) = box_in(zones_[zone], (*slots_)[slot].place);
  }

  static bool is_crowded(const Zone& zone) {
    return zone.subjects.size() > std::max(CROWD, zone.most) || zone.pieces.size() > std::max(MANY_PIECES, zone.most);
  }

  void divide_crowded() {
    while (!crowded_.empty()) {
      const std::uint32_t zone = crowded_.back();
      crowded_.pop_back();
      if (is_crowded(zones_[zone])) divide(zone);
    }
  }

  // If memory suffices. A crowded zone is slower, and is noticed again when something is added.
  void perhaps_divide_crowded() {
    if (torn_) return;
    try {
      divide_crowded();
    } catch (const std::bad_alloc&) {
      crowded_.clear();
    }
  }

  void divide(std::uint32_t number) {
    Box extent = Box::none();
    const Box box = zones_[number].box;
    const bool by_subjects = zones_[number].subjects.size() > std::max(CROWD, zones_[number].most);
    if (by_subjects)
      for (const std::uint32_t slot : zones_[number].subjects) extent.add((*slots_)[slot].place);
    else
      for (const Piece& piece : zones_[number].pieces) {
        const Box strip = around(strip_of(piece));
        extent.add(strip.least);
        extent.add(strip.greatest);
      }
    Point split = {middle(extent.least.x, extent.greatest.x, box.least.x, box.greatest.x),
                   middle(extent.least.y, extent.greatest.y, box.least.y, box.greatest.y)};
    const std::size_t size = by_subjects ? zones_[number].subjects.size() : zones_[number].pieces.size();
    if (!by_subjects) {  // a cut that most pieces cross only repeats them
      std::size_t across_x = 0, across_y = 0;
      for (const Piece& piece : zones_[number].pieces) {
        const Box strip = around(strip_of(piece));
        across_x += strip.least.x < split.x && split.x <= strip.greatest.x;
        across_y += strip.least.y < split.y && split.y <= strip.greatest.y;
      }
      if (across_x > size / 2 && across_y <= size / 2) split.x = INFINITE;
      if (across_y > size / 2 && across_x <= size / 2) split.y = INFINITE;
    }
    zones_[number].most = 2 * size;  // unless dividing helps
    if (split == HIGHEST) return;

    // Everything that may fail is done on the side.
    Zone parts[4];
    for (unsigned q = 0; q < 4; ++q) parts[q].box = Zones::quarter_of(box, split, q);
    const Zone& old = zones_[number];
    for (const std::uint32_t slot : old.subjects)
      parts[Zones::quarter(split, (*slots_)[slot].place)].subjects.push_back(slot);
    for (Zone& part : parts) {
      part.subjects.shrink_to_fit();
      if (Zones::empty(part.box)) continue;
      part.covering = old.covering;
      part.pending = old.pending;
      for (std::size_t i = 0; i < old.pieces.size();) {
        const std::span<const Piece> run = old.run(i);
        const Area& area = *fences_[run[0].fence]->area;
        const std::size_t first = part.pieces.size();
        for (const Piece& piece : run)
          if (may_touch(strip_of(piece), part.box)) part.pieces.push_back(piece);
        if (first == part.pieces.size()) {
          if (area.holds(part.anchor())) part.covering.push_back(run[0].fence);
        } else {
          const bool inside = inside_at(area, part.anchor());
          for (std::size_t k = first; k < part.pieces.size(); ++k) part.pieces[k].inside = inside;
        }
        i += run.size();
      }
      part.pieces.shrink_to_fit();
    }
    std::size_t largest = 0, pieces = 0;
    for (const Zone& part : parts) {
      largest = std::max(largest, by_subjects ? part.subjects.size() : part.pieces.size());
      pieces += part.pieces.size();
    }
    if (largest == size || (!by_subjects && pieces > 2 * size)) return;
    grow(crowded_, 4);
    grow(waiting_, 4);
    const auto children = zones_.divide(number, split);
    for (unsigned q = 0; q < 4; ++q) {
      Zone& zone = zones_[children[q]];
      zone = std::move(parts[q]);
      for (std::uint32_t at = 0; at < zone.subjects.size(); ++at) {
        Subject& subject = subjects_[zone.subjects[at]];
        subject.zone = children[q];
        subject.at = at;
        subjects_.box(zone.subjects[at]).stay_in(zone.box, (*slots_)[zone.subjects[at]].place);
      }
      if (is_crowded(zone)) crowded_.push_back(children[q]);
      if (!zone.pending.empty()) waiting_.push_back(children[q]);
    }
  }
  // Between the ends of what is in a box; infinite if it is all at one coordinate.
  static double middle(double least, double greatest, double from, double to) {
    least = std::max(least, from);
    greatest = std::min(greatest, to);
    if (!(least < greatest)) return INFINITE;
    const double middle = least / 2 + greatest / 2;
    return middle > least ? middle : greatest;
  }

  Strip strip_of(const Piece& piece) const {
    return piece.wide ? dynhull::strip_of(*fences_[piece.fence]->area, piece.edge) : Strip{piece.edge, 0, -1};
  }
  static bool is_simple(const Area& area) { return area.polygons.size() == 1; }
  static bool inside_at(const Area& area, Point anchor) { return is_simple(area) && area.where(anchor) > 0; }
  static void append_pieces(Zone& zone, std::uint32_t handle, const Area& area, std::span<const Edge> edges,
                            bool inside) {
    const bool disk = area.kind == Area::Kind::DISK;
    for (const Edge& edge : edges)
      zone.pieces.push_back({edge, handle, is_simple(area), disk || area.margin > 0, disk, inside});
  }

  // All subjects of a zone are to be decided again for a fence.
  void wait_for(std::uint32_t handle, std::uint32_t zone) {
    std::vector<std::uint32_t>& pending = zones_[zone].pending;
    if (pending.empty()) waiting_.push_back(zone);
    if (std::find(pending.begin(), pending.end(), handle) == pending.end()) pending.push_back(handle);
  }

  // Visits the zones that list a fence, each once.
  template <class Visit>
  void for_each_zone(std::uint32_t handle, Visit visit) {
    const Area& area = *fences_[handle]->area;
    const std::vector<Edge> edges = sorted_edges(area);
    std::vector<std::uint32_t> ids(edges.size()), zones;
    std::iota(ids.begin(), ids.end(), 0);
    zones_.descend(
        ids, [&](std::uint32_t id) { return dynhull::strip_of(area, edges[id]); },
        [&](Point p) { return area.holds(p); },
        [&](std::uint32_t number, std::span<const std::uint32_t>) { zones.push_back(number); });
    for (const std::uint32_t number : waiting_) {
      const std::vector<std::uint32_t>& pending = zones_[number].pending;
      if (std::find(pending.begin(), pending.end(), handle) != pending.end()) zones.push_back(number);
    }
    std::sort(zones.begin(), zones.end());
    zones.erase(std::unique(zones.begin(), zones.end()), zones.end());
    for (const std::uint32_t number : zones) visit(number);
  }

  const Slots* slots_;
  Subjects subjects_;
  MemberLists members_;
  Zones zones_;
  std::vector<std::uint32_t> crowded_, waiting_;  // zones to divide, and those with subjects to decide
  bool zoned_ = false;                            // whether there are any
  bool torn_ = false;                             // the zones are to be made anew
  bool everyone_ = false;                         // all subjects are to be decided
  std::vector<std::unique_ptr<Fence>> fences_;
  std::vector<std::uint32_t> former_;  // fences of one subject, while they change
};

}  // namespace dynhull
