// Batches of the journal as columns: `columns_of_rows` of storage/rows/batch_columns.py, with the same results.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "records.hpp"

namespace dynhull_server {

static_assert(std::endian::native == std::endian::little);  // as the records are

// What storage/rows/encoding.py writes.
constexpr std::uint8_t HAS_TIMES = 2, HAS_DEADLINES = 4, HAS_CLOCK = 8, KINDS = 48, OF_POINTS = 0, OF_STRINGS = 16,
                       OF_INTEGERS = 32;
constexpr std::uint8_t PLAIN_FLAGS = HAS_TIMES | HAS_DEADLINES | HAS_CLOCK | KINDS, MAY_SKIP = 2, HAS_CAUSE = 32;
constexpr std::int64_t FOREVER = std::numeric_limits<std::int64_t>::max();
// The places in OPS of storage/segments/columns.py: insert, delete, put, remove; and none.
constexpr std::int8_t NO_OP = -1, INSERT = 0, DELETE = 1, PUT = 2, REMOVE = 3;

// Keys; integers as their eight bytes.
using Wanted = std::unordered_set<std::string_view>;

// Batches that say nothing but what they put and remove; others are left to Python, as is what is no batch.
class PlainBatches {
 public:
  // Without `wanted` every key is.
  explicit PlainBatches(std::uint8_t kind, const Wanted* wanted = nullptr) : kind_(kind), wanted_(wanted) {}

  // Adds the batches of a payload, or nothing if one of them is not plain.
  bool add(std::string_view payload) {
    const Sizes before = sizes();
    left_ = payload;
    std::int32_t count = 0;
    for (; !left_.empty(); ++count)
      if (!add_one()) {
        truncate(before);
        return false;
      }
    if (count) records.push_back(count);
    return count > 0;
  }

  std::vector<std::int32_t> records;  // of each payload
  std::vector<std::int64_t> clocks;   // of each batch
  std::vector<std::int8_t> causes;    // of each batch: places in CAUSES
  std::vector<std::int32_t> rows;     // of each batch
  std::vector<std::int8_t> ops;       // of each row, as all that follow
  std::vector<double> points;
  std::vector<std::int64_t> times, deadlines;
  std::string lengths, keys;  // of the rows that have a key; integers have no lengths

 private:
  struct Sizes {
    std::size_t batches, rows, lengths, keys;
  };
  Sizes sizes() const { return {clocks.size(), ops.size(), lengths.size(), keys.size()}; }

  void truncate(const Sizes& to) {
    clocks.resize(to.batches), causes.resize(to.batches), rows.resize(to.batches);
    ops.resize(to.rows), points.resize(2 * to.rows), times.resize(to.rows), deadlines.resize(to.rows);
    lengths.resize(to.lengths), keys.resize(to.keys);
  }

  bool take(std::size_t size, std::string_view& taken) {
    if (size > left_.size()) return false;
    taken = left_.substr(0, size);
    left_.remove_prefix(size);
    return true;
  }

  template <class Value>
  bool take(Value& value) {
    std::string_view taken;
    if (!take(sizeof(Value), taken)) return false;
    std::memcpy(&value, taken.data(), sizeof(Value));
    return true;
  }

  bool add_one() {
    std::uint32_t added, removed;
    std::uint64_t sequence;
    std::uint8_t name, further, flags;
    std::string_view producer;
    if (!take(added) || !take(removed) || !take(sequence) || !take(name) || !take(further) || !take(flags))
      return false;
    if ((further & ~(MAY_SKIP | HAS_CAUSE)) || (flags & ~PLAIN_FLAGS) || (flags & KINDS) != kind_) return false;
    if (!take(name, producer)) return false;
    std::int64_t clock = NO_TIME;
    if ((flags & HAS_CLOCK) && !take(clock)) return false;
    // As many bytes as there are: no room for more rows than these can have.
    const std::size_t all = std::size_t(added) + removed;
    if (all > left_.size()) return false;
    std::size_t puts = added, takes = removed;
    if (kind_ == OF_POINTS) {
      if (!take_points(added) || !take_points(removed)) return false;
    } else {
      if (!take_keys(puts, put_) || !take_keys(takes, taken_) || !take_points(added)) return false;
      fill(points, 2 * takes, NOT_A_NUMBER);
    }
    if (!take_times(flags & HAS_TIMES, added, puts, takes, NO_TIME, times)) return false;
    if (!take_times(flags & HAS_DEADLINES, added, puts, takes, FOREVER, deadlines)) return false;
    std::int8_t cause = 0;
    if ((further & HAS_CAUSE) && (!take(cause) || cause < 1 || cause > MOST_CAUSES)) return false;
    fill(ops, puts, kind_ == OF_POINTS ? INSERT : PUT);
    fill(ops, takes, kind_ == OF_POINTS ? DELETE : REMOVE);
    if (puts + takes == 0) {  // a row that says so
      ops.push_back(NO_OP), times.push_back(NO_TIME), deadlines.push_back(FOREVER);
      fill(points, 2, NOT_A_NUMBER);
    }
    clocks.push_back(clock);
    causes.push_back(static_cast<std::int8_t>(cause - 1));
    rows.push_back(static_cast<std::int32_t>(puts + takes ? puts + takes : 1));
    return true;
  }

  // Sets `count` to that of the keys that are wanted, and `chosen` to their places, where not all are.
  bool take_keys(std::size_t& count, std::vector<std::size_t>& chosen) {
    std::string_view sizes, taken;
    std::size_t size = count * sizeof(std::uint64_t);
    if (kind_ == OF_STRINGS) {
      if (!take(count, sizes)) return false;
      size = 0;
      for (const char length : sizes) size += static_cast<std::uint8_t>(length);
    }
    if (!take(size, taken)) return false;
    if (!wanted_) {
      lengths += sizes;
      keys += taken;
      return true;
    }
    chosen.clear();
    for (std::size_t row = 0, at = 0; row < count; ++row) {
      const std::size_t length = kind_ == OF_STRINGS ? static_cast<std::uint8_t>(sizes[row]) : sizeof(std::uint64_t);
      const std::string_view key = taken.substr(at, length);
      at += length;
      if (!wanted_->contains(key)) continue;
      chosen.push_back(row);
      keys += key;
      if (kind_ == OF_STRINGS) lengths += sizes[row];
    }
    count = chosen.size();
    return true;
  }

  bool take_points(std::size_t count) {
    std::string_view taken;
    if (!take(count * 2 * sizeof(double), taken)) return false;
    append<2>(taken, points);
    return true;
  }

  // A column of times that has no time says that there is one: `detail` has that, and so Python reads it.
  bool take_times(bool there, std::size_t added, std::size_t puts, std::size_t takes, std::int64_t none,
                  std::vector<std::int64_t>& column) {
    if (!there) return fill(column, puts + takes, none), true;
    std::string_view taken;
    if (!take(added * sizeof(std::int64_t), taken)) return false;
    bool some = false;
    for (std::size_t row = 0; row < added && !some; ++row) {
      std::int64_t time;
      std::memcpy(&time, taken.data() + row * sizeof(time), sizeof(time));
      some = time != none;
    }
    append<1>(taken, column);
    fill(column, takes, none);
    return some;
  }

  // Appends the values of the keys that are put, `Each` of one.
  template <std::size_t Each, class Value>
  void append(std::string_view values, std::vector<Value>& column) const {
    constexpr std::size_t SIZE = Each * sizeof(Value);
    const std::size_t before = column.size();
    if (!wanted_) {
      column.resize(before + values.size() / sizeof(Value));
      if (!values.empty()) std::memcpy(column.data() + before, values.data(), values.size());
      return;
    }
    column.resize(before + Each * put_.size());
    for (std::size_t place = 0; place < put_.size(); ++place)
      std::memcpy(column.data() + before + Each * place, values.data() + put_[place] * SIZE, SIZE);
  }

  template <class Value>
  static void fill(std::vector<Value>& column, std::size_t count, Value value) {
    column.insert(column.end(), count, value);
  }

  static constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::int8_t MOST_CAUSES = 6;

  std::uint8_t kind_;
  const Wanted* wanted_;
  std::vector<std::size_t> put_, taken_;  // of one batch, the places of the keys that are wanted
  std::string_view left_;
};

}  // namespace dynhull_server
