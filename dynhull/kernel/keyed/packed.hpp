// Entities that nobody uses, in the least memory: one block with their times if any has one, their places and their
// keys. Strings are what they do not have in common with the one before, as neighbours often begin alike.
#pragma once

#include <algorithm>
#include <cstring>
#include <string_view>
#include <utility>

#include "keys.hpp"
#include "slot_table.hpp"
#include "slots.hpp"

namespace dynhull {

class Packed {
 public:
  Packed() = default;
  // Throws std::bad_alloc.
  explicit Packed(const Slots& slots) : count_(slots.size()) {
    std::string_view before;
    std::size_t common = 0;
    slots.for_each([&](std::uint32_t slot) {
      timed_ |= !std::isnan(slots[slot].time);
      if (!slots.strings()) return;
      const std::string_view name = slots.arena()[slots[slot].key];
      string_bytes_ += name.size();
      common += in_common(std::exchange(before, name), name);
    });
    bytes_ = count_ * ((timed_ ? sizeof(double) : 0) + sizeof(Point)) +
             (slots.strings() ? 2 * count_ + string_bytes_ - common : count_ * sizeof(std::uint64_t));
    if (bytes_ >= memory::LARGE) bytes_ = memory::whole_pages(bytes_);
    if (count_ == 0) return;
    data_ = static_cast<char*>(memory::resize(nullptr, 0, bytes_));
    char *time = data_, *place = places(), *key = keys(), *rest = key + 2 * count_;
    before = {};
    slots.for_each([&](std::uint32_t slot) {
      const Slot& each = slots[slot];
      if (timed_) write(time, each.time);
      write(place, each.place);
      if (!slots.strings()) return write(key, each.key);
      const std::string_view name = slots.arena()[each.key];
      const std::size_t same = in_common(std::exchange(before, name), name);
      key[count_] = static_cast<char>(same);
      *key++ = static_cast<char>(name.size());
      rest = std::copy(name.begin() + same, name.end(), rest);
    });
  }
  Packed(Packed&& other) noexcept { swap(other); }
  Packed& operator=(Packed&& other) noexcept {
    swap(other);
    return *this;
  }
  ~Packed() { memory::release(data_, bytes_); }

  std::size_t bytes() const { return bytes_; }

  // Fills slots that are empty, and the table of their keys. Throws std::bad_alloc.
  void unpack(Slots& slots, SlotTable& table) const {
    if (count_ == 0) return;
    if (!slots.strings())
      return enter(IntegerKeys(reinterpret_cast<const std::uint64_t*>(keys()), count_), slots, table);
    const auto* const lengths = reinterpret_cast<const std::uint8_t*>(keys());
    const Scratch<char> strings(string_bytes_);
    const char *rest = keys() + 2 * count_, *before = nullptr;
    char* to = strings.data();
    for (std::size_t i = 0; i < count_; ++i) {
      const std::size_t same = lengths[count_ + i];
      const char* const start = to;
      to = std::copy_n(before, same, to);
      to = std::copy_n(rest, lengths[i] - same, to);
      rest += lengths[i] - same;
      before = start;
    }
    enter(StringKeys(lengths, strings.data(), count_), slots, table);
  }

 private:
  static std::size_t in_common(std::string_view a, std::string_view b) {
    return static_cast<std::size_t>(std::mismatch(a.begin(), a.end(), b.begin(), b.end()).first - a.begin());
  }

  char* places() const { return data_ + (timed_ ? count_ * sizeof(double) : 0); }
  char* keys() const { return places() + count_ * sizeof(Point); }

  template <class Value>
  static void write(char*& to, const Value& value) {
    std::memcpy(to, &value, sizeof value);
    to += sizeof value;
  }
  template <class Value>
  static void read(const char*& from, Value& value) {
    std::memcpy(&value, from, sizeof value);
    from += sizeof value;
  }

  template <class Keys>
  void enter(const Keys& keys, Slots& slots, SlotTable& table) const {
    slots.reserve(count_, string_bytes_);
    table.reserve(count_);
    const char *time = data_, *place = places();
    for (std::size_t i = 0; i < count_; ++i) {
      const std::uint32_t slot = slots.take(keys, i);
      read(place, slots[slot].place);
      if (timed_) read(time, slots[slot].time);
      table.insert(keys.tag(i), slot);
    }
  }

  void swap(Packed& other) noexcept {
    std::swap(data_, other.data_);
    std::swap(bytes_, other.bytes_);
    std::swap(count_, other.count_);
    std::swap(string_bytes_, other.string_bytes_);
    std::swap(timed_, other.timed_);
  }

  char* data_ = nullptr;
  std::size_t bytes_ = 0, count_ = 0, string_bytes_ = 0;
  bool timed_ = false;
};

}  // namespace dynhull
