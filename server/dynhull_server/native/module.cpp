// dynhull_server._native: what the server does for each event of a fence, for Python.
#include <nanobind/nanobind.h>

#include <memory>
#include <utility>

#include "encoding.hpp"
#include "numbering.hpp"

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

// The columns of crossings of one revision, in the order of `Crossed` there and here.
class Columns {
 public:
  explicit Columns(const nb::tuple& columns)
      : fences_(columns[0]),
        changes_(columns[1], fences_.size()),
        causes_(columns[2], fences_.size()),
        points_(columns[4], 2 * fences_.size()),
        previous_(columns[5], 2 * fences_.size()),
        distances_(columns[6], fences_.size()) {
    crossed.count = fences_.size();
    crossed.fences = fences_.data();
    crossed.changes = changes_.data();
    crossed.causes = causes_.data();
    if (!columns[3].is_none()) crossed.lengths = lengths_.emplace(columns[3], crossed.count).data();
    crossed.points = points_.data();
    crossed.previous = previous_.data();
    crossed.distances = distances_.data();
    if (!columns[7].is_none()) crossed.event_times = event_times_.emplace(columns[7], crossed.count).data();
    crossed.meant = nb::cast<std::uint8_t>(columns[8]);
    crossed.stands_for = nb::cast<std::uint8_t>(columns[9]);
    crossed.now = nb::cast<std::int64_t>(columns[10]);
    crossed.hull = nb::cast<std::int64_t>(columns[11]);
    crossed.kind = nb::cast<std::uint8_t>(columns[12]);
    crossed.revision = nb::cast<std::int64_t>(columns[13]);
    if (!columns[14].is_none())
      for (const auto [fence, revision] : nb::cast<nb::dict>(columns[14]))
        crossed.areas.emplace(nb::cast<std::int64_t>(fence), nb::cast<std::int64_t>(revision));
    for (std::size_t row = 0; row < crossed.count; ++row)
      if (crossed.changes[row] < -1 || crossed.changes[row] > 1) throw nb::value_error("no change of side");
  }

  Crossed crossed;

 private:
  View<std::int64_t> fences_;
  View<std::int8_t> changes_;
  View<std::uint8_t> causes_;
  View<double> points_, previous_, distances_;
  std::optional<View<std::uint8_t>> lengths_;
  std::optional<View<std::int64_t>> event_times_;
};

template <class Value>
nb::bytes bytes(const Value* values, std::size_t count) {
  return nb::bytes(values, count * sizeof(Value));
}

// The last sequence and time of each fence, from its place in a column of each.
void look_up(Told& told, const nb::dict& places, const nb::object& lasts, const nb::object& times) {
  const View<std::int64_t> of_lasts(lasts), of_times(times, of_lasts.size());
  for (std::size_t i = 0; i < told.fences.size(); ++i) {
    const auto place = nb::cast<std::size_t>(places[nb::int_(told.fences[i])]);  // KeyError if it is not there
    if (place >= of_lasts.size()) throw nb::value_error("a place outside of the columns");
    told.places[i] = static_cast<std::int64_t>(place);
    told.lasts[i] = of_lasts.data()[place];
    told.times[i] = of_times.data()[place];
  }
}

nb::tuple numbered(const nb::list& waiting, const nb::bytes& types, const nb::dict& places, const nb::object& lasts,
                   const nb::object& times) {
  if (types.size() != 3) throw nb::value_error("there are three changes of side");
  std::vector<Columns> columns;
  columns.reserve(waiting.size());
  std::vector<Crossed> crossed;
  std::size_t count = 0;
  for (const nb::handle each : waiting) {
    columns.emplace_back(nb::cast<nb::tuple>(each));
    crossed.push_back(columns.back().crossed);
    count += crossed.back().count;
  }
  Told told(numbers_of(crossed));
  look_up(told, places, lasts, times);
  nb::object rows = nb::steal(PyBytes_FromStringAndSize(nullptr, Py_ssize_t(count * sizeof(Event))));
  if (!rows.is_valid()) throw nb::python_error();
  auto* const events = reinterpret_cast<Event*>(PyBytes_AS_STRING(rows.ptr()));
  std::vector<Run> runs;
  {
    std::optional<nb::gil_scoped_release> release;
    if (count >= MANY) release.emplace();
    number(crossed, static_cast<Types>(types.data()), told, runs, events);
  }
  std::vector<std::int64_t> table;
  for (const auto* column : {&told.fences, &told.places, &told.lasts, &told.times, &told.made, &told.changes})
    table.insert(table.end(), column->begin(), column->end());
  return nb::make_tuple(bytes(runs.data(), runs.size()), rows, bytes(table.data(), table.size()));
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

}  // namespace
}  // namespace dynhull_server

NB_MODULE(_native, module) {
  module.doc() = "Events of fences in C++, with the same results as in Python.";
  module.def("numbered", &dynhull_server::numbered, "waiting"_a, "types"_a, "places"_a, "lasts"_a, "times"_a,
             nb::sig("def numbered(waiting: list[tuple[object, ...]], types: bytes, places: dict[int, int], "
                     "lasts: object, times: object) -> tuple[bytes, bytes, bytes]"),
             "The events of crossings: the bytes of their runs, of themselves, and of what they say of their fences.");
  module.def("encoded", &dynhull_server::encoded, "runs"_a, "rows"_a, "keys"_a, "own"_a, "names"_a, "more"_a,
             nb::sig("def encoded(runs: object, rows: object, keys: bytes, own: object, names: tuple[str, ...], "
                     "more: int) -> bytes"),
             "Events as the bytes that are stored, without those of members and origins, whose flags are `more`.");
}
