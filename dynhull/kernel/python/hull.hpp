// The hull tree as a Python object: checks arguments, locks, and fills numpy arrays.
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "../globe/framed_tree.hpp"
#include "../query/certain_sign.hpp"
#include "../query/layers.hpp"
#include "../query/locate_index.hpp"
#include "../query/sketch.hpp"
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

// The gnomonic projection as Python passes it: the centre, and the sine and the cosine of its latitude.
inline Gnomonic gnomonic_of(const nb::object& parameters) {
  using Pair = std::pair<double, double>;
  const auto [center, sine, cosine] = nb::cast<std::tuple<Pair, Pair, Pair>>(parameters);
  return {center.first, center.second, {sine.first, sine.second}, {cosine.first, cosine.second}};
}
inline nb::object globe_module(const char* name) { return nb::module_::import_("dynhull._globe").attr(name); }

// The vertices that a hull had when they were last taken, and the number of its changes then.
struct LastVertices {
  std::vector<Point> points;
  std::int64_t changes = -1;
};

class Hull {
 protected:
  // What `work` returns while nobody changes the tree.
  template <class Work>
  auto reading(Work work, std::size_t rows = ALL_ROWS) {
    const ReadLock lock(lock_, rows);
    return work();
  }

  // About how many vertices there are: where they are few, a thread that waits for the GIL does not get it meanwhile.
  std::size_t expected_vertices() { return std::min(settled().distinct(), vertices_); }

  // Calls `work` with the number of each row and its point, while nobody changes the tree.
  template <class Work>
  void for_rows(const Rows& rows, Work work) {
    const ReadLock lock(lock_, rows.shape(0));
    for (std::size_t i = 0; i < rows.shape(0); ++i) work(i, points_of(rows)[i]);
  }

 public:
  Hull() = default;
  explicit Hull(HullTree tree) : tree_(std::move(tree)) {}
  explicit Hull(Frame frame) : tree_(std::move(frame)) {}

  std::size_t size() { return settled().size(); }
  std::size_t distinct() { return settled().distinct(); }
  std::uint64_t changes() {
    lock_.await_settled();
    return tree_.changes();
  }
  void set_changes(std::uint64_t changes) { writable().set_changes(changes); }
  void clear() { writable().clear(); }
  std::uint64_t count(nb::handle x, nb::handle y) {
    const Point p = point(x, y);
    return settled().count(p);
  }

  bool insert(nb::handle x, nb::handle y) {
    const Point p = point(x, y);
    return alone_with(p, [&](FramedTree& tree) { return tree.insert(p); });
  }

  bool remove(nb::handle x, nb::handle y) {
    const Point p = point(x, y);
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
    return array_of(reading([&] {
      std::vector<Point> all;
      all.reserve(tree_.size());
      tree_.for_each([&](Point p, std::uint64_t copies) {
        for (; copies > 0; --copies) all.push_back(p);
      });
      return all;
    }));
  }

  PointArray chain(int side) {
    if (side != UPPER && side != LOWER) throw nb::value_error("side must be 0 (upper) or 1 (lower)");
    return array_of(reading([&] { return tree_.plane().chain(static_cast<Side>(side)); }));
  }

  PointArray vertices() { return array_of(vertex_list()); }
  void take_vertices(LastVertices& last) { take(last, vertex_list()); }
  bool take_vertices_if(LastVertices& last, char measure, double bound, int least, int most) {
    std::vector<Point> found = vertex_list();
    const std::optional<int> sign = certain_sign(found, measure, bound);
    if (!sign || *sign < least || *sign > most) return false;
    take(last, std::move(found));
    return true;
  }

  SignArray locate(const nb::object& xy) {
    const Rows rows = tree_.frame().on_globe() ? nb::cast<Rows>(as_points(xy)) : as_rows(xy);
    const std::size_t count = rows.shape(0);
    const Output<std::int8_t> output(count);
    refresh_index_for(count);
    const bool finite = [&] {
      const ReadLock lock(lock_, count);
      if (!tree_.frame().on_globe()) return locate_places(points_of(rows), count, output.data());
      locate_projected(points_of(rows), count, output.data());
      return true;
    }();
    return finite ? output.array() : locate(checked(rows, INSERT));
  }

  CountArray count_many(const Rows& rows) {
    const Output<std::int64_t> output(rows.shape(0));
    for_rows(rows, [&](std::size_t i, Point p) { output.data()[i] = static_cast<std::int64_t>(tree_.count(p)); });
    return output.array();
  }

  PointArray support(const Rows& directions) {
    const Output<double, 2> output(directions.shape(0));
    auto* vertices = reinterpret_cast<Point*>(output.data());
    for_rows(directions, [&](std::size_t i, Point direction) {
      vertices[i] = tree_.size() > 0 ? dynhull::support(tree_.plane().nodes(), direction) : NO_EDGE.a;
    });
    return output.array();
  }

  EdgeArray tangents(const Rows& points) {
    const Output<double, 2, 2> output(points.shape(0));
    auto* edges = reinterpret_cast<Edge*>(output.data());
    bool all_near = true;
    for_rows(points, [&](std::size_t i, Point p) {
      const std::optional<Point> place = tree_.frame()(p);
      const std::optional<Edge> edge = place ? dynhull::tangents(tree_.plane().nodes(), *place) : std::nullopt;
      edges[i] = edge ? Edge{tree_.given_at(edge->a), tree_.given_at(edge->b)} : NO_EDGE;
      all_near &= place || !tree_.frame().projection();
    });
    if (!all_near) checked(points, INSERT);
    return output.array();
  }

  DoubleArray distance(const Rows& points) {
    const Output<double> output(points.shape(0));
    for_rows(points, [&](std::size_t i, Point p) { output.data()[i] = dynhull::distance(tree_.plane().nodes(), p); });
    return output.array();
  }

  EdgeArray intersect_lines(const Rows& p, const Rows& q) {
    if (q.shape(0) != p.shape(0)) throw nb::value_error("p and q must have the same length");
    const Output<double, 2, 2> output(p.shape(0));
    auto* edges = reinterpret_cast<Edge*>(output.data());
    for_rows(p, [&](std::size_t i, Point start) {
      edges[i] = intersect_line(tree_.plane().nodes(), start, points_of(q)[i]).value_or(NO_EDGE);
    });
    return output.array();
  }

  std::vector<PointArray> layers(std::size_t count) {
    std::vector<PointArray> arrays;
    for (std::vector<Point>& layer : reading([&] { return layers_of(tree_.plane(), count); }))
      arrays.push_back(array_of(std::move(layer)));
    return arrays;
  }

  DoubleArray influence() {
    const std::vector<double> areas = reading([&] { return influence_of(tree_.plane()); });
    const Output<double> output(areas.size());
    std::copy(areas.begin(), areas.end(), output.data());
    return output.array();
  }

  std::pair<PointArray, PointArray> sketch(std::size_t most) {
    Sketch sketch = reading([&] { return sketch_of(tree_.plane(), most); });
    std::vector<Point> beyond;
    for (const auto& [edge, farthest] : sketch.beyond) beyond.insert(beyond.end(), {edge.a, edge.b, farthest});
    return {array_of(std::move(sketch.vertices)), array_of(std::move(beyond))};
  }

  Hull* copy() {
    return reading([&] { return new Hull(*this); });
  }

  void check() {
    reading([&] { tree_.check(); });
  }

  std::pair<std::size_t, std::size_t> memory() {
    const FramedTree& tree = settled();
    return {tree.used_bytes(), tree.reserved_bytes()};
  }

 protected:
  static constexpr std::int8_t PLUS_ONE = 1;
  static constexpr Ops INSERT = {&PLUS_ONE, 0};

  Hull(const Hull& other) : tree_(other.tree_) {}  // while the other one is locked

  static constexpr double NOTHING = std::numeric_limits<double>::quiet_NaN();
  static constexpr Edge NO_EDGE = {{NOTHING, NOTHING}, {NOTHING, NOTHING}};

  std::int64_t apply(Ops ops, std::size_t ops_count, const nb::object& xy, bool ignore_missing,
                     std::optional<bool> together) {
    const Rows rows = as_rows(xy);
    const std::size_t count = rows.shape(0);
    if (ops.step > 0 && ops_count != count) throw nb::value_error("ops and xy must have the same length");
    const std::optional<Gnomonic> chosen = choose(rows, ops);
    const std::optional<Applied> applied = [&]() -> std::optional<Applied> {
      const WriteLock lock(lock_, count);
      FramedTree::Choice choice(tree_, chosen);
      try {
        const Applied applied = tree_.apply(ops, points_of(rows), count, ignore_missing, together);
        if (applied.first_missing < 0 || ignore_missing) choice.keep();
        return applied;
      } catch (const NotFinite&) {
        return {};
      }
    }();
    if (!applied) return apply(ops, ops_count, checked(rows, ops), ignore_missing, together);
    return rows_applied(*applied, rows, ignore_missing);
  }

  // The number of rows, or KeyError with the first row that deletes a missing point.
  static std::int64_t rows_applied(const Applied& applied, const Rows& rows, bool ignore_missing) {
    if (applied.first_missing < 0 || ignore_missing) return applied.rows;
    const Point p = Plain()(points_of(rows)[applied.first_missing]);
    PyErr_SetObject(PyExc_KeyError, nb::make_tuple(p.x, p.y, applied.first_missing).ptr());
    throw nb::python_error();
  }

  // The points of an argument, not yet checked if it is a plain array; and the checked copy that Python makes.
  Rows as_rows(const nb::object& xy) const {
    Rows rows;
    return is_plain_array(xy) && nb::try_cast(xy, rows, false) ? rows : nb::cast<Rows>(as_points(xy));
  }
  nb::object as_points(const nb::object& xy) const {
    return tree_.frame().on_globe() ? globe_module("as_lonlat")(xy) : dynhull::as_points(xy);
  }

  // The checked copy of points that a batch has refused; raises the error that names the bad row.
  nb::object checked(const Rows& rows, Ops ops) {
    const std::size_t count = rows.shape(0);
    const nb::object points = nb::cast(array_of({points_of(rows), points_of(rows) + count}));
    if (!tree_.frame().on_globe()) return dynhull::as_points(points);
    const Output<bool> inserted(count);
    for (std::size_t i = 0; i < count; ++i) inserted.data()[i] = !ops.deletes(i);
    return globe_module("refused")(points, inserted.array(), center(), "points row {}");
  }

  // A point of two arguments, checked but for the distance from the centre.
  Point point(nb::handle x, nb::handle y) const {
    if (!tree_.frame().on_globe()) return {coordinate(x, "x"), coordinate(y, "y")};
    const Point p = {coordinate(x, "lon"), coordinate(y, "lat")};
    if (!tree_.frame().has(p)) globe_module("as_place")(p.x, p.y);  // raises
    return p;
  }

  // Calls `work` with the tree, to which it adds a point.
  template <class Work>
  bool alone_with(Point p, Work work) {
    const std::optional<Gnomonic> chosen = choose(&p, 1, INSERT);
    FramedTree& tree = writable();
    FramedTree::Choice choice(tree, chosen);
    try {
      const bool changed = work(tree);
      choice.keep();
      return changed;
    } catch (const NotFinite&) {
    }
    const Output<bool> inserted(1);
    inserted.data()[0] = true;
    globe_module("refused")(array_of({p}), inserted.array(), center(), "the point");
    throw nb::value_error("another thread has moved the centre");
  }

  std::optional<std::pair<double, double>> center() {
    const auto& projection = settled().frame().projection();
    return projection ? std::optional(projection->center()) : std::nullopt;
  }

  // The projection that the points of a first batch choose; nothing if there is one already.
  std::optional<Gnomonic> choose(const Point* points, std::size_t count, Ops ops) {
    if (!settled().frame().on_globe() || tree_.frame().projection()) return {};
    std::vector<Point> inserted;
    for (std::size_t i = 0; i < count; ++i)
      if (!ops.deletes(i)) inserted.push_back(points[i]);
    const nb::object chosen = globe_module("chosen")(array_of(std::move(inserted)));
    return chosen.is_none() ? std::nullopt : std::optional(gnomonic_of(chosen));
  }
  std::optional<Gnomonic> choose(const Rows& rows, Ops ops) { return choose(points_of(rows), rows.shape(0), ops); }

  // The tree, to read or to write while the caller holds the GIL.
  const FramedTree& settled() {
    lock_.await_readable();
    return tree_;
  }
  FramedTree& writable() {
    lock_.await_writable();
    return tree_;
  }

  std::vector<Point> vertex_list() {
    const std::size_t expected = expected_vertices();
    std::vector<Point> found = reading([&] { return tree_.vertices(expected); }, expected);
    vertices_ = found.size();
    return found;
  }
  void take(LastVertices& last, std::vector<Point> found) {
    last.points = std::move(found);
    last.changes = static_cast<std::int64_t>(tree_.changes());
  }

  // Refreshes the index if that pays for the queries since the hull last changed.
  void refresh_index_for(std::size_t queries) {
    if (settled().plane().version() != asked_version_) queries_ = 0;
    asked_version_ = tree_.plane().version();
    queries_ += queries;
    if (!index_stale()) return;
    const WriteLock lock(lock_);
    if (!index_stale()) return;
    if (!index_) index_ = std::make_unique<LocateIndex>();
    index_->refresh(tree_.plane(), queries_);
  }
  bool index_stale() const {
    return index_ ? index_->stale(tree_.plane(), queries_) : queries_ > LocateIndex::FIRST_PAYS;
  }

  void forget_index() { index_.reset(); }

  FramedTree tree_;
  ReadWriteLock lock_;
  std::size_t vertices_ = ALL_ROWS;  // when they were asked for last

 private:
  static constexpr std::size_t LOCATE_A_THREAD = 8192;

  // False if a point is not finite.
  bool locate_places(const Point* points, std::size_t count, std::int8_t* where) const {
    std::atomic<bool> finite = true;
    for_ranges(count, LOCATE_A_THREAD, [&](std::size_t from, std::size_t to) {
      if (!locate_range(points + from, to - from, where + from)) finite = false;
    });
    return finite;
  }

  bool locate_range(const Point* points, std::size_t count, std::int8_t* where) const {
    if (index_ && index_->fresh(tree_.plane())) return index_->locate(tree_.plane(), points, count, where);
    Plain plain;
    for (std::size_t i = 0; i < count; ++i) {
      const Point p = plain(points[i]);
      if (!plain.finite()) return false;
      where[i] = static_cast<std::int8_t>(dynhull::locate(tree_.plane().nodes(), p).where);
    }
    return true;
  }

  void locate_projected(const Point* points, std::size_t count, std::int8_t* where) const {
    std::fill_n(where, count, std::int8_t{-1});
    if (!tree_.frame().projection()) return;
    const Scratch<Point> places(count);
    const Scratch<bool> has_place(count);
    for_ranges(count, LOCATE_A_THREAD, [&](std::size_t from, std::size_t to) {
      (*tree_.frame().projection())(points + from, to - from, places.data() + from, has_place.data() + from);
    });
    const Scratch<std::uint32_t> rows(count);
    std::size_t near = 0;
    for (std::size_t i = 0; i < count; ++i) {
      places[near] = places[i];
      rows[near] = static_cast<std::uint32_t>(i);
      near += has_place[i];
    }
    if (near == count) {
      locate_places(places.data(), count, where);
      return;
    }
    const Scratch<std::int8_t> found(near);
    locate_places(places.data(), near, found.data());
    for (std::size_t i = 0; i < near; ++i) where[rows[i]] = found[i];
  }

  std::unique_ptr<LocateIndex> index_;  // made when it pays: most of ten thousand hulls have none
  std::uint64_t asked_version_ = 0, queries_ = 0;
};

// Takes the vertices of a hull if the sign of a measure less a bound is certain, and one of those that are named: of
// someone who asks after each of its changes.
class VertexTaker {
 public:
  VertexTaker(nb::object tree, Hull& hull, nb::object last, std::string_view measure, double bound, int least, int most)
      : tree_(std::move(tree)),
        last_(std::move(last)),
        hull_(&hull),
        vertices_(nb::inst_ptr<LastVertices>(last_)),
        measure_(measure.empty() ? ' ' : measure[0]),
        bound_(bound),
        least_(least),
        most_(most) {}

  bool take() { return hull_->take_vertices_if(*vertices_, measure_, bound_, least_, most_); }

 private:
  nb::object tree_, last_;  // which have the two
  Hull* hull_;
  LastVertices* vertices_;
  char measure_;
  double bound_;
  int least_, most_;
};

}  // namespace dynhull
