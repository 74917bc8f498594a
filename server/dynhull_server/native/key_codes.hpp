// Equal keys have equal numbers: `key_codes` of storage/segments/gathered.py, with the same results.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "../../../dynhull/kernel/memory/hash.hpp"

namespace dynhull_server {

// A table of the different keys met so far, open to the next place where one is taken.
class KeyCodes {
 public:
  explicit KeyCodes(std::size_t most) {
    std::size_t room = 16;
    while (room < 2 * most) room *= 2;
    slots_.assign(room, {});
  }

  // The number of a key: 0 for the first one, and one more for each that is new.
  std::int32_t code(std::string_view key) {
    const std::uint32_t tag = dynhull::Hash::of(key);
    for (std::size_t at = tag & (slots_.size() - 1);; at = (at + 1) & (slots_.size() - 1)) {
      Slot& slot = slots_[at];
      if (slot.code < 0) {
        slot = {tag, static_cast<std::int32_t>(keys_.size())};
        keys_.push_back(key);
        return slot.code;
      }
      if (slot.tag == tag && keys_[static_cast<std::size_t>(slot.code)] == key) return slot.code;
    }
  }

 private:
  struct Slot {
    std::uint32_t tag = 0;
    std::int32_t code = -1;
  };
  std::vector<Slot> slots_;
  std::vector<std::string_view> keys_;
};

}  // namespace dynhull_server
