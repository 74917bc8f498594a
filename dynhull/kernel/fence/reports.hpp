// What the entities have reported since crossings were last taken: who has changed, and what is known of those that are
// gone, in case that they come back.
//
// Reports cannot fail: the entities make room first. If memory does not suffice elsewhere, the index is torn: the zones
// are made anew at the next call, and everything is decided again.
#pragma once

#include <cstring>
#include <string_view>

#include "../threads.hpp"
#include "crossings.hpp"
#include "zoning.hpp"

namespace dynhull {

class Reports : protected Zoning {
 public:
  // Only the two functions that make room throw.

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
      gone.carried = changes_[number].carried;
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

 protected:
  using Zoning::Zoning;

  static constexpr Point NOWHERE = {NO_TIME, NO_TIME};
  static constexpr std::uint32_t FIRST = 1;  // the base of numbers of changes
  // Subjects that are settled together, in how many parts at most, and so many that another thread is worth it.
  static constexpr std::size_t AT_ONCE = 1024, MOST_PARTS = 8, STRAYS_A_THREAD = (ROWS_A_THREAD + 3) / 4;

  // A subject that has changed since crossings were last taken.
  struct Change {
    Point before;  // NaN if it is new
    std::uint32_t slot;
    bool fresh = false, strayed = false;
    bool returned = false;  // what was known of a fresh one when it was there before is known again
    bool carried = false;   // a fresh one that was a subject of another index, with its place there
    bool decided = false;
  };
  struct Gone {
    Point before = NOWHERE;
    std::uint64_t key = 0;
    Cause cause = REMOVED;
    std::uint8_t length = 0;
    bool fresh = false, returned = false, carried = false, done = false;
    bool given = false;  // another index has it
    Members inside;
  };

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

  // Lists every subject in the zone where it is. Makes the zones if there are none, or if the index is torn.
  void ready() {
    prepare(false);
    settle_strayed([](std::uint32_t, const Zone&, std::size_t) {}, [](std::size_t) {});
    divide_crowded();
  }
  void prepare(bool only_strayed) {
    only_strayed ? number_strayed() : merge_changes();
    if (torn_) rebuild();
    if (returned_ != reports_) return_gone();
  }

  // Lists those that have strayed in the zone where they are. Calls `look` with each and its zone before, on several
  // threads if they are many, and with the number of the part that it is in, below MOST_PARTS; and `then` with each
  // part, in order, when its subjects are listed.
  template <class Look, class Then>
  void settle_strayed(Look look, Then then) {
    if (!zoned_) return;
    strays_.clear();
    const bool one_batch = batches_ < 2 && gone_.empty();  // then all of them are there, each once
    for (const std::uint32_t number : strayed_)
      if (one_batch || current(number)) strays_.push_back({changes_[number].slot});
    for (std::size_t from = 0; from < strays_.size(); from += AT_ONCE) {
      const std::size_t count = std::min(AT_ONCE, strays_.size() - from);
      Threads threads(count / STRAYS_A_THREAD);
      const std::size_t parts = threads.count() > 1 ? MOST_PARTS : 1;
      const auto start = [&](std::size_t part) { return from + count * part / parts; };
      threads.run(parts, [&](std::size_t part) {
        for (std::size_t i = start(part); i < start(part + 1); i += LOOKAHEAD)
          look_at(i, std::min(i + LOOKAHEAD, start(part + 1)),
                  [&](std::uint32_t slot, const Zone& zone) { look(slot, zone, part); });
      });
      for (std::size_t part = 0; part < parts; ++part) {
        for (std::size_t i = start(part); i < start(part + 1); ++i) relist(strays_[i]);
        then(part);
      }
    }
  }
  // Finds the zones and the boxes of some of those that have strayed. Their cache misses overlap.
  template <class Look>
  void look_at(std::size_t from, std::size_t to, Look look) {
    find_zones(std::span(strays_).subspan(from, to - from));
    for (std::size_t i = from; i < to; ++i) {
      const Zone& zone = zones_[strays_[i].zone];
      strays_[i].box = box_in(zone, (*slots_)[strays_[i].slot].place);
      look(strays_[i].slot, zone);
    }
  }
  // Makes the zones anew, and decides everything at the next occasion.
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

  // A way that was in the subject's box may meet a new area.
  void stray_changed() {
    for (std::size_t i = 0; i < changes_.size(); ++i) {
      if (changes_[i].strayed || !current(i)) continue;
      strayed_.push_back(static_cast<std::uint32_t>(i));
      merged_strayed_ = strayed_.size();
      changes_[i].strayed = true;
    }
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
    // With few subjects it takes less than the zones of the boundary.
    if (everyone_ || slots_->size() < fences_[handle]->area->corners()) {
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
      if (!gone_[i].fresh || gone_[i].carried) change.before = gone_[i].before;
      change.fresh = gone_[i].fresh;
      change.carried = gone_[i].carried;
      members_.clear(gone_[i].inside);
      gone_[i].done = true;
    }
    returned_ = reports_;
  }
  void merge(Gone& from, Gone& to) {
    former_.assign(members_.of(from.inside).begin(), members_.of(from.inside).end());
    for (const std::uint32_t handle : former_)
      if (!members_.has(to.inside, handle)) members_.add(to.inside, handle);
    if (!from.fresh || from.carried) {
      to.before = from.before;
      to.fresh = from.fresh;
      to.carried = from.carried;
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

  void append_key(Crossings& to, std::uint32_t slot, const Crossing& row = {}) const {
    const std::uint64_t key = (*slots_)[slot].key;
    slots_->strings() ? to.append(slots_->arena()[key], row) : to.append(key, row);
  }
  void append_key(Crossings& to, const Gone& gone, const Crossing& row = {}) const {
    slots_->strings() ? to.append(std::string_view(gone_keys_).substr(gone.key, gone.length), row)
                      : to.append(gone.key, row);
  }

  std::vector<Change> changes_;
  std::vector<std::uint32_t> strayed_;  // changes of subjects that have left their box, or are new
  std::vector<Stray> strays_;           // these subjects, while they are settled
  std::size_t merged_ = 0, merged_strayed_ = 0, batches_ = 0;
  std::vector<Gone> gone_;
  std::string gone_keys_;
  std::uint32_t base_ = FIRST;

  std::vector<std::uint32_t> recent_, owners_;  // fences set since crossings were last taken; around the own hull
  bool owners_changed_ = false;
  std::shared_ptr<const Places> places_;
  std::uint64_t reports_ = 0;                // of the entities
  std::uint64_t placed_ = 0, returned_ = 0;  // their number when the places were noted, and when subjects came back
};

}  // namespace dynhull
