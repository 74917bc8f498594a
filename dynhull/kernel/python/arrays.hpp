// Arrays and numbers between Python and the kernel.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <cmath>
#include <cstring>
#include <optional>
#include <vector>

#include "../sort/distinct.hpp"
#include "read_write_lock.hpp"

namespace dynhull {

namespace nb = nanobind;

using Rows = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using OpRows = nb::ndarray<const std::int8_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;

inline const Point* points_of(const Rows& rows) {
  static_assert(sizeof(Point) == 2 * sizeof(double));
  return reinterpret_cast<const Point*>(rows.data());
}

// A new numpy array of rows of shape (ROW...), not initialised.
template <class Scalar, nb::ssize_t... ROW>
class Output {
 public:
  using Array = nb::ndarray<nb::numpy, Scalar, nb::shape<-1, ROW...>>;

  explicit Output(std::size_t rows)
      : rows_(rows),
        data_(new Scalar[rows * (std::size_t{1} * ... * ROW)]),
        owner_(data_, [](void* memory) noexcept { delete[] static_cast<Scalar*>(memory); }) {}

  Scalar* data() const { return data_; }
  Array array() const { return Array(data_, {rows_, static_cast<std::size_t>(ROW)...}, owner_); }

 private:
  std::size_t rows_;
  Scalar* data_;
  nb::capsule owner_;
};

using PointArray = Output<double, 2>::Array;
using EdgeArray = Output<double, 2, 2>::Array;
using DoubleArray = Output<double>::Array;
using SignArray = Output<std::int8_t>::Array;
using CountArray = Output<std::int64_t>::Array;

// An array that owns the vector's memory.
inline PointArray array_of(std::vector<Point> points) {
  auto* const kept = new std::vector<Point>(std::move(points));
  const nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<std::vector<Point>*>(memory); });
  return PointArray(reinterpret_cast<double*>(kept->data()), {kept->size(), 2}, owner);
}

// A finite coordinate. A value other than a float or a small integer goes to dynhull.arrays, which converts or refuses
// it.
constexpr long long LARGEST_EXACT_INTEGER = 1LL << 53;

inline double coordinate(nb::handle value, const char* name) {
  if (PyFloat_CheckExact(value.ptr())) {
    const double number = PyFloat_AS_DOUBLE(value.ptr());
    if (std::isfinite(number)) return number + 0.0;  // turns -0.0 into 0.0
  } else if (PyLong_CheckExact(value.ptr())) {
    int overflow = 0;
    const long long number = PyLong_AsLongLongAndOverflow(value.ptr(), &overflow);
    if (overflow == 0 && -LARGEST_EXACT_INTEGER <= number && number <= LARGEST_EXACT_INTEGER)
      return static_cast<double>(number);
  }
  return nb::cast<double>(nb::module_::import_("dynhull.arrays").attr("as_coordinate")(value, name));
}

inline Point point_of(nb::handle pair) {
  PyObject* tuple = pair.ptr();
  if (!PyTuple_CheckExact(tuple) || PyTuple_GET_SIZE(tuple) != 2) throw nb::type_error("a point is a tuple (x, y)");
  const Point p = {PyFloat_AsDouble(PyTuple_GET_ITEM(tuple, 0)), PyFloat_AsDouble(PyTuple_GET_ITEM(tuple, 1))};
  if (PyErr_Occurred()) throw nb::python_error();
  return p;
}

// The checked copy that dynhull.arrays makes; raises its error, which names the bad row.
inline nb::object as_points(const nb::object& xy) {
  return nb::module_::import_("dynhull.arrays").attr("as_points")(xy);
}

// Excludes subclasses of numpy's array: some rows of a masked array may be missing.
inline bool is_plain_array(const nb::object& xy) {
  static const nb::handle type = nb::object(nb::module_::import_("numpy").attr("ndarray")).release();
  return xy.type().is(type);
}

// The rows of a plain array, not yet checked for finite values; anything else goes through dynhull.arrays.
inline Rows rows_of(const nb::object& xy) {
  Rows rows;
  return is_plain_array(xy) && nb::try_cast(xy, rows, false) ? rows : nb::cast<Rows>(as_points(xy));
}

// A copy of `count` points as trees hold them; None where a coordinate is not finite. `at` returns point i, which
// another thread may be changing.
template <class At>
std::optional<PointArray> plain_copy(std::size_t count, At at) {
  const Output<double, 2> output(count);
  Plain plain;
  {
    std::optional<nb::gil_scoped_release> release;
    if (count > FEW_ROWS) release.emplace();
    auto* const copies = reinterpret_cast<Point*>(output.data());
    for (std::size_t i = 0; i < count; ++i) copies[i] = plain(at(i));
  }
  return plain.finite() ? std::optional(output.array()) : std::nullopt;
}

// A double that is exactly the number; false for anything but a finite float or an integer of at most 2**53.
inline bool plain_number(PyObject* value, double& number) {
  if (PyFloat_CheckExact(value)) {
    number = PyFloat_AS_DOUBLE(value);
    return std::isfinite(number);
  }
  if (!PyLong_CheckExact(value)) return false;
  int overflow = 0;
  const long long integer = PyLong_AsLongLongAndOverflow(value, &overflow);
  number = static_cast<double>(integer);
  return overflow == 0 && -LARGEST_EXACT_INTEGER <= integer && integer <= LARGEST_EXACT_INTEGER;
}

// The points of a list of lists or tuples of two numbers; None for any other list.
inline std::optional<PointArray> listed_points(PyObject* list) {
  const auto count = static_cast<std::size_t>(PyList_GET_SIZE(list));
  if (count == 0) return std::nullopt;
  const Output<double, 2> output(count);
  for (std::size_t i = 0; i < count; ++i) {
    PyObject* const row = PyList_GET_ITEM(list, i);
    if (!(PyList_CheckExact(row) || PyTuple_CheckExact(row)) || PySequence_Fast_GET_SIZE(row) != 2) return std::nullopt;
    for (int axis = 0; axis < 2; ++axis) {
      double number;
      if (!plain_number(PySequence_Fast_GET_ITEM(row, axis), number)) return std::nullopt;
      output.data()[2 * i + axis] = number + 0.0;
    }
  }
  return output.array();
}

inline std::optional<PointArray> plain_points(nb::handle xy) {
  if (PyList_CheckExact(xy.ptr())) return listed_points(xy.ptr());
  Rows rows;
  if (!nb::try_cast(xy, rows, false)) return std::nullopt;
  return plain_copy(rows.shape(0), [&](std::size_t i) { return points_of(rows)[i]; });
}

inline std::optional<PointArray> packed_points(const nb::bytes& packed) {
  if (packed.size() % sizeof(Point) != 0) throw nb::value_error("the length must be a multiple of 16 bytes");
  return plain_copy(packed.size() / sizeof(Point), [data = packed.c_str()](std::size_t i) {
    Point p;
    std::memcpy(&p, data + i * sizeof(Point), sizeof(Point));
    return p;
  });
}

}  // namespace dynhull
