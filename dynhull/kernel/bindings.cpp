// dynhull._kernel: the kernel's HullTree and predicates for Python.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>

#include <cstring>

#include "chains.hpp"
#include "chan.hpp"
#include "check.hpp"
#include "lock.hpp"
#include "static_hull.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace dynhull {
namespace {

using Rows = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using OpRows = nb::ndarray<const std::int8_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

const Point* points_of(const Rows& rows) {
  static_assert(sizeof(Point) == 2 * sizeof(double));
  return reinterpret_cast<const Point*>(rows.data());
}

// A new array for numpy, of `count` items of `width` scalars.
template <class Scalar>
struct Output {
  Scalar* data;
  nb::capsule owner;

  explicit Output(std::size_t size)
      : data(new Scalar[size]), owner(data, [](void* memory) noexcept { delete[] static_cast<Scalar*>(memory); }) {}

  nb::object array(std::initializer_list<std::size_t> shape) const {
    return nb::cast(nb::ndarray<nb::numpy, Scalar>(data, shape.size(), shape.begin(), owner));
  }
};

// The points as an array, which takes over their memory.
nb::object array_of(std::vector<Point> points) {
  auto* const kept = new std::vector<Point>(std::move(points));
  const nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<Point>*>(memory); });
  auto* const data = reinterpret_cast<double*>(kept->data());
  return nb::cast(nb::ndarray<nb::numpy, double>(data, {kept->size(), 2}, owner));
}

// One coordinate, checked: what is not plainly a double goes the way of dynhull.arrays, which converts or refuses.
double coordinate(nb::handle value, const char* name) {
  constexpr long long LARGEST_EXACT_INTEGER = 1LL << 53;
  if (PyFloat_CheckExact(value.ptr())) {
    const double number = PyFloat_AS_DOUBLE(value.ptr());
    if (std::isfinite(number)) return number + 0.0;  // -0.0 is 0.0
  } else if (PyLong_CheckExact(value.ptr())) {
    int overflow = 0;
    const long long number = PyLong_AsLongLongAndOverflow(value.ptr(), &overflow);
    if (overflow == 0 && -LARGEST_EXACT_INTEGER <= number && number <= LARGEST_EXACT_INTEGER)
      return static_cast<double>(number);
  }
  return nb::cast<double>(nb::module_::import_("dynhull.arrays").attr("as_coordinate")(value, name));
}

// What dynhull.arrays makes of points, or an error that says where one is wrong.
nb::object as_points(const nb::object& xy) { return nb::module_::import_("dynhull.arrays").attr("as_points")(xy); }

// Whether this is numpy's array and no subclass of it: a masked array's rows may be missing.
bool is_plain_array(const nb::object& xy) {
  static const nb::handle type = nb::object(nb::module_::import_("numpy").attr("ndarray")).release();
  return xy.type().is(type);
}

// An array's rows as they are, of anything else what dynhull.arrays makes of it.
Rows rows_of(const nb::object& xy) {
  Rows rows;
  return is_plain_array(xy) && nb::try_cast(xy, rows, false) ? rows : nb::cast<Rows>(as_points(xy));
}

HullTree tree_of(const nb::object& xy) {
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

  nb::object points() {
    std::vector<Point> all;
    {
      const Reading turn(turns_);
      all.reserve(tree_.size());
      tree_.for_each([&](Point p, std::uint64_t copies) {
        for (; copies > 0; --copies) all.push_back(p);
      });
    }
    return array_of(std::move(all));
  }

  nb::object chain(int side) {
    if (side != UPPER && side != LOWER) throw nb::value_error("side must be 0 (upper) or 1 (lower)");
    std::vector<Point> chain;
    {
      const Reading turn(turns_);
      chain = tree_.chain(static_cast<Side>(side));
    }
    return array_of(std::move(chain));
  }

  nb::object vertices() {
    std::vector<Point> vertices;
    {
      const Reading turn(turns_);
      vertices = tree_.chain(LOWER);
      const std::vector<Point> upper = tree_.chain(UPPER);
      if (upper.size() > 2) vertices.insert(vertices.end(), upper.rbegin() + 1, upper.rend() - 1);
    }
    return array_of(std::move(vertices));
  }

  nb::object locate(const Rows& rows) {
    const std::size_t count = rows.shape(0);
    const Output<std::int8_t> output(count);
    flatten_for(count);
    {
      const Reading turn(turns_, count);
      if (chains_.fresh(tree_)) {
        chains_.locate(tree_, points_of(rows), count, output.data);
      } else {
        for (std::size_t i = 0; i < count; ++i)
          output.data[i] = static_cast<std::int8_t>(dynhull::locate(tree_.nodes(), points_of(rows)[i]).where);
      }
    }
    return output.array({count});
  }

  nb::object count_many(const Rows& rows) {
    const std::size_t count = rows.shape(0);
    const Output<std::int64_t> output(count);
    {
      const Reading turn(turns_, count);
      for (std::size_t i = 0; i < count; ++i)
        output.data[i] = static_cast<std::int64_t>(tree_.count(points_of(rows)[i]));
    }
    return output.array({count});
  }

  nb::object support(const Rows& directions) {
    const std::size_t count = directions.shape(0);
    const Output<double> output(2 * count);
    {
      const Reading turn(turns_, count);
      auto* rows = reinterpret_cast<Point*>(output.data);
      if (tree_.distinct() > 0)
        for (std::size_t i = 0; i < count; ++i) rows[i] = dynhull::support(tree_.nodes(), points_of(directions)[i]);
      else
        std::fill_n(rows, count, NO_EDGE.a);
    }
    return output.array({count, 2});
  }

  nb::object tangents(const Rows& points) {
    const std::size_t count = points.shape(0);
    const Output<double> output(4 * count);
    {
      const Reading turn(turns_, count);
      auto* rows = reinterpret_cast<Edge*>(output.data);
      for (std::size_t i = 0; i < count; ++i)
        rows[i] = dynhull::tangents(tree_.nodes(), points_of(points)[i]).value_or(NO_EDGE);
    }
    return output.array({count, 2, 2});
  }

  nb::object distance(const Rows& points) {
    const std::size_t count = points.shape(0);
    const Output<double> output(count);
    {
      const Reading turn(turns_, count);
      for (std::size_t i = 0; i < count; ++i) output.data[i] = dynhull::distance(tree_.nodes(), points_of(points)[i]);
    }
    return output.array({count});
  }

  nb::object intersect_lines(const Rows& p, const Rows& q) {
    const std::size_t count = p.shape(0);
    if (q.shape(0) != count) throw nb::value_error("p and q differ in length");
    const Output<double> output(4 * count);
    {
      const Reading turn(turns_, count);
      auto* rows = reinterpret_cast<Edge*>(output.data);
      for (std::size_t i = 0; i < count; ++i)
        rows[i] = intersect_line(tree_.nodes(), points_of(p)[i], points_of(q)[i]).value_or(NO_EDGE);
    }
    return output.array({count, 2, 2});
  }

  nb::object copy() {
    nb::object other = nb::cast(new Hull, nb::rv_policy::take_ownership);
    Hull& hull = *nb::inst_ptr<Hull>(other);
    const Reading turn(turns_);
    hull.tree_ = HullTree(tree_);
    return other;
  }

  void check() {
    const Reading turn(turns_);
    Check checked(tree_);
  }

  nb::tuple memory() {
    const HullTree& tree = settled();
    return nb::make_tuple(tree.used_bytes(), tree.reserved_bytes());
  }

 private:
  static constexpr double NOTHING = std::numeric_limits<double>::quiet_NaN();
  static constexpr Edge NO_EDGE = {{NOTHING, NOTHING}, {NOTHING, NOTHING}};

  std::int64_t apply(Ops ops, std::size_t ops_count, const nb::object& xy, bool ignore_missing,
                     std::optional<bool> together) {
    const Rows rows = rows_of(xy);
    const std::size_t count = rows.shape(0);
    if (ops.step > 0 && ops_count != count) throw nb::value_error("ops and xy differ in length");
    const std::optional<Applied> applied = [&]() -> std::optional<Applied> {
      const Writing turn(turns_, count);
      try {
        return tree_.apply(ops, points_of(rows), count, ignore_missing, together);
      } catch (const NotFinite&) {
        return {};
      }
    }();
    if (!applied) return apply(ops, ops_count, as_points(xy), ignore_missing, together);
    if (applied->first_missing >= 0 && !ignore_missing) {
      const Point p = Plain()(points_of(rows)[applied->first_missing]);
      PyErr_SetObject(PyExc_KeyError, nb::make_tuple(p.x, p.y, applied->first_missing).ptr());
      throw nb::python_error();
    }
    return applied->rows;
  }

  // The tree for a moment under the GIL: to read, or to write.
  const HullTree& settled() {
    turns_.await_readable();
    return tree_;
  }
  HullTree& writable() {
    turns_.await_writable();
    return tree_;
  }

  // Refresh the flat chains where that pays for the queries since the hull last changed.
  void flatten_for(std::size_t queries) {
    if (settled().version() != asked_version_) queries_ = 0;
    asked_version_ = tree_.version();
    queries_ += queries;
    if (!chains_.stale(tree_, queries_)) return;
    const Writing turn(turns_);
    if (chains_.stale(tree_, queries_)) chains_.refresh(tree_, queries_);
  }

  HullTree tree_;
  FlatChains chains_;
  std::uint64_t asked_version_ = 0, queries_ = 0;
  Turns turns_;
};

nb::object orientations(const Rows& a, const Rows& b, const Rows& c) {
  const std::size_t count = a.shape(0);
  if (b.shape(0) != count || c.shape(0) != count) throw nb::value_error("arrays differ in length");
  const Output<std::int8_t> output(count);
  {
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < count; ++i)
      output.data[i] = static_cast<std::int8_t>(orientation(points_of(a)[i], points_of(b)[i], points_of(c)[i]));
  }
  return output.array({count});
}

nb::object convex_hull(const Rows& rows, std::optional<bool> discard, std::optional<bool> threads) {
  std::optional<StaticHull> hull;
  {
    nb::gil_scoped_release release;
    hull.emplace(static_hull(points_of(rows), rows.shape(0), {discard, threads}));
  }
  if (!hull->finite()) return nb::none();
  const std::span<const Point> vertices = hull->vertices();
  const std::size_t count = vertices.size();
  if (2 * count <= hull->room()) return array_of({vertices.begin(), vertices.end()});
  Point* const memory = hull->take_memory().release();  // numpy's from here on
  const nb::capsule owner(memory, [](void* points) noexcept { delete[] static_cast<Point*>(points); });
  return nb::cast(nb::ndarray<nb::numpy, double>(reinterpret_cast<double*>(memory), {count, 2}, owner));
}

nb::tuple chan(const Rows& rows) {
  const Chan hull = [&] {
    nb::gil_scoped_release release;
    return Chan(points_of(rows), rows.shape(0));
  }();
  nb::list rounds;
  for (const Chan::Round& round : hull.rounds)
    rounds.append(nb::make_tuple(round.guess, round.groups, round.steps, round.closed));
  return nb::make_tuple(array_of(hull.vertices), rounds);
}

// The points as they are kept; None where a coordinate is not finite. `at` gives point i, which another thread may
// write to meanwhile.
template <class At>
nb::object plain_copy(std::size_t count, At at) {
  const Output<double> output(2 * count);
  Plain plain;
  {
    std::optional<nb::gil_scoped_release> release;
    if (count > FEW_ROWS) release.emplace();
    auto* const copies = reinterpret_cast<Point*>(output.data);
    for (std::size_t i = 0; i < count; ++i) copies[i] = plain(at(i));
  }
  return plain.finite() ? output.array({count, 2}) : nb::none();
}

// What dynhull.arrays.as_points makes of an array; None where it has more to look at than doubles that may not be
// finite.
nb::object plain_points(nb::handle xy) {
  Rows rows;
  if (!nb::try_cast(xy, rows, false)) return nb::none();
  return plain_copy(rows.shape(0), [&](std::size_t i) { return points_of(rows)[i]; });
}

nb::object packed_points(const nb::bytes& packed) {
  if (packed.size() % sizeof(Point) != 0) throw nb::value_error("a point is 16 bytes");
  return plain_copy(packed.size() / sizeof(Point), [data = packed.c_str()](std::size_t i) {
    Point p;
    std::memcpy(&p, data + i * sizeof(Point), sizeof(Point));
    return p;
  });
}

Point point_of(nb::handle pair) {
  PyObject* tuple = pair.ptr();
  if (!PyTuple_CheckExact(tuple) || PyTuple_GET_SIZE(tuple) != 2) throw nb::type_error("a point is a tuple (x, y)");
  const Point p = {PyFloat_AsDouble(PyTuple_GET_ITEM(tuple, 0)), PyFloat_AsDouble(PyTuple_GET_ITEM(tuple, 1))};
  if (PyErr_Occurred()) throw nb::python_error();
  return p;
}

}  // namespace
}  // namespace dynhull

NB_MODULE(_kernel, module) {
  using namespace dynhull;
  module.doc() = "The hull tree in C++: what dynhull.tree does, with the same results.";

  nb::register_exception_translator([](const std::exception_ptr& error, void*) {
    try {
      std::rethrow_exception(error);
    } catch (const std::logic_error& broken) {
      PyErr_SetString(PyExc_AssertionError, broken.what());
    }
  });

  nb::class_<Hull>(module, "HullTree", "A multiset of points and its convex hull: see dynhull.tree.HullTree.")
      .def(nb::init<>())
      .def(
          "__init__", [](Hull* hull, nb::object xy) { new (hull) Hull(xy.is_none() ? HullTree() : tree_of(xy)); },
          "xy"_a.none())
      .def("__len__", &Hull::size)
      .def_prop_ro("distinct", &Hull::distinct, "How many different points.")
      .def_prop_rw("changes", &Hull::changes, &Hull::set_changes, "How many updates changed the hull.")
      .def("count", &Hull::count, "x"_a.none(), "y"_a.none(), "How many times the point is there. O(log n).")
      .def("count_many", &Hull::count_many, "xy"_a, "How many times each point is there. O(log n) a row.")
      .def("insert", &Hull::insert, "x"_a.none(), "y"_a.none(), "Add a point. True where the hull changed. O(log² n).")
      .def("delete", &Hull::remove, "x"_a.none(), "y"_a.none(),
           "Remove a point once. True where the hull changed; KeyError where it is not there. O(log² n).")
      .def("clear", &Hull::clear, "Remove every point.")
      .def("apply", &Hull::apply_all, "op"_a, "xy"_a, "ignore_missing"_a, "together"_a = nb::none(),
           "Insert the rows, +1, or delete them, -1.")
      .def(
          "apply", &Hull::apply_each, "ops"_a, "xy"_a, "ignore_missing"_a, "together"_a = nb::none(),
          "Insert the rows with +1 and delete those with -1, as a set, together or one by one: the batch decides where "
          "not told. Returns how many rows were applied. A row that deletes what is not there raises "
          "KeyError(x, y, row), unless missing points are to be ignored.")
      .def("points", &Hull::points, "All points in lexicographic order, with multiplicity. O(n).")
      .def("vertices", &Hull::vertices, "The hull's vertices, counter-clockwise from the least. O(h log n).")
      .def("chain", &Hull::chain, "side"_a, "The upper (0) or lower (1) chain from left to right. O(h log n).")
      .def("locate", &Hull::locate, "xy"_a, "+1 inside, 0 on the boundary, -1 outside, a row each. O(log n) a row.")
      .def("support", &Hull::support, "directions"_a,
           "The vertex farthest in each direction; of two the lexicographically smaller. O(log n) a row.")
      .def("tangents", &Hull::tangents, "xy"_a,
           "The left and the right tangent point seen from each row, NaN where it is not outside. O(log n) a row.")
      .def("distance", &Hull::distance, "xy"_a,
           "The distance of each row to the hull, the nearest double; infinite without points. O(log n) a row.")
      .def("intersect_lines", &Hull::intersect_lines, "p"_a, "q"_a,
           "Where the line through p and q of each row, different points, enters and leaves the hull; NaN where it "
           "misses. O(log n) a row.")
      .def("copy", &Hull::copy, "An independent tree of the same points. O(n).")
      .def("check", &Hull::check, "Raise AssertionError where an invariant is broken. O(n log n).")
      .def_prop_ro("memory", &Hull::memory, "Bytes used and bytes reserved by the tree.");

  module.def(
      "orientation",
      [](nb::handle a, nb::handle b, nb::handle c) { return orientation(point_of(a), point_of(b), point_of(c)); },
      "a"_a, "b"_a, "c"_a, "+1 where three points turn left, -1 right, 0 on one line.");
  module.def(
      "direction_sign",
      [](nb::handle d, nb::handle a, nb::handle b) { return direction_sign(point_of(d), point_of(a), point_of(b)); },
      "d"_a, "a"_a, "b"_a, "+1 where b lies further than a in direction d, -1 less far, 0 neither.");
  module.def(
      "crossing",
      [](nb::handle a, nb::handle b, nb::handle c, nb::handle d, nb::handle z) {
        return crossing(point_of(a), point_of(b), point_of(c), point_of(d), point_of(z));
      },
      "a"_a, "b"_a, "c"_a, "d"_a, "z"_a, "The sign of height(ab) - height(cd) at z, for a < b < z <= c < d.");
  module.def(
      "plain_difference_of_products", &difference_of_products, "a"_a, "b"_a, "c"_a, "d"_a,
      "a * b - c * d as the predicates' filters compute it: three roundings. For the test of the build's flags.");
  module.def("plain_points", &plain_points, "xy"_a,
             "A copy of an (n, 2) array of finite doubles without negative zeros; None of anything else.");
  module.def("packed_points", &packed_points, "packed"_a,
             "The points whose doubles these bytes are, without negative zeros; None where one is not finite.");
  module.def("convex_hull", &convex_hull, "xy"_a, "discard"_a = nb::none(), "threads"_a = nb::none(),
             "The static hull's vertices, counter-clockwise from the least; None where a coordinate is not finite. "
             "Whether to discard points by a sample's hull first, and to use two threads, the input decides where not "
             "told. O(n log n).");
  module.def("chan", &chan, "xy"_a,
             "The same by Chan's algorithm, and its rounds: guess, groups, steps, closed. O(n log h).");
  module.def("orientations", &orientations, "a"_a, "b"_a, "c"_a, "`orientation` for each row of three arrays.");

  module.def("_before_fork", &Turns::before_fork);
  module.def("_after_fork_in_parent", &Turns::after_fork_in_parent);
  module.def("_after_fork_in_child", &Turns::after_fork_in_child);
  const nb::module_ os = nb::module_::import_("os");
  if (nb::hasattr(os, "register_at_fork"))
    os.attr("register_at_fork")("before"_a = module.attr("_before_fork"),
                                "after_in_parent"_a = module.attr("_after_fork_in_parent"),
                                "after_in_child"_a = module.attr("_after_fork_in_child"));
}
