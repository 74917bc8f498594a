// One fence: its area, now and when it was last decided.
#pragma once

#include <memory>
#include <string>
#include <unordered_map>

#include "../memory/hash.hpp"
#include "strips.hpp"

namespace dynhull {

using Places =
    std::unordered_map<std::string, std::optional<Point>, HashOfKey>;  // by key; none where the key is missing

struct alignas(LINE) Fence {
  std::int64_t number = 0;
  std::int64_t count = 0;  // of subjects inside
  std::shared_ptr<const Area> area, decided;
  bool cross = false, own = false;        // own: around the subjects' own hull, without the subject
  bool decided_own = false;               // when it was last decided
  bool given = false;                     // the keys inside were given, not decided
  bool listed = false;                    // own: all subjects that are new are listed as outside, or decided
  std::vector<std::uint32_t> outside;     // own: slots that are outside, and some that were
  std::shared_ptr<const Places> earlier;  // of a new fence: the places of the keys that had changed

  std::size_t bytes() const { return sizeof *this + area->bytes() + outside.capacity() * sizeof(std::uint32_t); }
};

}  // namespace dynhull
