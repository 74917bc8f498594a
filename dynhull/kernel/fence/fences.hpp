// An index of fences over the entities of a hull. The reference in Python is dynhull/_fences.py.
//
// Each subject has a box in which no boundary is, so that most moves cost four comparisons. A subject that has left its
// box is decided by its zone when crossings are taken: exactly, for the fences that cover or touch the zone and those
// that it was inside of. A new area visits the zones that its changed edges touch, and those between the old and the
// new boundary; their subjects are decided when crossings are taken, too. A fence around the subjects' own hull looks
// at the vertices only, and lists who is outside instead of inside.
//
// What the entities report cannot fail: they make room first. If memory does not suffice elsewhere, the index is torn:
// the zones are made anew at the next call, and everything is decided again.
#pragma once

#include <map>
#include <numeric>
#include <string_view>

#include "../hull_tree.hpp"
#include "../keyed/slots.hpp"
#include "../query/queries.hpp"
#include "fence.hpp"
#include "subjects.hpp"
#include "zones.hpp"

namespace dynhull {

enum Cause : std::uint8_t { MOVED = 1, AREA = 2, APPEARED = 4, REMOVED = 8, EXPIRED = 16 };

struct Crossing {
  std::int64_t fence;
  std::uint64_t key;  // the integer, or where the string begins
  Point now, before;
  double distance;
  std::uint8_t length;  // of the string
  std::int8_t change;
  std::uint8_t cause;
};

struct Crossings {
  std::vector<Crossing> rows;
  std::string strings;

  std::string_view string(const Crossing& row) const { return {strings.data() + row.key, row.length}; }
};

class Fences {
 public:
  explicit Fences(const Slots& slots) : slots_(&slots) { subjects_.reserve(slots_->end()); }

  // What the entities report. Only the two functions that make room throw.

  // For a batch with `extra` subjects that move or appear.
  void make_room(std::size_t extra) {
    ++batches_;
    subjects_.reserve(slots_->end() + extra);
    if (changes_.capacity() < changes_.size() + extra) forget_merged();
    grow(changes_, extra);
    grow(strayed_, extra);
  }
  // For `count` subjects that leave, with `bytes` in their keys.
  void make_room_to_leave(std::size_t count, std::size_t bytes) {
    grow(gone_, count);
    if (gone_keys_.capacity() < gone_keys_.size() + bytes)
      gone_keys_.reserve(std::max(gone_keys_.size() + bytes, 2 * gone_keys_.size()));
  }

  void fetch(std::uint32_t slot) const { prefetch(&subjects_.box(slot)); }

  void moved(std::uint32_t slot, Point before, Point now) {
    ++reports_;
    if (!subjects_.box(slot).holds(now)) {
      prefetch(&subjects_[slot]);
      strayed_.push_back(static_cast<std::uint32_t>(changes_.size()));
    }
    changes_.push_back({before, slot});
  }

  void appeared(std::uint32_t slot) {
    ++reports_;
    subjects_.begin(slot);
    if (zoned_) strayed_.push_back(static_cast<std::uint32_t>(changes_.size()));
    changes_.push_back({NOWHERE, slot, true});
  }

  void left(std::uint32_t slot, Cause cause) {
    ++reports_;
    merge_changes();
    Subject& subject = subjects_[slot];
    Gone gone;
    gone.before = (*slots_)[slot].place;
    gone.cause = cause;
    gone.inside = subject.inside;
    if (const std::size_t number = number_of(subject); number < changes_.size()) {
      gone.before = changes_[number].before;
      gone.fresh = changes_[number].fresh;
      gone.returned = changes_[number].returned;
    }
    if (slots_->strings()) {
      const std::string_view key = slots_->arena()[(*slots_)[slot].key];
      gone.key = gone_keys_.size();
      gone.length = static_cast<std::uint8_t>(key.size());
      gone_keys_.append(key);
    } else {
      gone.key = (*slots_)[slot].key;
    }
    gone_.push_back(gone);
    unlist(subject);
    subjects_.begin(slot);
  }

  // Fences

  std::size_t size() const { return numbers_.size(); }
  bool has(std::int64_t number) const { return numbers_.contains(number); }
  std::int64_t count(std::int64_t number) const { return fence(number).count; }

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
    sort(keys);
    return keys;
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
    found_.clear();
    prepare(only_strayed_matter());
    for (const std::uint32_t handle : recent_)
      if (fences_[handle] && *fences_[handle]->area == *fences_[handle]->decided)
        fences_[handle]->decided = fences_[handle]->area;
    if (everyone_) {
      for_each_strayed([](std::uint32_t) {}, [] {});
      slots_->for_each([&](std::uint32_t slot) { decide(slot), cross_found(); });
    } else {
      for_each_strayed([&](std::uint32_t slot) { decide(slot); }, [&] { cross_found(); });
    }
    divide_crowded();
    decide_waiting();
    for (const std::uint32_t handle : owners_) look_at_own(*fences_[handle], tree);
    report_gone();
    list_fresh();
    for (const std::uint32_t handle : owners_) decide_own(handle, tree, slots_at);
    sort(taken_);
    begin_again();
    return std::exchange(taken_, {});
  }

  std::size_t bytes() const {
    std::size_t bytes = subjects_.bytes() + zones_.bytes() + members_.bytes() + changes_.capacity() * sizeof(Change) +
                        strayed_.capacity() * sizeof(std::uint32_t) + gone_.capacity() * sizeof(Gone) +
                        gone_keys_.capacity();
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
  static constexpr Point NOWHERE = {NO_TIME, NO_TIME};
  static constexpr std::size_t CROWD = 96, MANY_PIECES = 32;  // beyond which a zone is divided
  static constexpr std::uint32_t FIRST = 1;                   // the base of numbers of changes
  static constexpr std::size_t LOOKAHEAD = 16;                // subjects that are being prefetched

  // A subject that has changed since crossings were last taken.
  struct Change {
    Point before;  // NaN if it is new
    std::uint32_t slot;
    bool fresh = false, strayed = false;
    bool returned = false;  // what was known of a fresh one when it was there before is known again
    bool decided = false;
  };
  struct Found {
    std::uint32_t fence, slot;
    int change;
    std::optional<double> distance;
  };
  struct Gone {
    Point before = NOWHERE;
    std::uint64_t key = 0;
    Cause cause = REMOVED;
    std::uint8_t length = 0;
    bool fresh = false, returned = false, done = false;
    Members inside;
  };

  template <class Item>
  static void grow(std::vector<Item>& items, std::size_t extra) {
    if (items.capacity() < items.size() + extra) items.reserve(std::max(items.size() + extra, 2 * items.size()));
  }

  // Whether a slot has a subject now: since it was noted, all may have left.
  bool there(std::uint32_t slot) const { return slot < slots_->end() && !slots_->free(slot); }

  const Fence& fence(std::int64_t number) const { return *fences_[numbers_.at(number)]; }

  // Changes

  std::size_t number_of(const Subject& subject) const { return subject.changed - base_; }

  const Change* change_of(std::uint32_t slot) const {
    const Subject& subject = subjects_[slot];
    return subject.changed != 0 && number_of(subject) < changes_.size() ? &changes_[number_of(subject)] : nullptr;
  }
  Change* change_of(std::uint32_t slot) { return const_cast<Change*>(std::as_const(*this).change_of(slot)); }

  // Changes are only appended until somebody asks for that of a subject: then its first one has its number.
  void merge_changes() {
    for (; merged_ < changes_.size(); ++merged_) {
      Subject& subject = subjects_[changes_[merged_].slot];
      if (number_of(subject) > merged_) subject.changed = base_ + static_cast<std::uint32_t>(merged_);
    }
    std::size_t kept = merged_strayed_;
    for (std::size_t i = merged_strayed_; i < strayed_.size(); ++i) {
      const std::size_t first = number_of(subjects_[changes_[strayed_[i]].slot]);
      if (first < changes_.size() && !std::exchange(changes_[first].strayed, true))
        strayed_[kept++] = static_cast<std::uint32_t>(first);
    }
    strayed_.resize(kept);
    merged_strayed_ = kept;
  }
  // The same where one batch is all that has happened, and nobody will ask for others than the strayed.
  void number_strayed() {
    for (const std::uint32_t number : strayed_) subjects_[changes_[number].slot].changed = base_ + number;
  }
  bool only_strayed_matter() const {
    return batches_ < 2 && merged_ == 0 && gone_.empty() && recent_.empty() && waiting_.empty() && owners_.empty() &&
           !torn_ && !everyone_;
  }

  // Removes changes that have been merged into others, and those of subjects that are gone.
  void forget_merged() {
    merge_changes();
    strayed_.clear();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < changes_.size(); ++i) {
      if (!current(i)) continue;
      const auto number = static_cast<std::uint32_t>(kept++);
      subjects_[changes_[i].slot].changed = base_ + number;
      changes_[number] = changes_[i];
      if (changes_[number].strayed) strayed_.push_back(number);
    }
    changes_.resize(kept);
    merged_ = kept;
    merged_strayed_ = strayed_.size();
  }

  // Forgets all changes. Their numbers are not used again until all numbers have been.
  void begin_again() {
    if (changes_.size() > (std::size_t{1} << 31) - base_) {
      for (std::uint32_t slot = 0; slot < subjects_.size(); ++slot) subjects_[slot].changed = 0;
      base_ = FIRST;
    } else {
      base_ += static_cast<std::uint32_t>(changes_.size());
    }
    changes_.clear();
    strayed_.clear();
    merged_ = merged_strayed_ = batches_ = 0;
    for (Gone& gone : gone_) members_.clear(gone.inside);
    gone_.clear();
    gone_keys_.clear();
    for (const std::uint32_t handle : recent_)
      if (Fence* const fence = fences_[handle].get()) {
        fence->decided = fence->area;
        fence->decided_own = fence->own;
        fence->given = fence->listed = false;
        fence->earlier.reset();
      }
    recent_.clear();
    for (const std::uint32_t handle : owners_) {
      fences_[handle]->decided = fences_[handle]->area;
      fences_[handle]->listed = false;
    }
    places_.reset();
    owners_changed_ = everyone_ = false;
  }

  // Zones

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

  // Lists every subject in the zone where it is. Makes the zones if there are none, or if the index is torn.
  void ready() {
    prepare(false);
    for_each_strayed([](std::uint32_t) {}, [] {});
    divide_crowded();
  }
  void prepare(bool only_strayed) {
    only_strayed ? number_strayed() : merge_changes();
    if (torn_) rebuild();
    if (returned_ != reports_) return_gone();
  }

  // Lists those that have strayed in the zone where they are, and visits them. Their cache misses overlap.
  template <class Visit, class After>
  void for_each_strayed(Visit visit, After after_some) {
    if (!zoned_) return;
    std::uint32_t slots[LOOKAHEAD], zones[LOOKAHEAD];
    for (std::size_t from = 0; from < strayed_.size(); from += LOOKAHEAD) {
      std::size_t count = 0;
      for (std::size_t i = from; i < std::min(from + LOOKAHEAD, strayed_.size()); ++i)
        if (current(strayed_[i])) slots[count++] = changes_[strayed_[i]].slot;
      find_zones({slots, count}, zones);
      for (std::size_t i = 0; i < count; ++i) {
        relist(slots[i], zones[i]);
        visit(slots[i]);
      }
      after_some();
    }
  }
  void find_zones(std::span<const std::uint32_t> slots, std::uint32_t* zones) const {
    for (const std::uint32_t slot : slots) {
      prefetch(&(*slots_)[slot]);
      if (const std::uint32_t zone = subjects_[slot].zone; zone != NONE) prefetch(&zones_[zone]);
    }
    for (std::size_t i = 0; i < slots.size(); ++i) {
      const Point p = (*slots_)[slots[i]].place;
      const std::uint32_t old = zones[i] = subjects_[slots[i]].zone;
      if (old != NONE && zones_[old].holds(p)) continue;
      zones[i] = zones_.find(p);
      if (old != NONE) zones_[old].fetch_subjects();
      zones_[zones[i]].fetch();
    }
    for (std::size_t i = 0; i < slots.size(); ++i) zones_[zones[i]].fetch_pieces();
  }
  void relist(std::uint32_t slot, std::uint32_t zone) {
    Subject& subject = subjects_[slot];
    const Point p = (*slots_)[slot].place;
    if (zone != subject.zone) {
      grow(zones_[zone].subjects, 1);
      unlist(subject);
      list(slot, zone);
    }
    lay_box(slot, p);
  }
  void lay_box(std::uint32_t slot, Point p) {
    const Zone& zone = zones_[subjects_[slot].zone];
    SafeBox box = SafeBox::everywhere();
    box.stay_in(zone.box, p);
    for (const Piece& piece : zone.pieces) box.keep_off(strip_of(piece), p);
    subjects_.box(slot) = box;
  }

  // Makes the zones from the fences and the places, and decides everything at the next occasion.
  void rebuild() {
    everyone_ = true;
    for (std::uint32_t slot = 0; slot < subjects_.size(); ++slot) subjects_[slot].zone = NONE;
    zones_ = Zones();
    crowded_.clear();
    waiting_.clear();
    slots_->for_each([&](std::uint32_t slot) { forget_lost(subjects_[slot].inside); });
    for (Gone& gone : gone_) forget_lost(gone.inside);
    if (zoned_) make_zones();
    torn_ = false;
  }
  void forget_lost(Members& inside) {
    former_.assign(members_.of(inside).begin(), members_.of(inside).end());
    for (const std::uint32_t handle : former_)
      if (!fences_[handle]) members_.remove(inside, handle);
  }
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
      for (const std::uint32_t slot : zones_[zone].subjects) lay_box(slot, (*slots_)[slot].place);
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
    const Point split = {middle(extent.least.x, extent.greatest.x, box.least.x, box.greatest.x),
                         middle(extent.least.y, extent.greatest.y, box.least.y, box.greatest.y)};
    const std::size_t size = by_subjects ? zones_[number].subjects.size() : zones_[number].pieces.size();
    zones_[number].most = 2 * size;  // unless dividing helps
    if (split == HIGHEST) return;

    // Everything that may fail is done on the side.
    Zone parts[4];
    for (unsigned q = 0; q < 4; ++q) {
      parts[q].box = box;
      (q & 1 ? parts[q].box.least.x : parts[q].box.greatest.x) = split.x;
      (q & 2 ? parts[q].box.least.y : parts[q].box.greatest.y) = split.y;
    }
    const Zone& old = zones_[number];
    for (const std::uint32_t slot : old.subjects)
      parts[Zones::quarter(split, (*slots_)[slot].place)].subjects.push_back(slot);
    for (Zone& part : parts) {
      part.covering = old.covering;
      part.pending = old.pending;
      part.subjects.shrink_to_fit();
      if (!(part.box.least.x < part.box.greatest.x && part.box.least.y < part.box.greatest.y)) continue;
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

  // Setting fences

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

  // Where the keys that have changed are now. Fences that are set at one time share it.
  std::shared_ptr<const Places> places() {
    if (changes_.empty() && gone_.empty()) return nullptr;
    if (places_ && placed_ == reports_) return places_;
    auto places = std::make_shared<Places>();
    for (const Gone& gone : gone_) places->insert_or_assign(key_of(gone), std::nullopt);
    for (std::size_t i = 0; i < changes_.size(); ++i)
      if (current(i)) places->insert_or_assign(key_of(changes_[i].slot), (*slots_)[changes_[i].slot].place);
    placed_ = reports_;
    return places_ = std::move(places);
  }
  // Whether a change is of a subject that is there, under this number.
  bool current(std::size_t change) const {
    const std::uint32_t slot = changes_[change].slot;
    return there(slot) && change_of(slot) == &changes_[change];
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
            for (const Edge& edge : near) subjects_.box(slot).keep_off(dynhull::strip_of(area, edge), p);
            if (inside || !(touching.empty() || area.holds(p))) continue;
            members_.add(subjects_[slot].inside, handle);
            ++fence.count;
          }
        });
    if (inside)
      for (const std::uint32_t slot : *inside) wait_for(handle, subjects_[slot].zone);
  }
  void wait_for(std::uint32_t handle, std::uint32_t zone) {
    std::vector<std::uint32_t>& pending = zones_[zone].pending;
    if (pending.empty()) waiting_.push_back(zone);
    if (std::find(pending.begin(), pending.end(), handle) == pending.end()) pending.push_back(handle);
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
          for (const std::uint32_t id : touching) {
            if (!is_added(id)) continue;
            const Strip strip = dynhull::strip_of(*area, added[id]);
            for (const std::uint32_t slot : zone.subjects) subjects_.box(slot).keep_off(strip, (*slots_)[slot].place);
          }
        });
    fence.area = std::move(area);
  }
  // A way that was in the subject's box may meet a new area.
  void stray_changed() {
    for (std::size_t i = 0; i < changes_.size(); ++i) {
      if (changes_[i].strayed || !current(i)) continue;
      strayed_.push_back(static_cast<std::uint32_t>(i));
      merged_strayed_ = strayed_.size();
      changes_[i].strayed = true;
    }
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

  // Visits the subjects inside that are there.
  template <class Visit>
  void for_each_inside(std::uint32_t handle, Visit visit) {
    if (fences_[handle]->own) {
      slots_->for_each([&](std::uint32_t slot) {
        if (was_inside_own(handle, slot)) visit(slot);
      });
      return;
    }
    if (everyone_) {
      slots_->for_each([&](std::uint32_t slot) {
        if (members_.has(subjects_[slot].inside, handle)) visit(slot);
      });
      return;
    }
    std::vector<std::uint32_t> strays;  // who was inside and is elsewhere now
    for (const std::uint32_t number : strayed_)
      if (current(number) && members_.has(subjects_[changes_[number].slot].inside, handle))
        strays.push_back(changes_[number].slot);
    std::sort(strays.begin(), strays.end());
    for_each_zone(handle, [&](std::uint32_t zone) {
      for (const std::uint32_t slot : zones_[zone].subjects)
        if (members_.has(subjects_[slot].inside, handle) && !std::binary_search(strays.begin(), strays.end(), slot))
          visit(slot);
    });
    for (const std::uint32_t slot : strays) visit(slot);
  }

  // Deciding

  static bool changed(const Fence& fence) {
    return fence.given || fence.area != fence.decided || fence.own != fence.decided_own;
  }

  void decide(std::uint32_t slot) {
    const Point p = (*slots_)[slot].place;
    const std::uint32_t number = subjects_[slot].zone;
    if (number == NONE) return;  // there are no zones
    const Zone& zone = zones_[number];
    Change* const change = change_of(slot);
    // The state before is that of areas which are still there, and the way from there is within the zone.
    const bool known =
        !everyone_ && recent_.empty() && change && !change->fresh && !change->decided && zone.holds(change->before);
    if (change) change->decided = true;
    if (!known) decide_covering(slot, zone);
    for (std::size_t i = 0; i < zone.pieces.size();) {
      const std::span<const Piece> run = zone.run(i);
      i += run.size();
      const std::uint32_t handle = run[0].fence;
      const bool was = members_.has(subjects_[slot].inside, handle);
      const bool from_before = known && !run[0].wide;
      const bool now =
          from_before ? holds(run, change->before, was, p, was) : holds(run, zone.anchor(), run[0].inside, p, was);
      if (now == was) continue;
      find(handle, slot, now ? +1 : -1, now || run[0].disk ? std::nullopt : zone.distance(run, p));
    }
    if (change && crossable_ > 0) {
      former_.clear();
      for (const Found& each : found_)
        if (each.slot == slot && each.change < 0) former_.push_back(each.fence);
      cross_found();
      decide_ways(*change, p);
    }
  }

  // Crossings of some subjects are reported together, when their fences have been fetched.
  void find(std::uint32_t handle, std::uint32_t slot, int change, std::optional<double> distance = {}) {
    prefetch(fences_[handle].get());
    found_.push_back({handle, slot, change, distance});
  }
  void cross_found() {
    for (const Found& each : found_) cross(each.fence, each.slot, each.change, each.distance);
    found_.clear();
  }

  // Decides for the fences that cover a zone, and for those that are not near it.
  void decide_covering(std::uint32_t slot, const Zone& zone) {
    const auto is_near = [&](std::uint32_t handle) { return zone.covered_by(handle) || !zone.run_of(handle).empty(); };
    for (const std::uint32_t handle : members_.of(subjects_[slot].inside))
      if (!is_near(handle) && !fences_[handle]->own) find(handle, slot, -1);
    for (const std::uint32_t handle : zone.covering)
      if (!members_.has(subjects_[slot].inside, handle)) find(handle, slot, +1);
  }

  // Decides for the fence of these pieces of a zone, by the way to p from another point of the zone, where it is known
  // whether that is inside.
  bool holds(std::span<const Piece> run, Point from, bool inside, Point p, bool was) const {
    const std::optional<bool> after = run[0].simple ? inside_after(run, from, inside, p) : std::nullopt;
    if (after && (*after || !run[0].wide || !was)) return *after;
    const Area& area = *fences_[run[0].fence]->area;
    const int where = after ? -1 : area.where(p);
    if (where >= (area.closed ? 0 : 1)) return true;
    if (!was || area.margin == 0) return false;
    if (where == 0) return true;
    if (area.kind == Area::Kind::DISK) return compare_distance(p, area.center, area.radius, area.margin) <= 0;
    return std::any_of(run.begin(), run.end(), [&](const Piece& piece) {
      return compare_distance(p, nearest_part(p, piece.edge), area.margin) <= 0;
    });
  }

  // Reports the fences that a subject has passed through: it was outside, is outside, and the way meets the area.
  void decide_ways(const Change& change, Point now) {
    ways_.clear();
    const std::uint32_t slot = change.slot;
    const auto collect = [&](Point from) {
      std::vector<std::uint32_t> ids(1, 0);
      const Strip way = {{from, now}, 0, -1};
      zones_.descend(
          ids, [&](std::uint32_t) { return way; }, [](Point) { return false; },
          [&](std::uint32_t number, std::span<const std::uint32_t>) {
            for (const std::uint32_t handle : zones_[number].covering) ways_.push_back(handle);
            for (const Piece& piece : zones_[number].pieces) ways_.push_back(piece.fence);
          });
    };
    if (!change.fresh && !(change.before == now)) collect(change.before);
    for (const std::uint32_t handle : recent_) {  // a place at the time when a fence was set
      const Fence* const fence = fences_[handle].get();
      if (fence == nullptr || !fence->cross || !fence->earlier) continue;
      const std::optional<Point> from = start(*fence, slot);
      if (from && !(*from == now) && !(*from == change.before)) collect(*from);
    }
    std::sort(ways_.begin(), ways_.end());
    ways_.erase(std::unique(ways_.begin(), ways_.end()), ways_.end());
    for (const std::uint32_t handle : ways_) {
      const Fence& fence = *fences_[handle];
      if (!fence.cross || members_.has(subjects_[slot].inside, handle) || just_left(handle)) continue;
      const std::optional<Point> from = start(fence, slot);
      if (from && !(*from == now) && fence.area->meets(*from, now)) cross(handle, slot, 0);
    }
  }
  bool just_left(std::uint32_t handle) const {
    return std::find(former_.begin(), former_.end(), handle) != former_.end();
  }

  // Where a subject was before, or when the fence was set; nothing if it was not there.
  std::optional<Point> start(const Fence& fence, std::uint32_t slot) const {
    if (fence.earlier)
      if (const auto entry = fence.earlier->find(key_of(slot)); entry != fence.earlier->end()) return entry->second;
    const Change* const change = change_of(slot);
    if (change == nullptr) return (*slots_)[slot].place;
    return change->fresh ? std::nullopt : std::optional(change->before);
  }

  void decide_waiting() {
    for (; !waiting_.empty(); waiting_.pop_back()) {
      const std::uint32_t number = waiting_.back();
      const Zone& zone = zones_[number];
      for (const std::uint32_t handle : zone.pending) {
        const bool covers = zone.covered_by(handle);
        const std::span<const Piece> run = zone.run_of(handle);
        for (std::size_t at = 0; at < zone.subjects.size(); ++at) {
          if (at + LOOKAHEAD < zone.subjects.size()) {
            prefetch(&(*slots_)[zone.subjects[at + LOOKAHEAD]]);
            prefetch(&subjects_[zone.subjects[at + LOOKAHEAD]]);
          }
          const std::uint32_t slot = zone.subjects[at];
          const bool was = members_.has(subjects_[slot].inside, handle);
          const bool now =
              covers || (!run.empty() && holds(run, zone.anchor(), run[0].inside, (*slots_)[slot].place, was));
          if (now != was) cross(handle, slot, now ? +1 : -1);
        }
      }
      zones_[number].pending.clear();
    }
  }

  // Reports a crossing and notes the new state.
  void cross(std::uint32_t handle, std::uint32_t slot, int change, std::optional<double> distance = {}) {
    Fence& fence = *fences_[handle];
    const Change* const moved = change_of(slot);
    Crossing row{};
    row.fence = fence.number;
    row.now = (*slots_)[slot].place;
    row.before = moved ? moved->before : row.now;
    row.change = static_cast<std::int8_t>(change);
    if (moved && moved->fresh)
      row.cause = APPEARED;
    else if (!(row.before == row.now))
      row.cause = MOVED;
    else
      row.cause = 0;
    if (changed(fence) || row.cause == 0) row.cause |= AREA;
    row.distance = distance ? *distance : change > 0 ? 0 : fence.area->distance_to_boundary(row.now);
    append_key(taken_, slot, row);
    try {
      if (change != 0 && (change > 0) != fence.own)
        members_.add(subjects_[slot].inside, handle);
      else if (change != 0)
        members_.remove(subjects_[slot].inside, handle);
    } catch (...) {
      taken_.rows.pop_back();
      throw;
    }
    fence.count += change;
  }

  // Subjects that are gone

  // Gives subjects that have come back under their key what was known of them.
  void return_gone() {
    if (gone_.empty()) return;
    std::unordered_map<std::string, std::uint32_t> slots;
    for (std::size_t i = 0; i < changes_.size(); ++i)
      if (changes_[i].fresh && current(i)) slots.emplace(key_of(changes_[i].slot), changes_[i].slot);
    std::unordered_map<std::string, std::size_t> last;
    for (std::size_t i = 0; i < gone_.size(); ++i) last[key_of(gone_[i])] = i;
    // All is kept by the last time that the key was there, the first place included.
    for (std::size_t i = gone_.size(); i-- > 0;) {
      const std::size_t to = last.at(key_of(gone_[i]));
      if (to == i || gone_[i].done) continue;
      merge(gone_[i], gone_[to]);
    }
    for (const auto& [key, i] : last) {
      const auto entry = slots.find(key);
      if (entry == slots.end() || gone_[i].done) continue;
      Subject& subject = subjects_[entry->second];
      former_.assign(members_.of(gone_[i].inside).begin(), members_.of(gone_[i].inside).end());
      for (const std::uint32_t handle : owners_)
        if (!members_.has(gone_[i].inside, handle) && !was_inside(handle, gone_[i])) former_.push_back(handle);
      for (const std::uint32_t handle : former_) {
        if (members_.has(subject.inside, handle)) continue;
        if (fences_[handle]->own) fences_[handle]->outside.push_back(entry->second);
        members_.add(subject.inside, handle);
      }
      Change& change = changes_[number_of(subject)];
      change.returned = true;
      if (!gone_[i].fresh) {
        change.before = gone_[i].before;
        change.fresh = false;
      }
      members_.clear(gone_[i].inside);
      gone_[i].done = true;
    }
    returned_ = reports_;
  }
  void merge(Gone& from, Gone& to) {
    former_.assign(members_.of(from.inside).begin(), members_.of(from.inside).end());
    for (const std::uint32_t handle : former_)
      if (!members_.has(to.inside, handle)) members_.add(to.inside, handle);
    if (!from.fresh) {
      to.before = from.before;
      to.fresh = false;
    }
    to.returned |= from.returned;
    members_.clear(from.inside);
    from.done = true;
  }

  // Whether a subject that is gone was inside of a fence when its state was last decided.
  bool was_inside(std::uint32_t handle, const Gone& gone) const {
    const Fence& fence = *fences_[handle];
    const bool listed = members_.has(gone.inside, handle);
    if (gone.done || !fence.own) return listed && !gone.done;
    return !listed && was_there(fence, key_of(gone), gone.fresh && !gone.returned);
  }
  bool was_inside_own(std::uint32_t handle, std::uint32_t slot) const {
    const Change* const change = change_of(slot);
    return !members_.has(subjects_[slot].inside, handle) &&
           was_there(*fences_[handle], key_of(slot), change && change->fresh && !change->returned);
  }
  // Whether a key was there when the state of a fence was last decided.
  static bool was_there(const Fence& fence, const std::string& key, bool fresh) {
    if (fence.earlier && !fence.listed)
      if (const auto entry = fence.earlier->find(key); entry != fence.earlier->end()) return entry->second.has_value();
    return !fresh;
  }

  void report_gone() {
    for (Gone& gone : gone_) {
      if (gone.done) continue;
      for (const std::uint32_t handle : owners_)
        if (was_inside(handle, gone)) {
          members_.add(gone.inside, handle);
          try {
            leave(handle, gone);
          } catch (...) {
            members_.remove(gone.inside, handle);
            throw;
          }
        }
      former_.assign(members_.of(gone.inside).begin(), members_.of(gone.inside).end());
      for (const std::uint32_t handle : former_) {
        if (fences_[handle]->own) continue;
        leave(handle, gone);
        members_.remove(gone.inside, handle);
      }
      gone.done = true;
    }
  }
  void leave(std::uint32_t handle, const Gone& gone) {
    Fence& fence = *fences_[handle];
    Crossing row{};
    row.fence = fence.number;
    row.now = NOWHERE;
    row.before = gone.fresh ? NOWHERE : gone.before;
    row.distance = NO_TIME;
    row.change = -1;
    row.cause = static_cast<std::uint8_t>(gone.cause | (changed(fence) ? AREA : 0));
    append_key(taken_, gone, row);
    --fence.count;
  }

  // The subjects' own hull: only a vertex that is there once is outside of the hull of the others.

  void add_own(const HullTree& tree, std::uint32_t handle, const std::vector<std::uint32_t>* inside) {
    Fence& fence = *fences_[handle];
    owners_changed_ = true;
    fence.area = std::make_shared<const Area>(Area::of_hull(vertices_of(tree), true, fence.area->margin));
    fence.decided = fence.area;
    std::vector<bool> within(slots_->end(), inside == nullptr);
    for (std::size_t i = 0; inside && i < inside->size(); ++i) within[(*inside)[i]] = true;
    const std::vector<Point> vertices = single_vertices(tree);
    slots_->for_each([&](std::uint32_t slot) {
      const Point p = (*slots_)[slot].place;
      if (within[slot] && (inside || !std::binary_search(vertices.begin(), vertices.end(), p))) {
        ++fence.count;
      } else {
        fence.outside.push_back(slot);
        members_.add(subjects_[slot].inside, handle);
      }
    });
  }

  // In order.
  static std::vector<Point> single_vertices(const HullTree& tree) {
    std::vector<Point> vertices = vertices_of(tree);
    std::erase_if(vertices, [&](Point p) { return tree.count(p) > 1; });
    std::sort(vertices.begin(), vertices.end());
    return vertices;
  }

  static void look_at_own(Fence& fence, const HullTree& tree) {
    auto area = std::make_shared<const Area>(Area::of_hull(vertices_of(tree), true, fence.area->margin));
    fence.area = *area == *fence.decided ? fence.decided : std::move(area);
  }

  // Subjects that were not there are outside at first.
  void list_fresh() {
    for (std::size_t i = 0; i < changes_.size() && !owners_.empty(); ++i) {
      if (!changes_[i].fresh || changes_[i].returned || !current(i)) continue;
      const std::uint32_t slot = changes_[i].slot;
      for (const std::uint32_t handle : owners_) {
        Fence& fence = *fences_[handle];
        if (members_.has(subjects_[slot].inside, handle) || was_there(fence, key_of(slot), true)) continue;
        fence.outside.push_back(slot);
        members_.add(subjects_[slot].inside, handle);
      }
      changes_[i].returned = true;
    }
    for (const std::uint32_t handle : owners_) fences_[handle]->listed = true;
  }

  template <class SlotsAt>
  void decide_own(std::uint32_t handle, HullTree& tree, SlotsAt slots_at) {
    Fence& fence = *fences_[handle];
    const std::vector<Point> vertices = single_vertices(tree);
    std::vector<std::uint32_t> at_vertices = slots_at(vertices);
    std::sort(at_vertices.begin(), at_vertices.end());
    const auto is_single = [&](std::uint32_t slot) {
      return std::binary_search(at_vertices.begin(), at_vertices.end(), slot);
    };
    std::vector<std::uint32_t> outside;
    outside.reserve(fence.outside.size() + at_vertices.size());
    std::sort(fence.outside.begin(), fence.outside.end());
    fence.outside.erase(std::unique(fence.outside.begin(), fence.outside.end()), fence.outside.end());
    for (const std::uint32_t slot : fence.outside) {
      if (!there(slot) || !members_.has(subjects_[slot].inside, handle)) continue;
      if (is_single(slot))
        outside.push_back(slot);
      else
        cross(handle, slot, +1, 0);
    }
    for (const std::uint32_t slot : at_vertices) {
      const Point p = (*slots_)[slot].place;
      if (!members_.has(subjects_[slot].inside, handle)) {
        if (is_near_neighbours(fence.area->convex, p, fence.area->margin)) continue;
        bool stays = false;
        double distance = 0;
        tree.without(p, [&] {
          const std::optional<Edge> part = nearest_part(tree.nodes(), p);
          stays = part && compare_distance(p, *part, fence.area->margin) <= 0;
          distance = dynhull::distance(tree.nodes(), p);
        });
        if (stays) continue;
        outside.push_back(slot);
        fence.outside.push_back(slot);  // in case of an exception
        cross(handle, slot, -1, distance);
        continue;
      }
      const std::optional<Point> from = start(fence, slot);
      if (!fence.cross || !from || *from == p) continue;
      bool meets = false;
      double distance = 0;
      tree.without(p, [&] {
        meets = Area::of_hull(vertices_of(tree), true, 0).meets(*from, p);
        distance = dynhull::distance(tree.nodes(), p);
      });
      if (meets) cross(handle, slot, 0, distance);
    }
    fence.outside = std::move(outside);
  }
  // Whether a vertex is so close to the chord of its neighbours that the hull of the others is near without a look.
  static bool is_near_neighbours(const std::vector<Point>& convex, Point p, double margin) {
    const auto vertex = std::find(convex.begin(), convex.end(), p);
    if (vertex == convex.end()) return false;
    const Point before = vertex == convex.begin() ? convex.back() : vertex[-1];
    const Point after = vertex + 1 == convex.end() ? convex.front() : vertex[1];
    return compare_distance(p, nearest_part(p, {before, after}), margin) <= 0;
  }

  // Keys

  std::string key_of(std::uint32_t slot) const {
    if (slots_->strings()) return std::string(slots_->arena()[(*slots_)[slot].key]);
    return bytes_of((*slots_)[slot].key);
  }
  std::string key_of(const Gone& gone) const {
    return slots_->strings() ? gone_keys_.substr(gone.key, gone.length) : bytes_of(gone.key);
  }
  static std::string bytes_of(std::uint64_t key) {
    std::string bytes(sizeof key, '\0');
    std::memcpy(bytes.data(), &key, sizeof key);
    return bytes;
  }

  void append_key(Crossings& to, std::uint32_t slot, Crossing row = {}) const {
    const std::uint64_t key = (*slots_)[slot].key;
    slots_->strings() ? append_string(to, slots_->arena()[key], row) : append_integer(to, key, row);
  }
  void append_key(Crossings& to, const Gone& gone, Crossing row = {}) const {
    slots_->strings() ? append_string(to, std::string_view(gone_keys_).substr(gone.key, gone.length), row)
                      : append_integer(to, gone.key, row);
  }
  static void append_string(Crossings& to, std::string_view key, Crossing& row) {
    row.key = to.strings.size();
    row.length = static_cast<std::uint8_t>(key.size());
    to.strings.append(key);
    to.rows.push_back(row);
  }
  static void append_integer(Crossings& to, std::uint64_t key, Crossing& row) {
    row.key = key;
    to.rows.push_back(row);
  }

  // By fence, then by key. After an exception, a way may have been reported already, or that of a subject that has
  // left.
  void sort(Crossings& found) const {
    const auto order = [&](const Crossing& a, const Crossing& b) {
      if (a.fence != b.fence) return a.fence <=> b.fence;
      return slots_->strings() ? found.string(a) <=> found.string(b) : a.key <=> b.key;
    };
    std::sort(found.rows.begin(), found.rows.end(), [&](const Crossing& a, const Crossing& b) {
      const auto sign = order(a, b);
      return sign != 0 ? sign<0 : (a.change != 0)>(b.change != 0);
    });
    const auto needless = [&](const Crossing& a, const Crossing& b) { return b.change == 0 && order(a, b) == 0; };
    found.rows.erase(std::unique(found.rows.begin(), found.rows.end(), needless), found.rows.end());
  }

  const Slots* slots_;
  Subjects subjects_;
  MemberLists members_;
  std::vector<Change> changes_;
  std::vector<std::uint32_t> strayed_;  // changes of subjects that have left their box, or are new
  std::size_t merged_ = 0, merged_strayed_ = 0, batches_ = 0;
  std::vector<Gone> gone_;
  std::string gone_keys_;
  std::uint32_t base_ = FIRST;

  Zones zones_;
  std::vector<std::uint32_t> crowded_, waiting_;  // zones to divide, and those with subjects to decide
  bool zoned_ = false;
  bool torn_ = false;      // the zones are to be made anew
  bool everyone_ = false;  // all subjects are to be decided

  std::map<std::int64_t, std::uint32_t> numbers_;
  std::vector<std::unique_ptr<Fence>> fences_;
  std::size_t first_free_ = 0;
  std::vector<std::uint32_t> recent_, owners_;  // fences set since crossings were last taken; around the own hull
  bool owners_changed_ = false;
  std::size_t crossable_ = 0;  // fences that report who passes through, other than those around the own hull
  std::shared_ptr<const Places> places_;
  std::uint64_t reports_ = 0;                // of the entities
  std::uint64_t placed_ = 0, returned_ = 0;  // their number when the places were noted, and when subjects came back

  Crossings taken_;
  std::vector<Found> found_;
  std::vector<std::uint32_t> former_, ways_;
};

}  // namespace dynhull
