// Entities in order of time.
//
// A wheel has the slot number of every entity with a time. A put with a greater time writes the time only: the wheel
// files the slot again when its turn comes. A put with a smaller time, and a new entity in a slot that was free, are
// pushed, so that the wheel may have a slot twice. What an entity leaves behind is dropped when its turn comes.
#pragma once

#include <algorithm>
#include <vector>

#include "../window/wheel.hpp"
#include "slots.hpp"

namespace dynhull {

class Ages {
 public:
  struct Taken {
    std::uint32_t slot;
    double time;
  };

  // O(n).
  explicit Ages(Slots& slots) : slots_(slots), wheel_(OldestFirst{&slots}) {
    wheel_.reserve(slots.size());
    slots.for_each([&](std::uint32_t slot) { push(slot); });
  }

  // Whether most of the wheel is what entities have left behind: it is worth making anew.
  bool stale() const { return wheel_.size() > 2 * slots_.size() + SPARE; }

  // Makes room for `extra` calls of `push` and `put`.
  void reserve(std::size_t extra) { wheel_.reserve(extra); }

  // A new entity.
  void push(std::uint32_t slot) {
    if (std::isnan(slots_[slot].time))
      ++timeless_;
    else
      wheel_.push(slot);
  }
  // An entity that had another time before.
  void put(std::uint32_t slot, double before) {
    if (before <= slots_[slot].time) return;
    timeless_ -= std::isnan(before);
    push(slot);
  }
  // An entity with this time leaves.
  void remove(double time) { timeless_ -= std::isnan(time); }

  // The least time; NO_TIME if no entity has one.
  double oldest() {
    const auto* const first = wheel_.front();
    return first == nullptr ? NO_TIME : first->time;
  }

  // Takes all entities with a time of at most `until`. Their slots have no time any more, so that none comes twice.
  void take_until(double until, std::vector<Taken>& taken) {
    wheel_.take_until(until, [&](std::uint32_t slot) { take(slot, taken); });
  }

  // Takes the `count` oldest entities: those without a time first, ties by key. O(n) if an entity has no time.
  void take_oldest(std::size_t count, std::vector<Taken>& taken) {
    if (timeless_ > 0) take_timeless(count, taken);
    while (taken.size() < count && wheel_.front() != nullptr) {
      take(wheel_.front()->slot, taken);
      wheel_.pop_front();
      wheel_.settle();
    }
  }

  // Throws std::logic_error unless the wheel has every entity with a time.
  void check() const {
    std::vector<bool> filed(slots_.end());
    wheel_.for_each([&](std::uint32_t slot) { filed[slot] = true; });
    std::size_t timeless = 0;
    slots_.for_each([&](std::uint32_t slot) {
      if (std::isnan(slots_[slot].time))
        ++timeless;
      else if (!filed[slot])
        throw std::logic_error("an entity that never expires");
    });
    if (timeless != timeless_) throw std::logic_error("entities without a time miscounted");
  }

  std::size_t bytes() const { return sizeof *this + wheel_.bytes() - sizeof wheel_; }

 private:
  static constexpr std::size_t SPARE = 1024;

  struct OldestFirst {
    // The arena keeps the bytes of a key that has left, so that entries stay in order.
    struct Entry {
      double time;
      std::uint64_t key;
      std::uint32_t slot;
    };
    const Slots* slots;

    double time(std::uint32_t slot) const { return slots->free(slot) ? NO_TIME : (*slots)[slot].time; }
    Entry entry(std::uint32_t slot) const { return {(*slots)[slot].time, (*slots)[slot].key, slot}; }
    static std::uint32_t item(const Entry& entry) { return entry.slot; }
    bool current(const Entry& entry) const {
      return time(entry.slot) == entry.time && (*slots)[entry.slot].key == entry.key;
    }
    bool before(const Entry& a, const Entry& b) const { return slots->key_less(a.key, b.key); }
  };

  void take(std::uint32_t slot, std::vector<Taken>& taken) {
    taken.push_back({slot, slots_[slot].time});
    slots_[slot].time = NO_TIME;
  }

  // Takes the entities without a time, the `count` least keys if there are more.
  void take_timeless(std::size_t count, std::vector<Taken>& taken) {
    slots_.for_each([&](std::uint32_t slot) {
      if (std::isnan(slots_[slot].time)) taken.push_back({slot, NO_TIME});
    });
    if (count >= taken.size()) return;
    const auto less = [&](const Taken& a, const Taken& b) { return slots_.less(a.slot, b.slot); };
    std::nth_element(taken.begin(), taken.begin() + static_cast<std::ptrdiff_t>(count), taken.end(), less);
    taken.resize(count);
  }

  Slots& slots_;
  Wheel<std::uint32_t, OldestFirst> wheel_;
  std::size_t timeless_ = 0;
};

}  // namespace dynhull
