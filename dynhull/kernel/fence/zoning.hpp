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

struct Zoning {
  static constexpr std::size_t CROWD = 96, MANY_PIECES = 32;  // beyond which a zone is divided
  static constexpr std::size_t LOOKAHEAD = 16;                // subjects that are being prefetched

  Zoning(const Slots& slots, std::shared_ptr<const Metres> metres) : slots(&slots), metres(std::move(metres)) {
    subjects.reserve(slots.end());
  }

  template <class Item>
  static void grow(std::vector<Item>& items, std::size_t extra) {
    if (items.capacity() < items.size() + extra) items.reserve(std::max(items.size() + extra, 2 * items.size()));
  }

  // Whether a slot has a subject now: since it was noted, all may have left.
  bool there(std::uint32_t slot) const { return slot < slots->end() && !slots->free(slot); }

  void unlist(Subject& subject) {
    if (subject.zone == NONE) return;
    std::vector<std::uint32_t>& listed = zones[subject.zone].subjects;
    subjects[listed.back()].at = subject.at;
    listed[subject.at] = listed.back();
    listed.pop_back();
    subject.zone = NONE;
  }
  void list(std::uint32_t slot, std::uint32_t zone) {
    std::vector<std::uint32_t>& listed = zones[zone].subjects;
    listed.push_back(slot);
    subjects[slot].zone = zone;
    subjects[slot].at = static_cast<std::uint32_t>(listed.size() - 1);
    if (is_crowded(zones[zone])) crowded.push_back(zone);
  }

  // A subject that has left its box, with the zone and the box that it gets.
  struct Stray {
    std::uint32_t slot;
    std::uint32_t zone = NONE;
    SafeBox box = SafeBox::nowhere();
  };
  void find_zones(std::span<Stray> strays) const {
    for (const Stray& stray : strays) {
      prefetch(&(*slots)[stray.slot]);
      if (const std::uint32_t zone = subjects[stray.slot].zone; zone != NONE) prefetch(&zones[zone]);
    }
    for (Stray& stray : strays) {
      const Point p = (*slots)[stray.slot].place;
      const std::uint32_t old = stray.zone = subjects[stray.slot].zone;
      if (old != NONE && zones[old].holds(p)) continue;
      stray.zone = zones.find(p);
      if (old != NONE) zones[old].fetch_subjects();
      zones[stray.zone].fetch();
    }
    for (const Stray& stray : strays) zones[stray.zone].fetch_pieces();
  }
  void relist(const Stray& stray) {
    Subject& subject = subjects[stray.slot];
    if (stray.zone != subject.zone) {
      grow(zones[stray.zone].subjects, 1);
      unlist(subject);
      list(stray.slot, stray.zone);
    }
    subjects.box(stray.slot) = stray.box;
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
    Zone& all = zones[0];
    for (std::uint32_t handle = 0; handle < fences.size(); ++handle)
      if (fences[handle] && !fences[handle]->own) {
        const std::vector<Edge> edges = sorted_edges(*fences[handle]->area);
        append_pieces(all, handle, *fences[handle]->area, edges, inside_at(*fences[handle]->area, all.anchor()));
      }
    all.subjects.reserve(slots->size());
    slots->for_each([&](std::uint32_t slot) {
      Subject& subject = subjects[slot];
      subject.zone = 0;
      subject.at = static_cast<std::uint32_t>(all.subjects.size());
      all.subjects.push_back(slot);
    });
    crowded.assign(1, 0);
    divide_crowded();
    for (std::uint32_t zone = 0; zone < zones.size(); ++zone)
      for (const std::uint32_t slot : zones[zone].subjects)
        subjects.box(slot) = box_in(zones[zone], (*slots)[slot].place);
  }

  static bool is_crowded(const Zone& zone) {
    return zone.subjects.size() > std::max(CROWD, zone.most) || zone.pieces.size() > std::max(MANY_PIECES, zone.most);
  }

  void divide_crowded() {
    while (!crowded.empty()) {
      const std::uint32_t zone = crowded.back();
      crowded.pop_back();
      if (is_crowded(zones[zone])) divide(zone);
    }
  }

  // If memory suffices. A crowded zone is slower, and is noticed again when something is added.
  void perhaps_divide_crowded() {
    if (torn) return;
    try {
      divide_crowded();
    } catch (const std::bad_alloc&) {
      crowded.clear();
    }
  }

  void divide(std::uint32_t number) {
    Box extent = Box::none();
    const Box box = zones[number].box;
    const bool by_subjects = zones[number].subjects.size() > std::max(CROWD, zones[number].most);
    if (by_subjects)
      for (const std::uint32_t slot : zones[number].subjects) extent.add((*slots)[slot].place);
    else
      for (const Piece& piece : zones[number].pieces) {
        const Box strip = around(strip_of(piece));
        extent.add(strip.least);
        extent.add(strip.greatest);
      }
    Point split = {middle(extent.least.x, extent.greatest.x, box.least.x, box.greatest.x),
                   middle(extent.least.y, extent.greatest.y, box.least.y, box.greatest.y)};
    const std::size_t size = by_subjects ? zones[number].subjects.size() : zones[number].pieces.size();
    if (!by_subjects) {  // a cut that most pieces cross only repeats them
      std::size_t across_x = 0, across_y = 0;
      for (const Piece& piece : zones[number].pieces) {
        const Box strip = around(strip_of(piece));
        across_x += strip.least.x < split.x && split.x <= strip.greatest.x;
        across_y += strip.least.y < split.y && split.y <= strip.greatest.y;
      }
      if (across_x > size / 2 && across_y <= size / 2) split.x = INFINITE;
      if (across_y > size / 2 && across_x <= size / 2) split.y = INFINITE;
    }
    zones[number].most = 2 * size;  // unless dividing helps
    if (split == HIGHEST) return;

    // Everything that may fail is done on the side.
    Zone parts[4];
    for (unsigned q = 0; q < 4; ++q) parts[q].box = Zones::quarter_of(box, split, q);
    const Zone& old = zones[number];
    for (const std::uint32_t slot : old.subjects)
      parts[Zones::quarter(split, (*slots)[slot].place)].subjects.push_back(slot);
    for (Zone& part : parts) {
      part.subjects.shrink_to_fit();
      if (Zones::empty(part.box)) continue;
      part.covering = old.covering;
      part.pending = old.pending;
      for (std::size_t i = 0; i < old.pieces.size();) {
        const std::span<const Piece> run = old.run(i);
        const Area& area = *fences[run[0].fence]->area;
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
    grow(crowded, 4);
    grow(waiting, 4);
    const auto children = zones.divide(number, split);
    for (unsigned q = 0; q < 4; ++q) {
      Zone& zone = zones[children[q]];
      zone = std::move(parts[q]);
      for (std::uint32_t at = 0; at < zone.subjects.size(); ++at) {
        Subject& subject = subjects[zone.subjects[at]];
        subject.zone = children[q];
        subject.at = at;
        subjects.box(zone.subjects[at]).stay_in(zone.box, (*slots)[zone.subjects[at]].place);
      }
      if (is_crowded(zone)) crowded.push_back(children[q]);
      if (!zone.pending.empty()) waiting.push_back(children[q]);
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
    return piece.wide ? dynhull::strip_of(*fences[piece.fence]->area, piece.edge) : Strip{piece.edge, 0, -1};
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
    std::vector<std::uint32_t>& pending = zones[zone].pending;
    if (pending.empty()) waiting.push_back(zone);
    if (std::find(pending.begin(), pending.end(), handle) == pending.end()) pending.push_back(handle);
  }

  // Visits the zones that list a fence, each once.
  template <class Visit>
  void for_each_zone(std::uint32_t handle, Visit visit) {
    const Area& area = *fences[handle]->area;
    const std::vector<Edge> edges = sorted_edges(area);
    std::vector<std::uint32_t> ids(edges.size()), found;
    std::iota(ids.begin(), ids.end(), 0);
    zones.descend(
        ids, [&](std::uint32_t id) { return dynhull::strip_of(area, edges[id]); },
        [&](Point p) { return area.holds(p); },
        [&](std::uint32_t number, std::span<const std::uint32_t>) { found.push_back(number); });
    for (const std::uint32_t number : waiting) {
      const std::vector<std::uint32_t>& pending = zones[number].pending;
      if (std::find(pending.begin(), pending.end(), handle) != pending.end()) found.push_back(number);
    }
    std::sort(found.begin(), found.end());
    found.erase(std::unique(found.begin(), found.end()), found.end());
    for (const std::uint32_t number : found) visit(number);
  }

  const Slots* slots;
  std::shared_ptr<const Metres> metres;  // in which distances are; none: units of the plane
  Subjects subjects;
  MemberLists members;
  Zones zones;
  std::vector<std::uint32_t> crowded, waiting;  // zones to divide, and those with subjects to decide
  bool zoned = false;                           // whether there are any
  bool torn = false;                            // the zones are to be made anew
  bool everyone = false;                        // all subjects are to be decided
  std::vector<std::unique_ptr<Fence>> fences;
};

}  // namespace dynhull
