// Of each key the last place that batches of the journal give it: `_last_places` of storage/rows/past_rows.py.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "batches.hpp"

namespace dynhull_server {

class LastPlaces {
 public:
  // `most` keys need no larger table: its memory is new only where something lies.
  LastPlaces(std::uint8_t kind, std::size_t most) : kind_(kind), table_(std::min(most, MOST_ROOM)) {}
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

  // The bytes of what has been added: keys that are put, and removed, and points, times and deadlines of the first.
  struct Taken {
    struct Keys {
      std::size_t lengths = 0, text = 0;  // integers have no lengths
    } put, removed;
    std::size_t points = 0, times = 0, deadlines = 0;  // of the last two none where no point has one
  };
  // Where these bytes go.
  struct Room {
    struct Keys {
      char *lengths, *text;
    } put, removed;
    char *points, *times, *deadlines;
  };

  Taken taken() const {
    Taken taken;
    for (std::size_t number = 0; number < count_; ++number) {
      const Row& row = row_at(number);
      Taken::Keys& keys = row.op == PUT ? taken.put : taken.removed;
      if (kind_ == OF_STRINGS) ++keys.lengths;
      keys.text += row.length;
      if (row.op == PUT) taken.points += sizeof row.x + sizeof row.y;
    }
    if (said_.dated) taken.times = taken.points / 2;
    if (said_.ending) taken.deadlines = taken.points / 2;
    return taken;
  }

  void write(Room room) const {
    for (std::size_t number = 0; number < count_; ++number) {
      const Row& row = row_at(number);
      Room::Keys& keys = row.op == PUT ? room.put : room.removed;
      if (kind_ == OF_STRINGS) *keys.lengths++ = static_cast<char>(row.length);
      const std::string_view key = key_of(row);
      std::memcpy(keys.text, key.data(), key.size());
      keys.text += key.size();
      if (row.op != PUT) continue;
      put(room.points, row.x), put(room.points, row.y);
      if (said_.dated) put(room.times, times_[number]);
      if (said_.ending) put(room.deadlines, deadlines_[number]);
    }
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
  // Short keys lie in their row, where they are compared without another wait for memory; of a longer one the place in
  // `text_`. Times are elsewhere: most keys have none.
  static constexpr std::size_t SHORT = 22;
  struct Row {
    double x, y;
    char key[SHORT];
    std::uint8_t length;
    std::int8_t op;
  };
  struct Entry {
    std::uint32_t hash, row;  // one more than its number; 0 for none
  };
  // Entries that are all empty, in memory that the system clears when it is touched.
  class Table {
   public:
    explicit Table(std::size_t most) {
      while (size_ < 2 * most) size_ *= 2;
      entries_.reset(static_cast<Entry*>(std::calloc(size_, sizeof(Entry))));
      if (!entries_) throw std::bad_alloc();
    }
    std::size_t size() const { return size_; }
    std::size_t next(std::size_t at) const { return (at + 1) & (size_ - 1); }
    std::size_t place(std::uint32_t hash) const { return hash & (size_ - 1); }
    Entry& operator[](std::size_t at) { return entries_[at]; }

   private:
    struct Free {
      void operator()(Entry* entries) const { std::free(entries); }
    };
    std::size_t size_ = 16;
    std::unique_ptr<Entry[], Free> entries_;
  };
  static constexpr std::size_t MOST_ROOM = std::size_t{1} << 20;
  // What points say that are put.
  struct Said {
    bool dated = false, undated = false, ending = false, endless = false;

    void add(std::int64_t time, std::int64_t deadline) {
      (time == NO_TIME ? undated : dated) = true;
      (deadline == FOREVER ? endless : ending) = true;
    }
    bool is_mixed() const { return (dated && undated) || (ending && endless); }
  };
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
      for (std::size_t i = from; i < to; ++i) fetch(&table_[table_.place(moves_[i].hash)], sizeof(Entry));
      for (std::size_t i = from; i < to; ++i)
        if (const std::uint32_t row = table_[table_.place(moves_[i].hash)].row) fetch(&row_at(row - 1), sizeof(Row));
      for (std::size_t i = from; i < to; ++i) {
        const Move& move = moves_[i];
        const std::size_t number = number_of(texts_[i], move.hash);
        Row& row = row_at(number);
        row.x = move.x, row.y = move.y, row.op = move.op;
        if (said_.dated) at_number(times_, number, NO_TIME) = move.time;
        if (said_.ending) at_number(deadlines_, number, FOREVER) = move.deadline;
      }
    }
  }

  // Rows before the first that has a time are keys that were removed.
  std::int64_t& at_number(std::vector<std::int64_t>& column, std::size_t number, std::int64_t none) {
    if (column.size() < count_) column.resize(count_, none);
    return column[number];
  }

  template <class Value>
  static void put(char*& room, Value value) {
    std::memcpy(room, &value, sizeof value);
    room += sizeof value;
  }

  static constexpr std::size_t TOGETHER = 32;

  static void fetch([[maybe_unused]] const void* address, [[maybe_unused]] std::size_t size) {
#ifdef __GNUC__
    __builtin_prefetch(address);
    __builtin_prefetch(static_cast<const char*>(address) + size - 1);
#endif
  }

  const Row& row_at(std::size_t number) const { return chunks_[number / CHUNK][number % CHUNK]; }
  Row& row_at(std::size_t number) { return chunks_[number / CHUNK][number % CHUNK]; }

  std::string_view key_of(const Row& row) const {
    if (row.length <= SHORT) return {row.key, row.length};
    std::size_t start;
    std::memcpy(&start, row.key, sizeof start);
    return {text_.data() + start, row.length};
  }

  // The number of the row of a key: open to the next place where one is taken, at most half of them.
  std::size_t number_of(std::string_view key, std::uint32_t hash) {
    std::size_t at = table_.place(hash);
    for (; table_[at].row; at = table_.next(at))
      if (table_[at].hash == hash && key_of(row_at(table_[at].row - 1)) == key) return table_[at].row - 1;
    if (count_ % CHUNK == 0) chunks_.push_back(std::make_unique_for_overwrite<Row[]>(CHUNK));
    Row& row = row_at(count_++);
    table_[at] = {hash, static_cast<std::uint32_t>(count_)};
    row.length = static_cast<std::uint8_t>(key.size());
    if (key.size() <= SHORT) {
      std::memcpy(row.key, key.data(), key.size());
    } else {
      const std::size_t start = text_.size();
      std::memcpy(row.key, &start, sizeof start);
      text_ += key;
    }
    if (2 * count_ > table_.size()) grow();
    return count_ - 1;
  }

  void grow() {
    Table larger(table_.size());
    for (std::size_t from = 0; from < table_.size(); ++from) {
      const Entry& entry = table_[from];
      if (!entry.row) continue;
      std::size_t at = larger.place(entry.hash);
      while (larger[at].row) at = larger.next(at);
      larger[at] = entry;
    }
    table_ = std::move(larger);
  }

  std::uint8_t kind_;
  Said said_;
  std::vector<Move> moves_;  // those of one payload, and their keys
  std::vector<std::string_view> texts_;
  Table table_;
  std::vector<std::unique_ptr<Row[]>> chunks_;
  std::size_t count_ = 0;
  std::vector<std::int64_t> times_, deadlines_;  // of each row, if any has one
  std::string text_;                             // longer keys
};

}  // namespace dynhull_server
