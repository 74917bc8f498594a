// Entities that nobody uses, in the least memory: one block with their times if any has one, their places and their
// keys.
#pragma once

#include <cstring>
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
    slots.for_each([&](std::uint32_t slot) {
      timed_ |= !std::isnan(slots[slot].time);
      if (slots.strings()) string_bytes_ += Arena::length(slots[slot].key);
    });
    bytes_ = count_ * ((timed_ ? sizeof(double) : 0) + sizeof(Point)) +
             (slots.strings() ? count_ + string_bytes_ : count_ * sizeof(std::uint64_t));
    if (bytes_ >= memory::LARGE) bytes_ = memory::whole_pages(bytes_);
    if (count_ == 0) return;
    data_ = static_cast<char*>(memory::resize(nullptr, 0, bytes_));
    char *time = data_, *place = places(), *key = keys(), *string = key + count_;
    slots.for_each([&](std::uint32_t slot) {
      const Slot& each = slots[slot];
      if (timed_) write(time, each.time);
      write(place, each.place);
      if (!slots.strings()) return write(key, each.key);
      const std::string_view name = slots.arena()[each.key];
      *key++ = static_cast<char>(name.size());
      std::memcpy(string, name.data(), name.size());
      string += name.size();
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
    if (slots.strings())
      enter(StringKeys(reinterpret_cast<const std::uint8_t*>(keys()), keys() + count_, count_), slots, table);
    else
      enter(IntegerKeys(reinterpret_cast<const std::uint64_t*>(keys()), count_), slots, table);
  }

 private:
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
