// Of each key the last place that batches of the journal give it: `_last_places` of storage/rows/past_rows.py.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "batches.hpp"

namespace dynhull_server {

class LastPlaces {
 public:
  explicit LastPlaces(std::uint8_t kind) : kind_(kind), table_(16, NONE) {}

  // Adds the batches of a payload that has `expected` ones, or nothing: if one is not plain, or if of all points that
  // are put some would have a time, or a deadline, and others none.
  bool add(std::string_view payload, std::size_t expected) {
    PlainBatches batches(kind_);
    if (!batches.add(payload) || batches.rows.size() != expected) return false;
    Said said = said_;
    for (std::size_t row = 0; row < batches.ops.size(); ++row)
      if (batches.ops[row] == PUT) said.add(batches.times[row], batches.deadlines[row]);
    if (said.is_mixed()) return false;
    said_ = said;
    clock = batches.clocks.back();
    cause = batches.causes.back();
    look_up(batches);
    std::size_t number = 0;
    for (std::size_t row = 0; row < batches.ops.size(); ++row) {
      if (batches.ops[row] == NO_OP) continue;
      Row& last = row_of(found_[number].key, found_[number].hash);
      ++number;
      last.op = batches.ops[row];
      last.x = batches.points[2 * row], last.y = batches.points[2 * row + 1];
      last.time = batches.times[row], last.deadline = batches.deadlines[row];
    }
    return true;
  }

  struct Keys {
    std::string lengths, text;  // integers have no lengths
  };
  struct Taken {
    Keys put, removed;
    std::vector<double> points;
    std::vector<std::int64_t> times, deadlines;  // empty where no point has one
  };

  Taken taken() const {
    Taken taken;
    for (const Row& row : rows_) {
      Keys& keys = row.op == PUT ? taken.put : taken.removed;
      if (kind_ == OF_STRINGS) keys.lengths += static_cast<char>(row.length);
      keys.text += key_of(row);
      if (row.op != PUT) continue;
      taken.points.push_back(row.x), taken.points.push_back(row.y);
      if (said_.dated) taken.times.push_back(row.time);
      if (said_.ending) taken.deadlines.push_back(row.deadline);
    }
    return taken;
  }

  std::int64_t clock = NO_TIME;  // of the last batch, as its cause
  std::int8_t cause = -1;

 private:
  struct Row {
    std::size_t start;
    std::size_t hash;
    std::uint8_t length;
    std::int8_t op;
    double x, y;
    std::int64_t time, deadline;
  };
  // What points say that are put.
  struct Said {
    bool dated = false, undated = false, ending = false, endless = false;

    void add(std::int64_t time, std::int64_t deadline) {
      (time == NO_TIME ? undated : dated) = true;
      (deadline == FOREVER ? endless : ending) = true;
    }
    bool is_mixed() const { return (dated && undated) || (ending && endless); }
  };
  static constexpr std::uint32_t NONE = 0xffffffff;

  // Finds the keys of batches, and fetches what `row_of` needs of them: the waits for memory overlap.
  void look_up(const PlainBatches& batches) {
    found_.clear();
    const std::string_view text = batches.keys;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t length =
          kind_ == OF_STRINGS ? static_cast<std::uint8_t>(batches.lengths[found_.size()]) : sizeof(std::uint64_t);
      const std::string_view key = text.substr(at, length);
      found_.push_back({key, std::hash<std::string_view>{}(key)});
      at += length;
      fetch(&table_[found_.back().hash & (table_.size() - 1)]);
    }
    for (const Found& each : found_)
      if (const std::uint32_t row = first(each.hash); row != NONE) fetch(&rows_[row]);
    for (const Found& each : found_)
      if (const std::uint32_t row = first(each.hash); row != NONE) fetch(text_.data() + rows_[row].start);
  }
  std::uint32_t first(std::size_t hash) const { return table_[hash & (table_.size() - 1)]; }
  static void fetch([[maybe_unused]] const void* address) {
#ifdef __GNUC__
    __builtin_prefetch(address);
#endif
  }

  std::string_view key_of(const Row& row) const { return std::string_view(text_).substr(row.start, row.length); }

  // The row of a key: open to the next place where one is taken, at most half of them.
  Row& row_of(std::string_view key, std::size_t hash) {
    std::size_t at = hash & (table_.size() - 1);
    for (; table_[at] != NONE; at = (at + 1) & (table_.size() - 1)) {
      Row& row = rows_[table_[at]];
      if (row.hash == hash && key_of(row) == key) return row;
    }
    table_[at] = static_cast<std::uint32_t>(rows_.size());
    rows_.push_back({text_.size(), hash, static_cast<std::uint8_t>(key.size()), NO_OP, 0, 0, NO_TIME, FOREVER});
    text_ += key;
    if (2 * rows_.size() > table_.size()) grow();
    return rows_.back();
  }

  void grow() {
    std::vector<std::uint32_t> larger(2 * table_.size(), NONE);
    for (std::size_t row = 0; row < rows_.size(); ++row) {
      std::size_t at = rows_[row].hash & (larger.size() - 1);
      while (larger[at] != NONE) at = (at + 1) & (larger.size() - 1);
      larger[at] = static_cast<std::uint32_t>(row);
    }
    table_.swap(larger);
  }

  struct Found {
    std::string_view key;
    std::size_t hash;
  };

  std::uint8_t kind_;
  Said said_;
  std::vector<Found> found_;  // the keys of one payload
  std::vector<std::uint32_t> table_;
  std::vector<Row> rows_;
  std::string text_;  // the keys
};

}  // namespace dynhull_server
