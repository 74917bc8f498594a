// Of each key the last place that batches of the journal give it: `_last_places` of storage/rows/past_rows.py.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "batches.hpp"

namespace dynhull_server {

class LastPlaces {
 public:
  explicit LastPlaces(std::uint8_t kind) : kind_(kind), table_(16) {}
  LastPlaces(const LastPlaces&) = delete;

  // Adds the batches of a payload that has `expected` ones, or nothing: if one is not plain, or if of all points that
  // are put some would have a time, or a deadline, and others none.
  bool add(std::string_view payload, std::size_t expected) {
    moves_.clear(), texts_.clear();
    PlainBatch batch;
    Said said = said_;
    std::size_t batches = 0;
    for (; !payload.empty(); ++batches) {
      if (!batch.take(payload, kind_)) return false;
      std::size_t at = 0;
      for (std::size_t row = 0; row < batch.puts; ++row) {
        Move& move = moved(PUT, batch.put_lengths, batch.put_keys, row, at);
        move.x = PlainBatch::at<double>(batch.points, 2 * row),
        move.y = PlainBatch::at<double>(batch.points, 2 * row + 1);
        if (!batch.times.empty()) move.time = PlainBatch::at<std::int64_t>(batch.times, row);
        if (!batch.deadlines.empty()) move.deadline = PlainBatch::at<std::int64_t>(batch.deadlines, row);
        said.add(move.time, move.deadline);
      }
      at = 0;
      for (std::size_t row = 0; row < batch.removes; ++row)
        moved(REMOVE, batch.removed_lengths, batch.removed_keys, row, at);
    }
    if (batches != expected || batches == 0 || said.is_mixed()) return false;
    said_ = said;
    clock = batch.clock;
    cause = batch.cause;
    apply();
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
    for (std::size_t number = 0; number < count_; ++number) {
      const Row& row = row_at(number);
      Keys& keys = row.last.op == PUT ? taken.put : taken.removed;
      if (kind_ == OF_STRINGS) keys.lengths += static_cast<char>(row.length);
      keys.text += key_of(row);
      if (row.last.op != PUT) continue;
      taken.points.push_back(row.last.x), taken.points.push_back(row.last.y);
      if (said_.dated) taken.times.push_back(row.last.time);
      if (said_.ending) taken.deadlines.push_back(row.last.deadline);
    }
    return taken;
  }

  std::int64_t clock = NO_TIME;  // of the last batch, as its cause
  std::int8_t cause = -1;

 private:
  struct Move {
    double x = 0, y = 0;
    std::int64_t time = NO_TIME, deadline = FOREVER;
    std::uint32_t hash = 0;
    std::int8_t op = NO_OP;
  };
  // Short keys lie in their row, where they are compared without another wait for memory.
  static constexpr std::size_t SHORT = 20;
  struct Row {
    Move last;
    std::uint8_t length;
    union {
      char key[SHORT];
      std::size_t start;  // of a longer one, in `text_`
    };
  };
  struct Entry {
    std::uint32_t hash, row = NONE;
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
  static constexpr std::size_t CHUNK = 4096;  // rows, which stay where they are

  // The next row of a batch, whose key begins at `at`.
  Move& moved(std::int8_t op, std::string_view lengths, std::string_view text, std::size_t row, std::size_t& at) {
    const std::size_t length = kind_ == OF_STRINGS ? static_cast<std::uint8_t>(lengths[row]) : sizeof(std::uint64_t);
    const std::string_view key = text.substr(at, length);
    at += length;
    texts_.push_back(key);
    Move& move = moves_.emplace_back();
    move.hash = dynhull::Hash::of(key);
    move.op = op;
    return move;
  }

  // Each of the moves, in order, is the last one of its key. What some of them need is fetched before: the waits for
  // memory overlap.
  void apply() {
    for (std::size_t from = 0; from < moves_.size(); from += TOGETHER) {
      const std::size_t to = std::min(from + TOGETHER, moves_.size());
      for (std::size_t i = from; i < to; ++i) fetch(&table_[moves_[i].hash & (table_.size() - 1)]);
      for (std::size_t i = from; i < to; ++i)
        if (const Entry& entry = table_[moves_[i].hash & (table_.size() - 1)]; entry.row != NONE)
          fetch(&row_at(entry.row));
      for (std::size_t i = from; i < to; ++i) row_of(texts_[i], moves_[i].hash).last = moves_[i];
    }
  }
  static constexpr std::size_t TOGETHER = 32;

  static void fetch([[maybe_unused]] const void* address) {
#ifdef __GNUC__
    __builtin_prefetch(address);
    __builtin_prefetch(static_cast<const char*>(address) + sizeof(Row) - 1);
#endif
  }

  const Row& row_at(std::size_t number) const { return chunks_[number / CHUNK][number % CHUNK]; }
  Row& row_at(std::size_t number) { return chunks_[number / CHUNK][number % CHUNK]; }

  std::string_view key_of(const Row& row) const {
    return {row.length <= SHORT ? row.key : text_.data() + row.start, row.length};
  }

  // The row of a key: open to the next place where one is taken, at most half of them.
  Row& row_of(std::string_view key, std::uint32_t hash) {
    std::size_t at = hash & (table_.size() - 1);
    for (; table_[at].row != NONE; at = (at + 1) & (table_.size() - 1)) {
      if (table_[at].hash != hash) continue;
      Row& row = row_at(table_[at].row);
      if (key_of(row) == key) return row;
    }
    if (count_ % CHUNK == 0) chunks_.push_back(std::make_unique_for_overwrite<Row[]>(CHUNK));
    table_[at] = {hash, static_cast<std::uint32_t>(count_)};
    Row& row = row_at(count_++);
    row.length = static_cast<std::uint8_t>(key.size());
    if (key.size() <= SHORT) {
      std::memcpy(row.key, key.data(), key.size());
    } else {
      row.start = text_.size();
      text_ += key;
    }
    if (2 * count_ > table_.size()) grow();
    return row;
  }

  void grow() {
    std::vector<Entry> larger(2 * table_.size());
    for (const Entry& entry : table_) {
      if (entry.row == NONE) continue;
      std::size_t at = entry.hash & (larger.size() - 1);
      while (larger[at].row != NONE) at = (at + 1) & (larger.size() - 1);
      larger[at] = entry;
    }
    table_.swap(larger);
  }

  std::uint8_t kind_;
  Said said_;
  std::vector<Move> moves_;  // those of one payload, and their keys
  std::vector<std::string_view> texts_;
  std::vector<Entry> table_;
  std::vector<std::unique_ptr<Row[]>> chunks_;
  std::size_t count_ = 0;
  std::string text_;  // longer keys
};

}  // namespace dynhull_server
