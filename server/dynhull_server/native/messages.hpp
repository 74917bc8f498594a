// The messages of Stream that come most often, as their bytes: what a StreamRequest has that is a batch of points to
// insert or to delete and nothing else, and the StreamResponse to it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "encoding.hpp"

namespace dynhull_server {

// The tags of fields with a length, which are read and written here, and of numbers, which are written.
enum Tag : std::uint8_t { NAME = 0x0a, BATCH = 0x12, INSERTS = 0x0a, DELETES = 0x12, PACKED = 0x0a, RESULT = 0x0a };
enum NumberTag : std::uint8_t {
  REVISION = 0x08,
  INSERTED = 0x10,
  DELETED = 0x18,
  MISSING = 0x20,
  HULL_CHANGED = 0x28,
  POINTS = 0x30,
  SEQUENCE = 0x10
};
constexpr std::size_t POINT_BYTES = 16;
constexpr int LENGTH_BYTES = 5;  // of a length, at most

struct PointsMessage {
  std::string_view name;  // empty if it has none
  bool inserts;
  std::string_view points;
};

class FieldReader {
 public:
  explicit FieldReader(std::string_view rest) : rest_(rest) {}

  bool at(Tag tag) const { return !rest_.empty() && static_cast<std::uint8_t>(rest_[0]) == tag; }

  // The field at which this is, if all of it is there.
  std::optional<std::string_view> take() {
    std::uint64_t length = 0;
    for (std::size_t i = 1; i <= LENGTH_BYTES && i < rest_.size(); ++i) {
      const auto byte = static_cast<std::uint8_t>(rest_[i]);
      length |= std::uint64_t{byte & 127u} << 7 * (i - 1);
      if (byte > 127) continue;
      if (length > rest_.size() - i - 1) return {};
      const std::string_view found = rest_.substr(i + 1, length);
      rest_.remove_prefix(i + 1 + length);
      return found;
    }
    return {};
  }

  // The same for the last field; nothing if others follow.
  std::optional<std::string_view> take_last(Tag tag) {
    if (!at(tag)) return {};
    const auto found = take();
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

struct PlainResult {
  std::uint64_t revision, inserted, deleted, missing, hull_changed, points;
};

inline std::string acknowledgement(std::uint64_t sequence, const PlainResult& result) {
  Bytes body, message;
  const auto put = [](Bytes& out, NumberTag tag, std::uint64_t number) {
    if (number == 0) return;  // a field that has its default is left out
    out.byte(tag);
    out.unsigned_integer(number);
  };
  put(body, REVISION, result.revision);
  put(body, INSERTED, result.inserted);
  put(body, DELETED, result.deleted);
  put(body, MISSING, result.missing);
  put(body, HULL_CHANGED, result.hull_changed);
  put(body, POINTS, result.points);
  message.byte(RESULT);
  message.text(body.data);
  put(message, SEQUENCE, sequence);
  return message.data;
}

}  // namespace dynhull_server
