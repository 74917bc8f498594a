// Events as they lie in the arrays of numpy: the types RUN and EVENT of state/fences/events/block.py.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

namespace dynhull_server {

// The time that there is not, and the kinds of keys.
constexpr std::int64_t NO_TIME = std::numeric_limits<std::int64_t>::min();
enum Kind : std::uint8_t { NO_KEY = 0, STRING_KEY = 1, INTEGER_KEY = 2 };
constexpr std::uint8_t INTEGER_BYTES = 8;

#pragma pack(push, 1)
struct Run {
  std::int64_t fence, first, count, hull;
  std::uint8_t kind;
  std::int64_t subject_revision, area_revision, time;
};
struct Event {
  std::uint8_t type, causes, length;
  double x, y, before_x, before_y, distance;
  std::int64_t event_time, first_time;

  bool has_position() const { return !std::isnan(x); }
  bool has_previous() const { return !std::isnan(before_x); }
  bool is_far() const { return !std::isnan(distance) && distance != 0; }
};
#pragma pack(pop)
static_assert(sizeof(Run) == 57 && sizeof(Event) == 59);

}  // namespace dynhull_server
