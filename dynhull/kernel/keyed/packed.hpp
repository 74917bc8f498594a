// Entities that nobody uses, in the least memory: one block with their places, integers and times, each without the
// upper bytes that all have in common, as numbers of one hull are alike; and their strings, of each what it does not
// have in common with the one before, as neighbours often begin alike.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <string_view>
#include <utility>

#include "keys.hpp"
#include "slot_table.hpp"
#include "slots.hpp"

namespace dynhull {

static_assert(std::endian::native == std::endian::little);  // the lower bytes come first

class Packed {
 public:
  Packed() = default;
  // Throws std::bad_alloc.
  explicit Packed(const Slots& slots) : count_(slots.size()) {
    if (count_ == 0) return;
    const Values first = measure(slots);
    data_ = static_cast<char*>(memory::resize(nullptr, 0, bytes_));
    char* to = data_;
    for (std::size_t column = 0; column < COLUMNS; ++column) {
      std::memcpy(std::exchange(to, to + WHOLE), &first[column], WHOLE);
      if (widths_[column] == 0) continue;
      slots.for_each([&](std::uint32_t slot) {  // what is written beyond the width, the next one overwrites
        const std::uint64_t value = values_of(slots, slot)[column];
        std::memcpy(std::exchange(to, to + widths_[column]), &value, WHOLE);
      });
    }
    if (slots.strings()) write_strings(slots);
  }
  // Throws std::bad_alloc.
  Packed(const Packed& other) {
    if (other.count_ == 0) return;
    data_ = static_cast<char*>(memory::resize(nullptr, 0, other.bytes_));
    std::memcpy(data_, other.data_, other.bytes_);
    bytes_ = other.bytes_, count_ = other.count_, string_bytes_ = other.string_bytes_;
    widths_ = other.widths_, length_ = other.length_;
  }
  Packed(Packed&& other) noexcept { swap(other); }
  Packed& operator=(Packed&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Packed() { memory::release(data_, bytes_); }

  std::size_t size() const { return count_; }
  std::size_t bytes() const { return bytes_; }

  // Writes as many places as there are.
  void places(Point* to) const {
    if (count_ == 0) return;
    Column x = column(X), y = column(Y);
    for (std::size_t row = 0; row < count_; ++row) to[row] = {x.number(), y.number()};
  }

  // Fills slots that are empty, and the table of their keys. Throws std::bad_alloc.
  void unpack(Slots& slots, SlotTable& table) const {
    if (count_ == 0) return;
    if (!slots.strings()) {
      const Scratch<std::uint64_t> integers(count_);
      Column integer = column(INTEGER);
      for (std::size_t row = 0; row < count_; ++row) integers[row] = integer.next();
      return enter(IntegerKeys(integers.data(), count_), slots, table);
    }
    const Scratch<std::uint8_t> lengths(count_);
    const Scratch<char> strings(string_bytes_);
    const char *common = keys(), *before = nullptr;
    if (length_ > 0)
      std::fill_n(lengths.data(), count_, length_);
    else
      std::memcpy(lengths.data(), std::exchange(common, common + count_), count_);
    const char* rest = common + count_;
    char* to = strings.data();
    for (std::size_t row = 0; row < count_; ++row) {
      const std::size_t same = static_cast<std::uint8_t>(common[row]), other = lengths[row] - same;
      const char* const start = to;
      to = std::copy_n(before, same, to);
      to = std::copy_n(std::exchange(rest, rest + other), other, to);
      before = start;
    }
    enter(StringKeys(lengths.data(), strings.data(), count_), slots, table);
  }

 private:
  // Columns of the block. Each begins with a whole value.
  enum : std::size_t { X, Y, INTEGER, TIME, COLUMNS };
  using Values = std::array<std::uint64_t, COLUMNS>;
  static constexpr std::size_t WHOLE = sizeof(std::uint64_t);

  struct Column {
    const char* at;
    std::uint64_t common, mask;
    std::size_t width;

    std::uint64_t next() {  // reads bytes of the next one, or of what follows the column, and drops them
      std::uint64_t value;
      std::memcpy(&value, std::exchange(at, at + width), WHOLE);
      return common | (value & mask);
    }
    double number() { return std::bit_cast<double>(next()); }
  };

  static Values values_of(const Slots& slots, std::uint32_t slot) {
    const Slot& each = slots[slot];
    return {std::bit_cast<std::uint64_t>(each.place.x), std::bit_cast<std::uint64_t>(each.place.y),
            slots.strings() ? 0 : each.key, std::bit_cast<std::uint64_t>(each.time)};
  }

  // Finds the sizes of everything, and returns a value of each column.
  Values measure(const Slots& slots) {
    Values first{}, differ{};
    std::string_view before;
    std::size_t rows = 0, common = 0;
    bool alike = true;  // in length
    slots.for_each([&](std::uint32_t slot) {
      const Values values = values_of(slots, slot);
      if (rows++ == 0) first = values;
      for (std::size_t column = 0; column < COLUMNS; ++column) differ[column] |= values[column] ^ first[column];
      if (!slots.strings()) return;
      const std::string_view name = slots.arena()[slots[slot].key];
      string_bytes_ += name.size();
      alike &= before.empty() || before.size() == name.size();
      common += in_common(std::exchange(before, name), name);
    });
    length_ = alike ? static_cast<std::uint8_t>(before.size()) : 0;
    for (std::size_t column = 0; column < COLUMNS; ++column)
      widths_[column] = static_cast<std::uint8_t>((std::bit_width(differ[column]) + 7) / 8);
    bytes_ = offset(COLUMNS) + WHOLE;  // the last one is written whole
    if (slots.strings()) bytes_ += count_ * (length_ > 0 ? 1 : 2) + string_bytes_ - common;
    if (bytes_ >= memory::LARGE) bytes_ = memory::whole_pages(bytes_);
    return first;
  }

  void write_strings(const Slots& slots) {
    char *length = keys(), *common = length + (length_ > 0 ? 0 : count_), *rest = common + count_;
    std::string_view before;
    slots.for_each([&](std::uint32_t slot) {
      const std::string_view name = slots.arena()[slots[slot].key];
      const std::size_t same = in_common(std::exchange(before, name), name);
      if (length_ == 0) *length++ = static_cast<char>(name.size());
      *common++ = static_cast<char>(same);
      rest = std::copy(name.begin() + same, name.end(), rest);
    });
  }

  static std::size_t in_common(std::string_view a, std::string_view b) {
    return static_cast<std::size_t>(std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first - a.begin());
  }

  std::size_t offset(std::size_t column) const {
    std::size_t widths = 0;
    for (std::size_t before = 0; before < column; ++before) widths += widths_[before];
    return column * WHOLE + count_ * widths;
  }
  char* keys() const { return data_ + offset(COLUMNS); }

  Column column(std::size_t column) const {
    const std::size_t width = widths_[column];
    const std::uint64_t mask = width == WHOLE ? ~std::uint64_t(0) : (std::uint64_t(1) << 8 * width) - 1;
    std::uint64_t first;
    std::memcpy(&first, data_ + offset(column), WHOLE);
    return {data_ + offset(column) + WHOLE, first & ~mask, mask, width};
  }

  template <class Keys>
  void enter(const Keys& keys, Slots& slots, SlotTable& table) const {
    slots.reserve(count_, string_bytes_);
    table.reserve(count_);
    Column x = column(X), y = column(Y), time = column(TIME);
    for (std::size_t row = 0; row < count_; ++row) {
      const std::uint32_t slot = slots.take(keys, row);
      slots[slot].place = {x.number(), y.number()};
      slots[slot].time = time.number();
      table.insert(keys.tag(row), slot);
    }
  }

  void swap(Packed& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    std::swap(count_, other.count_);
    std::swap(string_bytes_, other.string_bytes_);
    std::swap(widths_, other.widths_);
    std::swap(length_, other.length_);
  }

  char* data_ = nullptr;
  std::size_t bytes_ = 0, count_ = 0, string_bytes_ = 0;
  std::array<std::uint8_t, COLUMNS> widths_ = {};
  std::uint8_t length_ = 0;  // of every string; 0 where they differ
};

}  // namespace dynhull
