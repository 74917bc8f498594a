// dynhull._kernel: HullTree, the predicates and the static hulls for Python.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "../fence/valid_rings.hpp"
#include "../query/certain_sign.hpp"
#include "../static/chan.hpp"
#include "../static/static_hull.hpp"
#include "fences.hpp"
#include "globe.hpp"
#include "window.hpp"

using namespace nanobind::literals;

namespace dynhull {
namespace {

SignArray orientations(const Rows& a, const Rows& b, const Rows& c) {
  const std::size_t count = a.shape(0);
  if (b.shape(0) != count || c.shape(0) != count) throw nb::value_error("a, b and c must have the same length");
  const Output<std::int8_t> output(count);
  {
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < count; ++i)
      output.data()[i] = static_cast<std::int8_t>(orientation(points_of(a)[i], points_of(b)[i], points_of(c)[i]));
  }
  return output.array();
}

std::vector<int> turnings(const std::vector<Rows>& rings) {
  std::vector<Point> corners;
  std::vector<std::size_t> sizes;
  for (const Rows& ring : rings) {
    corners.insert(corners.end(), points_of(ring), points_of(ring) + ring.shape(0));
    sizes.push_back(ring.shape(0));
  }
  std::optional<nb::gil_scoped_release> release;
  if (corners.size() > FEW_ROWS) release.emplace();
  return RingSweep(corners, sizes).turnings();
}

std::optional<int> sign_of_measure(const Rows& vertices, std::string_view measure, double bound) {
  return certain_sign({points_of(vertices), vertices.shape(0)}, measure.empty() ? ' ' : measure[0], bound);
}

std::optional<PointArray> convex_hull(const Rows& xy, std::optional<bool> discard, std::optional<bool> threads) {
  std::optional<StaticHull> hull;
  {
    nb::gil_scoped_release release;
    hull.emplace(static_hull(points_of(xy), xy.shape(0), {discard, threads}));
  }
  if (!hull->finite()) return std::nullopt;
  const std::span<const Point> vertices = hull->vertices();
  const std::size_t count = vertices.size();
  if (count == 0 || 2 * count <= hull->memory()->room()) return array_of({vertices.begin(), vertices.end()});
  auto* const kept = new Scratch<Point>(std::move(*hull->memory()));
  const nb::capsule owner(kept, [](void* memory) noexcept { delete static_cast<Scratch<Point>*>(memory); });
  return PointArray(reinterpret_cast<double*>(kept->data()), {count, 2}, owner);
}

using ChanRound = std::tuple<std::uint64_t, std::uint64_t, std::uint64_t, bool>;

std::pair<PointArray, std::vector<ChanRound>> chan(const Rows& xy) {
  const Chan hull = [&] {
    nb::gil_scoped_release release;
    return Chan(points_of(xy), xy.shape(0));
  }();
  std::vector<ChanRound> rounds;
  for (const Chan::Round& round : hull.rounds)
    rounds.emplace_back(round.guess, round.groups, round.steps, round.closed);
  return {array_of(hull.vertices), std::move(rounds)};
}

void translate_broken_invariant(const std::exception_ptr& error, void*) {
  try {
    std::rethrow_exception(error);
  } catch (const std::logic_error& broken) {
    PyErr_SetString(PyExc_AssertionError, broken.what());
  }
}

// What hulls of points and of entities have in common.
template <class Tree>
nb::class_<Tree>& add_reads(nb::class_<Tree>& type) {
  return type.def("__len__", &Tree::size)
      .def_prop_ro("distinct", &Tree::distinct, "The number of different points.")
      .def_prop_rw("changes", &Tree::changes, &Tree::set_changes, "The number of updates that changed the hull.")
      .def("count", &Tree::count, nb::sig("def count(self, x: float, y: float) -> int"), "x"_a.none(), "y"_a.none(),
           "The number of copies of the point. O(log n).")
      .def("count_many", &Tree::count_many, "xy"_a, "The number of copies of each point. O(log n) a row.")
      .def("clear", &Tree::clear, "Remove every point.")
      .def("points", &Tree::points, "All points in lexicographic order, with multiplicity. O(n).")
      .def("vertices", &Tree::vertices, "The hull's vertices, counter-clockwise from the least. O(h log n).")
      .def("take_vertices", &Tree::take_vertices, "last"_a, "Take the vertices. O(h log n).")
      .def(
          "vertex_taker",
          [](nb::handle_t<Tree> tree, nb::handle_t<LastVertices> last, std::string_view measure, double bound,
             int least, int most) {
            Hull& hull = *nb::inst_ptr<Tree>(tree);
            return VertexTaker(nb::borrow(tree), hull, nb::borrow(last), measure, bound, least, most);
          },
          "last"_a, "measure"_a, "bound"_a, "least"_a, "most"_a,
          "What takes the vertices where the sign of a measure less a bound is certain, as `sign_of_measure` has it, "
          "and at least `least` and at most `most`.")
      .def("chain", &Tree::chain, "side"_a, "The upper (0) or lower (1) chain from left to right. O(h log n).")
      .def("locate", &Tree::locate, "xy"_a, "For each row +1 inside, 0 on the boundary, -1 outside. O(log n) a row.")
      .def("support", &Tree::support, "directions"_a,
           "The farthest vertex in each direction, the lexicographically smaller of two. O(log n) a row.")
      .def("tangents", &Tree::tangents, "xy"_a,
           "The left and the right tangent point seen from each row, NaN unless the row is outside. O(log n) a row.")
      .def("distance", &Tree::distance, "xy"_a,
           "The distance of each row to the hull, rounded once; infinite without points. O(log n) a row.")
      .def("intersect_lines", &Tree::intersect_lines, "p"_a, "q"_a,
           "Where the line through p and q of each row enters and leaves the hull; NaN if it misses. p and q differ. "
           "O(log n) a row.")
      .def("layers", &Tree::layers, "count"_a,
           "The vertices of the outermost convex layers, each counter-clockwise from the least. O(log² n) a vertex.")
      .def("influence", &Tree::influence,
           "For each vertex the area that goes with it, rounded once. O(log² n) a vertex.")
      .def("sketch", &Tree::sketch, "most"_a,
           "At most that many vertices, at least 4; and three rows for each edge of theirs beyond which the hull has "
           "others: its ends and the farthest of those. O(most log n).")
      .def("copy", &Tree::copy, "An independent tree of the same points. O(n).")
      .def("check", &Tree::check, "Raise AssertionError if an invariant is broken. O(n log n).")
      .def_prop_ro("memory", &Tree::memory, "The bytes that the tree uses, and the bytes that it reserves.");
}

void add_last_vertices(nb::module_& module) {
  nb::class_<LastVertices>(module, "LastVertices", "The vertices that a hull had when they were last taken.")
      .def(nb::init<>())
      .def("__len__", [](const LastVertices& last) { return last.points.size(); })
      .def(
          "points", [](const LastVertices& last) { return array_of(last.points); }, "The vertices.")
      .def_ro("changes", &LastVertices::changes, "The hull's number of changes when they were taken; -1 before that.");
  nb::class_<VertexTaker>(module, "VertexTaker", "Takes the vertices of a hull where a sign of it is as it was.")
      .def("take", &VertexTaker::take, "Take them, and say whether that was so. O(h log n), or O(h²) of few.");
}

void add_hull_tree(nb::module_& module) {
  nb::class_<Hull> type(module, "HullTree", "A multiset of points and its convex hull: see dynhull's tree in Python.");
  add_reads(type)
      .def(
          "__init__", [](Hull* hull, nb::object xy) { new (hull) Hull(xy.is_none() ? HullTree() : tree_of(xy)); },
          "xy"_a = nb::none())
      .def("insert", &Hull::insert, nb::sig("def insert(self, x: float, y: float) -> bool"), "x"_a.none(), "y"_a.none(),
           "Add a point. True if the hull changed. O(log² n).")
      .def("delete", &Hull::remove, nb::sig("def delete(self, x: float, y: float) -> bool"), "x"_a.none(), "y"_a.none(),
           "Remove one copy of a point. True if the hull changed; KeyError if the point is missing. O(log² n).")
      .def("apply", &Hull::apply_all, "op"_a, "xy"_a.none(), "ignore_missing"_a, "together"_a = nb::none(),
           "Insert all rows (+1) or delete all rows (-1).")
      .def("apply", &Hull::apply_each, "ops"_a, "xy"_a.none(), "ignore_missing"_a, "together"_a = nb::none(),
           "Insert the rows with +1 and delete those with -1, as a set. Returns the number of rows applied. A row that "
           "deletes a missing point raises KeyError(x, y, row), unless `ignore_missing`. `together` forces divide and "
           "conquer (True) or one change after the other (False); by default the batch decides.");
}

void add_entities(nb::module_& module) {
  nb::class_<PackedEntities> packed(module, "PackedEntities", "Entities that nobody has used since they were loaded.");
  nb::class_<KeyedHull> type(module, "Entities", "Entities and their convex hull: see dynhull's class in Python.");
  add_reads(type)
      .def(nb::init<std::string_view, bool>(),
           nb::sig("def __init__(self, key_type: dynhull.keys.KeyType = 'str', ordered: bool = False) -> None"),
           "key_type"_a = "str", "ordered"_a = false)
      .def_prop_ro("key_type", &KeyedHull::key_type, nb::sig("def key_type(self) -> dynhull.keys.KeyType"),
                   "The kind of the keys, \"str\" or \"int\".")
      .def_prop_ro("ordered", &KeyedHull::ordered, "Whether a put that is older than the entity changes nothing.")
      .def("update", &KeyedHull::update, "keys"_a.none(), "xy"_a.none(), "times"_a.none(), "only"_a.none(),
           "Insert or move the entity of each row, as one batch. Returns the numbers of rows that were new, moved, "
           "unmoved, stale and skipped.")
      .def("load", &KeyedHull::load, "keys"_a.none(), "xy"_a.none(), "times"_a.none(),
           "Put all rows; a time that is NaN means none.")
      .def("begin_load", &KeyedHull::begin_load, "room"_a = 0,
           "Put off the tree, for some calls of `load` and `remove_many`; with room for that many entities.")
      .def("end_load", &KeyedHull::end_load, "Build the tree. O(n log n).")
      .def("packed", &KeyedHull::packed, "most"_a,
           "What was loaded, in place of `end_load`; None if it is more than so many entities. O(n log n).")
      .def("put", &KeyedHull::put,
           nb::sig("def put(self, key: object, x: float, y: float, time: float | None, only: str | None) -> bool"),
           "key"_a.none(), "x"_a.none(), "y"_a.none(), "time"_a.none(), "only"_a.none(),
           "Insert or move one entity. True if the hull changed. O(log² n).")
      .def("remove", &KeyedHull::remove, "key"_a.none(),
           "Remove one entity. True if the hull changed; MissingKeyError if there is none. O(log² n).")
      .def("remove_many", &KeyedHull::remove_many, "keys"_a.none(), "ignore_missing"_a,
           "Remove entities as one batch. Returns their number.")
      .def("expire", &KeyedHull::expire, "until"_a.none(), "Remove every entity with a time of at most `until`. O(n).")
      .def("evict", &KeyedHull::evict, "count"_a, "Remove the oldest entities, those without a time first. O(n).")
      .def("has", &KeyedHull::has, "key"_a.none(), "Whether there is an entity of the key. O(1).")
      .def("position", &KeyedHull::position, "key"_a.none(), "The place of an entity. O(1).")
      .def("positions", &KeyedHull::positions, "keys"_a.none(),
           "The place of each key, NaN where it is missing. O(1) a row.")
      .def("times", &KeyedHull::times, "keys"_a.none(), "The time of each key, NaN where there is none. O(1) a row.")
      .def("entities", &KeyedHull::entities,
           nb::sig("def entities(self) -> tuple[dynhull.keys.Keys, dynhull.arrays.Points, dynhull.arrays.Points]"),
           "Keys in order, places and times. O(n log n).")
      .def("pack", &KeyedHull::pack, "idle"_a,
           "Hold the entities in less memory until they are needed, `idle` unless they were since the last such call. "
           "Whether they are held so. O(n), and O(n log n) when they are needed.")
      .def("oldest", &KeyedHull::oldest_of_all, "The least time; None if no entity has one. O(n).")
      .def("keys_at", &KeyedHull::keys_at, nb::sig("def keys_at(self, xy: object) -> list[typing.Any]"), "xy"_a.none(),
           "The least key at each place, None where there is none.")
      .def("vertex_keys", &KeyedHull::vertex_keys, nb::sig("def vertex_keys(self) -> list[typing.Any]"),
           "The least key at each vertex, in the order of `vertices`.");
  packed.def("__len__", &PackedEntities::size)
      .def_prop_ro("distinct", &PackedEntities::distinct, "The number of distinct places.")
      .def_prop_ro("vertex_count", &PackedEntities::vertex_count, "The number of vertices.")
      .def(
          "entities", [](const PackedEntities& packed) { return new KeyedHull(packed); },
          "The entities, which are put together when they are used.");
}

void add_fences(nb::module_& module) {
  nb::class_<FenceIndex>(module, "Fences", "Fences of one set of entities: see dynhull's class in Python.")
      .def(nb::init<KeyedHull&, std::optional<std::pair<double, double>>>(), "entities"_a, "latitude"_a.none(),
           nb::keep_alive<1, 2>())
      .def("detach", &FenceIndex::detach, "End the reports of the entities.")
      .def("__len__", &FenceIndex::size)
      .def("has", &FenceIndex::has, "fence"_a, "Whether there is a fence of this number.")
      .def("set_polygons", &FenceIndex::set_polygons,
           nb::sig("def set_polygons(self, fence: int, polygons: list[list[dynhull.arrays.Points]], closed: bool, "
                   "margin: float, cross: bool, inside: dynhull.keys.Keys | None) -> None"),
           "fence"_a, "polygons"_a, "closed"_a, "margin"_a, "cross"_a, "inside"_a.none(),
           "Add or replace a fence around polygons.")
      .def("set_circle", &FenceIndex::set_circle,
           nb::sig("def set_circle(self, fence: int, x: float, y: float, radius: float, closed: bool, margin: float, "
                   "cross: bool, inside: dynhull.keys.Keys | None) -> None"),
           "fence"_a, "x"_a, "y"_a, "radius"_a, "closed"_a, "margin"_a, "cross"_a, "inside"_a.none(),
           "Add or replace a fence around a disk.")
      .def("set_hull", &FenceIndex::set_hull,
           nb::sig("def set_hull(self, fence: int, vertices: dynhull.arrays.Points, closed: bool, margin: float, "
                   "cross: bool, without_self: bool, inside: dynhull.keys.Keys | None) -> None"),
           "fence"_a, "vertices"_a, "closed"_a, "margin"_a, "cross"_a, "without_self"_a, "inside"_a.none(),
           "Add or replace a fence around a convex hull; `without_self` around that of the entities.")
      .def("drop", &FenceIndex::drop, nb::sig("def drop(self, fence: int) -> dynhull.keys.Keys"), "fence"_a,
           "Remove a fence. Returns the keys that were inside.")
      .def("inside", &FenceIndex::inside, nb::sig("def inside(self, fence: int) -> dynhull.keys.Keys"), "fence"_a,
           "The keys inside, in order.")
      .def("count", &FenceIndex::count, "fence"_a, "The number of keys inside.")
      .def("margin", &FenceIndex::margin, "fence"_a, "The margin.")
      .def("distances", &FenceIndex::distances,
           nb::sig("def distances(self, fence: int, places: dynhull.arrays.Points) -> "
                   "numpy.typing.NDArray[numpy.float64]"),
           "fence"_a, "places"_a, "The distances of places to the area; of entities, to that of the others.")
      .def("clear", &FenceIndex::clear,
           nb::sig("def clear(self, fence: int, places: dynhull.arrays.Points, errors: "
                   "numpy.typing.NDArray[numpy.float64]) -> numpy.typing.NDArray[numpy.bool_]"),
           "fence"_a, "places"_a, "errors"_a,
           "Which places are farther than their errors from the boundary; of entities, from that of the others.")
      .def("carry", &FenceIndex::carry,
           nb::sig("def carry(self, source: Fences, keys: dynhull.keys.Keys) -> numpy.typing.NDArray[numpy.bool_]"),
           "source"_a, "keys"_a, "Let keys that were removed there and are new here have moved.")
      .def("take", &FenceIndex::take, nb::sig("def take(self) -> tuple[bytes, bytes | None, bytes] | None"),
           "What has crossed since the last call, as in `PackedCrossings`; None if nothing has.")
      .def("check", &FenceIndex::check, "Raise AssertionError if an invariant is broken.")
      .def_prop_ro("memory", &FenceIndex::memory, "The bytes that the index uses.");
}

void add_window_tree(nb::module_& module) {
  nb::class_<Window, Hull>(module, "WindowTree",
                           "A tree of points with times, of which the oldest leave: see dynhull's in Python.")
      .def(nb::init<std::optional<double>, std::optional<std::size_t>>(), "max_age"_a.none(), "max_points"_a.none())
      .def_prop_ro("max_age", &Window::max_age, "The age at which a point leaves; None for any.")
      .def_prop_ro("max_points", &Window::max_points, "The greatest number of points; None for any.")
      .def_prop_ro("now", &Window::now, "The greatest time seen; None before.")
      .def_prop_ro("oldest", &Window::oldest,
                   "The time of the oldest point; None if there is none, or if it has no time.")
      .def_prop_ro("expired", &Window::expired, "The number of points that left because of their age.")
      .def_prop_ro("evicted", &Window::evicted, "The number of points that left because there were too many.")
      .def_prop_ro("late", &Window::late, "The number of points that were too old to be added.")
      .def("add", &Window::add, "xy"_a, "times"_a.none(),
           "Add the points that are not late, and remove those that are too old or too many, as one batch. Returns the "
           "number of points added.")
      .def("advance", &Window::advance, "now"_a,
           "Move the clock. Returns the number of points that left. ValueError if time would go back.")
      .def("expire", &Window::expire, "until"_a,
           "Remove the points of this time or before, as one batch. Returns their number.")
      .def("delete", &Window::remove, nb::sig("def delete(self, x: float, y: float) -> bool"), "x"_a.none(),
           "y"_a.none(),
           "Remove the oldest copy of a point. True if the hull changed; KeyError if the point is missing. O(log² n).")
      .def("delete_many", &Window::remove_many, "xy"_a, "ignore_missing"_a,
           "Remove the oldest copies of points as one batch, like `apply`. Returns the number of points removed.")
      .def("clear", &Window::clear, "Remove every point. The clock stays.")
      .def("times", &Window::times,
           "The times of the points in the order of `points`, copies of a point in order of time. O(n log n).")
      .def("state", &Window::state,
           "What `restore` needs: the points in the order in which they leave, their times, now, and the numbers of "
           "changes, expired, evicted and late points. O(n log n).")
      .def("restore", &Window::restore, "points"_a, "times"_a, "now"_a.none(), "totals"_a,
           "Fill an empty tree with the state of another.")
      .def("copy", &Window::copy, "An independent tree of the same points and times. O(n).")
      .def("check", &Window::check,
           "Raise AssertionError if an invariant of the tree or of the window is broken. O(n log n).");
}

template <class Tree, class Base>
void add_globe(nb::class_<Tree, Base>& type) {
  type.def_prop_ro("center", &Tree::center, "The centre of the projection; None before the first points.")
      .def("recenter", &Tree::recenter, nb::sig("def recenter(self, center: tuple[float, float]) -> None"), "center"_a,
           "Project all places about another centre. ValueError if one is too far; nothing has changed. O(n log n).")
      .def("copy", &Tree::copy, "An independent tree of the same places about the same centre.");
}

void add_globe(nb::module_& module) {
  module.def("gnomonic", &gnomonic,
             nb::sig("def gnomonic(lonlat: dynhull.arrays.Points, parameters: typing.Any) -> "
                     "tuple[dynhull.arrays.Points, numpy.typing.NDArray[numpy.bool_]]"),
             "lonlat"_a, "parameters"_a,
             "The projections of places, NaN where there is none, and where there is one. The parameters are the "
             "centre, and the sine and the cosine of its latitude as sums of two doubles.");
  nb::class_<OnGlobe<Hull>, Hull> tree(module, "GlobeTree", "Places on the globe and their hull: see dynhull's class.");
  tree.def(
      "__init__", [](OnGlobe<Hull>* tree, const nb::object& center) { new (tree) OnGlobe<Hull>(center); },
      nb::sig("def __init__(self, center: tuple[float, float] | None = None) -> None"), "center"_a = nb::none());
  add_globe(tree);
  nb::class_<OnGlobe<KeyedHull>, KeyedHull> entities(module, "GlobeEntities",
                                                     "Entities on the globe: see dynhull's class in Python.");
  entities.def(
      "__init__",
      [](OnGlobe<KeyedHull>* tree, std::string_view key_type, bool ordered, const nb::object& center) {
        new (tree) OnGlobe<KeyedHull>(center, key_type, ordered);
      },
      nb::sig("def __init__(self, key_type: dynhull.keys.KeyType = 'str', ordered: bool = False, "
              "center: tuple[float, float] | None = None) -> None"),
      "key_type"_a = "str", "ordered"_a = false, "center"_a = nb::none());
  add_globe(entities);
  nb::class_<OnGlobe<Window>, Window> window(module, "GlobeWindowTree",
                                             "A window on the globe: see dynhull's class in Python.");
  window.def(
      "__init__",
      [](OnGlobe<Window>* tree, std::optional<double> max_age, std::optional<std::size_t> max_points,
         const nb::object& center) { new (tree) OnGlobe<Window>(center, max_age, max_points); },
      nb::sig("def __init__(self, max_age: float | None, max_points: int | None, "
              "center: tuple[float, float] | None = None) -> None"),
      "max_age"_a.none(), "max_points"_a.none(), "center"_a = nb::none());
  add_globe(window);
}

void add_predicates(nb::module_& module) {
  module.def(
      "orientation",
      [](nb::handle a, nb::handle b, nb::handle c) { return orientation(point_of(a), point_of(b), point_of(c)); },
      nb::sig("def orientation(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> int"), "a"_a,
      "b"_a, "c"_a, "+1 if the three points turn left, -1 if they turn right, 0 if they are collinear.");
  module.def(
      "direction_sign",
      [](nb::handle d, nb::handle a, nb::handle b) { return direction_sign(point_of(d), point_of(a), point_of(b)); },
      nb::sig("def direction_sign(d: tuple[float, float], a: tuple[float, float], b: tuple[float, float]) -> int"),
      "d"_a, "a"_a, "b"_a, "+1 if b is farther than a in direction d, -1 if it is less far, 0 if neither.");
  module.def(
      "crossing",
      [](nb::handle a, nb::handle b, nb::handle c, nb::handle d, nb::handle z) {
        return crossing(point_of(a), point_of(b), point_of(c), point_of(d), point_of(z));
      },
      nb::sig("def crossing(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], "
              "d: tuple[float, float], z: tuple[float, float]) -> int"),
      "a"_a, "b"_a, "c"_a, "d"_a, "z"_a, "The sign of height(ab) - height(cd) at z, for a < b < z <= c < d.");
  module.def("orientations", &orientations, "a"_a, "b"_a, "c"_a, "`orientation` of each row of three arrays.");
  module.def("turnings_if_valid", &turnings,
             nb::sig("def turnings_if_valid(rings: list[dynhull.arrays.Points]) -> list[int]"), "rings"_a,
             "Of each ring of a polygon, +1 if its inside is on the left, -1 if on the right. Empty if a ring is not "
             "simple, or is a hole that is not inside the first one or overlaps another.");
  module.def("sign_of_measure", &sign_of_measure,
             nb::sig("def sign_of_measure(vertices: dynhull.arrays.Points, measure: str, bound: float) -> int | None"),
             "vertices"_a, "measure"_a, "bound"_a,
             "The sign of the area, the diameter or the width of a hull less a bound that is not negative; None where "
             "rounding might decide, or of many vertices. O(h), or O(h²) of few.");
  module.def("plain_difference_of_products", &difference_of_products, "a"_a, "b"_a, "c"_a, "d"_a,
             "a * b - c * d with three roundings, as the predicates' filters compute it: tests the compiler's flags.");
}

void add_arrays_and_static_hulls(nb::module_& module) {
  module.def("plain_points", &plain_points, "xy"_a,
             "A copy, without negative zeros, of an (n, 2) array of finite doubles or of a list of pairs of plain "
             "numbers; None for any other argument.");
  module.def("packed_points", &packed_points, "packed"_a,
             "The points whose coordinates are these doubles, without negative zeros; None if one is not finite.");
  module.def("convex_hull", &convex_hull, "xy"_a, "discard"_a = nb::none(), "threads"_a = nb::none(),
             "The static hull's vertices, counter-clockwise from the least; None if a coordinate is not finite. "
             "`discard` drops points inside a sample's hull first, `threads` uses two threads; by default the input "
             "decides. O(n log n).");
  module.def("chan", &chan, "xy"_a,
             "The same by Chan's algorithm, with its rounds (guess, groups, steps, closed). O(n log h).");
}

void add_threads(nb::module_& module) {
  module.def("set_threads", &Team::set_limit, "threads"_a, "beside"_a,
             "How many threads one call may use; 0 for one on each processor available to the process. And whether, if "
             "that is one, one more finds what a put crosses.");
  module.def("threads", &Team::limit, "How many threads one call may use.");
}

void add_fork_hooks(nb::module_& module) {
  module.def("_before_fork", &ReadWriteLock::before_fork);
  module.def("_after_fork_in_parent", &ReadWriteLock::after_fork_in_parent);
  module.def("_after_fork_in_child", &ReadWriteLock::after_fork_in_child);
  const nb::module_ os = nb::module_::import_("os");
  if (nb::hasattr(os, "register_at_fork"))
    os.attr("register_at_fork")("before"_a = module.attr("_before_fork"),
                                "after_in_parent"_a = module.attr("_after_fork_in_parent"),
                                "after_in_child"_a = module.attr("_after_fork_in_child"));
}

}  // namespace
}  // namespace dynhull

NB_MODULE(_kernel, module) {
  nanobind::set_leak_warnings(false);  // a daemon thread that has a hull at the end of its program is no fault
  module.doc() = "The hull tree in C++, with the same results as the one in Python.";
  nanobind::register_exception_translator(dynhull::translate_broken_invariant);
  dynhull::add_last_vertices(module);
  dynhull::add_hull_tree(module);
  dynhull::add_entities(module);
  dynhull::add_fences(module);
  dynhull::add_window_tree(module);
  dynhull::add_globe(module);
  dynhull::add_predicates(module);
  dynhull::add_arrays_and_static_hulls(module);
  dynhull::add_threads(module);
  dynhull::add_fork_hooks(module);
}
