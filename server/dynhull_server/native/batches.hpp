// Batches of the journal as columns: `columns_of_rows` of storage/rows/batch_columns.py, with the same results.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

#include "records.hpp"

namespace dynhull_server {

static_assert(std::endian::native == std::endian::little);  // as the records are

// What storage/rows/encoding.py writes.
constexpr std::uint8_t HAS_TIMES = 2, HAS_DEADLINES = 4, HAS_CLOCK = 8, KINDS = 48, OF_POINTS = 0, OF_STRINGS = 16;
constexpr std::uint8_t PLAIN_FLAGS = HAS_TIMES | HAS_DEADLINES | HAS_CLOCK | KINDS, MAY_SKIP = 2, HAS_CAUSE = 32;
constexpr std::int64_t FOREVER = std::numeric_limits<std::int64_t>::max();
// The places in OPS of storage/segments/columns.py: insert, delete, put, remove; and none.
constexpr std::int8_t NO_OP = -1, INSERT = 0, DELETE = 1, PUT = 2, REMOVE = 3;

// Batches that say nothing but what they put and remove; others are left to Python, as is what is no batch.
class PlainBatches {
 public:
  explicit PlainBatches(std::uint8_t kind) : kind_(kind) {}

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
    if (kind_ == OF_POINTS) {
      if (!take_points(added) || !take_points(removed)) return false;
    } else {
      if (!take_keys(added) || !take_keys(removed) || !take_points(added)) return false;
      fill(points, 2 * removed, NOT_A_NUMBER);
    }
    if (!take_times(flags & HAS_TIMES, added, removed, NO_TIME, times)) return false;
    if (!take_times(flags & HAS_DEADLINES, added, removed, FOREVER, deadlines)) return false;
    std::int8_t cause = 0;
    if ((further & HAS_CAUSE) && (!take(cause) || cause < 1 || cause > MOST_CAUSES)) return false;
    fill(ops, std::size_t{added}, kind_ == OF_POINTS ? INSERT : PUT);
    fill(ops, std::size_t{removed}, kind_ == OF_POINTS ? DELETE : REMOVE);
    if (all == 0) {  // a row that says so
      ops.push_back(NO_OP), times.push_back(NO_TIME), deadlines.push_back(FOREVER);
      fill(points, 2, NOT_A_NUMBER);
    }
    clocks.push_back(clock);
    causes.push_back(static_cast<std::int8_t>(cause - 1));
    rows.push_back(static_cast<std::int32_t>(all ? all : 1));
    return true;
  }

  bool take_keys(std::size_t count) {
    std::string_view taken;
    std::size_t size = count * sizeof(std::uint64_t);
    if (kind_ == OF_STRINGS) {
      if (!take(count, taken)) return false;
      size = 0;
      for (const char length : taken) size += static_cast<std::uint8_t>(length);
      lengths += taken;
    }
    if (!take(size, taken)) return false;
    keys += taken;
    return true;
  }

  bool take_points(std::size_t count) {
    std::string_view taken;
    if (!take(count * 2 * sizeof(double), taken)) return false;
    const std::size_t before = points.size();
    points.resize(before + 2 * count);
    if (count) std::memcpy(points.data() + before, taken.data(), taken.size());
    return true;
  }

  // A column of times that has no time says that there is one: `detail` has that, and so Python reads it.
  bool take_times(bool there, std::size_t added, std::size_t removed, std::int64_t none,
                  std::vector<std::int64_t>& column) {
    if (!there) return fill(column, added + removed, none), true;
    std::string_view taken;
    if (!take(added * sizeof(std::int64_t), taken)) return false;
    const std::size_t before = column.size();
    column.resize(before + added);
    if (added) std::memcpy(column.data() + before, taken.data(), taken.size());
    bool some = false;
    for (std::size_t row = before; row < column.size(); ++row) some = some || column[row] != none;
    fill(column, removed, none);
    return some;
  }

  template <class Value>
  static void fill(std::vector<Value>& column, std::size_t count, Value value) {
    column.insert(column.end(), count, value);
  }

  static constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();
  static constexpr std::int8_t MOST_CAUSES = 6;

  std::uint8_t kind_;
  std::string_view left_;
};

}  // namespace dynhull_server
