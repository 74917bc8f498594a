// A window's tree as a Python object.
#pragma once

#include "../window/expiry.hpp"
#include "hull.hpp"

namespace dynhull {

using TimeRows = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Totals = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t, std::uint64_t>;
using WindowState = std::tuple<PointArray, DoubleArray, std::optional<double>, Totals>;

class Window : public Hull {
 public:
  Window(std::optional<double> max_age, std::optional<std::size_t> max_points)
      : expiry_(max_age.value_or(INFINITE), max_points.value_or(Expiry::ANY_NUMBER)) {}
  Window(std::optional<double> max_age, std::optional<std::size_t> max_points, Frame frame)
      : Hull(std::move(frame)), expiry_(max_age.value_or(INFINITE), max_points.value_or(Expiry::ANY_NUMBER)) {}

  std::optional<double> max_age() const {
    return expiry_.max_age() == INFINITE ? std::nullopt : std::optional(expiry_.max_age());
  }
  std::optional<std::size_t> max_points() const {
    return expiry_.max_points() == Expiry::ANY_NUMBER ? std::nullopt : std::optional(expiry_.max_points());
  }
  std::optional<double> now() { return known(read().now()); }
  std::uint64_t expired() { return read().expired; }
  std::uint64_t evicted() { return read().evicted; }
  std::uint64_t late() { return read().late; }

  std::optional<double> oldest() {
    writable();  // may open a bucket of the wheel
    return known(expiry_.oldest().value_or(Expiry::NEVER));
  }

  std::int64_t add(const nb::object& xy, const nb::object& times) {
    const Rows rows = as_rows(xy);
    const std::size_t count = rows.shape(0);
    std::optional<TimeRows> moments;
    if (!times.is_none()) moments = times_of(times, count);
    const double* const first = moments ? moments->data() : nullptr;
    const double last = moments && count > 0 ? first[count - 1] : Expiry::NEVER;
    const std::optional<Gnomonic> chosen = choose(rows, INSERT);
    const std::optional<std::size_t> added = [&]() -> std::optional<std::size_t> {
      const WriteLock lock(lock_, rows_at(last, count));
      FramedTree::Choice choice(tree_, chosen);
      try {
        const std::size_t added = expiry_.add(tree_, points_of(rows), first, count);
        choice.keep();
        return added;
      } catch (const NotFinite&) {
        return {};
      }
    }();
    if (added) return static_cast<std::int64_t>(*added);
    const nb::object points = as_points(nb::cast(array_of({points_of(rows), points_of(rows) + count})));
    const nb::object checked_times = as_times(times, count);
    return add(checked(nb::cast<Rows>(points), INSERT), checked_times);
  }

  std::size_t advance(double now) {
    std::optional<double> later;
    std::size_t left = 0;
    {
      const WriteLock lock(lock_, rows_at(now, 0));
      if (now < expiry_.now())
        later = expiry_.now();
      else
        left = expiry_.advance(tree_, now);
    }
    if (later) {
      PyErr_Format(PyExc_ValueError, "now is %R, before the window's time %R: time does not go back",
                   nb::float_(now).ptr(), nb::float_(*later).ptr());
      throw nb::python_error();
    }
    return left;
  }

  std::size_t expire(double until) {
    lock_.await_writable();
    const WriteLock lock(lock_, expiry_.many_until(until, FEW_ROWS) ? ALL_ROWS : 0);
    return expiry_.expire(tree_, until);
  }

  bool remove(nb::handle x, nb::handle y) {
    const Point p = point(x, y);
    const HullTree::Removal removal = expiry_.remove(writable(), p);
    if (removal == HullTree::Removal::MISSING) {
      PyErr_SetObject(PyExc_KeyError, nb::make_tuple(p.x, p.y).ptr());
      throw nb::python_error();
    }
    return removal == HullTree::Removal::HULL_CHANGED;
  }

  std::int64_t remove_many(const nb::object& xy, bool ignore_missing) {
    const Rows rows = as_rows(xy);
    const std::size_t count = rows.shape(0);
    const std::optional<Applied> applied = [&]() -> std::optional<Applied> {
      const WriteLock lock(lock_, count);
      try {
        return expiry_.remove(tree_, points_of(rows), count, ignore_missing);
      } catch (const NotFinite&) {
        return {};
      }
    }();
    if (!applied) return remove_many(as_points(xy), ignore_missing);
    return rows_applied(*applied, rows, ignore_missing);
  }

  void clear() { expiry_.clear(writable()); }

  DoubleArray times() {
    return times_of(reading([&] {
      std::vector<Dated> items = expiry_.items();
      std::stable_sort(items.begin(), items.end(), [](const Dated& a, const Dated& b) { return a.p < b.p; });
      return items;
    }));
  }

  WindowState state() {
    std::vector<Dated> items;
    std::optional<double> now;
    Totals totals;
    {
      const ReadLock lock(lock_);
      items = expiry_.items();
      now = known(expiry_.now());
      totals = {tree_.changes(), expiry_.expired, expiry_.evicted, expiry_.late};
    }
    std::vector<Point> points;
    points.reserve(items.size());
    for (const Dated& item : items) points.push_back(item.p);
    return {array_of(std::move(points)), times_of(items), now, totals};
  }

  void restore(const Rows& points, const TimeRows& times, std::optional<double> now, const Totals& totals) {
    if (times.shape(0) != points.shape(0)) throw nb::value_error("points and times must have the same length");
    writable();
    expiry_.restore(tree_, points_of(points), times.data(), points.shape(0), now.value_or(Expiry::NEVER));
    std::uint64_t changes;
    std::tie(changes, expiry_.expired, expiry_.evicted, expiry_.late) = totals;
    tree_.set_changes(changes);
  }

  Window* copy() {
    const ReadLock lock(lock_);
    return new Window(*this);
  }

  void check() {
    const ReadLock lock(lock_);
    tree_.check();
    expiry_.check(tree_);
  }

 protected:
  Window(const Window& other) : Hull(other), expiry_(other.expiry_) {}

 private:
  static std::optional<double> known(double time) { return time == Expiry::NEVER ? std::nullopt : std::optional(time); }

  static nb::object as_times(const nb::object& times, std::size_t rows) {
    return times.is_none() ? times : nb::module_::import_("dynhull.arrays").attr("as_times")(times, rows);
  }

  // The times of a plain array, not yet checked for finite values; anything else goes through dynhull.arrays.
  static TimeRows times_of(const nb::object& times, std::size_t rows) {
    TimeRows plain;
    if (is_plain_array(times) && nb::try_cast(times, plain, false) && plain.shape(0) == rows) return plain;
    return nb::cast<TimeRows>(as_times(times, rows));
  }

  static DoubleArray times_of(const std::vector<Dated>& items) {
    const Output<double> output(items.size());
    for (std::size_t i = 0; i < items.size(); ++i) output.data()[i] = items[i].time;
    return output.array();
  }

  // The number of rows by which an update holds the GIL or not: a batch of few rows may make many points leave.
  std::size_t rows_at(double now, std::size_t rows) {
    lock_.await_writable();
    return rows <= FEW_ROWS && expiry_.many_due(now, FEW_ROWS) ? ALL_ROWS : rows;
  }

  const Expiry& read() {
    lock_.await_readable();
    return expiry_;
  }

  Expiry expiry_;
};

}  // namespace dynhull
