// Events as bytes: `encode_block` of storage/rows/event_blocks.py and `encode_lone` of storage/rows/lone_events.py,
// which say what the bytes mean, with the same results.
#pragma once

#include <bit>
#include <cstring>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "records.hpp"

namespace dynhull_server {

constexpr std::uint8_t MOVED = 1;  // a cause

using Integers = std::vector<std::int64_t>;

inline std::uint64_t bits_of(double number) { return std::bit_cast<std::uint64_t>(number); }
inline int bytes_of(std::uint64_t number) { return (std::bit_width(number) + 7) / 8; }

class Bytes {
 public:
  std::string data;

  void byte(int value) { data.push_back(static_cast<char>(value)); }
  void text(std::string_view text) {
    unsigned_integer(text.size());
    data += text;
  }
  void little(std::uint64_t number, int size) {
    char bytes[8];
    put_little(bytes, number, size);
    data.append(bytes, static_cast<std::size_t>(size));
  }
  void big(std::uint64_t number, int size) {
    char bytes[8];
    for (int i = 0; i < size; ++i) bytes[i] = static_cast<char>(number >> 8 * (size - 1 - i));
    data.append(bytes, static_cast<std::size_t>(size));
  }
  void real(double number) { little(bits_of(number), 8); }

  // Seven bits a byte.
  void unsigned_integer(std::uint64_t number) {
    for (; number > 127; number >>= 7) byte(static_cast<int>(number & 127) | 128);
    byte(static_cast<int>(number));
  }
  // a - b, its sign in the lowest bit: one bit more than a word may be needed.
  void difference(std::int64_t a, std::int64_t b) {
    const bool negative = a < b;
    const std::uint64_t size = negative ? static_cast<std::uint64_t>(b) - static_cast<std::uint64_t>(a)
                                        : static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b);
    const int first = static_cast<int>(size & 63) << 1 | negative;
    if (size >> 6 == 0) return byte(first);
    byte(first | 128);
    unsigned_integer(size >> 6);
  }
  void signed_integer(std::int64_t number) { difference(number, 0); }

  // The least of n integers, the bytes of a difference to it, and these differences.
  template <class Of>
  void column(std::size_t n, Of of) {
    std::int64_t least = of(0), greatest = least;
    for (std::size_t i = 1; i < n; ++i) {
      const std::int64_t number = of(i);
      least = std::min(least, number);
      greatest = std::max(greatest, number);
    }
    const auto base = static_cast<std::uint64_t>(least);
    const int size = bytes_of(static_cast<std::uint64_t>(greatest) - base);
    signed_integer(least);
    byte(size);
    if (size == 0) return;
    const std::size_t begin = data.size();
    data.resize(begin + n * static_cast<std::size_t>(size));
    char* to = data.data() + begin;
    for (std::size_t i = 0; i < n; ++i, to += size) put_little(to, static_cast<std::uint64_t>(of(i)) - base, size);
  }
  void column(const Integers& numbers) {
    column(numbers.size(), [&](std::size_t i) { return numbers[i]; });
  }

 private:
  static void put_little(char* to, std::uint64_t number, int size) {
    for (int i = 0; i < size; ++i) to[i] = static_cast<char>(number >> 8 * i);
  }
};

// A coordinate as a multiple of 1e-7; nothing if it is no such number, or too large.
inline std::optional<std::int64_t> as_decimal(double value) {
  const double multiple = value * PLACES;
  if (!(std::abs(multiple) <= GREATEST)) return {};
  const double found = std::nearbyint(multiple);
  if (found / PLACES != value || (found == 0 && std::signbit(value))) return {};
  return static_cast<std::int64_t>(found);
}

struct Decimals {
  std::int64_t x, y;
};

inline std::optional<Decimals> as_decimals(double x, double y) {
  const auto first = as_decimal(x);
  if (!first) return {};
  const auto second = as_decimal(y);
  return second ? std::optional(Decimals{*first, *second}) : std::nullopt;
}

// In which bits a position differs from the one after it; from zeros where there is none.
struct Differing {
  std::uint64_t x, y;

  explicit Differing(const Event& event)
      : x(bits_of(event.before_x) ^ (event.has_position() ? bits_of(event.x) : 0)),
        y(bits_of(event.before_y) ^ (event.has_position() ? bits_of(event.y) : 0)) {}

  void put_sizes(Bytes& out) const { out.byte(bytes_of(x) << 4 | bytes_of(y)); }
  void put(Bytes& out) const {
    out.big(x, bytes_of(x));
    out.big(y, bytes_of(y));
  }
};

inline std::uint8_t mark_of(const Event& event) {
  return static_cast<std::uint8_t>(
      event.type | (event.has_position() ? Mark::HAS_POSITION : 0) | (event.has_previous() ? Mark::HAS_PREVIOUS : 0) |
      (event.is_far() ? Mark::HAS_DISTANCE : 0) | (event.event_time != NO_TIME ? Mark::HAS_EVENT_TIME : 0));
}

// An event that is alone, without members and origins. `hull` is empty if it follows from the fence.
inline void encode_lone(const Run& run, const Event& event, std::string_view key, std::optional<std::string_view> hull,
                        Bytes& out) {
  std::optional<Decimals> here, before;
  if (event.has_position()) here = as_decimals(event.x, event.y);
  if (event.has_previous()) before = as_decimals(event.before_x, event.before_y);
  const bool decimals = here.has_value() == event.has_position() && before.has_value() == event.has_previous();
  out.byte(0);
  out.byte((hull ? LoneFlag::HAS_HULL : 0) | (run.area_revision ? LoneFlag::HAS_AREA : 0) |
           (event.first_time != NO_TIME ? LoneFlag::HAS_FIRST_TIME : 0) |
           (event.causes != MOVED ? LoneFlag::HAS_CAUSES : 0) | (decimals ? LoneFlag::DECIMALS : 0) |
           (run.kind == STRING_KEY ? LoneFlag::STRING_KEY : 0) | (run.kind == INTEGER_KEY ? LoneFlag::INTEGER_KEY : 0));
  out.unsigned_integer(static_cast<std::uint64_t>(run.fence));
  out.unsigned_integer(static_cast<std::uint64_t>(run.first));
  out.byte(mark_of(event));
  if (event.causes != MOVED) out.byte(event.causes);
  out.unsigned_integer(static_cast<std::uint64_t>(run.subject_revision));
  out.difference(run.time, NEAR);
  if (run.area_revision) out.unsigned_integer(static_cast<std::uint64_t>(run.area_revision));
  if (hull) out.text(*hull);
  if (decimals) {
    if (here) {
      out.signed_integer(here->x);
      out.signed_integer(here->y);
    }
    if (before) {
      const Decimals from = here.value_or(Decimals{0, 0});
      out.difference(before->x, from.x);
      out.difference(before->y, from.y);
    }
  } else {
    if (event.has_position()) {
      out.big(bits_of(event.x), 8);
      out.big(bits_of(event.y), 8);
    }
    if (event.has_previous()) {
      const Differing differing(event);
      differing.put_sizes(out);
      differing.put(out);
    }
  }
  if (event.is_far()) out.real(event.distance);
  if (event.event_time != NO_TIME) out.difference(event.event_time, run.time);
  if (event.first_time != NO_TIME) out.difference(event.first_time, run.time);
  out.data += key;
}

// Positions, and those before, as multiples of 1e-7; false if one of them is no such number.
inline bool put_decimals(std::span<const Event> events, Bytes& out) {
  Integers points[2], differences[2], alone[2];
  for (const Event& event : events) {
    Decimals here{0, 0};
    if (event.has_position()) {
      const auto found = as_decimals(event.x, event.y);
      if (!found) return false;
      here = *found;
      points[0].push_back(here.x);
      points[1].push_back(here.y);
    }
    if (event.has_previous()) {
      const auto found = as_decimals(event.before_x, event.before_y);
      if (!found) return false;
      Integers* const to = event.has_position() ? differences : alone;
      to[0].push_back(found->x - here.x);
      to[1].push_back(found->y - here.y);
    }
  }
  for (const Integers* const columns : {points, differences, alone})
    if (!columns[0].empty()) {
      out.column(columns[0]);
      out.column(columns[1]);
    }
  return true;
}

inline void put_doubles(std::span<const Event> events, Bytes& out) {
  for (const Event& event : events)
    if (event.has_position()) {
      out.real(event.x);
      out.real(event.y);
    }
  for (const Event& event : events)
    if (event.has_previous()) Differing(event).put_sizes(out);
  for (const Event& event : events)
    if (event.has_previous()) Differing(event).put(out);
}

// The hulls that do not follow from the fences of their runs, in the order of their places, and which of them a run
// has.
inline void put_hulls(std::span<const Run> runs, const std::uint8_t* own, const std::vector<std::string_view>& names,
                      Bytes& out) {
  Integers places(names.size());
  for (std::size_t i = 0; i < runs.size(); ++i)
    if (!own[i]) places[static_cast<std::size_t>(runs[i].hull)] = 1;
  std::int64_t used = 0;
  for (std::int64_t& place : places)
    if (place) place = ++used;
  out.unsigned_integer(static_cast<std::uint64_t>(used));
  for (std::size_t i = 0; i < names.size(); ++i)
    if (places[i]) out.text(names[i]);
  out.column(runs.size(), [&](std::size_t i) { return own[i] ? 0 : places[static_cast<std::size_t>(runs[i].hull)]; });
}

// Some events, without their members and origins, which follow. `own` says of which runs the hull follows from the
// fence; `more` are flags of what follows.
inline void encode_block(std::span<const Run> runs, std::span<const Event> events, std::string_view keys,
                         const std::uint8_t* own, const std::vector<std::string_view>& names, int more, Bytes& out) {
  bool named = false, areas = false, first_times = false;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    named |= !own[i];
    areas |= runs[i].area_revision != 0;
  }
  Integers event_times;
  for (const Event& event : events) {
    if (event.event_time != NO_TIME) event_times.push_back(event.event_time);
    first_times |= event.first_time != NO_TIME;
  }
  Bytes positions;
  const bool decimals = put_decimals(events, positions);
  if (!decimals) {
    positions.data.clear();
    put_doubles(events, positions);
  }
  const bool one_each = runs.size() == events.size();
  const auto of_runs = [&](auto field) { out.column(runs.size(), [&](std::size_t i) { return field(runs[i]); }); };
  const auto of_events = [&](auto field) {
    out.column(events.size(), [&](std::size_t i) { return std::int64_t{field(events[i])}; });
  };
  out.unsigned_integer(events.size());
  out.unsigned_integer(runs.size());
  out.byte(more | (named ? BlockFlag::HAS_HULLS : 0) | (event_times.empty() ? 0 : BlockFlag::HAS_EVENT_TIMES) |
           (first_times ? BlockFlag::HAS_FIRST_TIMES : 0) | (one_each ? BlockFlag::ONE_EACH : 0) |
           (areas ? 0 : BlockFlag::NO_AREAS) | (decimals ? BlockFlag::DECIMALS : 0));
  of_runs([](const Run& run) { return run.fence; });
  of_runs([](const Run& run) { return run.first; });
  if (!one_each) of_runs([](const Run& run) { return run.count; });
  if (named) put_hulls(runs, own, names, out);
  of_runs([](const Run& run) { return std::int64_t{run.kind}; });
  of_runs([](const Run& run) { return run.subject_revision; });
  if (areas) of_runs([](const Run& run) { return run.area_revision; });
  of_runs([](const Run& run) { return run.time; });
  of_events(mark_of);
  of_events([](const Event& event) { return event.causes; });
  of_events([](const Event& event) { return event.length; });
  out.data += keys;
  out.data += positions.data;
  for (const Event& event : events)
    if (event.is_far()) out.real(event.distance);
  if (!event_times.empty()) out.column(event_times);
  if (first_times) of_events([](const Event& event) { return event.first_time; });
}

}  // namespace dynhull_server
