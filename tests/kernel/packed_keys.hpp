// Keys as callers of the kernel pack them.
#pragma once

#include <string>
#include <vector>

#include "../../dynhull/kernel/keyed/entities.hpp"

namespace {

// Calls `work` with the keys: `strings`, or what `integer` makes of each.
template <class Integer, class Work>
void with_packed_keys(bool strings, const std::vector<std::string>& rows, Integer integer, Work work) {
  if (strings) {
    std::vector<std::uint8_t> lengths;
    std::string data;
    for (const std::string& key : rows) {
      lengths.push_back(static_cast<std::uint8_t>(key.size()));
      data += key;
    }
    work(dynhull::StringKeys(lengths.data(), data.data(), rows.size()));
  } else {
    std::vector<std::uint64_t> integers;
    for (const std::string& key : rows) integers.push_back(integer(key));
    work(dynhull::IntegerKeys(integers.data(), rows.size()));
  }
}

}  // namespace
