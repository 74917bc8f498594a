// The messages of Stream that come most often, as their bytes: what a StreamRequest has that is a batch of points to
// insert or to delete and nothing else, and the StreamResponse to it; and those with batches that put keys.
#pragma once

#include <cstdint>
#include <iterator>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "encoding.hpp"

namespace dynhull_server {

// The tags of fields with a length, which are read and written here, and of numbers, which are written.
enum Tag : std::uint8_t { NAME = 0x0a, BATCH = 0x12, INSERTS = 0x0a, DELETES = 0x12, PACKED = 0x0a, RESULT = 0x0a };
enum PutsTag : std::uint8_t {
  BATCHES = 0x2a,
  NUMBERED = 0x0a,
  NUMBER = 0x10,
  PUTS = 0x2a,
  KEYS = 0x0a,
  LENGTHS = 0x0a,
  TEXT = 0x12,
  INTEGERS = 0x22,
  POSITIONS = 0x12
};
constexpr std::size_t POINT_BYTES = 16;
constexpr int LENGTH_BYTES = 5;  // of a length, at most
constexpr int NUMBER_BYTES = 9;  // of a number that is read, at most: those of ten bytes are left to Python

struct PointsMessage {
  std::string_view name;  // empty if it has none
  bool inserts;
  std::string_view points;
};

// A batch that puts keys, each at a point.
struct PutsBatch {
  std::uint64_t sequence;
  std::string_view integers;       // the keys,
  std::string_view lengths, text;  // or these
  std::string_view points;
};

struct PutsMessage {
  std::string_view name;  // empty if it has none
  bool several;           // whether it may have several
  std::vector<PutsBatch> batches;
};

class FieldReader {
 public:
  explicit FieldReader(std::string_view rest) : rest_(rest) {}

  bool empty() const { return rest_.empty(); }

  bool at(std::uint8_t tag) const { return !rest_.empty() && static_cast<std::uint8_t>(rest_[0]) == tag; }

  // The field at which this is, if all of it is there.
  std::optional<std::string_view> take() {
    const auto length = number(LENGTH_BYTES);
    if (!length || *length > rest_.size()) return {};
    const std::string_view found = rest_.substr(0, *length);
    rest_.remove_prefix(*length);
    return found;
  }

  // The number at which this is, if it has at most so many bytes.
  std::optional<std::uint64_t> number(std::size_t most) {
    std::uint64_t value = 0;
    for (std::size_t i = 1; i <= most && i < rest_.size(); ++i) {
      const auto byte = static_cast<std::uint8_t>(rest_[i]);
      value |= std::uint64_t{byte & 127u} << 7 * (i - 1);
      if (byte > 127) continue;
      rest_.remove_prefix(i + 1);
      return value;
    }
    return {};
  }

  // The field with this tag, if it comes next.
  std::optional<std::string_view> take(std::uint8_t tag) { return at(tag) ? take() : std::nullopt; }

  // The same for the last field; nothing if others follow.
  std::optional<std::string_view> take_last(std::uint8_t tag) {
    const auto found = take(tag);
    return rest_.empty() ? found : std::nullopt;
  }

 private:
  std::string_view rest_;
};

// Nothing if the message has anything else, or its fields in another order.
inline std::optional<PointsMessage> points_message(std::string_view data) {
  FieldReader message(data);
  PointsMessage found = {};
  if (message.at(NAME)) {
    const auto name = message.take();
    if (!name) return {};
    found.name = *name;
  }
  const auto batch = message.take_last(BATCH);
  if (!batch) return {};
  FieldReader rows(*batch);
  found.inserts = rows.at(INSERTS);
  const auto points = rows.take_last(found.inserts ? INSERTS : DELETES);
  if (!points) return {};
  const auto packed = FieldReader(*points).take_last(PACKED);
  if (!packed || packed->empty() || packed->size() % POINT_BYTES != 0) return {};
  found.points = *packed;
  return found;
}

// Nothing if the batch does anything else, or has not as many points as keys, or none.
inline std::optional<PutsBatch> puts_batch(std::string_view batch) {
  const auto puts = FieldReader(batch).take_last(PUTS);
  if (!puts) return {};
  FieldReader rows(*puts);
  const auto keys = rows.take(KEYS);
  const auto points = rows.take_last(POSITIONS);
  if (!keys || !points) return {};
  const auto packed = FieldReader(*points).take_last(PACKED);
  if (!packed || packed->empty() || packed->size() % POINT_BYTES != 0) return {};
  PutsBatch found = {};
  found.points = *packed;
  FieldReader names(*keys);
  std::size_t count;
  if (names.at(INTEGERS)) {
    const auto integers = names.take_last(INTEGERS);
    if (!integers || integers->size() % sizeof(std::uint64_t) != 0) return {};
    found.integers = *integers;
    count = integers->size() / sizeof(std::uint64_t);
  } else {
    const auto lengths = names.take(LENGTHS);
    const auto text = names.take_last(TEXT);
    if (!lengths || !text) return {};
    found.lengths = *lengths;
    found.text = *text;
    count = lengths->size();
  }
  if (count != packed->size() / POINT_BYTES) return {};
  return found;
}

// Nothing if the message has anything else, or its fields in another order.
inline std::optional<PutsMessage> puts_message(std::string_view data) {
  FieldReader message(data);
  PutsMessage found = {};
  if (message.at(NAME)) {
    const auto name = message.take();
    if (!name) return {};
    found.name = *name;
  }
  if (message.at(BATCH)) {
    const auto batch = message.take_last(BATCH);
    const auto puts = batch ? puts_batch(*batch) : std::nullopt;
    if (!puts) return {};
    found.batches.push_back(*puts);
    return found;
  }
  found.several = true;
  while (!message.empty()) {
    const auto numbered = message.take(BATCHES);
    if (!numbered) return {};
    FieldReader fields(*numbered);
    const auto batch = fields.take(NUMBERED);
    auto puts = batch ? puts_batch(*batch) : std::nullopt;
    if (!puts) return {};
    if (fields.at(NUMBER)) {
      const auto sequence = fields.number(NUMBER_BYTES);
      if (!sequence) return {};
      puts->sequence = *sequence;
    }
    if (!fields.empty()) return {};
    found.batches.push_back(*puts);
  }
  return found.batches.empty() ? std::nullopt : std::optional(std::move(found));
}

// The numbers of the fields of a BatchResult that are counts or flags.
constexpr std::uint8_t COUNTS[] = {1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 17, 18};
constexpr std::uint8_t RESULTS = 0x1a, SEQUENCE = 0x10;

// A result and its number, as a StreamResponse and a NumberedResult have them; `values` are those of COUNTS.
inline std::string numbered_result(std::uint64_t sequence, const std::uint64_t (&values)[std::size(COUNTS)]) {
  Bytes result, numbered;
  for (std::size_t i = 0; i < std::size(COUNTS); ++i) {
    if (values[i] == 0) continue;  // a field that has its default is left out
    result.unsigned_integer(std::uint64_t{COUNTS[i]} << 3);
    result.unsigned_integer(values[i]);
  }
  numbered.byte(RESULT);
  numbered.text(result.data);
  if (sequence != 0) {
    numbered.byte(SEQUENCE);
    numbered.unsigned_integer(sequence);
  }
  return numbered.data;
}

}  // namespace dynhull_server
