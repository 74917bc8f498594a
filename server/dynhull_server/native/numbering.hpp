// Crossings become events: `numbered` of state/fences/events/sequences.py, with the same results.
#pragma once

#include <algorithm>
#include <cstddef>
#include <unordered_map>
#include <utility>
#include <vector>

#include "records.hpp"

namespace dynhull_server {

// Crossings of one revision: n rows of each column.
struct Crossed {
  std::size_t count = 0;
  const std::int64_t* fences = nullptr;
  const std::int8_t* changes = nullptr;
  const std::uint8_t* causes = nullptr;
  const std::uint8_t* lengths = nullptr;
  const double *points = nullptr, *previous = nullptr, *distances = nullptr;
  const std::int64_t* event_times = nullptr;  // or none
  std::uint8_t meant = 0, stands_for = 0;     // a cause, and the one in its place
  std::uint8_t kind = NO_KEY;
  std::int64_t now = 0, hull = 0, revision = 0;
  std::unordered_map<std::int64_t, std::int64_t> areas;  // the revisions of the hulls that are areas, by fence
};

// What is said of k fences, by ascending numbers: the rows of `Told`.
struct Told {
  std::vector<std::int64_t> fences, places, lasts, times, made, changes;

  explicit Told(std::vector<std::int64_t> numbers)
      : fences(std::move(numbers)),
        places(fences.size()),
        lasts(fences.size()),
        times(fences.size()),
        made(fences.size()),
        changes(fences.size()) {}

  // Where a fence is. O(log(1 + how far that is behind `from`)) where it is behind.
  std::size_t place_of(std::int64_t fence, std::size_t from) const {
    if (from >= fences.size() || fences[from] > fence) from = 0;
    std::size_t step = 1;
    while (from + step < fences.size() && fences[from + step] <= fence) from += std::exchange(step, 2 * step);
    const auto first = fences.begin() + static_cast<std::ptrdiff_t>(from);
    const auto end = fences.begin() + static_cast<std::ptrdiff_t>(std::min(from + step, fences.size()));
    return static_cast<std::size_t>(std::lower_bound(first, end, fence) - fences.begin());
  }
};

// The numbers of the fences, ascending. O(n + k log k).
inline std::vector<std::int64_t> numbers_of(const std::vector<Crossed>& waiting) {
  std::vector<std::int64_t> numbers;
  for (const Crossed& each : waiting)
    for (std::size_t row = 0; row < each.count; ++row)
      if (row == 0 || each.fences[row] != each.fences[row - 1]) numbers.push_back(each.fences[row]);
  std::sort(numbers.begin(), numbers.end());
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  return numbers;
}

// The types of events by the change of side: 0, 1, -1.
using Types = const std::uint8_t*;

// Writes the events of all rows, and appends their runs. `told` has the last sequences and times, which go on here.
// O(n + runs log k).
inline void number(const std::vector<Crossed>& waiting, Types types, Told& told, std::vector<Run>& runs, Event* event) {
  for (const Crossed& each : waiting) {
    std::size_t place = 0;
    for (std::size_t row = 0; row < each.count; ++row, ++event) {
      const std::int64_t fence = each.fences[row];
      if (row == 0 || fence != each.fences[row - 1]) {
        place = told.place_of(fence, place);
        const std::int64_t time = told.times[place] = std::max(told.times[place], each.now);
        const auto area = each.areas.find(fence);
        const std::int64_t area_revision = area == each.areas.end() ? 0 : area->second;
        runs.push_back({fence, told.lasts[place] + 1, 0, each.hull, each.kind, each.revision, area_revision, time});
      }
      const std::int8_t change = each.changes[row];
      ++runs.back().count;
      ++told.lasts[place];
      ++told.made[place];
      told.changes[place] += change;
      event->type = types[change < 0 ? 2 : change];
      const std::uint8_t causes = each.causes[row];
      event->causes = causes & each.meant ? (causes & ~each.meant) | each.stands_for : causes;
      event->length = each.lengths ? each.lengths[row] : INTEGER_BYTES;
      event->x = each.points[2 * row];
      event->y = each.points[2 * row + 1];
      event->before_x = each.previous[2 * row];
      event->before_y = each.previous[2 * row + 1];
      event->distance = event->has_position() ? each.distances[row] : std::numeric_limits<double>::quiet_NaN();
      event->event_time = each.event_times ? each.event_times[row] : NO_TIME;
      event->first_time = NO_TIME;
    }
  }
}

}  // namespace dynhull_server
