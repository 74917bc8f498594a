// Entities and their hull as a Python object. Arguments in a plain form are read here; all others, and the errors, are
// those of dynhull/_entities.py and dynhull/keys.py.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "../keyed/entities.hpp"
#include "../keyed/expiry.hpp"
#include "hull.hpp"

namespace dynhull {

using Integers = nb::ndarray<const std::uint64_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Doubles = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using IntegerArray = Output<std::uint64_t>::Array;

inline nb::object keys_module(const char* name) { return nb::module_::import_("dynhull.keys").attr(name); }
inline nb::object entities_module(const char* name) { return nb::module_::import_("dynhull._entities").attr(name); }

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
      const std::string& lengths = lengths_;
      const auto* bytes = reinterpret_cast<const std::uint8_t*>(outer_lengths_ ? outer_lengths_ : lengths.data());
      return work(StringKeys(bytes, outer_data_ ? outer_data_ : data_.data(), count_));
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

class KeyedHull : public Hull {
  // Calls `work` with one key, as given and as a Python object, both checked.
  template <class Work>
  auto with_key(const nb::object& key, Work work) {
    if (strings() && PyUnicode_CheckExact(key.ptr()) && PyUnicode_IS_COMPACT_ASCII(key.ptr())) {
      const std::string_view ascii = ascii_of(key.ptr());
      if (0 < ascii.size() && ascii.size() <= GivenKeys::MOST_KEY_BYTES) return work(GivenKeys::of_string(ascii), key);
    }
    if (!strings() && PyLong_CheckExact(key.ptr())) {
      const std::uint64_t number = PyLong_AsUnsignedLongLong(key.ptr());
      if (!PyErr_Occurred()) return work(GivenKeys::of_integer(number), key);
      PyErr_Clear();
    }
    const nb::object checked = keys_module("as_key")(key, key_type());
    if (!strings()) {
      const auto number = nb::cast<std::uint64_t>(checked);
      return work(GivenKeys::of_integer(number), checked);
    }
    const nb::bytes utf8 = nb::steal<nb::bytes>(PyUnicode_AsUTF8String(checked.ptr()));
    return work(GivenKeys::of_string({utf8.c_str(), utf8.size()}), checked);
  }

 public:
  KeyedHull(std::string_view key_type, bool ordered) : entities_(key_type == "str", ordered) {}

  const char* key_type() const { return strings() ? "str" : "int"; }
  bool ordered() const { return entities_.ordered; }

  using Tally = std::tuple<std::int64_t, std::int64_t, std::int64_t, std::int64_t, std::int64_t>;

  Tally update(const nb::object& keys, const nb::object& xy, const nb::object& times, const nb::object& only) {
    const Counts counts = put_all(keys, xy, times, only_of(only), false);
    return {counts.fresh, counts.moved, counts.unmoved, counts.stale, counts.skipped};
  }
  void load(const nb::object& keys, const nb::object& xy, const nb::object& times) {
    put_all(keys, xy, times, Only::ALL, !ordered());
  }

  bool put(const nb::object& key, nb::handle x, nb::handle y, const nb::object& time, const nb::object& only) {
    return with_key(key, [&](const GivenKeys& given, const nb::object&) {
      const Point place = {coordinate(x, "x"), coordinate(y, "y")};
      const double at = time_of(time);
      Puts puts(&place, time.is_none() ? nullptr : &at, false, 1);
      HullTree& tree = writable();
      const std::uint64_t before = tree.changes;
      given.with(strings(), [&](const auto& keys) { entities_.put(tree, keys, puts, only_of(only)); });
      return tree.changes > before;
    });
  }

  bool remove(const nb::object& key) {
    return with_key(key, [&](const GivenKeys& given, const nb::object& checked) {
      HullTree& tree = writable();
      const std::uint64_t before = tree.changes;
      try {
        given.with(strings(), [&](const auto& keys) { entities_.remove(tree, keys, false); });
      } catch (const MissingKey&) {
        missing(checked);
      }
      return tree.changes > before;
    });
  }

  std::int64_t remove_many(const nb::object& keys, bool ignore_missing) {
    const auto given = given_keys(keys);
    try {
      const WriteLock lock(lock_, given.second.size());
      return given.second.with(strings(),
                               [&](const auto& batch) { return entities_.remove(tree_, batch, ignore_missing); });
    } catch (const DuplicateKey&) {
      duplicate(given.first);
    } catch (const MissingKey& absent) {
      missing(distinct_keys(given.first)[absent.row], nb::int_(absent.row));
    }
  }

  std::size_t expire(const nb::object& until) {
    const double time = nb::cast<double>(nb::module_::import_("dynhull._times").attr("as_time")(until, "until"));
    const WriteLock lock(lock_);
    return remove_slots(expired(entities_.slots(), time));
  }
  std::size_t evict(std::size_t count) {
    const WriteLock lock(lock_);
    return remove_slots(oldest(entities_.slots(), count));
  }

  void clear() { entities_.clear(writable()); }

  bool has(const nb::object& key) {
    return with_key(key, [&](const GivenKeys& given, const nb::object&) { return slot_of(given) != NONE; });
  }

  std::pair<double, double> position(const nb::object& key) {
    return with_key(key, [&](const GivenKeys& given, const nb::object& checked) {
      const std::uint32_t slot = slot_of(given);
      if (slot == NONE) missing(checked);
      const Point place = entities_.slots()[slot].place;
      return std::pair(place.x, place.y);
    });
  }

  PointArray positions(const nb::object& keys) {
    const GivenKeys given = given_keys(keys).second;
    const Output<double, 2> output(given.size());
    auto* const places = reinterpret_cast<Point*>(output.data());
    look_up(given, [&](std::size_t row, const Slot* slot) { places[row] = slot ? slot->place : NO_EDGE.a; });
    return output.array();
  }

  DoubleArray times(const nb::object& keys) {
    const GivenKeys given = given_keys(keys).second;
    const Output<double> output(given.size());
    look_up(given, [&](std::size_t row, const Slot* slot) { output.data()[row] = slot ? slot->time : NO_TIME; });
    return output.array();
  }

  nb::tuple entities() {
    KeyList keys(strings());
    std::vector<Point> places;
    std::vector<double> times;
    {
      const ReadLock lock(lock_);
      const Slots& slots = entities_.slots();
      for (const std::uint32_t slot : slots.in_order()) {
        keys.add(slots, slot);
        places.push_back(slots[slot].place);
        times.push_back(slots[slot].time);
      }
    }
    const Output<double> moments(times.size());
    std::copy(times.begin(), times.end(), moments.data());
    return nb::make_tuple(keys.packed(), array_of(std::move(places)), moments.array());
  }

  std::optional<double> oldest_of_all() {
    const ReadLock lock(lock_);
    const double time = oldest_time(entities_.slots());
    return std::isnan(time) ? std::nullopt : std::optional(time);
  }

  nb::list keys_at(const nb::object& xy) {
    const nb::object checked = as_points(xy);
    const Rows rows = nb::cast<Rows>(checked);
    return names_of([&] { return std::vector<Point>(points_of(rows), points_of(rows) + rows.shape(0)); });
  }
  nb::list vertex_keys() {
    return names_of([&] { return vertices_of(tree_); });
  }

  KeyedHull* copy() {
    const ReadLock lock(lock_);
    return new KeyedHull(*this, tree_);
  }

  void check() {
    const ReadLock lock(lock_);
    const Check checked(tree_);
    entities_.check(tree_);
  }

  std::pair<std::size_t, std::size_t> memory() {
    const auto [used, reserved] = Hull::memory();
    return {used + entities_.bytes(), reserved + entities_.bytes()};
  }

 private:
  // Keys to return: made into Python objects once the lock is released.
  class KeyList {
   public:
    explicit KeyList(bool strings) : strings_(strings) {}

    void add(const Slots& slots, std::uint32_t slot) {
      if (!strings_) return integers_.push_back(slots[slot].key);
      const std::string_view key = slots.arena()[slots[slot].key];
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

  KeyedHull(const KeyedHull& other, const HullTree& tree) : Hull(HullTree(tree)), entities_(other.entities_) {}

  bool strings() const { return entities_.slots().strings(); }

  static Only only_of(const nb::object& only) {
    if (only.is_none()) return Only::ALL;
    return nb::cast<std::string_view>(only) == "absent" ? Only::ABSENT : Only::PRESENT;
  }

  // The checked keys as a Python object, and as given.
  std::pair<nb::object, GivenKeys> given_keys(const nb::object& keys) const {
    if (auto given = GivenKeys::plain(keys, strings())) return {keys, std::move(*given)};
    nb::object checked = keys_module("as_keys")(keys, key_type());
    return {checked, *GivenKeys::plain(checked, strings())};
  }

  double time_of(const nb::object& time) const {
    if (PyFloat_CheckExact(time.ptr()) && std::isfinite(PyFloat_AS_DOUBLE(time.ptr())))
      return PyFloat_AS_DOUBLE(time.ptr());
    if (!time.is_none()) return nb::cast<double>(nb::module_::import_("dynhull._times").attr("as_time")(time));
    if (ordered()) throw nb::value_error("time is None: a hull with ordered=True needs a time with every put");
    return NO_TIME;
  }

  Counts put_all(const nb::object& keys, const nb::object& xy, const nb::object& times, Only only, bool or_none) {
    const std::optional<GivenKeys> given = GivenKeys::plain(keys, strings());
    Rows rows;
    Doubles moments;
    const bool plain = given && is_plain_array(xy) && nb::try_cast(xy, rows, false) && given->size() == rows.shape(0) &&
                       (times.is_none() ? !ordered()
                                        : is_plain_array(times) && nb::try_cast(times, moments, false) &&
                                              given->size() == moments.shape(0));
    if (plain) try {
        const WriteLock lock(lock_, given->size());
        Puts puts(points_of(rows), times.is_none() ? nullptr : moments.data(), or_none, given->size());
        return given->with(strings(), [&](const auto& batch) { return entities_.put(tree_, batch, puts, only); });
      } catch (const NotFinite&) {  // checked below
      } catch (const DuplicateKey&) {
        duplicate(keys);
      }
    const nb::object checked =
        entities_module("checked_puts")(keys, xy, times, key_type(), ordered(), nb::arg("or_none") = or_none);
    return put_all(checked[0], checked[1], checked[2], only, or_none);
  }

  // Called with the lock held.
  std::size_t remove_slots(const std::vector<std::uint32_t>& slots) {
    entities_.remove(tree_, slots);
    return slots.size();
  }

  std::uint32_t slot_of(const GivenKeys& given) {
    settled();
    std::uint32_t found = NONE;
    given.with(strings(), [&](const auto& keys) {
      entities_.find(keys, [&](std::size_t, std::uint32_t, std::uint32_t slot) {
        found = slot;
        return true;
      });
    });
    return found;
  }

  // Calls `read` with each row and its slot, or nullptr.
  template <class Read>
  void look_up(const GivenKeys& given, Read read) {
    const ReadLock lock(lock_, given.size());
    given.with(strings(), [&](const auto& keys) {
      entities_.find(keys, [&](std::size_t row, std::uint32_t, std::uint32_t slot) {
        read(row, slot == NONE ? nullptr : &entities_.slots()[slot]);
        return true;
      });
    });
  }

  // The least keys at the places that `places` returns.
  template <class Places>
  nb::list names_of(Places places) {
    KeyList keys(strings());
    std::vector<std::uint32_t> slots;
    const auto answer = [&](const std::vector<Point>& asked) {
      slots = entities_.least_at(asked);
      for (const std::uint32_t slot : slots)
        if (slot != NONE) keys.add(entities_.slots(), slot);
    };
    const bool answered = [&] {
      const ReadLock lock(lock_);
      const std::vector<Point> asked = places();
      if (!entities_.named(tree_, asked)) return false;
      answer(asked);
      return true;
    }();
    if (!answered) {
      const WriteLock lock(lock_);
      entities_.name(tree_);
      answer(places());
    }
    return keys.listed(slots);
  }

  // A list of the keys of a batch; raises DuplicateKeyError.
  nb::object distinct_keys(const nb::object& keys) const {
    return entities_module("distinct")(keys_module("as_keys")(keys, key_type()));
  }
  [[noreturn]] void duplicate(const nb::object& keys) const {
    distinct_keys(keys);
    throw nb::value_error("another thread changed the keys during the call");
  }

  [[noreturn]] static void missing(const nb::object& key, const nb::object& row = nb::none()) {
    const nb::object type = entities_module("MissingKeyError");
    PyErr_SetObject(type.ptr(), type(key, row).ptr());
    throw nb::python_error();
  }

  Entities entities_;
};

}  // namespace dynhull
