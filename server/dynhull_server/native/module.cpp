// dynhull_server._native: what the server does for each event of a fence, each batch of the past, and each message that
// comes often, for Python.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>

#include <memory>
#include <string>
#include <utility>

#include "batches.hpp"
#include "encoding.hpp"
#include "footer.hpp"
#include "key_codes.hpp"
#include "last_places.hpp"
#include "messages.hpp"
#include "numbering.hpp"
#include "numbers.hpp"

namespace nb = nanobind;
using namespace nanobind::literals;

namespace dynhull_server {
namespace {

// So many events are worth letting other threads of Python run meanwhile.
constexpr std::size_t MANY = 4096;

// The memory of an array or of bytes: `count` values, of each of which it has as many bytes as expected.
template <class Value>
class View {
 public:
  View() = default;
  explicit View(nb::handle source) {
    if (PyObject_GetBuffer(source.ptr(), &buffer_, PyBUF_SIMPLE) != 0) throw nb::python_error();
    held_ = true;
    if (size_t(buffer_.len) % sizeof(Value) != 0) throw nb::value_error("the memory has no whole number of values");
  }
  View(nb::handle source, std::size_t count) : View(source) {
    if (size() != count) throw nb::value_error("a column has another number of rows");
  }
  View(View&& other) noexcept : buffer_(other.buffer_), held_(std::exchange(other.held_, false)) {}
  View& operator=(View&&) = delete;
  ~View() {
    if (held_) PyBuffer_Release(&buffer_);
  }

  std::size_t size() const { return size_t(buffer_.len) / sizeof(Value); }
  const Value* data() const { return static_cast<const Value*>(buffer_.buf); }
  std::span<const Value> values() const { return {data(), size()}; }
  std::string_view text() const { return {static_cast<const char*>(buffer_.buf), size_t(buffer_.len)}; }

 private:
  Py_buffer buffer_ = {};
  bool held_ = false;
};

// The memory of an array, to be changed.
class Room {
 public:
  explicit Room(const nb::object& source) {
    if (PyObject_GetBuffer(source.ptr(), &buffer_, PyBUF_WRITABLE) != 0) throw nb::python_error();
  }
  Room(const Room&) = delete;
  ~Room() { PyBuffer_Release(&buffer_); }

  std::size_t size() const { return size_t(buffer_.len) / sizeof(std::int64_t); }
  std::int64_t& operator[](std::size_t place) const {
    if (place >= size()) throw nb::value_error("a place outside of the column");
    return static_cast<std::int64_t*>(buffer_.buf)[place];
  }

 private:
  Py_buffer buffer_ = {};
};

// The memory of an array of rows of integers, one of each fence, to be changed.
class Table {
 public:
  explicit Table(const nb::object& source) {
    if (PyObject_GetBuffer(source.ptr(), &buffer_, PyBUF_ND | PyBUF_WRITABLE) != 0) throw nb::python_error();
    if (buffer_.ndim == 2 && buffer_.itemsize == Py_ssize_t(sizeof(std::int64_t))) return;
    PyBuffer_Release(&buffer_);
    throw nb::value_error("the table has no rows of integers");
  }
  Table(const Table&) = delete;
  ~Table() { PyBuffer_Release(&buffer_); }

  std::int64_t& at(std::int64_t place, std::size_t column) const {
    if (place < 0 || place >= buffer_.shape[0] || column >= std::size_t(buffer_.shape[1]))
      throw nb::value_error("a place outside of the table");
    return static_cast<std::int64_t*>(buffer_.buf)[std::size_t(place) * std::size_t(buffer_.shape[1]) + column];
  }

 private:
  Py_buffer buffer_ = {};
};

// Crossings of one revision: the columns of PackedCrossings, and what else `Crossed` has.
class Columns {
  static constexpr std::size_t ROW = 6 * sizeof(double) + 2;

 public:
  // `hull`: the place of the name of its hull among all.
  Columns(const nb::tuple& of_revision, std::int64_t hull) : columns_(nb::cast<nb::tuple>(of_revision[0])[0]) {
    const auto packed = nb::cast<nb::tuple>(of_revision[0]);
    const std::size_t count = crossed.count = columns_.size() / ROW;
    if (columns_.size() != count * ROW) throw nb::value_error("the columns have no whole number of rows");
    crossed.fences = reinterpret_cast<const std::int64_t*>(columns_.data());
    crossed.points = reinterpret_cast<const double*>(crossed.fences + count);
    crossed.previous = crossed.points + 2 * count;
    crossed.distances = crossed.previous + 2 * count;
    crossed.changes = reinterpret_cast<const std::int8_t*>(crossed.distances + count);
    crossed.causes = reinterpret_cast<const std::uint8_t*>(crossed.changes + count);
    crossed.kind = packed[1].is_none() ? INTEGER_KEY : STRING_KEY;
    if (!packed[1].is_none()) crossed.lengths = lengths_.emplace(packed[1], count).data();
    crossed.hull = hull;
    crossed.revision = nb::cast<std::int64_t>(of_revision[2]);
    if (!of_revision[3].is_none())
      for (const auto [fence, revision] : nb::cast<nb::dict>(of_revision[3]))
        crossed.areas.emplace(nb::cast<std::int64_t>(fence), nb::cast<std::int64_t>(revision));
    if (!of_revision[4].is_none()) crossed.event_times = event_times_.emplace(of_revision[4], count).data();
    if (!of_revision[5].is_none()) {
      const auto swap = nb::cast<nb::tuple>(of_revision[5]);
      crossed.meant = nb::cast<std::uint8_t>(nb::int_(swap[0]));
      crossed.stands_for = nb::cast<std::uint8_t>(nb::int_(swap[1]));
    }
    crossed.now = nb::cast<std::int64_t>(of_revision[6]);
    for (std::size_t row = 0; row < crossed.count; ++row)
      if (crossed.changes[row] < -1 || crossed.changes[row] > 1) throw nb::value_error("no change of side");
  }

  Crossed crossed;

 private:
  View<char> columns_;
  std::optional<View<std::uint8_t>> lengths_;
  std::optional<View<std::int64_t>> event_times_;
};

template <class Value>
nb::bytes bytes(const Value* values, std::size_t count) {
  return nb::bytes(values, count * sizeof(Value));
}

std::int64_t value_of(const Numbers& numbers, std::int64_t key) {
  if (const std::int64_t* const found = numbers.find(key)) return *found;
  throw nb::key_error(std::to_string(key).c_str());
}

// The last sequence and time of each fence, from its row in a table.
void look_up(Told& told, const Numbers& places, const Table& table, std::size_t last, std::size_t time) {
  for (std::size_t i = 0; i < told.fences.size(); ++i) {
    told.places[i] = value_of(places, told.fences[i]);  // KeyError if it is not there
    told.lasts[i] = table.at(told.places[i], last);
    told.times[i] = table.at(told.places[i], time);
  }
}

// The place of an object in a tuple.
std::int64_t place_in(const nb::tuple& names, nb::handle name) {
  for (std::size_t place = 0; place < names.size(); ++place)
    if (names[place].is(name) || names[place].equal(name)) return static_cast<std::int64_t>(place);
  throw nb::value_error("a hull that is not among the names");
}

nb::tuple numbered(const nb::list& waiting, const nb::tuple& names, const nb::bytes& types, const Numbers& places,
                   const nb::object& table, std::size_t last, std::size_t time) {
  if (types.size() != 3) throw nb::value_error("there are three changes of side");
  std::vector<Columns> columns;
  columns.reserve(waiting.size());
  std::vector<Crossed> crossed;
  std::string keys;
  std::size_t count = 0;
  for (const nb::handle each : waiting) {
    const auto of_revision = nb::cast<nb::tuple>(each);
    const auto more = nb::cast<nb::bytes>(nb::cast<nb::tuple>(of_revision[0])[2]);
    keys.append(more.c_str(), more.size());
    columns.emplace_back(of_revision, place_in(names, of_revision[1]));
    crossed.push_back(columns.back().crossed);
    count += crossed.back().count;
  }
  Told told(numbers_of(crossed));
  look_up(told, places, Table(table), last, time);
  nb::object rows = nb::steal(PyBytes_FromStringAndSize(nullptr, Py_ssize_t(count * sizeof(Event))));
  if (!rows.is_valid()) throw nb::python_error();
  auto* const events = reinterpret_cast<Event*>(PyBytes_AS_STRING(rows.ptr()));
  std::vector<Run> runs;
  {
    std::optional<nb::gil_scoped_release> release;
    if (count >= MANY) release.emplace();
    number(crossed, static_cast<Types>(types.data()), told, runs, events);
  }
  std::vector<std::int64_t> said;
  for (const auto* column : {&told.fences, &told.places, &told.lasts, &told.times, &told.made, &told.changes})
    said.insert(said.end(), column->begin(), column->end());
  return nb::make_tuple(bytes(runs.data(), runs.size()), rows, bytes(keys.data(), keys.size()),
                        bytes(said.data(), said.size()));
}

nb::bytes encoded(const nb::object& runs, const nb::object& rows, const nb::bytes& keys, const nb::object& own,
                  const nb::tuple& names, int more) {
  const View<Run> of_runs(runs);
  const View<Event> events(rows);
  const View<std::uint8_t> is_own(own, of_runs.size());
  std::vector<std::string_view> texts;
  for (const nb::handle name : names) {
    Py_ssize_t size = 0;
    const char* const text = PyUnicode_AsUTF8AndSize(name.ptr(), &size);
    if (!text) throw nb::python_error();
    texts.emplace_back(text, std::size_t(size));
  }
  std::uint64_t count = 0;
  for (const Run& run : of_runs.values()) {
    count += static_cast<std::uint64_t>(run.count);
    if (run.hull < 0 || std::size_t(run.hull) >= texts.size()) throw nb::value_error("a run has a hull without a name");
  }
  if (count == 0 || count != events.size()) throw nb::value_error("the runs have another number of events");
  const std::string_view all(keys.c_str(), keys.size());
  Bytes out;
  if (count == 1 && more == 0) {
    std::optional<std::string_view> hull;
    if (!*is_own.data()) hull = texts[std::size_t(of_runs.data()->hull)];
    encode_lone(*of_runs.data(), *events.data(), all, hull, out);
  } else {
    encode_block(of_runs.values(), events.values(), all, is_own.data(), texts, more, out);
  }
  return nb::bytes(out.data.data(), out.data.size());
}

// Takes note in `news` of the last events of fences, if each run follows the one before; otherwise changes nothing.
bool followed(const nb::object& runs, const Numbers& places, const nb::object& table, std::size_t last_column,
              Numbers& news) {
  const View<Run> of_runs(runs);
  const Table of_fences(table);
  Numbers found;
  found.reserve(of_runs.size());
  for (const Run& run : of_runs.values()) {
    const std::int64_t* last = found.find(run.fence);
    if (!last) last = news.find(run.fence);
    if (!last) {
      const std::int64_t* const place = places.find(run.fence);
      if (!place) return false;
      last = &of_fences.at(*place, last_column);
    }
    if (run.first != *last + 1) return false;
    found.set(run.fence, *last + run.count);
  }
  if (news.size() == 0) {
    std::swap(news, found);
    return true;
  }
  news.reserve(found.size());
  found.for_each([&](std::int64_t fence, std::int64_t last) { news.set(fence, last); });
  return true;
}

// Of which runs the hull is the one that the fence names; None if a fence does not exist. The table has the names as
// numbers, and `names` those of the hulls.
nb::object own(const nb::object& runs, const Numbers& places, const nb::object& table, std::size_t subjects,
               const nb::tuple& names) {
  const View<Run> of_runs(runs);
  const Table of_fences(table);
  std::vector<std::int64_t> of_hulls;
  for (const nb::handle name : names) of_hulls.push_back(nb::cast<std::int64_t>(name));
  std::string found;
  found.reserve(of_runs.size());
  for (const Run& run : of_runs.values()) {
    const std::int64_t* const place = places.find(run.fence);
    if (!place) return nb::none();
    if (static_cast<std::size_t>(run.hull) >= of_hulls.size()) throw nb::value_error("a hull without a name");
    found.push_back(of_fences.at(*place, subjects) == of_hulls[static_cast<std::size_t>(run.hull)]);
  }
  return nb::bytes(found.data(), found.size());
}

// Adds runs to the three columns of new ones, from `end` on, and sets the last events of their fences.
void added(const nb::object& runs, const Numbers& places, const nb::object& table, std::size_t last,
           const nb::object& news, std::size_t end, std::int64_t row) {
  const View<Run> of_runs(runs);
  const Table of_fences(table);
  const Room of_news(news);
  const std::size_t room = of_news.size() / 3;
  if (end + of_runs.size() > room) throw nb::value_error("there is no room for the runs");
  for (const Run& run : of_runs.values()) {
    of_news[end] = run.fence;
    of_news[room + end] = run.first;
    of_news[2 * room + end++] = row;
    of_fences.at(value_of(places, run.fence), last) = run.first + run.count - 1;
  }
}

// Counts events of fences, given their places: the first two of these columns get the new value, the next two as much
// more, and the last one a 1.
void counted(const nb::object& places, const nb::tuple& news, const nb::object& table, const nb::tuple& columns) {
  if (news.size() != 4 || columns.size() != 5) throw nb::value_error("there are four columns of news, and five others");
  const View<std::int64_t> of_places(places);
  const std::size_t count = of_places.size();
  const View<std::int64_t> lasts(news[0], count), times(news[1], count), made(news[2], count), changes(news[3], count);
  const Table of_fences(table);
  std::size_t at[5];
  for (std::size_t i = 0; i < 5; ++i) at[i] = nb::cast<std::size_t>(nb::int_(columns[i]));
  for (std::size_t i = 0; i < count; ++i) {
    const std::int64_t place = of_places.data()[i];
    of_fences.at(place, at[0]) = lasts.data()[i];
    of_fences.at(place, at[1]) = times.data()[i];
    of_fences.at(place, at[2]) += made.data()[i];
    of_fences.at(place, at[3]) += changes.data()[i];
    of_fences.at(place, at[4]) = 1;
  }
}

// The number of each key: equal ones have the same, and each that is new one more than those before.
nb::bytes key_codes(const nb::bytes& lengths, const nb::bytes& data) {
  const View<std::uint8_t> of_lengths(lengths);
  const std::size_t count = of_lengths.size();
  std::size_t total = 0;
  for (const std::uint8_t length : of_lengths.values()) total += length;
  if (total != data.size()) throw nb::value_error("the lengths do not add up to the data");
  nb::object codes = nb::steal(PyBytes_FromStringAndSize(nullptr, Py_ssize_t(count * sizeof(std::int32_t))));
  if (!codes.is_valid()) throw nb::python_error();
  auto* const out = reinterpret_cast<std::int32_t*>(PyBytes_AS_STRING(codes.ptr()));
  {
    std::optional<nb::gil_scoped_release> release;
    if (count >= MANY) release.emplace();
    KeyCodes table(count);
    const char* at = data.c_str();
    for (std::size_t row = 0; row < count; ++row) {
      const std::uint8_t length = of_lengths.data()[row];
      out[row] = table.code({at, length});
      at += length;
    }
  }
  return nb::borrow<nb::bytes>(codes);
}

template <class Value>
nb::bytes bytes(const std::vector<Value>& values) {
  return bytes(values.data(), values.size());
}

// The batches in payloads of the journal, from one of these on up to the first that has one that is not plain. Of keys
// only those that are wanted, if some are named.
nb::tuple plain_batches(const nb::list& payloads, std::size_t first, std::uint8_t kind,
                        const std::optional<nb::list>& wanted) {
  if (kind != 0 && kind != 16 && kind != 32) throw nb::value_error("no kind of rows");
  std::vector<View<char>> texts;
  std::optional<Wanted> keys;
  if (wanted && kind != OF_POINTS) {
    keys.emplace();
    for (const nb::handle key : *wanted) keys->insert(texts.emplace_back(key).text());
  }
  std::vector<View<char>> views;
  views.reserve(payloads.size());
  std::size_t size = 0;
  for (std::size_t place = first; place < payloads.size(); ++place) {
    views.emplace_back(payloads[place]);
    size += views.back().size();
  }
  PlainBatches batches(kind, keys ? &*keys : nullptr);
  {
    std::optional<nb::gil_scoped_release> release;
    if (size >= MANY) release.emplace();
    for (const View<char>& payload : views)
      if (!batches.add(payload.text())) break;
  }
  return nb::make_tuple(bytes(batches.records), bytes(batches.clocks), bytes(batches.causes), bytes(batches.rows),
                        bytes(batches.ops), nb::bytes(batches.lengths.data(), batches.lengths.size()),
                        nb::bytes(batches.keys.data(), batches.keys.size()), bytes(batches.points),
                        bytes(batches.times), bytes(batches.deadlines));
}

nb::object points_of_message(const nb::bytes& data) {
  const std::string_view all(data.c_str(), data.size());
  const auto found = points_message(all);
  if (!found) return nb::none();
  return nb::make_tuple(nb::bytes(found->name.data(), found->name.size()), found->inserts,
                        found->points.data() - all.data());
}

nb::object puts_of_message(const nb::bytes& data) {
  const auto found = puts_message({data.c_str(), data.size()});
  if (!found) return nb::none();
  const auto piece = [](std::string_view part) { return nb::bytes(part.data(), part.size()); };
  nb::list batches;
  for (const PutsBatch& each : found->batches) {
    const nb::object integers = each.text.data() == nullptr ? nb::object(piece(each.integers)) : nb::none();
    batches.append(nb::make_tuple(each.sequence, integers, piece(each.lengths), piece(each.text), piece(each.points)));
  }
  return nb::make_tuple(piece(found->name), found->several, batches);
}

// What a StreamResponse and a NumberedResult have of a result: its number, and the values of its fields. Nothing where
// it has a clock, or rows that are held.
std::optional<std::string> result_of(std::uint64_t sequence, const nb::tuple& fields) {
  constexpr std::size_t CLOCK = std::size(COUNTS), HELD = CLOCK + 1;
  if (fields.size() != HELD + 1) throw nb::value_error("a result has another number of values");
  if (!fields[CLOCK].is_none() || nb::len(nb::object(fields[HELD])) != 0) return {};
  std::uint64_t values[CLOCK];
  for (std::size_t i = 0; i < CLOCK; ++i) values[i] = nb::cast<std::uint64_t>(fields[i]);
  return numbered_result(sequence, values);
}

nb::object acknowledged(std::uint64_t sequence, const nb::tuple& fields) {
  const auto found = result_of(sequence, fields);
  return found ? nb::object(nb::bytes(found->data(), found->size())) : nb::none();
}

nb::object results(const nb::list& outcomes) {
  Bytes response;
  for (const nb::handle each : outcomes) {
    const nb::tuple outcome = nb::cast<nb::tuple>(each);
    const auto found = result_of(nb::cast<std::uint64_t>(outcome[0]), nb::cast<nb::tuple>(outcome[1]));
    if (!found) return nb::none();
    response.byte(RESULTS);
    response.text(*found);
  }
  return nb::bytes(response.data.data(), response.data.size());
}

// Where the list of groups of rows begins in a footer, and the first group; and of each group its end, and of one
// column the least value, the greatest one, None for what is not known, and how many rows have none.
nb::object footer_groups(const nb::bytes& footer, std::uint64_t column) {
  const auto found = Footer::of({footer.c_str(), footer.size()}, column);
  if (!found) return nb::none();
  const auto value = [](const std::optional<std::string_view>& text) {
    return text ? nb::object(nb::bytes(text->data(), text->size())) : nb::none();
  };
  nb::list groups;
  for (const Footer::Group& group : found->groups)
    groups.append(nb::make_tuple(group.end, value(group.least), value(group.greatest), group.nulls));
  return nb::make_tuple(found->list, found->first, groups);
}

// Bytes that are written later.
nb::object room(std::size_t size) {
  nb::object room = nb::steal(PyBytes_FromStringAndSize(nullptr, Py_ssize_t(size)));
  if (!room.is_valid()) throw nb::python_error();
  return room;
}

// The lengths and the text of the keys with some numbers. Of all keys, one after the other, `ends` has where each
// begins, and the end of the last one.
nb::tuple keys_at(nb::handle ends, nb::handle text, nb::handle codes) {
  const View<std::int32_t> of_ends(ends), of_codes(codes);
  const View<char> all(text);
  const auto refuse = [](bool wrong) {
    if (wrong) throw nb::value_error("keys do not lie where they are said to");
  };
  std::size_t total = 0;
  {
    const nb::gil_scoped_release release;
    for (const std::int32_t code : of_codes.values()) {
      refuse(code < 0 || std::size_t(code) + 1 >= of_ends.size());
      const std::int32_t begin = of_ends.data()[code], end = of_ends.data()[code + 1];
      refuse(begin < 0 || end < begin || std::size_t(end) > all.size() || end - begin > 255);
      total += std::size_t(end - begin);
    }
  }
  const nb::object lengths = room(of_codes.size()), found = room(total);
  {
    const nb::gil_scoped_release release;
    char *length = PyBytes_AS_STRING(lengths.ptr()), *at = PyBytes_AS_STRING(found.ptr());
    for (const std::int32_t code : of_codes.values()) {
      const std::size_t begin = std::size_t(of_ends.data()[code]), size = std::size_t(of_ends.data()[code + 1]) - begin;
      *length++ = static_cast<char>(size);
      std::memcpy(at, all.data() + begin, size);
      at += size;
    }
  }
  return nb::make_tuple(lengths, found);
}

LastPlaces* last_places(std::uint8_t kind, std::size_t most) {
  if (kind != OF_STRINGS && kind != OF_INTEGERS) throw nb::value_error("no kind of keys");
  return new LastPlaces(kind, most);
}

// Adds the batches of payloads up to the first that cannot be added; the number of those that are.
std::size_t add_batches(LastPlaces& places, const nb::list& payloads, const nb::list& expected) {
  std::vector<View<char>> views;
  std::vector<std::size_t> counts;
  for (const nb::handle payload : payloads) views.emplace_back(payload);
  for (const nb::handle count : expected) counts.push_back(nb::cast<std::size_t>(count));
  if (views.size() != counts.size()) throw nb::value_error("as many payloads as numbers of batches");
  const nb::gil_scoped_release release;
  std::size_t added = 0;
  while (added < views.size() && places.add(views[added].text(), counts[added])) ++added;
  return added;
}

nb::tuple taken(const LastPlaces& places) {
  const LastPlaces::Taken found = [&] {
    const nb::gil_scoped_release release;
    return places.taken();
  }();
  const nb::object lengths = room(found.put.lengths), text = room(found.put.text);
  const nb::object removed_lengths = room(found.removed.lengths), removed_text = room(found.removed.text);
  const nb::object points = room(found.points), times = room(found.times), deadlines = room(found.deadlines);
  const auto of = [](const nb::object& bytes) { return PyBytes_AS_STRING(bytes.ptr()); };
  {
    const nb::gil_scoped_release release;
    places.write(
        {{of(lengths), of(text)}, {of(removed_lengths), of(removed_text)}, of(points), of(times), of(deadlines)});
  }
  return nb::make_tuple(places.clock, places.cause, lengths, text, removed_lengths, removed_text, points, times,
                        deadlines);
}

}  // namespace
}  // namespace dynhull_server

NB_MODULE(_native, module) {
  module.doc() = "Events of fences, batches of the past and messages in C++, with the same results as in Python.";
  using dynhull_server::Numbers;
  nb::class_<Numbers>(module, "Numbers", "A dictionary of integers, those of fences, without an object for each.")
      .def(nb::init<>())
      .def("__len__", &Numbers::size)
      .def("__contains__", [](const Numbers& numbers, std::int64_t key) { return numbers.find(key) != nullptr; })
      .def("__getitem__", &dynhull_server::value_of, "key"_a)
      .def("__setitem__", &Numbers::set, "key"_a, "value"_a)
      .def(
          "pop",
          [](Numbers& numbers, std::int64_t key) {
            const auto taken = numbers.take(key);
            return taken ? *taken : dynhull_server::value_of(numbers, key);  // KeyError
          },
          "key"_a);
  module.def("numbered", &dynhull_server::numbered, "waiting"_a, "names"_a, "types"_a, "places"_a, "table"_a, "last"_a,
             "time"_a,
             nb::sig("def numbered(waiting: list[typing.Any], names: tuple[str, ...], types: bytes, places: Numbers, "
                     "table: object, last: int, time: int) -> tuple[bytes, bytes, bytes, bytes]"),
             "The events of crossings: the bytes of their runs, of themselves, of their keys, and of what they say of "
             "their fences.");
  module.def("encoded", &dynhull_server::encoded, "runs"_a, "rows"_a, "keys"_a, "own"_a, "names"_a, "more"_a,
             nb::sig("def encoded(runs: object, rows: object, keys: bytes, own: object, names: tuple[str, ...], "
                     "more: int) -> bytes"),
             "Events as the bytes that are stored, without those of members and origins, whose flags are `more`.");
  module.def("followed", &dynhull_server::followed, "runs"_a, "places"_a, "table"_a, "last"_a, "news"_a,
             nb::sig("def followed(runs: object, places: Numbers, table: object, last: int, news: Numbers) -> bool"),
             "Whether each run follows the last event of its fence; if so, `news` has the new last events.");
  module.def("own", &dynhull_server::own, "runs"_a, "places"_a, "table"_a, "subjects"_a, "names"_a,
             nb::sig("def own(runs: object, places: Numbers, table: object, subjects: int, names: tuple[int, ...]) "
                     "-> bytes | None"),
             "Of which runs the hull is the one that the fence names; None if a fence does not exist.");
  module.def("added", &dynhull_server::added, "runs"_a, "places"_a, "table"_a, "last"_a, "news"_a, "end"_a, "row"_a,
             nb::sig("def added(runs: object, places: Numbers, table: object, last: int, news: object, end: int, "
                     "row: int) -> None"),
             "Add runs to the columns of new ones, and set the last events of their fences.");
  module.def("counted", &dynhull_server::counted, "places"_a, "news"_a, "table"_a, "columns"_a,
             nb::sig("def counted(places: object, news: tuple[object, object, object, object], table: object, "
                     "columns: tuple[int, int, int, int, int]) -> None"),
             "Count events of fences at these places: two columns are set, two are added to, and the last is 1.");
  module.def(
      "plain_batches", &dynhull_server::plain_batches, "payloads"_a, "first"_a, "kind"_a, "wanted"_a.none(),
      nb::sig("def plain_batches(payloads: list[bytes], first: int, kind: int, wanted: list[bytes] | None) "
              "-> tuple[bytes, ...]"),
      "The batches in payloads of the journal as columns, up to the first payload that has one of another kind; of "
      "keys, in UTF-8 or as eight bytes, only those that are wanted.");
  module.def("points_message", &dynhull_server::points_of_message, "data"_a,
             nb::sig("def points_message(data: bytes) -> tuple[bytes, bool, int] | None"),
             "The name in a StreamRequest, whether its points are inserts, and where they begin; None if it has "
             "anything else, or none.");
  module.def("puts_message", &dynhull_server::puts_of_message, "data"_a,
             nb::sig("def puts_message(data: bytes) -> tuple[bytes, bool, list[tuple[int, bytes | None, bytes, bytes, "
                     "bytes]]] | None"),
             "The name in a StreamRequest whose batches put keys, whether it may have several, and of each its number, "
             "the keys as integers, or None and their lengths and text, and the points; None if it has anything else, "
             "or none.");
  module.def(
      "acknowledged", &dynhull_server::acknowledged, "sequence"_a, "fields"_a,
      nb::sig("def acknowledged(sequence: int, fields: tuple[typing.Any, ...]) -> bytes | None"),
      "The StreamResponse with a result: its counts in the order of the fields, its clock, and the rows that are "
      "held. None if it has a clock or such rows.");
  module.def("results", &dynhull_server::results, "outcomes"_a,
             nb::sig("def results(outcomes: list[tuple[int, tuple[typing.Any, ...]]]) -> bytes | None"),
             "The same with several results and their numbers.");
  using dynhull_server::LastPlaces;
  nb::class_<LastPlaces>(
      module, "LastPlaces",
      "Of each key the last place that batches of the journal give it; there is room for `most` keys at once.")
      .def(nb::new_(&dynhull_server::last_places), "kind"_a, "most"_a = 0)
      .def("add", &dynhull_server::add_batches, "payloads"_a, "batches"_a,
           nb::sig("def add(self, payloads: list[bytes], batches: list[int]) -> int"),
           "Add payloads with so many batches each, up to the first that cannot be; the number of those that are.")
      .def("taken", &dynhull_server::taken,
           nb::sig("def taken(self) -> tuple[int, int, bytes, bytes, bytes, bytes, bytes, bytes, bytes]"),
           "The clock and the cause of the last batch; keys that are put, and removed, as lengths and text; and the "
           "points, times and deadlines of those that are put.");
  module.def(
      "footer_groups", &dynhull_server::footer_groups, "footer"_a, "column"_a,
      nb::sig("def footer_groups(footer: bytes, column: int) -> "
              "tuple[int, int, list[tuple[int, bytes | None, bytes | None, int]]] | None"),
      "Where the groups of rows of a Parquet file lie in its footer: the list, the first of them, and of each its end, "
      "the least and the greatest value of a column, and how many rows have none. None for what is no such footer.");
  module.def("keys_at", &dynhull_server::keys_at, "ends"_a, "text"_a, "codes"_a,
             nb::sig("def keys_at(ends: object, text: bytes, codes: object) -> tuple[bytes, bytes]"),
             "The lengths and the text of the keys with some numbers, of keys that lie one after the other; int32.");
  module.def(
      "key_codes", &dynhull_server::key_codes, "lengths"_a, "data"_a,
      nb::sig("def key_codes(lengths: bytes, data: bytes) -> bytes"),
      "The number of each key, as int32: equal ones have the same, each that is new one more than those before.");
}
