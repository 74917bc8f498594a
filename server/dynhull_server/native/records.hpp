// Events as they lie in the arrays of numpy: `event_format.hpp` is made of state/fences/events/format.py.
#pragma once

#include <cmath>
#include <cstdint>
#include <limits>

#include "event_format.hpp"

namespace dynhull_server {

// The time that there is not.
constexpr std::int64_t NO_TIME = std::numeric_limits<std::int64_t>::min();

using Run = RUN_FIELDS;
struct Event : EVENT_FIELDS {
  bool has_position() const { return !std::isnan(x); }
  bool has_previous() const { return !std::isnan(before_x); }
  bool is_far() const { return !std::isnan(distance) && distance != 0; }
};
static_assert(sizeof(Run) == 57 && sizeof(Event) == 59);

}  // namespace dynhull_server
