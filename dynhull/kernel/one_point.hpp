// Methods of one point, called the most, for Python: in the place of DynamicHull's own, and without their frame.
#pragma once

#include <nanobind/nanobind.h>
#include <structmember.h>

#include <string>

namespace dynhull {

// METHOD of a tree, as a method of the class that has such trees in its slot `_tree`. The Python method is called with
// arguments by name, with trees of other kinds, and for points that are missing: it says so in its own way.
template <auto METHOD>
class OnePoint {
 public:
  static void replace(nanobind::handle type, const char* name) {
    const nanobind::object slot = type.attr("_tree"), method = type.attr(name);
    tree_at_ = reinterpret_cast<PyMemberDescrObject*>(slot.ptr())->d_member->offset;
    python_ = method.inc_ref().ptr();
    doc_ = std::string(name) + "($self, x, y)\n--\n\n" + nanobind::str(method.attr("__doc__")).c_str();
    const auto function = reinterpret_cast<void (*)()>(call);
    definition_ = {name, reinterpret_cast<PyCFunction>(function), METH_FASTCALL | METH_KEYWORDS, doc_.c_str()};
    PyObject* const own = PyDescr_NewMethod(reinterpret_cast<PyTypeObject*>(type.ptr()), &definition_);
    if (own == nullptr) throw nanobind::python_error();
    type.attr(name) = nanobind::steal(own);
  }

 private:
  template <class Tree, class Result>
  static Tree* tree_of(Result (Tree::*)(nanobind::handle, nanobind::handle), PyObject* self) {
    const nanobind::handle tree = *reinterpret_cast<PyObject**>(reinterpret_cast<char*>(self) + tree_at_);
    Tree* found = nullptr;
    return tree.is_valid() && nanobind::try_cast(tree, found, false) ? found : nullptr;
  }

  static PyObject* call(PyObject* self, PyObject* const* arguments, Py_ssize_t count, PyObject* names) noexcept {
    if (count == 2 && names == nullptr) {
      try {
        if (auto* tree = tree_of(METHOD, self))
          return nanobind::cast((tree->*METHOD)(arguments[0], arguments[1])).release().ptr();
      } catch (nanobind::python_error& error) {
        if (!error.matches(PyExc_KeyError)) return error.restore(), nullptr;
      } catch (const std::bad_alloc&) {
        return PyErr_NoMemory();
      } catch (const std::exception& error) {
        return PyErr_Format(PyExc_RuntimeError, "%s", error.what());
      }
    }
    PyObject* const bound = PyMethod_New(python_, self);
    if (bound == nullptr) return nullptr;
    PyObject* const result = PyObject_Vectorcall(bound, arguments, static_cast<std::size_t>(count), names);
    Py_DECREF(bound);
    return result;
  }

  static inline Py_ssize_t tree_at_;
  static inline PyObject* python_;
  static inline std::string doc_;
  static inline PyMethodDef definition_;
};

}  // namespace dynhull
