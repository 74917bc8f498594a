// Batches of the journal as columns: `columns_of_rows` of storage/rows/batch_columns.py, with the same results.
#pragma once

#include <bit>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <unordered_set>
#include <vector>

#include "../../../dynhull/kernel/memory/hash.hpp"
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

// Keys; integers as their eight bytes. Most of those that are looked up are none of these: a sieve of their lengths and
// last bytes lets few others through.
class Wanted {
 public:
  void insert(std::string_view key) {
    keys_.insert(key);
    const std::string padded = std::string(sizeof(std::uint64_t), '\0') + std::string(key);
    sieve_[hole({padded.data() + sizeof(std::uint64_t), key.size()})] = true;
  }

  // There are at least eight other bytes before the key.
  bool contains(std::string_view key) const { return sieve_[hole(key)] && keys_.contains(key); }

 private:
  static constexpr int HOLES = 12;  // bits

  static std::size_t hole(std::string_view key) {
    constexpr std::size_t SIZE = sizeof(std::uint64_t);
    if (key.empty()) return 0;
    std::uint64_t last;
    std::memcpy(&last, key.data() + key.size() - SIZE, SIZE);
    if (key.size() < SIZE) last >>= 8 * (SIZE - key.size());
    return static_cast<std::size_t>((last ^ key.size()) * 0x9e3779b97f4a7c15 >> (64 - HOLES));
  }

  std::unordered_set<std::string_view, dynhull::HashOfKey> keys_;
  std::bitset<std::size_t(1) << HOLES> sieve_;
};

// One batch of a payload that says nothing but what it puts and removes; others are left to Python, as is what is no
// batch. What it has lies in the payload.
struct PlainBatch {
  std::uint32_t puts, removes;  // or points that are inserted, and deleted
  std::int64_t clock;
  std::int8_t cause;                                                      // a place in CAUSES
  std::string_view put_lengths, put_keys, removed_lengths, removed_keys;  // integers have no lengths
  std::string_view points, deleted;
  std::string_view times, deadlines;  // empty where no point has one

  // Takes a batch from the beginning of `left`; false if it is none of these.
  bool take(std::string_view& left, std::uint8_t kind) {
    std::uint64_t sequence;
    std::uint8_t name, further, flags;
    std::string_view producer;
    if (!value(left, puts) || !value(left, removes) || !value(left, sequence) || !value(left, name) ||
        !value(left, further) || !value(left, flags))
      return false;
    if ((further & ~(MAY_SKIP | HAS_CAUSE)) || (flags & ~PLAIN_FLAGS) || (flags & KINDS) != kind) return false;
    if (!bytes(left, name, producer)) return false;
    clock = NO_TIME;
    if ((flags & HAS_CLOCK) && !value(left, clock)) return false;
    // As many bytes as there are: no room for more rows than these can have.
    if (std::size_t(puts) + removes > left.size()) return false;
    put_lengths = put_keys = removed_lengths = removed_keys = deleted = times = deadlines = {};
    if (kind == OF_POINTS) {
      if (!bytes(left, puts * POINT, points) || !bytes(left, removes * POINT, deleted)) return false;
    } else if (!keys(left, kind, puts, put_lengths, put_keys) ||
               !keys(left, kind, removes, removed_lengths, removed_keys) || !bytes(left, puts * POINT, points)) {
      return false;
    }
    if ((flags & HAS_TIMES) && !column(left, NO_TIME, times)) return false;
    if ((flags & HAS_DEADLINES) && !column(left, FOREVER, deadlines)) return false;
    std::int8_t code = 0;
    if ((further & HAS_CAUSE) && (!value(left, code) || code < 1 || code > MOST_CAUSES)) return false;
    cause = static_cast<std::int8_t>(code - 1);
    return true;
  }

  template <class Value>
  static Value at(std::string_view values, std::size_t place) {
    Value value;
    std::memcpy(&value, values.data() + place * sizeof(Value), sizeof(Value));
    return value;
  }

 private:
  static constexpr std::size_t POINT = 2 * sizeof(double);
  static constexpr std::int8_t MOST_CAUSES = 6;

  static bool bytes(std::string_view& left, std::size_t size, std::string_view& taken) {
    if (size > left.size()) return false;
    taken = left.substr(0, size);
    left.remove_prefix(size);
    return true;
  }

  template <class Value>
  static bool value(std::string_view& left, Value& value) {
    std::string_view taken;
    if (!bytes(left, sizeof(Value), taken)) return false;
    value = at<Value>(taken, 0);
    return true;
  }

  static bool keys(std::string_view& left, std::uint8_t kind, std::size_t count, std::string_view& lengths,
                   std::string_view& text) {
    std::size_t size = count * sizeof(std::uint64_t);
    if (kind == OF_STRINGS) {
      if (!bytes(left, count, lengths)) return false;
      size = 0;
      for (const char length : lengths) size += static_cast<std::uint8_t>(length);
    }
    return bytes(left, size, text);
  }

  // A column of times that has no time says that there is one: `detail` has that, and so Python reads it.
  bool column(std::string_view& left, std::int64_t none, std::string_view& taken) const {
    if (!bytes(left, puts * sizeof(std::int64_t), taken)) return false;
    for (std::size_t row = 0; row < puts; ++row)
      if (at<std::int64_t>(taken, row) != none) return true;
    return false;
  }
};

// Batches of payloads, one after the other, as columns.
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

  bool add_one() {
    PlainBatch batch;
    if (!batch.take(left_, kind_)) return false;
    std::size_t puts = batch.puts, removes = batch.removes;
    if (kind_ == OF_POINTS) {
      append<2>(batch.points, points);
      append<2>(batch.deleted, points);
    } else {
      take_keys(batch.put_lengths, batch.put_keys, puts, put_);
      take_keys(batch.removed_lengths, batch.removed_keys, removes, removed_);
      append<2>(batch.points, points);
      fill(points, 2 * removes, NOT_A_NUMBER);
    }
    add_times(batch.times, puts, removes, NO_TIME, times);
    add_times(batch.deadlines, puts, removes, FOREVER, deadlines);
    fill(ops, puts, kind_ == OF_POINTS ? INSERT : PUT);
    fill(ops, removes, kind_ == OF_POINTS ? DELETE : REMOVE);
    if (puts + removes == 0) {  // a row that says so
      ops.push_back(NO_OP), times.push_back(NO_TIME), deadlines.push_back(FOREVER);
      fill(points, 2, NOT_A_NUMBER);
    }
    clocks.push_back(batch.clock);
    causes.push_back(batch.cause);
    rows.push_back(static_cast<std::int32_t>(puts + removes ? puts + removes : 1));
    return true;
  }

  // Sets `count` to that of the keys that are wanted, and `chosen` to their places, where not all are.
  void take_keys(std::string_view sizes, std::string_view taken, std::size_t& count, std::vector<std::size_t>& chosen) {
    if (!wanted_) {
      lengths += sizes;
      keys += taken;
      return;
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
  }

  void add_times(std::string_view given, std::size_t puts, std::size_t removes, std::int64_t none,
                 std::vector<std::int64_t>& column) {
    given.empty() ? fill(column, puts, none) : append<1>(given, column);
    fill(column, removes, none);
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

  std::uint8_t kind_;
  const Wanted* wanted_;
  std::vector<std::size_t> put_, removed_;  // of one batch, the places of the keys that are wanted
  std::string_view left_;
};

}  // namespace dynhull_server
