// Which entities are the oldest: a scan of all.
#pragma once

#include <algorithm>
#include <vector>

#include "slots.hpp"

namespace dynhull {

// The slots of all entities with a time of at most `until`.
inline std::vector<std::uint32_t> expired(const Slots& slots, double until) {
  std::vector<std::uint32_t> found;
  slots.for_each([&](std::uint32_t slot) {
    if (slots[slot].time <= until) found.push_back(slot);
  });
  return found;
}

// The slots of the `count` oldest entities: those without a time first, ties by key.
inline std::vector<std::uint32_t> oldest(const Slots& slots, std::size_t count) {
  std::vector<std::uint32_t> found;
  found.reserve(slots.size());
  slots.for_each([&](std::uint32_t slot) { found.push_back(slot); });
  if (count >= found.size()) return found;
  const auto older = [&](std::uint32_t a, std::uint32_t b) {
    const bool timed_a = !std::isnan(slots[a].time), timed_b = !std::isnan(slots[b].time);
    if (timed_a != timed_b) return timed_b;
    if (timed_a && slots[a].time != slots[b].time) return slots[a].time < slots[b].time;
    return slots.less(a, b);
  };
  std::nth_element(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(count), found.end(), older);
  found.resize(count);
  return found;
}

// The least time; NO_TIME if no entity has one.
inline double oldest_time(const Slots& slots) {
  double least = NO_TIME;
  slots.for_each([&](std::uint32_t slot) {
    if (!(slots[slot].time >= least) && !std::isnan(slots[slot].time)) least = slots[slot].time;
  });
  return least;
}

}  // namespace dynhull
