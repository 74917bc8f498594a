// The hull tree as a Python object: checks arguments, locks, and fills numpy arrays.
#pragma once

#include <memory>
#include <utility>

#include "../check.hpp"
#include "../query/locate_index.hpp"
#include "arrays.hpp"

namespace dynhull {

inline HullTree tree_of(const nb::object& xy) {
  const Rows rows = rows_of(xy);
  {
    nb::gil_scoped_release release;
    const Distinct points(points_of(rows), rows.shape(0));
    if (points.finite()) return HullTree(points);
  }
  return tree_of(as_points(xy));
}

class Hull {
 public:
  Hull() = default;
  explicit Hull(HullTree tree) : tree_(std::move(tree)) {}

  std::size_t size() { return settled().size(); }
  std::size_t distinct() { return settled().distinct(); }
  std::uint64_t changes() { return settled().changes; }
  void set_changes(std::uint64_t changes) { writable().changes = changes; }
  void clear() { writable().clear(); }
  std::uint64_t count(nb::handle x, nb::handle y) {
    const Point p = {coordinate(x, "x"), coordinate(y, "y")};
    return settled().count(p);
  }

  bool insert(nb::handle x, nb::handle y) {
    const Point p = {coordinate(x, "x"), coordinate(y, "y")};
    return writable().insert(p);
  }

  bool remove(nb::handle x, nb::handle y) {
    const Point p = {coordinate(x, "x"), coordinate(y, "y")};
    const HullTree::Removal removal = writable().remove(p);
    if (removal == HullTree::Removal::MISSING) {
      PyErr_SetObject(PyExc_KeyError, nb::make_tuple(p.x, p.y).ptr());
      throw nb::python_error();
    }
    return removal == HullTree::Removal::HULL_CHANGED;
  }

  std::int64_t apply_all(std::int8_t op, const nb::object& xy, bool ignore_missing, std::optional<bool> together) {
    return apply({&op, 0}, 1, xy, ignore_missing, together);
  }
  std::int64_t apply_each(const OpRows& ops, const nb::object& xy, bool ignore_missing, std::optional<bool> together) {
    return apply({ops.data()}, ops.shape(0), xy, ignore_missing, together);
  }

  PointArray points() {
    std::vector<Point> all;
    {
      const ReadLock lock(lock_);
      all.reserve(tree_.size());
      tree_.for_each([&](Point p, std::uint64_t copies) {
        for (; copies > 0; --copies) all.push_back(p);
      });
    }
    return array_of(std::move(all));
  }

  PointArray chain(int side) {
    if (side != UPPER && side != LOWER) throw nb::value_error("side must be 0 (upper) or 1 (lower)");
    std::vector<Point> chain;
    {
      const ReadLock lock(lock_);
      chain = tree_.chain(static_cast<Side>(side));
    }
    return array_of(std::move(chain));
  }

  PointArray vertices() {
    std::vector<Point> vertices;
    {
      const ReadLock lock(lock_);
      vertices = vertices_of(tree_);
    }
    return array_of(std::move(vertices));
  }

  SignArray locate(const Rows& rows) {
    const std::size_t count = rows.shape(0);
    const Output<std::int8_t> output(count);
    refresh_index_for(count);
    {
      const ReadLock lock(lock_, count);
      if (index_.fresh(tree_)) {
        index_.locate(tree_, points_of(rows), count, output.data());
      } else {
        for (std::size_t i = 0; i < count; ++i)
          output.data()[i] = static_cast<std::int8_t>(dynhull::locate(tree_.nodes(), points_of(rows)[i]).where);
      }
    }
    return output.array();
  }

  CountArray count_many(const Rows& rows) {
    const std::size_t count = rows.shape(0);
    const Output<std::int64_t> output(count);
    {
      const ReadLock lock(lock_, count);
      for (std::size_t i = 0; i < count; ++i)
        output.data()[i] = static_cast<std::int64_t>(tree_.count(points_of(rows)[i]));
    }
    return output.array();
  }

  PointArray support(const Rows& directions) {
    const std::size_t count = directions.shape(0);
    const Output<double, 2> output(count);
    {
      const ReadLock lock(lock_, count);
      auto* rows = reinterpret_cast<Point*>(output.data());
      if (tree_.distinct() > 0)
        for (std::size_t i = 0; i < count; ++i) rows[i] = dynhull::support(tree_.nodes(), points_of(directions)[i]);
      else
        std::fill_n(rows, count, NO_EDGE.a);
    }
    return output.array();
  }

  EdgeArray tangents(const Rows& points) {
    const std::size_t count = points.shape(0);
    const Output<double, 2, 2> output(count);
    {
      const ReadLock lock(lock_, count);
      auto* rows = reinterpret_cast<Edge*>(output.data());
      for (std::size_t i = 0; i < count; ++i)
        rows[i] = dynhull::tangents(tree_.nodes(), points_of(points)[i]).value_or(NO_EDGE);
    }
    return output.array();
  }

  DoubleArray distance(const Rows& points) {
    const std::size_t count = points.shape(0);
    const Output<double> output(count);
    {
      const ReadLock lock(lock_, count);
      for (std::size_t i = 0; i < count; ++i) output.data()[i] = dynhull::distance(tree_.nodes(), points_of(points)[i]);
    }
    return output.array();
  }

  EdgeArray intersect_lines(const Rows& p, const Rows& q) {
    const std::size_t count = p.shape(0);
    if (q.shape(0) != count) throw nb::value_error("p and q must have the same length");
    const Output<double, 2, 2> output(count);
    {
      const ReadLock lock(lock_, count);
      auto* rows = reinterpret_cast<Edge*>(output.data());
      for (std::size_t i = 0; i < count; ++i)
        rows[i] = intersect_line(tree_.nodes(), points_of(p)[i], points_of(q)[i]).value_or(NO_EDGE);
    }
    return output.array();
  }

  Hull* copy() {
    auto other = std::make_unique<Hull>();
    const ReadLock lock(lock_);
    other->tree_ = HullTree(tree_);
    return other.release();
  }

  void check() {
    const ReadLock lock(lock_);
    Check checked(tree_);
  }

  std::pair<std::size_t, std::size_t> memory() {
    const HullTree& tree = settled();
    return {tree.used_bytes(), tree.reserved_bytes()};
  }

 protected:
  static constexpr double NOTHING = std::numeric_limits<double>::quiet_NaN();
  static constexpr Edge NO_EDGE = {{NOTHING, NOTHING}, {NOTHING, NOTHING}};

  std::int64_t apply(Ops ops, std::size_t ops_count, const nb::object& xy, bool ignore_missing,
                     std::optional<bool> together) {
    const Rows rows = rows_of(xy);
    const std::size_t count = rows.shape(0);
    if (ops.step > 0 && ops_count != count) throw nb::value_error("ops and xy must have the same length");
    const std::optional<Applied> applied = [&]() -> std::optional<Applied> {
      const WriteLock lock(lock_, count);
      try {
        return tree_.apply(ops, points_of(rows), count, ignore_missing, together);
      } catch (const NotFinite&) {
        return {};
      }
    }();
    if (!applied) return apply(ops, ops_count, as_points(xy), ignore_missing, together);
    return rows_applied(*applied, rows, ignore_missing);
  }

  // The number of rows, or KeyError with the first row that deletes a missing point.
  static std::int64_t rows_applied(const Applied& applied, const Rows& rows, bool ignore_missing) {
    if (applied.first_missing < 0 || ignore_missing) return applied.rows;
    const Point p = Plain()(points_of(rows)[applied.first_missing]);
    PyErr_SetObject(PyExc_KeyError, nb::make_tuple(p.x, p.y, applied.first_missing).ptr());
    throw nb::python_error();
  }

  // The tree, to read or to write while the caller holds the GIL.
  const HullTree& settled() {
    lock_.await_readable();
    return tree_;
  }
  HullTree& writable() {
    lock_.await_writable();
    return tree_;
  }

  // Refreshes the index if that pays for the queries since the hull last changed.
  void refresh_index_for(std::size_t queries) {
    if (settled().version() != asked_version_) queries_ = 0;
    asked_version_ = tree_.version();
    queries_ += queries;
    if (!index_.stale(tree_, queries_)) return;
    const WriteLock lock(lock_);
    if (index_.stale(tree_, queries_)) index_.refresh(tree_, queries_);
  }

  HullTree tree_;
  ReadWriteLock lock_;

 private:
  LocateIndex index_;
  std::uint64_t asked_version_ = 0, queries_ = 0;
};

}  // namespace dynhull
