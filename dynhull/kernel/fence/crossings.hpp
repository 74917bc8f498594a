// Who crossed which fence: what an index of fences reports.
#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "../predicates/point.hpp"

namespace dynhull {

enum Cause : std::uint8_t { MOVED = 1, AREA = 2, APPEARED = 4, REMOVED = 8, EXPIRED = 16 };

struct Crossing {
  std::int64_t fence;
  std::uint64_t key;  // the integer, or where the string begins
  Point now, before;
  double distance;
  std::uint8_t length;  // of the string
  std::int8_t change;   // +1 entered, -1 left, 0 crossed, 2 was inside as an entity of another hull
  std::uint8_t cause;
  std::uint32_t found;  // its place in a list of what was found

  bool turns() const { return change == 1 || change == -1; }
};

struct Crossings {
  std::vector<Crossing> rows;
  std::string strings;

  std::string_view string(const Crossing& row) const { return {strings.data() + row.key, row.length}; }

  void append(std::string_view key, Crossing row) {
    row.key = strings.size();
    row.length = static_cast<std::uint8_t>(key.size());
    strings.append(key);
    rows.push_back(row);
  }
  void append(std::uint64_t key, Crossing row) {
    row.key = key;
    rows.push_back(row);
  }

  // By fence, then by key. Of a subject that enters or leaves, nothing else is reported: after an exception, a way may
  // have been reported already, or that of a subject that has left; and one that was carried may have entered.
  void sort(bool by_string) {
    const auto order = [&](const Crossing& a, const Crossing& b) {
      if (a.fence != b.fence) return a.fence <=> b.fence;
      return by_string ? string(a) <=> string(b) : a.key <=> b.key;
    };
    std::sort(rows.begin(), rows.end(), [&](const Crossing& a, const Crossing& b) {
      const auto sign = order(a, b);
      return sign != 0 ? sign < 0 : a.turns() > b.turns();
    });
    const auto needless = [&](const Crossing& a, const Crossing& b) { return !b.turns() && order(a, b) == 0; };
    rows.erase(std::unique(rows.begin(), rows.end(), needless), rows.end());
  }
};

}  // namespace dynhull
