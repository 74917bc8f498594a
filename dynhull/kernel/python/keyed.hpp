// Entities and their hull as a Python object. Arguments in a plain form are read here; all others, and the errors, are
// those of dynhull/_entities.py and dynhull/keys.py.
#pragma once

#include <utility>
#include <vector>

#include "../keyed/entities.hpp"
#include "hull.hpp"
#include "keys.hpp"

namespace dynhull {

using Doubles = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

inline nb::object entities_module(const char* name) { return nb::module_::import_("dynhull._entities").attr(name); }

// The entities of a hull that nobody has used since they were loaded, and what is known of it.
class PackedEntities {
 public:
  PackedEntities(bool strings, bool ordered, Packed packed)
      : packed_(std::move(packed)), strings_(strings), ordered_(ordered) {
    const Scratch<Point> places(packed_.size());
    packed_.places(places.data());
    const HullTree tree(places.data(), packed_.size());
    distinct_ = static_cast<std::uint32_t>(tree.distinct());
    vertices_ = static_cast<std::uint32_t>(vertices_of(tree).size());
  }

  bool strings() const { return strings_; }
  bool ordered() const { return ordered_; }
  std::size_t size() const { return packed_.size(); }
  std::size_t distinct() const { return distinct_; }
  std::size_t vertex_count() const { return vertices_; }

  const Packed& packed() const { return packed_; }

 private:
  Packed packed_;
  std::uint32_t distinct_, vertices_;
  bool strings_, ordered_;
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
  KeyedHull(std::string_view key_type, bool ordered, Frame frame)
      : Hull(std::move(frame)), entities_(key_type == "str", ordered) {}

  // Puts itself together when it is used.
  explicit KeyedHull(const PackedEntities& packed) : entities_(packed.strings(), packed.ordered()) {
    entities_.hold(Packed(packed.packed()));
    put_away();
  }

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

  void begin_load(std::size_t room) {
    if (tree_.frame().on_globe() || size() > 0) throw nb::value_error("only an empty hull of a plane is loaded so");
    const WriteLock lock(lock_);
    entities_.put_off(room);
  }
  void end_load() {
    const WriteLock lock(lock_);
    entities_.build(tree_);
  }
  // What was loaded, in place of `end_load`; nothing if it is more than so many.
  std::optional<PackedEntities> packed(std::size_t most) {
    const WriteLock lock(lock_);
    if (!entities_.is_put_off()) throw nb::value_error("only what is being loaded is packed so");
    if (entities_.size() > most) return {};
    return PackedEntities(strings(), ordered(), entities_.packed());
  }

  bool put(const nb::object& key, nb::handle x, nb::handle y, const nb::object& time, const nb::object& only) {
    return with_key(key, [&](const GivenKeys& given, const nb::object&) {
      const Point place = point(x, y);
      const double at = time_of(time);
      Puts puts(tree_.frame(), &place, time.is_none() ? nullptr : &at, false, 1);
      return alone_with(place, [&](FramedTree& tree) {
        const std::uint64_t before = tree.changes();
        given.with(strings(), [&](const auto& keys) { entities_.put(tree, keys, puts, only_of(only)); });
        return tree.changes() > before;
      });
    });
  }

  bool remove(const nb::object& key) {
    return with_key(key, [&](const GivenKeys& given, const nb::object& checked) {
      FramedTree& tree = writable();
      const std::uint64_t before = tree.changes();
      try {
        given.with(strings(), [&](const auto& keys) { entities_.remove(tree, keys, false); });
      } catch (const MissingKey&) {
        missing(checked);
      }
      return tree.changes() > before;
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
    return entities_.expire(tree_, time);
  }
  std::size_t evict(std::size_t count) {
    const WriteLock lock(lock_);
    return entities_.evict(tree_, count);
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
    const WriteLock lock(lock_);
    const double time = entities_.oldest();
    return std::isnan(time) ? std::nullopt : std::optional(time);
  }

  nb::list keys_at(const nb::object& xy) {
    const nb::object checked = as_points(xy);
    const Rows rows = nb::cast<Rows>(checked);
    return names_of(rows.shape(0),
                    [&] { return std::vector<Point>(points_of(rows), points_of(rows) + rows.shape(0)); });
  }
  nb::list vertex_keys() {
    return names_of(expected_vertices(), [&] { return tree_.vertices(); });
  }

  KeyedHull* copy() {
    const ReadLock lock(lock_);
    return new KeyedHull(*this);
  }

  void check() {
    const ReadLock lock(lock_);
    tree_.check();
    entities_.check(tree_);
  }

  // Calls `work` with the entities and their tree, which nobody else reads or writes meanwhile.
  template <class Work>
  auto alone(std::size_t rows, Work work) {
    const WriteLock lock(lock_, rows);
    return work(entities_, tree_);
  }

  // The checked keys as a Python object, and as given.
  std::pair<nb::object, GivenKeys> given_keys(const nb::object& keys) const {
    if (auto given = GivenKeys::plain(keys, strings())) return {keys, std::move(*given)};
    nb::object checked = keys_module("as_keys")(keys, key_type());
    return {checked, GivenKeys::plain(checked, strings()).value()};
  }

  // The slots of keys that are there.
  std::vector<std::uint32_t> slots_of(const nb::object& keys) {
    const GivenKeys given = given_keys(keys).second;
    std::vector<std::uint32_t> slots;
    const ReadLock lock(lock_, given.size());
    given.with(strings(), [&](const auto& batch) {
      entities_.find(batch, [&](std::size_t, std::uint32_t, std::uint32_t slot) {
        if (slot != NONE) slots.push_back(slot);
      });
    });
    return slots;
  }

  // The vertices; the first time of a hull that is put away without taking it out, as who asks once may ask all hulls.
  PointArray vertices() {
    if (!lock_.put_away() || std::exchange(peeked_, true)) return Hull::vertices();
    return array_of(entities_.packed_vertices(tree_));
  }

  // Puts the hull away until it is used, `idle` unless it has been used since the last such call. Whether it is.
  bool pack(bool idle) {
    if (lock_.put_away()) return true;
    if (lock_.busy() || (idle && lock_.used())) return false;
    try {
      if (!entities_.pack(tree_)) return false;
    } catch (const std::bad_alloc&) {
      return false;
    }
    forget_index();
    put_away();
    return true;
  }

  bool strings() const { return entities_.slots().strings(); }

  std::pair<std::size_t, std::size_t> memory() {
    lock_.await_settled();
    const std::size_t used = tree_.used_bytes(), reserved = tree_.reserved_bytes();
    return {used + entities_.bytes(), reserved + entities_.bytes()};
  }

 protected:
  KeyedHull(const KeyedHull& other) : Hull(other), entities_(other.entities_) {}
  void forget_names() { entities_.forget_names(); }

 private:
  static Only only_of(const nb::object& only) {
    if (only.is_none()) return Only::ALL;
    return nb::cast<std::string_view>(only) == "absent" ? Only::ABSENT : Only::PRESENT;
  }

  double time_of(const nb::object& time) const {
    if (PyFloat_CheckExact(time.ptr()) && std::isfinite(PyFloat_AS_DOUBLE(time.ptr())))
      return PyFloat_AS_DOUBLE(time.ptr());
    if (!time.is_none()) return nb::cast<double>(nb::module_::import_("dynhull._times").attr("as_time")(time));
    if (ordered()) throw nb::value_error("time is None: a hull with ordered=True needs a time with every put");
    return NO_TIME;
  }

  Counts put_all(const nb::object& keys, const nb::object& xy, const nb::object& times, Only only, bool or_none) {
    if (const auto counts = put_plain(keys, xy, times, only, or_none)) return *counts;
    const nb::object as_points =
        tree_.frame().on_globe() ? globe_module("as_lonlat") : nb::module_::import_("dynhull.arrays").attr("as_points");
    const nb::object rows = entities_module("checked_puts")(
        keys, xy, times, key_type(), ordered(), nb::arg("or_none") = or_none, nb::arg("checked") = as_points);
    if (const auto counts = put_plain(rows[0], rows[1], rows[2], only, or_none)) return *counts;
    distinct_keys(rows[0]);
    const nb::object points = checked(nb::cast<Rows>(rows[1]), INSERT);
    return put_plain(rows[0], points, rows[2], only, or_none).value();
  }

  // Nothing unless all arguments are in a plain form, and the places and times are finite.
  std::optional<Counts> put_plain(const nb::object& keys, const nb::object& xy, const nb::object& times, Only only,
                                  bool or_none) {
    const std::optional<GivenKeys> given = GivenKeys::plain(keys, strings());
    Rows rows;
    Doubles moments;
    if (!given || !is_plain_array(xy) || !nb::try_cast(xy, rows, false) || given->size() != rows.shape(0)) return {};
    if (times.is_none()
            ? ordered()
            : !is_plain_array(times) || !nb::try_cast(times, moments, false) || given->size() != moments.shape(0))
      return {};
    const std::optional<Gnomonic> chosen = choose(rows, INSERT);
    try {
      const WriteLock lock(lock_, given->size());
      FramedTree::Choice choice(tree_, chosen);
      Puts puts(tree_.frame(), points_of(rows), times.is_none() ? nullptr : moments.data(), or_none, given->size());
      const Counts counts =
          given->with(strings(), [&](const auto& batch) { return entities_.put(tree_, batch, puts, only); });
      choice.keep();
      return counts;
    } catch (const NotFinite&) {
      return {};
    } catch (const DuplicateKey&) {
      duplicate(keys);
    }
  }

  void put_away() {
    peeked_ = false;
    lock_.put_away(this, [](void* hull) {
      auto* const self = static_cast<KeyedHull*>(hull);
      self->entities_.unpack(self->tree_);
    });
  }

  std::uint32_t slot_of(const GivenKeys& given) {
    settled();
    std::uint32_t found = NONE;
    given.with(strings(), [&](const auto& keys) {
      entities_.find(keys, [&](std::size_t, std::uint32_t, std::uint32_t slot) { found = slot; });
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
      });
    });
  }

  // The least keys at the places that `places` returns, about `count`.
  template <class Places>
  nb::list names_of(std::size_t count, Places places) {
    KeyList keys(strings());
    std::vector<std::uint32_t> slots;
    const auto answer = [&](const std::vector<Point>& asked) {
      slots = entities_.least_at(asked);
      for (const std::uint32_t slot : slots)
        if (slot != NONE) keys.add(entities_.slots(), slot);
    };
    const bool answered = [&] {
      const ReadLock lock(lock_, count);
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
  bool peeked_ = false;  // at the vertices, since it was put away
};

}  // namespace dynhull
