// Keys between Python and the kernel.
#pragma once

#include <string>
#include <vector>

#include "../keyed/keys.hpp"
#include "../keyed/slots.hpp"
#include "arrays.hpp"

namespace dynhull {

using Integers = nb::ndarray<const std::uint64_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

inline nb::object keys_module(const char* name) { return nb::module_::import_("dynhull.keys").attr(name); }

inline std::string_view ascii_of(PyObject* text) {
  return {static_cast<const char*>(PyUnicode_DATA(text)), static_cast<std::size_t>(PyUnicode_GET_LENGTH(text))};
}

// The keys of a batch, as far as they come in a plain form: an array of uint64, PackedKeys, or a list of strings.
class GivenKeys {
 public:
  static constexpr std::size_t MOST_KEY_BYTES = 255;

  static std::optional<GivenKeys> plain(const nb::object& keys, bool strings) {
    GivenKeys given;
    if (!strings) {
      if (!is_plain_array(keys) || !nb::try_cast(keys, given.integers_, false)) return {};
      given.count_ = given.integers_.shape(0);
      return given;
    }
    const bool known = PyList_CheckExact(keys.ptr()) ? given.pack(keys) : given.unpack(keys);
    return known ? std::optional(std::move(given)) : std::nullopt;
  }

  // One key, which has to outlive this.
  static GivenKeys of_integer(const std::uint64_t& key) {
    GivenKeys given;
    given.count_ = 1;
    given.one_ = &key;
    return given;
  }
  static GivenKeys of_string(std::string_view key) {
    GivenKeys given;
    given.count_ = 1;
    given.lengths_.assign(1, static_cast<char>(key.size()));
    given.data_ = key;
    return given;
  }

  std::size_t size() const { return count_; }

  // Calls `work` with IntegerKeys or StringKeys.
  template <class Work>
  auto with(bool strings, Work work) const {
    if (strings) {
      const char* const lengths = outer_lengths_ ? outer_lengths_ : lengths_.data();
      return work(
          StringKeys(reinterpret_cast<const std::uint8_t*>(lengths), outer_data_ ? outer_data_ : data_.data(), count_));
    }
    return work(IntegerKeys(one_ ? one_ : integers_.data(), count_));
  }

 private:
  GivenKeys() = default;

  // From a list of strings. Encodes those that are not ASCII into new objects: the others would keep their UTF-8.
  bool pack(const nb::object& list) {
    count_ = static_cast<std::size_t>(PyList_GET_SIZE(list.ptr()));
    lengths_.reserve(count_);
    data_.reserve(16 * count_);
    for (std::size_t i = 0; i < count_; ++i) {
      if (i + LOOKAHEAD < count_) {
        const auto* ahead =
            reinterpret_cast<const char*>(PyList_GET_ITEM(list.ptr(), static_cast<Py_ssize_t>(i + LOOKAHEAD)));
        prefetch(ahead);
        prefetch(ahead + sizeof(PyASCIIObject));
      }
      PyObject* const item = PyList_GET_ITEM(list.ptr(), static_cast<Py_ssize_t>(i));
      if (!PyUnicode_CheckExact(item)) return false;
      if (PyUnicode_IS_COMPACT_ASCII(item)) {
        if (!append(ascii_of(item))) return false;
        continue;
      }
      const nb::object bytes = nb::steal(PyUnicode_AsUTF8String(item));
      if (!bytes.is_valid()) {
        PyErr_Clear();
        return false;
      }
      if (!append({PyBytes_AS_STRING(bytes.ptr()), static_cast<std::size_t>(PyBytes_GET_SIZE(bytes.ptr()))}))
        return false;
    }
    return true;
  }
  bool append(std::string_view key) {
    if (key.empty() || key.size() > MOST_KEY_BYTES) return false;
    lengths_.push_back(static_cast<char>(key.size()));
    data_.append(key);
    return true;
  }

  // From PackedKeys, which holds bytes that nobody changes.
  bool unpack(const nb::object& keys) {
    if (!keys.type().is(packed_keys())) return false;
    owners_[0] = keys.attr("lengths");
    owners_[1] = keys.attr("data");
    outer_lengths_ = PyBytes_AS_STRING(owners_[0].ptr());
    outer_data_ = PyBytes_AS_STRING(owners_[1].ptr());
    count_ = static_cast<std::size_t>(PyBytes_GET_SIZE(owners_[0].ptr()));
    return true;
  }
  static nb::handle packed_keys() {
    static const nb::handle type = keys_module("PackedKeys").release();
    return type;
  }

  static constexpr std::size_t LOOKAHEAD = 16;  // strings that are being prefetched

  std::size_t count_ = 0;
  Integers integers_;
  const std::uint64_t* one_ = nullptr;
  std::string lengths_, data_;
  nb::object owners_[2];
  const char *outer_lengths_ = nullptr, *outer_data_ = nullptr;
};

// Keys to return: made into Python objects once the lock is released.
class KeyList {
 public:
  explicit KeyList(bool strings) : strings_(strings) {}

  void add(const Slots& slots, std::uint32_t slot) {
    strings_ ? add(slots.arena()[slots[slot].key]) : add(slots[slot].key);
  }
  void add(std::uint64_t key) { integers_.push_back(key); }
  void add(std::string_view key) {
    lengths_.push_back(static_cast<char>(key.size()));
    data_.append(key);
  }
  nb::object packed() const {
    if (strings_)
      return keys_module("PackedKeys")(nb::bytes(lengths_.data(), lengths_.size()),
                                       nb::bytes(data_.data(), data_.size()));
    const Output<std::uint64_t> output(integers_.size());
    std::copy(integers_.begin(), integers_.end(), output.data());
    return nb::cast(output.array());
  }
  // One entry for each slot, None for NONE.
  nb::list listed(const std::vector<std::uint32_t>& slots) const {
    nb::list list;
    std::size_t next = 0, start = 0;
    for (const std::uint32_t slot : slots) {
      if (slot == NONE) {
        list.append(nb::none());
      } else if (strings_) {
        const auto length = static_cast<std::uint8_t>(lengths_[next++]);
        list.append(nb::str(data_.data() + start, length));
        start += length;
      } else {
        list.append(nb::int_(integers_[next++]));
      }
    }
    return list;
  }

 private:
  bool strings_;
  std::vector<std::uint64_t> integers_;
  std::string lengths_, data_;
};

}  // namespace dynhull
