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

class Reports {
 public:
  explicit Reports(Zoning& zoning) : zoning_(zoning) {}

  // Only the two functions that make room throw.

  // For a batch with `extra` subjects that move or appear.
  void make_room(std::size_t extra) {
    ++batches_;
    ahead = false;
    zoning_.subjects.reserve(zoning_.slots->end() + extra);
    if (changes.capacity() < changes.size() + extra) forget_merged();
    Zoning::grow(changes, extra);
    Zoning::grow(strayed, extra);
  }
  // For `count` subjects that leave, with `bytes` in their keys.
  void make_room_to_leave(std::size_t count, std::size_t bytes) {
    ahead = false;
    Zoning::grow(absent, count);
    if (gone_keys_.capacity() < gone_keys_.size() + bytes)
      gone_keys_.reserve(std::max(gone_keys_.size() + bytes, 2 * gone_keys_.size()));
  }

  void fetch(std::uint32_t slot) const { prefetch(&zoning_.subjects.box(slot)); }

  void moved(std::uint32_t slot, Point before, Point now) {
    ++reports_;
    if (!zoning_.subjects.box(slot).holds(now)) {
      prefetch(&zoning_.subjects[slot]);
      strayed.push_back(static_cast<std::uint32_t>(changes.size()));
    }
    changes.push_back({before, slot});
  }

  void appeared(std::uint32_t slot) {
    ++reports_;
    zoning_.subjects.begin(slot);
    if (zoning_.zoned) strayed.push_back(static_cast<std::uint32_t>(changes.size()));
    changes.push_back({NOWHERE, slot, true});
  }

  void left(std::uint32_t slot, Cause cause) {
    ++reports_;
    merge_changes();
    Subject& subject = zoning_.subjects[slot];
    Gone gone;
    gone.before = (*zoning_.slots)[slot].place;
    gone.cause = cause;
    gone.inside = subject.inside;
    if (const std::size_t number = number_of(subject); number < changes.size()) {
      gone.before = changes[number].before;
      gone.fresh = changes[number].fresh;
      gone.returned = changes[number].returned;
      gone.carried = changes[number].carried;
    }
    if (zoning_.slots->strings()) {
      const std::string_view key = zoning_.slots->arena()[(*zoning_.slots)[slot].key];
      gone.key = gone_keys_.size();
      gone.length = static_cast<std::uint8_t>(key.size());
      gone_keys_.append(key);
    } else {
      gone.key = (*zoning_.slots)[slot].key;
    }
    absent.push_back(gone);
    zoning_.unlist(subject);
    zoning_.subjects.begin(slot);
  }

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

  const Change* change_of(std::uint32_t slot) const {
    const Subject& subject = zoning_.subjects[slot];
    return subject.changed != 0 && number_of(subject) < changes.size() ? &changes[number_of(subject)] : nullptr;
  }
  Change* change_of(std::uint32_t slot) { return const_cast<Change*>(std::as_const(*this).change_of(slot)); }

  bool only_strayed_matter() const {
    return batches_ < 2 && merged_ == 0 && absent.empty() && recent.empty() && zoning_.waiting.empty() &&
           owners.empty() && !zoning_.torn && !zoning_.everyone;
  }

  // Whether nothing has happened since crossings were last taken.
  bool at_rest() const { return batches_ == 0 && changes.empty() && only_strayed_matter(); }

  // Forgets all changes. Their numbers are not used again until all numbers have been.
  void begin_again() {
    if (changes.size() > (std::size_t{1} << 31) - base_) {
      for (std::uint32_t slot = 0; slot < zoning_.subjects.size(); ++slot) zoning_.subjects[slot].changed = 0;
      base_ = FIRST;
    } else {
      base_ += static_cast<std::uint32_t>(changes.size());
    }
    changes.clear();
    strayed.clear();
    merged_ = merged_strayed_ = batches_ = 0;
    for (Gone& gone : absent) zoning_.members.clear(gone.inside);
    absent.clear();
    gone_keys_.clear();
    for (const std::uint32_t handle : recent)
      if (Fence* const fence = zoning_.fences[handle].get()) {
        fence->decided = fence->area;
        fence->decided_own = fence->own;
        fence->given = fence->listed = false;
        fence->earlier.reset();
      }
    recent.clear();
    for (const std::uint32_t handle : owners) {
      zoning_.fences[handle]->decided = zoning_.fences[handle]->area;
      zoning_.fences[handle]->listed = false;
    }
    places_.reset();
    owners_changed = zoning_.everyone = ahead = false;
  }

  // Lists every subject in the zone where it is. Makes the zones if there are none, or if the index is torn.
  void ready() {
    ahead = false;
    prepare(false);
    settle_strayed([](const Zoning::Stray&, const Zone&, std::size_t) {}, [](std::size_t) {});
    zoning_.divide_crowded();
  }
  void prepare(bool only_strayed) {
    only_strayed ? number_strayed() : merge_changes();
    if (zoning_.torn) rebuild();
    if (returned_ != reports_) return_gone();
  }

  // Lists those that have strayed in the zone where they are. Calls `look` with each and its zone before, on several
  // threads if they are many, and with the number of the part that it is in, below MOST_PARTS; and `then` with each
  // part, in order, when its subjects are listed.
  template <class Look, class Then>
  void settle_strayed(Look look, Then then) {
    if (!zoning_.zoned) return;
    strays_.clear();
    const bool one_batch = batches_ < 2 && absent.empty();  // then all of them are there, each once
    for (const std::uint32_t number : strayed)
      if (one_batch || current(number)) strays_.push_back({changes[number].slot});
    for (std::size_t from = 0; from < strays_.size(); from += AT_ONCE) {
      const std::size_t count = std::min(AT_ONCE, strays_.size() - from);
      Threads threads(count / STRAYS_A_THREAD);
      const std::size_t parts = threads.count() > 1 ? MOST_PARTS : 1;
      const auto start = [&](std::size_t part) { return from + count * part / parts; };
      threads.run(parts, [&](std::size_t part) {
        for (std::size_t i = start(part); i < start(part + 1); i += Zoning::LOOKAHEAD)
          look_at(i, std::min(i + Zoning::LOOKAHEAD, start(part + 1)),
                  [&](const Zoning::Stray& stray, const Zone& zone) { look(stray, zone, part); });
      });
      for (std::size_t part = 0; part < parts; ++part) {
        for (std::size_t i = start(part); i < start(part + 1); ++i) zoning_.relist(strays_[i]);
        then(part);
      }
    }
  }
  // Makes the zones anew, and decides everything at the next occasion.
  void rebuild() {
    zoning_.everyone = true;
    for (std::uint32_t slot = 0; slot < zoning_.subjects.size(); ++slot) zoning_.subjects[slot].zone = NONE;
    zoning_.zones = Zones();
    zoning_.crowded.clear();
    zoning_.waiting.clear();
    zoning_.slots->for_each([&](std::uint32_t slot) { forget_lost(zoning_.subjects[slot].inside); });
    for (Gone& gone : absent) forget_lost(gone.inside);
    if (zoning_.zoned) zoning_.make_zones();
    zoning_.torn = false;
  }

  // Where the keys that have changed are now. Fences that are set at one time share it.
  std::shared_ptr<const Places> places() {
    if (changes.empty() && absent.empty()) return nullptr;
    if (places_ && placed_ == reports_) return places_;
    auto places = std::make_shared<Places>();
    for (const Gone& gone : absent) places->insert_or_assign(key_of(gone), std::nullopt);
    for (std::size_t i = 0; i < changes.size(); ++i)
      if (current(i)) places->insert_or_assign(key_of(changes[i].slot), (*zoning_.slots)[changes[i].slot].place);
    placed_ = reports_;
    return places_ = std::move(places);
  }
  // Whether a change is of a subject that is there, under this number.
  bool current(std::size_t change) const {
    const std::uint32_t slot = changes[change].slot;
    return zoning_.there(slot) && change_of(slot) == &changes[change];
  }

  // A way that was in the subject's box may meet a new area.
  void stray_changed() {
    for (std::size_t i = 0; i < changes.size(); ++i) {
      if (changes[i].strayed || !current(i)) continue;
      strayed.push_back(static_cast<std::uint32_t>(i));
      merged_strayed_ = strayed.size();
      changes[i].strayed = true;
    }
  }

  // Visits the subjects inside that are there.
  template <class Visit>
  void for_each_inside(std::uint32_t handle, Visit visit) {
    if (zoning_.fences[handle]->own) {
      zoning_.slots->for_each([&](std::uint32_t slot) {
        if (was_inside_own(handle, slot)) visit(slot);
      });
      return;
    }
    // With few subjects it takes less than the zones of the boundary.
    if (zoning_.everyone || zoning_.slots->size() < zoning_.fences[handle]->area->corners()) {
      zoning_.slots->for_each([&](std::uint32_t slot) {
        if (zoning_.members.has(zoning_.subjects[slot].inside, handle)) visit(slot);
      });
      return;
    }
    std::vector<std::uint32_t> strays;  // who was inside and is elsewhere now
    for (const std::uint32_t number : strayed)
      if (current(number) && zoning_.members.has(zoning_.subjects[changes[number].slot].inside, handle))
        strays.push_back(changes[number].slot);
    std::sort(strays.begin(), strays.end());
    zoning_.for_each_zone(handle, [&](std::uint32_t zone) {
      for (const std::uint32_t slot : zoning_.zones[zone].subjects)
        if (zoning_.members.has(zoning_.subjects[slot].inside, handle) &&
            !std::binary_search(strays.begin(), strays.end(), slot))
          visit(slot);
    });
    for (const std::uint32_t slot : strays) visit(slot);
  }

  // Subjects that are gone

  // Whether a subject that is gone was inside of a fence when its state was last decided.
  bool was_inside(std::uint32_t handle, const Gone& gone) const {
    const Fence& fence = *zoning_.fences[handle];
    const bool listed = zoning_.members.has(gone.inside, handle);
    if (gone.done || !fence.own) return listed && !gone.done;
    return !listed && was_there(fence, key_of(gone), gone.fresh && !gone.returned);
  }
  // Whether a key was there when the state of a fence was last decided.
  static bool was_there(const Fence& fence, const std::string& key, bool fresh) {
    if (fence.earlier && !fence.listed)
      if (const auto entry = fence.earlier->find(key); entry != fence.earlier->end()) return entry->second.has_value();
    return !fresh;
  }

  // Keys

  std::string key_of(std::uint32_t slot) const {
    if (zoning_.slots->strings()) return std::string(zoning_.slots->arena()[(*zoning_.slots)[slot].key]);
    return bytes_of((*zoning_.slots)[slot].key);
  }
  std::string key_of(const Gone& gone) const {
    return zoning_.slots->strings() ? gone_keys_.substr(gone.key, gone.length) : bytes_of(gone.key);
  }

  void append_key(Crossings& to, std::uint32_t slot, const Crossing& row = {}) const {
    const std::uint64_t key = (*zoning_.slots)[slot].key;
    zoning_.slots->strings() ? to.append(zoning_.slots->arena()[key], row) : to.append(key, row);
  }
  void append_key(Crossings& to, const Gone& gone, const Crossing& row = {}) const {
    zoning_.slots->strings() ? to.append(std::string_view(gone_keys_).substr(gone.key, gone.length), row)
                             : to.append(gone.key, row);
  }

  std::size_t bytes() const {
    return changes.capacity() * sizeof(Change) + strayed.capacity() * sizeof(std::uint32_t) +
           strays_.capacity() * sizeof(Zoning::Stray) + absent.capacity() * sizeof(Gone) + gone_keys_.capacity();
  }

  std::vector<Change> changes;
  std::vector<std::uint32_t> strayed;  // changes of subjects that have left their box, or are new
  std::vector<Gone> absent;
  std::vector<std::uint32_t> recent, owners;  // fences set since crossings were last taken; around the own hull
  bool owners_changed = false;
  bool ahead = false;  // whether what the strayed cross is found, and nothing has been asked or reported since

 private:
  std::size_t number_of(const Subject& subject) const { return subject.changed - base_; }

  // Changes are only appended until somebody asks for that of a subject: then its first one has its number.
  void merge_changes() {
    for (; merged_ < changes.size(); ++merged_) {
      Subject& subject = zoning_.subjects[changes[merged_].slot];
      if (number_of(subject) > merged_) subject.changed = base_ + static_cast<std::uint32_t>(merged_);
    }
    std::size_t kept = merged_strayed_;
    for (std::size_t i = merged_strayed_; i < strayed.size(); ++i) {
      const std::size_t first = number_of(zoning_.subjects[changes[strayed[i]].slot]);
      if (first < changes.size() && !std::exchange(changes[first].strayed, true))
        strayed[kept++] = static_cast<std::uint32_t>(first);
    }
    strayed.resize(kept);
    merged_strayed_ = kept;
  }

  // The same where one batch is all that has happened, and nobody will ask for others than the strayed.
  void number_strayed() {
    for (const std::uint32_t number : strayed) zoning_.subjects[changes[number].slot].changed = base_ + number;
  }

  // Removes changes that have been merged into others, and those of subjects that are gone.
  void forget_merged() {
    merge_changes();
    strayed.clear();
    std::size_t kept = 0;
    for (std::size_t i = 0; i < changes.size(); ++i) {
      if (!current(i)) continue;
      const auto number = static_cast<std::uint32_t>(kept++);
      zoning_.subjects[changes[i].slot].changed = base_ + number;
      changes[number] = changes[i];
      if (changes[number].strayed) strayed.push_back(number);
    }
    changes.resize(kept);
    merged_ = kept;
    merged_strayed_ = strayed.size();
  }

  // Finds the zones and the boxes of some of those that have strayed. Their cache misses overlap.
  template <class Look>
  void look_at(std::size_t from, std::size_t to, Look look) {
    zoning_.find_zones(std::span(strays_).subspan(from, to - from));
    for (std::size_t i = from; i < to; ++i) {
      const Zone& zone = zoning_.zones[strays_[i].zone];
      strays_[i].box = zoning_.box_in(zone, (*zoning_.slots)[strays_[i].slot].place);
      look(strays_[i], zone);
    }
  }

  void forget_lost(Members& inside) {
    former_.assign(zoning_.members.of(inside).begin(), zoning_.members.of(inside).end());
    for (const std::uint32_t handle : former_)
      if (!zoning_.fences[handle]) zoning_.members.remove(inside, handle);
  }

  // Gives subjects that have come back under their key what was known of them.
  void return_gone() {
    if (absent.empty()) return;
    std::unordered_map<std::string, std::uint32_t, HashOfKey> slots;
    for (std::size_t i = 0; i < changes.size(); ++i)
      if (changes[i].fresh && current(i)) slots.emplace(key_of(changes[i].slot), changes[i].slot);
    std::unordered_map<std::string, std::size_t, HashOfKey> last;
    for (std::size_t i = 0; i < absent.size(); ++i) last[key_of(absent[i])] = i;
    // All is kept by the last time that the key was there, the first place included.
    for (std::size_t i = absent.size(); i-- > 0;) {
      const std::size_t to = last.at(key_of(absent[i]));
      if (to == i || absent[i].done) continue;
      merge(absent[i], absent[to]);
    }
    for (const auto& [key, i] : last) {
      const auto entry = slots.find(key);
      if (entry == slots.end() || absent[i].done) continue;
      Subject& subject = zoning_.subjects[entry->second];
      former_.assign(zoning_.members.of(absent[i].inside).begin(), zoning_.members.of(absent[i].inside).end());
      for (const std::uint32_t handle : owners)
        if (!zoning_.members.has(absent[i].inside, handle) && !was_inside(handle, absent[i])) former_.push_back(handle);
      for (const std::uint32_t handle : former_) {
        if (zoning_.members.has(subject.inside, handle)) continue;
        if (zoning_.fences[handle]->own) zoning_.fences[handle]->outside.push_back(entry->second);
        zoning_.members.add(subject.inside, handle);
      }
      Change& change = changes[number_of(subject)];
      change.returned = true;
      if (!absent[i].fresh || absent[i].carried) change.before = absent[i].before;
      change.fresh = absent[i].fresh;
      change.carried = absent[i].carried;
      zoning_.members.clear(absent[i].inside);
      absent[i].done = true;
    }
    returned_ = reports_;
  }

  void merge(Gone& from, Gone& to) {
    former_.assign(zoning_.members.of(from.inside).begin(), zoning_.members.of(from.inside).end());
    for (const std::uint32_t handle : former_)
      if (!zoning_.members.has(to.inside, handle)) zoning_.members.add(to.inside, handle);
    if (!from.fresh || from.carried) {
      to.before = from.before;
      to.fresh = from.fresh;
      to.carried = from.carried;
    }
    to.returned |= from.returned;
    zoning_.members.clear(from.inside);
    from.done = true;
  }

  bool was_inside_own(std::uint32_t handle, std::uint32_t slot) const {
    const Change* const change = change_of(slot);
    return !zoning_.members.has(zoning_.subjects[slot].inside, handle) &&
           was_there(*zoning_.fences[handle], key_of(slot), change && change->fresh && !change->returned);
  }

  static std::string bytes_of(std::uint64_t key) {
    std::string bytes(sizeof key, '\0');
    std::memcpy(bytes.data(), &key, sizeof key);
    return bytes;
  }

  Zoning& zoning_;
  std::vector<Zoning::Stray> strays_;  // the subjects that have strayed, while they are settled
  std::size_t merged_ = 0, merged_strayed_ = 0, batches_ = 0;
  std::string gone_keys_;
  std::uint32_t base_ = FIRST;
  std::shared_ptr<const Places> places_;
  std::uint64_t reports_ = 0;                // of the entities
  std::uint64_t placed_ = 0, returned_ = 0;  // their number when the places were noted, and when subjects came back
  std::vector<std::uint32_t> former_;        // fences of one subject, while they change
};

}  // namespace dynhull
